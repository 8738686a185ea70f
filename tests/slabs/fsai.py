"""The sparse approximate inverse on slabs is that of one process."""

from functools import partial

import numpy as np

import toeplitz_mg as tmg
from tests.slabs.products import serial_and_slabs
from tests.slabs.ranks import refuses
from toeplitz_mg import cg, halfspace, slabs

SHAPES = {  # With the sides of an element: cells of an aggregate are 4 x 4, 16 x 1, 1 x 16.
    (128, 128): (1.0, 1.0),
    (97, 101): (1.0, 1.0),
    (64, 150): (1.0, 12.0),
    (151, 64): (12.0, 1.0),
    (120, 48): (1.0, 60.0),
    (120, 50): (60.0, 1.0),
    (7, 400): (1.0, 1.0),
    (900, 1): (1.0, 1.0),
    (8, 5): (1.0, 1.0),
}


def areas(shape):
    """Masks, by their names: one leaves ranks without unknowns, one has as many as are few."""
    rng = np.random.default_rng(0)
    i, j = np.indices(shape)
    disc = (i / shape[0] - 0.5) ** 2 + (j / shape[1] - 0.5) ** 2 < 0.2
    masks = {
        "full": np.ones(shape, bool),
        "half": rng.random(shape) < 0.5,
        "disc": disc,
        "first rows": (i < 0.2 * shape[0]) & (rng.random(shape) < 0.9),
        "last row": i == shape[0] - 1,
        "few": rng.random(shape) < 300 / i.size,
    }
    return {name: mask for name, mask in masks.items() if mask.any()}


def both(slab, element, mask, dtype=np.float64):
    """A mask of a half-space matrix, of one process and of these ranks."""
    points = halfspace.offsets(slab.shape, element), slab.offsets(element)
    whole, own = (halfspace.influence_zz(*xy, element, G=1.0, nu=0.28) for xy in points)
    serial = tmg.MaskedOperator(tmg.ToeplitzOperator(whole.astype(dtype)), mask)
    full = slabs.ToeplitzOperator(own.astype(dtype), slab)
    return serial, slabs.MaskedOperator(full, mask[..., slab.rows, :])


def check_same(slab, P, ours, mask, tolerance=1e-14):
    """Assert that two operators on a mask do the same with some vector; return it."""
    b = np.random.default_rng(1).standard_normal(mask.shape)
    own = mask[..., slab.rows, :]
    expected = np.zeros(mask.shape)
    expected[mask] = P @ b[mask].astype(P.dtype)
    y = ours @ b[..., slab.rows, :][own].astype(ours.dtype)
    assert y.dtype == P.dtype
    error = np.abs(y - expected[..., slab.rows, :][own]).max(initial=0.0)
    assert error <= tolerance * np.abs(expected).max()
    return b


def test_it_is_that_of_one_process(comm):
    for shape, element in SHAPES.items():
        if shape[0] < comm.size:
            continue
        slab = slabs.Slab(comm, shape)
        # Serial ones, on each rank, take the time: on the other grids some areas will do.
        names = list(areas(shape)) if shape == (97, 101) else ["full", "half"]
        for mask in map(areas(shape).get, names):
            # Balanced ranks have other rows, not in whole cells.
            for cut in (slab, slab.balanced(mask[slab.rows])):
                A, ours = both(cut, element, mask)
                P = slabs.fsai_preconditioner(ours)
                check_same(cut, tmg.fsai_preconditioner(A), P, mask)


def test_the_result_may_be_where_the_vector_is_and_in_more_precision(comm):
    shape = (96, 80)
    slab, mask = slabs.Slab(comm, shape), areas(shape)["half"]
    _, ours = both(slab, (1.0, 1.0), mask)
    P = slabs.fsai_preconditioner(ours, dtype=np.float32)
    x = np.random.default_rng(comm.rank).random(ours.shape[0]).astype("f")
    y = P @ x
    assert np.array_equal(P.apply(x, np.empty(len(x))), y)
    assert np.array_equal(P.apply(x, x), y)


def test_a_line_of_one_rank(comm):
    if comm.size == 1:
        for shape in ((1, 700), (1, 30, 40)):
            slab, c = slabs.Slab(comm, shape), 1.0 / (1.0 + np.indices(shape).sum(axis=0))
            A, ours = tmg.ToeplitzOperator(c), slabs.ToeplitzOperator(c, slab)
            expected = tmg.fsai_preconditioner(A)
            x = np.random.default_rng(0).random(A.shape[0])
            y = expected @ x
            error = np.abs(slabs.fsai_preconditioner(ours) @ x - y).max()
            assert error <= 1e-14 * np.abs(y).max()


def test_single_precision_and_neighbours_that_are_given(comm):
    shape = (96, 80)
    slab, mask = slabs.Slab(comm, shape), areas(shape)["half"]
    for dtype, tolerance in ((np.float64, 1e-14), (np.float32, 2e-6)):
        A, ours = both(slab, (1.0, 1.0), mask, dtype)
        for neighbours in (5, 24):
            P = tmg.fsai_preconditioner(A, neighbours=neighbours)
            Q = slabs.fsai_preconditioner(ours, neighbours=neighbours)
            check_same(slab, P, Q, mask, tolerance)
    A, ours = both(slab, (1.0, 1.0), mask)
    P, Q = (f.fsai_preconditioner(B, dtype=np.float32) for f, B in ((tmg, A), (slabs, ours)))
    check_same(slab, P, Q, mask, 2e-6)


