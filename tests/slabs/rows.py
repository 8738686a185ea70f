"""Every row of a grid has one rank, and numbers of all ranks are the same bits on each."""

import pickle
from copy import deepcopy
from functools import partial

import numpy as np
import pytest

from tests.slabs.counting import MPI
from tests.slabs.ranks import refuses
from toeplitz_mg.slabs import (
    CoupledOperator,
    MaskedOperator,
    Slab,
    ToeplitzOperator,
    cosine_preconditioner,
    fft_preconditioner,
    fsai_preconditioner,
)

SHAPES = [(4, 1), (5, 7), (16, 3), (97, 4, 5), (130, 2), (1030, 2)]


def grid_of(shape):
    """A grid of which every rank knows all."""
    return np.random.default_rng(0).random(shape)


def test_every_row_has_one_rank(comm):
    for shape in SHAPES:
        slab = Slab(comm, shape)
        rows = slab.everywhere(np.arange(slab.rows.start, slab.rows.stop))
        assert np.array_equal(rows, np.arange(shape[0]))
        assert slab.local == grid_of(shape)[slab.rows].shape
        assert slab.starts[comm.rank] == slab.rows.start
        assert (slab.starts[1:-1] % slab.unit == 0).all()
        sizes = np.diff(slab.starts)
        assert sizes.max() <= sizes.mean() * 17 / 16 + slab.unit


def test_units_grow_with_the_rows_of_a_rank(comm):
    assert Slab(comm, (16 * comm.size, 3)).unit == 1
    assert Slab(comm, (64 * comm.size, 3)).unit == 4
    assert Slab(comm, (2**10 * comm.size, 3)).unit == 64


