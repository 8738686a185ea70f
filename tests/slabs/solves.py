"""Preconditioners and solves on slabs are those of one process, iteration by iteration."""

from functools import partial

import numpy as np
import pytest

import toeplitz_mg as tmg
from comparisons.systems import masks
from tests.slabs.products import (
    SHAPES,
    assert_rows,
    assert_sent,
    kernel,
    lags_of,
    on_slab,
    serial_and_slabs,
    tolerance,
    with_fewer_ranks_than_rows,
)
from tests.slabs.ranks import refuses
from toeplitz_mg import halfspace, slabs

NAMES = ["fft_preconditioner", "cosine_preconditioner", "sine_preconditioner"]
N = 32  # Elements across the grids of all areas.
RTOL = 1e-5  # The default of `cg`.


def test_a_preconditioner_is_that_of_one_process(comm):
    # The last are large, and 2 n - 1 is slow: 363 = 3 · 11², but 365 = 5 · 73. And 67 is slow.
    shapes = [*SHAPES, (20, 67), (200, 200), (182, 183)]
    for shape in with_fewer_ranks_than_rows(comm, shapes):
        A, whole = on_slab(comm, shape)
        slab = A.slab
        x = np.random.default_rng(0).random(shape)
        for name in NAMES:
            for dtype in (np.float64, np.float32):
                serial = getattr(tmg, name)(whole, dtype=dtype)
                M = getattr(slabs, name)(A, dtype=dtype)
                y = M @ x[slab.rows].ravel()
                assert M.dtype == dtype
                assert_rows(slab, y, (serial @ x.ravel()).reshape(shape), tolerance(dtype))


def test_preconditioners_of_components_are_those_of_one_process(comm):
    slab = slabs.Slab(comm, (24, 10))
    serial, ours = serial_and_slabs(slab)
    x = np.random.default_rng(0).random((2, *slab.shape))
    mask = np.random.default_rng(1).random(x.shape) < 0.6
    for name in NAMES:
        make = getattr(tmg, name)  # M is that of the components together.
        by_itself = (make if name == NAMES[0] else tmg.componentwise(make))(serial) @ x.ravel()
        M = getattr(slabs, name)(ours)
        assert_rows(slab, M @ x[:, slab.rows].ravel(), by_itself.reshape(x.shape), 1e-14)
        A = slabs.MaskedOperator(ours, mask[:, slab.rows])
        assert getattr(slabs, name)(A).shape == A.shape


def blocks_of(slab, signs, size):
    """Blocks whose parities are products of signs of their components: serial, and on ranks."""
    serial, ours = [], []
    rng = np.random.default_rng(0)
    for i, one in enumerate(signs):
        serial.append([])
        ours.append([])
        for j, other in enumerate(signs[: i + 1]):
            parity = tuple(np.multiply(one, other).tolist())
            c = rng.random(slab.shape) * kernel(slab.shape) ** 4 * (1.0 if i == j else size)
            for axis in (axis for axis, sign in enumerate(parity) if sign < 0):
                np.moveaxis(c, axis, 0)[0] = 0.0
            c.flat[0] += 2.0 * (i == j)
            A = tmg.ToeplitzOperator.from_lags(lags_of(c, parity))
            B = slabs.ToeplitzOperator(c[slab.rows], slab, parity=parity)
            transposed = slabs.ToeplitzOperator(np.prod(parity) * c[slab.rows], slab, parity=parity)
            for k, block, transpose in ((serial, A, A.T), (ours, B, transposed)):
                k[i].append(block)
                if i != j:
                    k[j].append(transpose)
    return tmg.CoupledOperator(serial), slabs.CoupledOperator(ours)


def test_m_of_components_together(comm):
    """Also of three, and where blocks are odd along one axis alone, and so of both signs."""
    cases = {
        (24, 11): ((-1, 1), (1, -1), (1, 1)),
        (9, 8): ((-1, 1), (1, 1)),
        (130,): ((-1,), (1,)),
        (7, 5, 4): ((-1, 1, 1), (1, 1, -1)),
    }
    for shape, signs in cases.items():
        slab = slabs.Slab(comm, shape)
        serial, A = blocks_of(slab, signs, 0.3)
        x = np.random.default_rng(1).random((len(signs), *shape))
        for dtype in (np.float64, np.float32):
            M = tmg.fft_preconditioner(serial, dtype=dtype)
            W = slabs.fft_preconditioner(A, dtype=dtype)
            assert W.dtype == dtype
            whole = (M @ x.ravel()).reshape(x.shape)
            assert_rows(slab, W @ x[:, slab.rows].ravel(), whole, tolerance(dtype))
        mask = np.random.default_rng(2).random(x.shape) < 0.6
        full = np.zeros(x.shape)
        full[mask] = tmg.fft_preconditioner(tmg.MaskedOperator(serial, mask)) @ x[mask]
        own = mask[:, slab.rows]
        y = np.zeros(own.shape)
        y[own] = slabs.fft_preconditioner(slabs.MaskedOperator(A, own)) @ x[:, slab.rows][own]
        assert_rows(slab, y, full, 1e-14)