def test_a_covariance_takes_as_many_neighbours(comm):
    shape = (80, 64)
    slab, mask = slabs.Slab(comm, shape), areas(shape)["half"]
    c = np.exp(-np.hypot(*np.indices(shape)) / 3.0)
    A = tmg.MaskedOperator(tmg.ToeplitzOperator(c), mask)
    full = slabs.ToeplitzOperator(c[slab.rows], slab)
    ours = slabs.MaskedOperator(full, mask[slab.rows])
    expected = tmg.fsai_preconditioner(A)
    check_same(slab, expected, slabs.fsai_preconditioner(ours), mask)
    twelve = tmg.fsai_preconditioner(A, neighbours=12)
    assert np.abs((expected - twelve) @ np.ones(A.shape[0])).max() > 1e-3


def test_cg_takes_the_same_iterations(comm):
    shape = (128, 96)
    slab = slabs.Slab(comm, shape)
    for name in ("full", "half", "last row"):
        mask = areas(shape)[name]
        A, ours = both(slab, (1.0, 1.0), mask)
        b, counts = np.random.default_rng(1).standard_normal(shape), []
        for B, right, M in (
            (A, b[mask], tmg.fsai_preconditioner(A)),
            (ours, b[slab.rows][mask[slab.rows]], slabs.fsai_preconditioner(ours)),
        ):
            residuals = []
            _, info = cg(B, right, M=M, rtol=1e-8, residuals=residuals)
            assert info == 0
            counts.append(len(residuals))
        assert counts[0] == counts[1]


def test_coupled_components(comm):
    """Together where they are strongly coupled, else each by itself."""
    rng = np.random.default_rng(0)
    for shape, nu in (((40, 36), 0.45), ((43, 30), 0.2)):
        slab = slabs.Slab(comm, shape)
        serial, ours = serial_and_slabs(slab, nu=nu, element=(0.5, 0.5))
        island = np.zeros((2, *shape), bool)
        island[1, -3:] = True
        for mask in (rng.random((2, *shape)) < 0.6, island):
            A = tmg.MaskedOperator(serial, mask)
            P = slabs.fsai_preconditioner(slabs.MaskedOperator(ours, mask[:, slab.rows]))
            check_same(slab, tmg.fsai_preconditioner(A), P, mask)
        whole = slabs.fsai_preconditioner(ours)
        check_same(slab, tmg.fsai_preconditioner(serial), whole, np.ones(mask.shape, bool))


def test_bytes_of_an_application(comm):
    """A few rows between neighbours, each way and level, and one number for each aggregate."""
    shape = (1024, 1024)
    slab = slabs.Slab(comm, shape)
    x, y = slab.offsets((1.0, 1.0))
    A = slabs.ToeplitzOperator(halfspace.influence_zz(x, y, (1.0, 1.0), G=1.0, nu=0.28), slab)
    P = slabs.fsai_preconditioner(A)
    ones = np.ones(A.shape[0])
    comm.reset()
    P.apply(ones)
    assert set(comm.calls) <= {"Alltoallv", "Allgatherv"}
    assert comm.largest <= 8 * 2**20 / 64
    sent = comm.sent
    total = sum(slab.gather(sent))
    assert total <= 1.0 * 2**20
    assert total > 0.0 or comm.size == 1


def test_what_the_serial_one_refuses_all_ranks_refuse(comm):
    shape = (64, 64)
    slab = slabs.Slab(comm, shape)
    i, j = np.indices(shape)[:, slab.rows]
    make = slabs.fsai_preconditioner
    smooth = slabs.ToeplitzOperator(np.exp(-(i**2 + j**2) / 40.0) + 1e-3 * (i + j == 0), slab)
    refuses(comm, np.linalg.LinAlgError, "too smooth a kernel", lambda: make(smooth))
    text = "if these are refused use fft_preconditioner(A), or cg without M"
    refuses(comm, np.linalg.LinAlgError, text, lambda: make(smooth))
    indefinite = slabs.ToeplitzOperator(np.where(i + j == 1, 1.0, 1.0 * (i + j == 0)), slab)
    text = "positive definite"
    refuses(comm, np.linalg.LinAlgError, text, partial(make, indefinite, neighbours=12))
    A = slabs.ToeplitzOperator(1.0 / (1.0 + i + j), slab)
    refuses(comm, ValueError, "neighbours is 101", partial(make, A, neighbours=101))
    refuses(comm, TypeError, "neighbours is 1.5", partial(make, A, neighbours=1.5))
    if comm.size > 1:
        text = "neighbours is 5 on rank 0 and 6 on rank 1, but must be the same on all"
        refuses(comm, ValueError, text, lambda: make(A, neighbours=5 + min(comm.rank, 1)))
    refuses(comm, TypeError, "dtype is complex128", partial(make, A, dtype=complex))
    refuses(comm, TypeError, "A is of type ndarray, but must be", lambda: make(np.eye(3)))
    tiny = slabs.ToeplitzOperator(1e-40 / (1.0 + i + j), slab)
    refuses(comm, ValueError, "scale A", partial(make, tiny, dtype=np.float32))
    solid = slabs.Slab(comm, (8, 4, 4))
    B = slabs.ToeplitzOperator(np.ones(solid.local), solid)
    refuses(comm, ValueError, "must have one axis or two", lambda: make(B))
    odd = slabs.ToeplitzOperator(np.where(i * j > 0, 0.1, 0.0), slab, parity=(-1, -1))
    refuses(comm, ValueError, "symmetric along each axis", lambda: make(odd))
    C = slabs.CoupledOperator([[A, odd], [None, A]])
    refuses(comm, ValueError, "are not each other's transpose", lambda: make(C))
    C = slabs.CoupledOperator([[None, A], [A, None]])
    refuses(comm, ValueError, "diagonal block of component 0 is zero", lambda: make(C))
