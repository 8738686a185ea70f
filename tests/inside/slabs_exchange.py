"""Rows become columns, and come back; each number is sent to the ranks that see it, once.

`python -m tests.slabs tests.inside.slabs_exchange` runs these cases on a rank (see `tests.slabs`).
"""

import numpy as np

from tests.slabs.rows import SHAPES, grid_of
from toeplitz_mg.slabs import Slab
from toeplitz_mg.slabs.intervals import Intervals


def test_columns_are_those_of_the_grid_and_come_back(comm):
    for shape in SHAPES:
        slab, X = Slab(comm, shape), grid_of(shape)
        for dtype in (np.float32, np.complex128):
            Y = X.astype(dtype)
            own = np.ascontiguousarray(Y[slab.rows])
            ((_, turn),) = slab.turns(shape[-1], shape[-1])
            C, back = slab.to_columns(own, turn), np.zeros_like(own)
            assert np.array_equal(C, Y[..., slab.columns(shape[-1])])
            slab.to_rows(C, back, turn)
            assert np.array_equal(back, own)


def test_turns_take_every_column_once(comm):
    shape = (9, 3, 41)
    slab, X = Slab(comm, shape), grid_of(shape)
    own = X[slab.rows]
    for width in (1, 2, 5, 100):
        back, columns = np.zeros_like(own), []
        first = slab.columns(shape[-1]).start
        for mine, turn in slab.turns(shape[-1], width):
            (a, b) = turn[comm.rank]
            assert b - a <= width
            assert mine == slice(a - first, b - first)
            C = slab.to_columns(own, turn, np.empty((*shape[:-1], b - a)))
            assert np.array_equal(C, X[..., a:b])
            slab.to_rows(2.0 * C, back, turn)
            columns += range(a, b)
        assert columns == list(range(*slab.columns(shape[-1]).indices(shape[-1])))
        assert np.array_equal(back, 2.0 * own)


def test_bytes_of_an_exchange(comm):
    slab, P = Slab(comm, (24, 12)), comm.size
    comm.reset()
    ((_, turn),) = slab.turns(12, 12)
    slab.to_columns(np.zeros(slab.local), turn)
    assert P * sum(slab.gather(comm.sent)) == 8 * 24 * 12 * (P - 1)


def test_windows_are_sent_and_added(comm):
    P, rank = comm.size, comm.rank
    slab = Slab(comm, (4 * P, 1))
    owned = np.append(0, np.cumsum(np.arange(P) % 3 * 5))  # Some ranks own nothing.
    rng = np.random.default_rng(0)
    x = rng.random((owned[-1], 2))
    for _ in range(5):
        first, stop = np.sort(rng.integers(0, owned[-1] + 1, (2, P)), axis=0)
        intervals = Intervals(slab, owned, first, stop)
        seen = intervals.spread(x[owned[rank] : owned[rank + 1]])
        assert np.array_equal(seen, x[first[rank] : stop[rank]])
        expected = np.zeros_like(x)
        for k in range(P):
            expected[first[k] : stop[k]] += x[first[k] : stop[k]] ** 2
        total = intervals.collect(seen**2)
        np.testing.assert_allclose(total, expected[owned[rank] : owned[rank + 1]], rtol=1e-14)