def test_components_that_have_no_m_are_refused_by_all(comm):
    slab = slabs.Slab(comm, (12, 9))
    c = kernel(slab.shape)[slab.rows]
    A, B = slabs.ToeplitzOperator(c, slab), slabs.ToeplitzOperator(2.0 * c, slab)
    make = slabs.fft_preconditioner
    for blocks, kind, text in (
        ([[A, B], [A, A]], ValueError, "is not symmetric"),
        ([[A, B], [B, A]], np.linalg.LinAlgError, "has the pivot"),
        ([[None, A], [A, A]], ValueError, "component 0 is zero"),
        ([[A, None], [None, slabs.ToeplitzOperator(c, slab, behind=c)]], ValueError, "of parity"),
    ):
        refuses(comm, kind, text, partial(make, slabs.CoupledOperator(blocks)))
    other = partial(slabs.cosine_preconditioner, slabs.CoupledOperator([[A, B], [A, A]]))
    refuses(comm, ValueError, "is not symmetric", other)


def test_bytes_of_preconditioners(comm):
    """For each unknown 32 (1 - 1/P), half in single precision; real transforms take half of it.

    On a line they take one and a half times as much.
    """
    for shape, of_each in (((60, 64), (32, 16, 16)), ((2**14,), (32, 48, 48))):
        slab, c = slabs.Slab(comm, shape), kernel(shape)
        c.flat[0] += 3.0
        A = slabs.ToeplitzOperator(c[slab.rows], slab)
        for name, bytes_of_one in zip(NAMES, of_each, strict=True):
            for dtype, share in ((np.float64, 1.0), (np.float32, 0.5)):
                M = getattr(slabs, name)(A, dtype=dtype)
                assert_sent(comm, M, dtype, share * bytes_of_one)


def residuals_of(A, b, **options):
    residuals = []
    x, info = tmg.cg(A, b, rtol=RTOL, residuals=residuals, maxiter=200, **options)
    assert info == 0
    return x, residuals


def area_and_its_rows(comm, mask, *, is_balanced=False):
    slab, element = slabs.Slab(comm, mask.shape), (2.0 / N, 2.0 / N)
    slab = slab.balanced(mask[slab.rows]) if is_balanced else slab
    influence = partial(halfspace.influence_zz, element=element, G=1.0, nu=0.28)
    whole = tmg.ToeplitzOperator(influence(*halfspace.offsets(mask.shape, element)))
    full = slabs.ToeplitzOperator(influence(*slab.offsets(element)), slab)
    own = mask[slab.rows]
    return tmg.MaskedOperator(whole, mask), slabs.MaskedOperator(full, own), own


def test_cg_in_less_precision_within_takes_the_iterations_of_one_process(comm):
    mask = masks.FRAGMENTED["circle"](N)
    serial, A, own = area_and_its_rows(comm, mask)
    for method in NAMES:
        of_serial, of_A = (
            {
                "M": getattr(package, method)(matrix, dtype=np.float32),
                "inner": matrix.astype(np.float32),
            }
            for package, matrix in ((tmg, serial), (slabs, A))
        )
        expected, before = residuals_of(serial, np.ones(serial.shape[0]), **of_serial)
        x, residuals = residuals_of(A, np.ones(A.shape[0]), **of_A)
        assert len(residuals) == len(before)
        whole = np.zeros(mask.shape)
        whole[mask] = expected
        error = np.abs(x - whole[A.slab.rows][own]).max(initial=0.0)
        assert error <= 10 * RTOL * np.abs(expected).max()