def test_balanced_rows_have_as_many_unknowns(comm):
    for shape in SHAPES:
        for unit in (1, None):
            slab, mask = Slab(comm, shape, unit=unit), grid_of(shape) ** 8 < grid_of(shape)[0, 0]
            mask[: shape[0] // 2] &= grid_of(shape)[: shape[0] // 2] < 0.1
            other = slab.balanced(mask[slab.rows])
            assert (other.shape, other.unit) == (slab.shape, slab.unit)
            assert other.local == mask[other.rows].shape
            rows = other.everywhere(np.arange(other.rows.start, other.rows.stop))
            assert np.array_equal(rows, np.arange(shape[0]))
            assert (other.starts[1:-1] % slab.unit == 0).all()
            assert np.diff(other.starts).min() > 0
            units = [mask[k : k + slab.unit] for k in range(0, shape[0], slab.unit)]
            most = mask.sum() / comm.size + max(part.sum() for part in units)
            most += (mask.size / comm.size + units[0].size) / 4  # Each cell counts a little, too.
            assert mask[other.rows].sum() <= most


def test_a_mask_of_components_balances_too(comm):
    slab = Slab(comm, (40, 3))
    mask = np.zeros((2, 40, 3), bool)
    mask[1, 30:] = True
    own = slab.balanced(mask[:, slab.rows])
    assert np.array_equal(own.starts, slab.balanced(mask[1, slab.rows]).starts)
    for wrong in (mask[:, :2], mask[1, slab.rows] * 1.0, mask[1, slab.rows, :2]):
        refuses(comm, ValueError, "of this rank's rows", partial(slab.balanced, wrong))


def test_a_receive_of_the_callers_own_takes_no_message(comm):
    """One of any rank and any tag waits on the same communicator: for a message of the caller's."""
    slab, X, got = Slab(comm, (16, 3)), grid_of((16, 3)), np.zeros(3)
    A = ToeplitzOperator(0.5 ** np.arange(48.0).reshape(16, 3)[slab.rows], slab)
    waits = MPI.Comm.Irecv(comm, got, MPI.ANY_SOURCE, MPI.ANY_TAG)
    total = slab.sum(X[slab.rows])
    y = A @ np.ones(A.shape[0])
    sent = MPI.Comm.Isend(comm, np.full(3, 5.0), (comm.rank + 1) % comm.size)
    waits.Wait()
    sent.Wait()
    assert np.array_equal(got, np.full(3, 5.0))
    assert np.array_equal(A @ np.ones(A.shape[0]), y)
    np.testing.assert_allclose(total, X.sum(), rtol=1e-13)


def test_numbers_are_the_same_bits_on_all_ranks(comm):
    slab = Slab(comm, (97, 3))
    X = grid_of((97, 3)) - 0.5
    x = X[slab.rows]
    numbers = [slab.sum(x), slab.vectors.norm(x), slab.vectors.dot(x, x), *slab.extent(x)]
    assert len(set(comm.allgather(tuple(numbers)))) == 1
    np.testing.assert_allclose(
        numbers, [X.sum(), np.linalg.norm(X), (X * X).sum(), X.min(), X.max()], rtol=1e-13
    )
    assert slab.gather(comm.rank) == list(range(comm.size))
    assert slab.vectors.count(x > 0) == np.count_nonzero(X > 0)


def test_sums_and_extents_are_of_real_numbers(comm):
    slab, last = Slab(comm, (8, 3)), comm.size - 1
    x = np.arange(24.0).reshape(8, 3)[slab.rows]
    for values in (x, x.tolist(), x.astype(int), x.astype(np.float32)):
        assert slab.extent(values) == (0.0, 23.0)
        assert slab.sum(values) == 276.0
    assert slab.extent(x > 7.0) == (0.0, 1.0)
    assert slab.sum(x > 7.0) == 16.0
    for wrong, name in ((x + 1j, "complex128"), ("no field", "<U8")):
        values, text = wrong if comm.rank == last else x, f"rank {last}: x has dtype {name}"
        for work in (slab.sum, slab.extent):
            refuses(comm, TypeError, text, partial(work, values))


def test_a_slab_is_not_pickled_but_copied_with_what_lives_on_it(comm):
    slab = Slab(comm, (8, 3))
    A = ToeplitzOperator(0.5 ** np.arange(24.0).reshape(8, 3)[slab.rows], slab)
    P = fsai_preconditioner(A)
    for thing in (slab, A, P, MaskedOperator(A, np.ones(slab.local, bool))):
        with pytest.raises(TypeError, match=r"make it anew by Slab\(comm, shape\)"):
            pickle.dumps(thing)
    assert deepcopy(slab) is slab
    x = np.ones(A.shape[0])
    for thing in (A, P):
        assert np.array_equal(deepcopy(thing) @ x, thing @ x)


def test_numbers_where_only_one_rank_has_any(comm):
    slab = Slab(comm, (8, 3))
    for rank in range(comm.size):
        x = np.array([-3.0, 4.0]) if comm.rank == rank else np.empty(0)
        assert slab.extent(x) == (-3.0, 4.0)
        assert slab.vectors.norm(x) == 5.0
        assert slab.vectors.min(x) == -3.0
        assert np.array_equal(slab.everywhere(x), [-3.0, 4.0])
    assert slab.extent(np.empty(0)) == (np.inf, -np.inf)


def test_offsets_are_those_of_the_rows(comm):
    slab = Slab(comm, (9, 4))
    x, y = slab.offsets((0.5, 2.0))
    assert np.array_equal(x[:, 0], 0.5 * np.arange(9)[slab.rows])
    assert np.array_equal(y[0], 2.0 * np.arange(4))
    refuses(comm, ValueError, "element is (1.0,)", lambda: slab.offsets((1.0,)))


def test_an_error_of_one_rank_is_one_of_all(comm):
    """Of its own kind where that is a common one, and else a RuntimeError that names it."""
    slab, last = Slab(comm, (8, 3)), comm.size - 1

    def fail(kind):
        with slab.agree():
            if comm.rank == last:
                raise kind("its rows are wrong")

    of_its_kind = ValueError, TypeError, OSError, MemoryError, FloatingPointError, OverflowError
    for kind in (*of_its_kind, np.linalg.LinAlgError):
        refuses(comm, kind, f"rank {last}: its rows are wrong", partial(fail, kind))
    for kind in (RuntimeWarning, UserWarning, ZeroDivisionError, NotImplementedError, Exception):
        text = f"rank {last}: {kind.__name__}: its rows are wrong"
        refuses(comm, RuntimeError, text, partial(fail, kind))
        with pytest.raises(RuntimeError) as error:
            fail(kind)
        assert isinstance(error.value.__cause__, kind if comm.rank == last else type(None))


def test_what_is_not_the_same_is_refused(comm):
    slab = Slab(comm, (8, 3))

    def differ():
        with slab.agree() as same:
            same["rtol"] = 1e-8 if comm.rank == 0 else 1e-5

    if comm.size == 1:
        differ()
    else:
        text = "rtol is 1e-08 on rank 0 and 1e-05 on rank 1, but must be the same on all"
        refuses(comm, ValueError, text, differ)


def test_operators_of_two_kinds_are_refused_wherever_they_meet(comm):
    """Ranks whose messages differ would wait for each other."""
    if comm.size == 1:
        return
    slab, is_first = Slab(comm, (12, 10)), comm.rank == 0
    x, y = slab.offsets((1.0, 1.0))
    A = ToeplitzOperator(1.0 / (1.0 + np.hypot(x, y)), slab)
    coupled = CoupledOperator([[A, None], [None, A]])
    masked = MaskedOperator(A, np.ones(slab.local, bool))
    for one, other in ((A, coupled), (A, masked), (A, A.astype(np.float32))):
        own = one if is_first else other
        for make in (cosine_preconditioner, fft_preconditioner, fsai_preconditioner):
            refuses(comm, ValueError, "A is ", partial(make, own))
        refuses(comm, ValueError, "must be the same", lambda own=own: own @ np.ones(own.shape[0]))
        if other is not masked:
            everywhere = np.ones(own.grid_shape, bool)
            refuses(comm, ValueError, "A is ", partial(MaskedOperator, own, everywhere))
    makes = cosine_preconditioner, fft_preconditioner
    refuses(comm, ValueError, "the preconditioner is", partial(makes[is_first], A))
    assert np.isfinite(A @ np.ones(A.shape[0])).all()


def test_wrong_grids_are_refused(comm):
    P = comm.size
    refuses(comm, TypeError, "each number of shape is 2.5", lambda: Slab(comm, (2.5, 3)))
    refuses(comm, ValueError, "shape is ()", lambda: Slab(comm, ()))
    refuses(comm, ValueError, "shape is 64", lambda: Slab(comm, 64))
    refuses(comm, ValueError, "unit is 0", lambda: Slab(comm, (5, 3), unit=0))
    if P > 1:
        text = f"the grid ({P - 1}, 64) has {P - 1} rows, but each of {P} ranks needs one at least"
        refuses(comm, ValueError, text, lambda: Slab(comm, (P - 1, 64)))
        text = f"has {4 * P - 4} rows, {P - 1} units of 4 rows, but each"
        refuses(comm, ValueError, text, lambda: Slab(comm, (4 * P - 4, 64), unit=4))
        text = "the shape of the grid is (8, 8) on rank 0 and (9, 8) on rank 1"
        refuses(comm, ValueError, text, lambda: Slab(comm, (8 + (comm.rank == 1), 8)))


def test_what_is_no_communicator_is_refused(comm):
    text = "must be a communicator, as MPI.COMM_WORLD"
    for wrong in (None, 4, comm.Get_group()):
        refuses(comm, TypeError, text, partial(Slab, wrong, (8, 3)))


def test_sums_are_in_double_precision_and_extents_tell_of_what_is_no_number(comm):
    slab = Slab(comm, (comm.size,))
    ranks = comm.size
    assert slab.sum(np.full(100, 1000, np.float16)) == 1e5 * ranks
    assert slab.sum(np.full(2, 2**62)) == ranks * 2.0**63
    assert abs(slab.sum(np.full(10**6, 0.1, np.float32)) / (ranks * 1e5) - 1.0) < 1e-7
    for rank in range(ranks):
        x = np.array([np.nan if comm.rank == rank else 1.0])
        assert np.isnan(slab.extent(x)).all()