def test_an_iteration_adds_three_sums_to_its_products(comm):
    """A norm, and two inner products by rows, which are two numbers of each rank."""
    mask = masks.FRAGMENTED["circle"](N)
    _, A, _ = area_and_its_rows(comm, mask)
    M, b, calls, sent = slabs.cosine_preconditioner(A), np.ones(A.shape[0]), [], []
    comm.reset()
    A.apply(b)
    M.apply(b)
    of_products = comm.sent

    def count(x):
        calls.append(dict(comm.calls))
        sent.append(comm.sent)

    comm.reset()
    _, info = tmg.cg(A, b, M=M, rtol=RTOL, callback=count)
    assert info == 0
    sums = np.diff([made["Allgather"] for made in calls])
    assert (sums == 3).all()
    assert (np.diff(sent) - of_products == 5 * 8 * (comm.size - 1)).all()
    # Each iteration asks whether a callback has raised.
    assert [made["allgather"] for made in calls] == [1 + k for k in range(len(calls))]
    steps = np.diff([made["Alltoallv"] for made in calls])
    assert (steps == (4 if comm.size > 1 else 2)).all()  # One rank multiplies without.


def test_a_callback_that_raises_on_one_rank_does_on_all(comm):
    A, _ = on_slab(comm, (20, 16))

    def stop(x):
        raise LookupError("enough")

    for iterate in (tmg.cg, tmg.richardson):
        callback, own = (stop, LookupError) if comm.rank == comm.size - 1 else (None, RuntimeError)
        with pytest.raises(own, match="enough"):
            iterate(A, np.ones(A.shape[0]), M=slabs.fft_preconditioner(A), callback=callback)


def test_islands_on_one_rank(comm):
    """Each rank in turn is the only one that has unknowns."""
    for k in range(comm.size):
        mask = np.zeros((8 * comm.size, 12), bool)
        mask[8 * k + 2 : 8 * k + 6, 3:9] = True
        slab, c = slabs.Slab(comm, mask.shape), kernel(mask.shape)
        A = slabs.MaskedOperator(slabs.ToeplitzOperator(c[slab.rows], slab), mask[slab.rows])
        serial = tmg.MaskedOperator(tmg.ToeplitzOperator(c), mask)
        expected, before = residuals_of(serial, np.ones(serial.shape[0]))
        for options in ({}, {"inner": A.astype(np.float32)}, {"M": slabs.sine_preconditioner(A)}):
            x, residuals = residuals_of(A, np.ones(A.shape[0]), **options)
            np.testing.assert_allclose(x, expected if len(x) else [], rtol=100 * RTOL)
            if not options:
                assert len(residuals) == len(before)


def test_a_first_guess_and_a_zero_right_hand_side(comm):
    A, _ = on_slab(comm, (12, 9))
    slab = A.slab
    b = A @ np.ones(A.shape[0])
    x, info = tmg.cg(A, b, np.ones(A.shape[0]), rtol=1e-10)
    assert info == 0
    np.testing.assert_allclose(x, 1.0, rtol=1e-9)
    x, info = tmg.cg(A, np.zeros(A.shape[0]))
    assert info == 0
    assert not x.any()
    on_one = np.where(comm.rank == 0, np.eye(1, A.shape[0])[0], 0.0)
    x, info = tmg.cg(A, on_one, rtol=1e-10)
    assert info == 0
    error = A @ x - on_one
    assert slab.vectors.norm(error) <= 1e-9


def test_numbers_of_any_size(comm):
    A, _ = on_slab(comm, (12, 9))
    # Of some ranks the right-hand side is so small that its square is zero.
    sizes = np.where(comm.rank == comm.size - 1, 1e200, 1e-250)
    x, info = tmg.cg(A, np.full(A.shape[0], sizes), M=slabs.fft_preconditioner(A), rtol=1e-8)
    assert info == 0
    assert np.isfinite(x).all()


def test_richardson_takes_the_iterations_of_one_process(comm):
    shape = (24, 9)
    slab, c = slabs.Slab(comm, shape), kernel(shape)
    c.flat[0] += 8.0
    A, whole = slabs.ToeplitzOperator(c[slab.rows], slab), tmg.ToeplitzOperator(c)
    counts = []
    for package, matrix in ((tmg, whole), (slabs, A)):
        residuals, M = [], package.cosine_preconditioner(matrix)
        b = np.ones(matrix.shape[0])
        _, info = tmg.richardson(matrix, b, M=M, rtol=1e-8, residuals=residuals)
        assert info == 0
        counts.append(len(residuals))
    assert counts[0] == counts[1]


def test_what_is_not_positive_definite_is_refused_by_all(comm):
    for shape in ((300,), (12, 16)):
        slab = slabs.Slab(comm, shape)
        c = np.where(np.indices(shape).sum(axis=0) == 1, 1.0, 0.0)[slab.rows]
        A = slabs.ToeplitzOperator(c, slab)
        for name in NAMES:
            text = "but all must be above"
            refuses(comm, np.linalg.LinAlgError, text, partial(getattr(slabs, name), A))
    _, info = tmg.cg(A, np.ones(A.shape[0]))
    assert set(comm.allgather(info)) == {info}
    odd = np.random.default_rng(0).random(shape)
    odd[0] = odd[:, 0] = 0.0
    B = slabs.ToeplitzOperator(odd[slab.rows], slab, parity=(-1, -1))
    refuses(comm, ValueError, "but must be even", lambda: slabs.fft_preconditioner(B))
    refuses(comm, TypeError, "A is of type ndarray", lambda: slabs.fft_preconditioner(np.eye(3)))


def test_wrong_systems_are_refused_by_all(comm):
    last, shape = comm.size - 1, (12, 16)
    slab, c = slabs.Slab(comm, shape), kernel(shape)
    A, is_last = slabs.ToeplitzOperator(c[slab.rows], slab), comm.rank == comm.size - 1
    n = A.shape[0]

    def solve(b, **options):
        return lambda: tmg.cg(A, b, **options)

    b = np.ones(n)
    text = f"rank {last}: b has shape"
    refuses(comm, ValueError, text, solve(b[: n - is_last]))
    text = f"rank {last}: b has entries that are not finite"
    refuses(comm, ValueError, text, solve(np.where(is_last, np.nan, b)))
    refuses(comm, ValueError, "rtol is -1", solve(b, rtol=-1.0))
    refuses(comm, ValueError, "rank 0: maxiter is 0", solve(b, maxiter=0))
    text = f"rank {last}: callback is 3, but must be a function"
    refuses(comm, TypeError, text, solve(b, callback=3 if is_last else None))
    refuses(comm, TypeError, "A and b have the dtype complex128", solve(b + 1j))
    serial = tmg.ToeplitzOperator(kernel(slab.local))
    text = "but both must be of toeplitz_mg.slabs, on the same slab, or none of them"
    refuses(comm, TypeError, text, solve(b, M=serial))
    refuses(comm, TypeError, text, solve(b, inner=serial.astype(np.float32)))
    refuses(comm, TypeError, text, lambda: tmg.cg(serial, b, M=A))
    other = slabs.Slab(comm, shape)
    B = slabs.ToeplitzOperator(c[other.rows], other)
    refuses(comm, TypeError, text, solve(b, M=B))
    refuses(comm, TypeError, "an operator on slabs, but must be", lambda: tmg.gmres(A, b))
    if last:
        text = "rtol, atol, maxiter is (1e-08, 0.0, None) on rank 0 and (0.0001, 0.0, None) on"
        refuses(comm, ValueError, text, solve(b, rtol=1e-4 if is_last else 1e-8))
        M, single = slabs.fft_preconditioner(A), slabs.fft_preconditioner(A, dtype=np.float32)
        text = f"M is {M.kind} on rank 0 and None on rank"
        refuses(comm, ValueError, text, solve(b, M=None if is_last else M))
        sine, cosine = slabs.sine_preconditioner(A), slabs.cosine_preconditioner(A)
        for one, other in ((M, single), (sine, cosine), (sine, slabs.fsai_preconditioner(A))):
            text = f"M is {one.kind} on rank 0 and {other.kind} on rank"
            refuses(comm, ValueError, text, solve(b, M=other if is_last else one))
        less = A.astype(np.float32)
        text = f"inner is {less.kind} on rank 0 and None on rank"
        refuses(comm, ValueError, text, solve(b, inner=None if is_last else less))
        text = f"inner is {less.kind} on rank 0 and {A.kind} on rank"
        refuses(comm, ValueError, text, solve(b, inner=A if is_last else less))
        text = f"rank {last}: inner is 3, but must be A in lower precision"
        refuses(comm, TypeError, text, solve(b, inner=3 if is_last else less))


def test_iterations_of_scipy_refuse_what_is_on_slabs(comm):
    from scipy.sparse.linalg import cg

    A, _ = on_slab(comm, (12, 9))
    assert not hasattr(A, "matvec")
    refuses(comm, TypeError, "type not understood", lambda: cg(A, np.ones(A.shape[0])))
