"""Products on slabs are those of one process."""

from functools import partial
from math import prod

import numpy as np
import pytest

import toeplitz_mg as tmg
from tests.slabs.ranks import refuses
from toeplitz_mg import halfspace, slabs

# Odd and prime lengths, one column, few rows for each rank, lengths that are 5-smooth and not.
SHAPES = [
    (300,),
    (1009,),
    (4, 1),
    (4, 5),
    (17, 13),
    (64, 64),
    (97, 1),
    (31, 128),
    (130, 7),
    (5, 4, 6),
    (9, 1, 7),
    (8, 7, 1),
]
ELEMENT = (0.5, 0.25)
NU = 0.28


def tolerance(dtype):
    return 1e-14 if dtype == np.float64 else 2e-6


def assert_near(x, expected, tolerance):
    """Assert that this rank's part is right, relative to the largest number of all."""
    assert x.shape == expected.shape
    largest = max(np.abs(expected).max(initial=0.0), 1e-300)
    assert np.abs(x - expected).max(initial=0.0) <= tolerance * largest


def assert_rows(slab, x, whole, tolerance):
    """Assert that x are the rows of this rank of a field that every rank knows."""
    rows = whole[..., slab.rows, *[slice(None)] * (len(slab.shape) - 1)]
    assert np.abs(x.reshape(rows.shape) - rows).max() <= tolerance * np.abs(whole).max()


def kernel(shape):
    """Coefficients of a symmetric positive definite matrix, not separable."""
    k = np.indices(shape)
    return 1.0 / (1.0 + np.sqrt((k**2 * 1.3).sum(axis=0)))


def lags_of(c, parity, behind=None):
    """All coefficients, from those of lags that are not negative."""
    for axis in reversed(range(c.ndim)):
        other = np.moveaxis(c if behind is None or axis else behind, axis, 0)[:0:-1]
        sign = parity[axis] if behind is None or axis else 1
        c, front = np.moveaxis(c, axis, 0), sign * other
        c = np.moveaxis(np.concatenate([front, c]), 0, axis)
        if behind is not None and axis:
            b = np.moveaxis(behind, axis, 0)
            behind = np.moveaxis(np.concatenate([sign * b[:0:-1], b]), 0, axis)
    return c


def on_slab(comm, shape):
    """The matrix of `kernel` on these ranks, and of one process."""
    slab, c = slabs.Slab(comm, shape), kernel(shape)
    return slabs.ToeplitzOperator(c[slab.rows], slab), tmg.ToeplitzOperator(c)


def with_fewer_ranks_than_rows(comm, shapes):
    return [shape for shape in shapes if shape[0] >= comm.size] + [(1, 300)] * (comm.size == 1)


def test_a_product_is_that_of_one_process(comm):
    for shape in with_fewer_ranks_than_rows(comm, SHAPES):
        slab, c, x = slabs.Slab(comm, shape), kernel(shape), np.random.default_rng(0).random(shape)
        for dtype in (np.float64, np.float32):
            A = slabs.ToeplitzOperator(c[slab.rows].astype(dtype), slab)
            y = A @ x[slab.rows].ravel().astype(dtype)
            assert y.dtype == dtype
            whole = (tmg.ToeplitzOperator(c) @ x.ravel()).reshape(shape)
            assert_rows(slab, y, whole, tolerance(dtype))


def test_large_products_are_made_in_turns(comm):
    """So that a rank has few columns at a time."""
    shape = (4096, 300)
    slab, c, x = slabs.Slab(comm, shape), kernel(shape), np.random.default_rng(0).random(shape)
    A, serial = slabs.ToeplitzOperator(c[slab.rows], slab), tmg.ToeplitzOperator(c)
    comm.reset()
    y = A @ x[slab.rows].ravel()
    assert comm.calls["Alltoallv"] > 2 or comm.size == 1
    assert_rows(slab, y, (serial @ x.ravel()).reshape(shape), 1e-14)


def test_coefficients_that_are_odd_or_neither(comm):
    rng = np.random.default_rng(0)
    for shape, parity in [
        ((12, 9), (-1, 1)),
        ((12, 9), (-1, -1)),
        ((8, 5, 6), (1, -1, 1)),
        ((150,), (-1,)),
    ]:
        c = rng.random(shape)
        for axis, sign in enumerate(parity):
            if sign < 0:
                np.moveaxis(c, axis, 0)[0] = 0.0
        behind = rng.random(shape)
        behind[0] = c[0]
        slab, x = slabs.Slab(comm, shape), rng.random(shape)
        for other in (None, behind):
            if other is not None and parity[0] < 0:
                parity = (1, *parity[1:])
            lags = lags_of(c, parity, other)
            rows = None if other is None else other[slab.rows]
            A = slabs.ToeplitzOperator(c[slab.rows], slab, parity=parity, behind=rows)
            serial = tmg.ToeplitzOperator.from_lags(lags)
            assert A.is_symmetric == serial.is_symmetric
            whole = (serial @ x.ravel()).reshape(shape)
            assert_rows(slab, A @ x[slab.rows].ravel(), whole, 1e-14)
            single = A.astype(np.float32) @ x[slab.rows].ravel().astype(np.float32)
            assert_rows(slab, single, whole, 2e-6)


def serial_and_slabs(slab, dtype=np.float64, nu=NU, element=ELEMENT):
    """The matrix of two coupled components, of one process and of these ranks."""
    parts = {"xx": (1, 1), "xy": (-1, -1), "yy": (1, 1)}
    x, y = halfspace.offsets(slab.shape, element)
    own = slab.offsets(element)
    serial, ours = {}, {}
    for name, parity in parts.items():
        influence = partial(getattr(halfspace, f"influence_{name}"), G=1.0, nu=nu)
        lags = lags_of(influence(x, y, element), parity)
        serial[name] = tmg.ToeplitzOperator.from_lags(lags)
        c = influence(*own, element).astype(dtype)
        ours[name] = slabs.ToeplitzOperator(c, slab, parity=parity)
    arrange = [["xx", "xy"], ["xy", "yy"]]
    return (
        tmg.CoupledOperator([[serial[name] for name in row] for row in arrange]),
        slabs.CoupledOperator([[ours[name] for name in row] for row in arrange]),
    )


def test_coupled_components_are_those_of_one_process(comm):
    for shape in with_fewer_ranks_than_rows(comm, [(8, 8), (17, 12), (65, 3)]):
        slab, x = slabs.Slab(comm, shape), np.random.default_rng(0).random((2, *shape))
        for dtype in (np.float64, np.float32):
            serial, A = serial_and_slabs(slab, dtype)
            whole = (serial @ x.ravel()).reshape(x.shape)
            y = A @ x[:, slab.rows].ravel().astype(dtype)
            assert_rows(slab, y, whole, tolerance(dtype))
        assert_rows(slab, A.astype(np.float64) @ x[:, slab.rows].ravel(), whole, 2e-6)


def test_components_of_both_precisions_are_those_of_one_process(comm):
    """Their products, and the preconditioners of a block in single precision, are in double."""
    for shape in ((17, 12), (300,)):
        slab, c = slabs.Slab(comm, shape), kernel(shape)
        x, single = np.random.default_rng(0).random((2, *shape)), c.astype(np.float32)
        serial = [tmg.ToeplitzOperator(a) for a in (single.astype(float), c)]
        ours = [slabs.ToeplitzOperator(a[slab.rows], slab) for a in (single, c)]
        S, A = (
            package.CoupledOperator([[one, None], [None, other]])
            for package, (one, other) in ((tmg, serial), (slabs, ours))
        )
        own = x[:, slab.rows].ravel()
        assert_rows(slab, A @ own, (S @ x.ravel()).reshape(x.shape), 1e-14)
        for name in ("fft", "cosine", "sine", "fsai"):
            name = f"{name}_preconditioner"
            make = getattr(tmg, name)
            M = (tmg.componentwise(make) if name[:2] in ("co", "si") else make)(S)
            y = getattr(slabs, name)(A) @ own
            assert y.dtype == np.float64
            assert_rows(slab, y, (M @ x.ravel()).reshape(x.shape), 1e-14)
    if comm.size > 1:
        blocks = [[ours[comm.rank == 0], None], [None, ours[0]]]
        text = "the dtypes of the blocks is ['float64', 'float32'] on rank 0 and ['float32'"
        refuses(comm, ValueError, text, lambda: slabs.CoupledOperator(blocks))


def test_a_precision_is_that_of_all_ranks(comm):
    slab, last = slabs.Slab(comm, (12, 8)), comm.size - 1
    A = slabs.ToeplitzOperator(kernel((12, 8))[slab.rows], slab)
    B = slabs.CoupledOperator([[A, None], [None, A]])
    for C in (A, B, slabs.MaskedOperator(A, np.ones(slab.local, bool))):
        wrong = "single" if comm.rank != last else int
        refuses(comm, TypeError, f"rank {last}: dtype is int64", partial(C.astype, wrong))
        if last:
            dtype = np.float32 if comm.rank == last else np.float64
            text = f"dtype is float64 on rank 0 and float32 on rank {last}"
            refuses(comm, ValueError, text, partial(C.astype, dtype))


def test_functions_of_one_process_refuse_operators_of_slabs(comm):
    slab = slabs.Slab(comm, (12, 8))
    A = slabs.ToeplitzOperator(kernel((12, 8))[slab.rows], slab)
    B = slabs.CoupledOperator([[A, None], [None, A]])
    names = ("fft", "cosine", "sine", "chan", "strang", "tau", "fsai", "jacobi", "default")
    functions = [getattr(tmg, f"{name}_preconditioner") for name in names]
    functions += [tmg.multigrid, tmg.toeplitz_inverse, tmg.select_preconditioner]
    for C in (A, B, slabs.MaskedOperator(A, np.ones(slab.local, bool))):
        for function in functions:
            text = "toeplitz_mg.slabs has the preconditioners"
            refuses(comm, TypeError, text, partial(function, C))
    text = "blocks[0][0] is <ToeplitzOperator 12 x 8 on"
    refuses(comm, TypeError, text, lambda: tmg.CoupledOperator([[A]]))


def test_each_rank_evaluates_its_own_rows_to_the_same_bits(comm):
    for shape in [(12, 7), (64, 32)]:
        slab = slabs.Slab(comm, shape)
        own, whole = slab.offsets(ELEMENT), halfspace.offsets(shape, ELEMENT)
        for name in ("zz", "xx", "xy"):
            influence = getattr(halfspace, f"influence_{name}")
            c = influence(*own, ELEMENT, G=1.0, nu=NU)
            assert c.shape == slab.local
            assert np.array_equal(c, influence(*whole, ELEMENT, G=1.0, nu=NU)[slab.rows])


def test_masks_are_those_of_one_process(comm):
    shape, rng = (16, 11), np.random.default_rng(0)
    slab, c = slabs.Slab(comm, shape), kernel(shape)
    one = tmg.ToeplitzOperator(c), slabs.ToeplitzOperator(c[slab.rows], slab)
    island = np.zeros(shape, bool)  # On one rank: the others have no unknown.
    island[-2:, 3:6] = True
    cases = [(*one, mask) for mask in (rng.random(shape) < 0.5, island, np.ones(shape, bool))]
    # A mask of components may be one for each, or for all.
    cases += [(*serial_and_slabs(slab), rng.random((*k, *shape)) < 0.5) for k in ((2,), ())]
    for whole, full, mask in cases:
        mask_of_all = np.broadcast_to(mask, whole.grid_shape)
        x = np.where(mask_of_all, rng.random(whole.grid_shape), 0.0)
        y = np.zeros(x.shape)
        y[mask_of_all] = tmg.MaskedOperator(whole, mask) @ x[mask_of_all]
        own = mask_of_all[..., slab.rows, :]
        for dtype in (np.float64, np.float32):
            A = slabs.MaskedOperator(full, mask[..., slab.rows, :]).astype(dtype)
            z = np.zeros(own.shape)
            z[own] = A @ x[..., slab.rows, :][own].astype(dtype)
            assert_rows(slab, z, y, tolerance(dtype))


def test_rows_of_vectors(comm):
    A, _ = on_slab(comm, (9, 6))
    X = np.random.default_rng(0).random((3, A.shape[0]))
    Y = A.apply(X)
    for x, y in zip(X, Y, strict=True):
        assert np.array_equal(A @ x, y)
    assert A.apply(X, X) is X
    assert np.array_equal(X, Y)


def assert_sent(comm, A, dtype, bytes_of_one):
    """Assert that a product sends at most so many bytes times 1 - 1/P for each unknown."""
    slab, P, m = A.slab, comm.size, prod(A.slab.shape)
    comm.reset()
    A.apply(np.ones(A.shape[0], dtype))
    assert set(comm.calls) == {"Alltoallv"} or (P == 1 and not comm.calls)
    sent = comm.sent
    # Of the frequencies of a line one row more than half of them is sent.
    more = 1.0 if len(slab.shape) > 1 else 1.0 + 2**-6
    assert sum(slab.gather(sent)) <= bytes_of_one * (1 - 1 / P) * m * more + 1e-6


def test_bytes_of_a_product(comm):
    """In double precision 32, by transforms of the length of the grid."""
    for shape in ((60, 64), (2**14,)):
        slab, c = slabs.Slab(comm, shape), kernel(shape)
        for dtype, bytes_of_one in ((np.float64, 32), (np.float32, 16)):
            A = slabs.ToeplitzOperator(c[slab.rows].astype(dtype), slab)
            assert_sent(comm, A, dtype, bytes_of_one)


def test_wrong_coefficients_are_refused_by_all(comm):
    slab, last = slabs.Slab(comm, (12, 8)), comm.size - 1
    c = kernel((12, 8))[slab.rows]
    is_last = comm.rank == last

    def make(c, **options):
        return lambda: slabs.ToeplitzOperator(c, slab, **options)

    text = f"rank {last}: c has shape ("
    refuses(comm, ValueError, text, make(c[:, :7] if is_last else c))
    bad = np.where(is_last, np.nan, c)
    refuses(comm, ValueError, f"rank {last}: c has the coefficient nan", make(bad))
    refuses(comm, TypeError, "coefficients on slabs must be real", make(c + 1j))
    refuses(comm, ValueError, "add up to inf", make(np.full(c.shape, 1e308)))
    # Those of all lags are nearly four times as many.
    refuses(comm, ValueError, "add up to inf", make(np.full(c.shape, 1e308 / 96)))
    refuses(comm, ValueError, "parity is (1,)", make(c, parity=(1,)))
    refuses(comm, ValueError, f"rank {last}: parity is 5", make(c, parity=5 if is_last else (1, 1)))
    refuses(comm, ValueError, "rank 0: parity is (-1, 1)", make(c, parity=(-1, 1)))
    refuses(comm, ValueError, "behind has shape (2, 8)", make(c, behind=np.ones((2, 8))))
    refuses(comm, ValueError, "differ in their first row", make(c, behind=c + 1.0))
    with pytest.raises(TypeError, match="but must be a Slab"):
        slabs.ToeplitzOperator(c, slab.shape)
    with pytest.raises(TypeError, match="its mask is a toeplitz_mg"):
        tmg.MaskedOperator(slabs.ToeplitzOperator(c, slab), np.ones(slab.local, bool))
    if last:
        text = f"the dtype of c is float64 on rank 0 and float32 on rank {last}"
        refuses(comm, ValueError, text, make(c.astype(np.float32) if is_last else c))


def test_what_the_caller_changes_later_changes_nothing(comm):
    shape = (12, 8)
    slab, c = slabs.Slab(comm, shape), kernel(shape)
    own, behind = c[slab.rows].copy(), c[slab.rows].copy()
    x = np.random.default_rng(0).random(own.size)
    A = slabs.ToeplitzOperator(own, slab, behind=behind)
    B = slabs.ToeplitzOperator(own, slab)
    expected = A @ x, slabs.cosine_preconditioner(B) @ x
    own[:] = behind[:] = 0.0
    assert np.array_equal(A.c, c[slab.rows])
    assert np.array_equal(A.behind, c[slab.rows])
    assert np.array_equal(A @ x, expected[0])
    assert np.array_equal(slabs.cosine_preconditioner(B) @ x, expected[1])


def test_coefficients_of_another_order_of_bytes(comm):
    shape = (12, 8)
    slab, c = slabs.Slab(comm, shape), kernel(shape)
    own, x = c[slab.rows], np.random.default_rng(0).random(c[slab.rows].size)
    A, B = (slabs.ToeplitzOperator(a, slab) for a in (own, own.astype(">f8")))
    assert np.array_equal(A @ x, B @ x)
    for name in ("cosine_preconditioner", "fsai_preconditioner"):
        make = getattr(slabs, name)
        assert np.array_equal(make(A) @ x, make(B) @ x)


def test_coefficients_may_be_tiny_far_away(comm):
    slab = slabs.Slab(comm, (64, 4))
    i = np.arange(64)[slab.rows, None]
    c = np.exp(-12.0 * i) * np.exp(-np.arange(4.0))
    A = slabs.ToeplitzOperator(c, slab)
    assert np.isfinite(A @ np.ones(A.shape[0])).all()


def test_wrong_vectors_and_masks_are_refused_by_all(comm):
    slab, last = slabs.Slab(comm, (12, 8)), comm.size - 1
    A = slabs.ToeplitzOperator(kernel((12, 8))[slab.rows], slab)
    is_last, n = comm.rank == last, A.shape[0]
    x = np.ones(n - is_last)
    refuses(comm, ValueError, f"rank {last}: x has shape ", lambda: A @ x)
    refuses(comm, TypeError, "x has dtype complex128", lambda: A @ np.ones(n, complex))
    if last:
        x = np.ones(n, np.float32 if is_last else np.float64)
        text = f"the dtype of x is float64 on rank 0 and float32 on rank {last}"
        refuses(comm, ValueError, text, lambda: A @ x)
        work = partial(A.astype, np.float32) if is_last else lambda: A @ np.ones(n)
        refuses(comm, ValueError, "all ranks must call the same functions", work)
    mask = np.ones(slab.local, int if is_last else bool)
    text = f"rank {last}: mask has dtype int64"
    refuses(comm, TypeError, text, lambda: slabs.MaskedOperator(A, mask))
    nothing = np.zeros(slab.local, bool)
    text = "mask is nowhere true on any rank"
    refuses(comm, ValueError, text, lambda: slabs.MaskedOperator(A, nothing))
    B = slabs.MaskedOperator(A, ~nothing)
    text = "A is of type MaskedOperator, but must be"
    refuses(comm, TypeError, text, lambda: slabs.MaskedOperator(B, ~nothing))
    other = slabs.ToeplitzOperator(A.c, slabs.Slab(comm, (12, 8)))
    text = "the blocks live on several slabs"
    refuses(comm, ValueError, text, lambda: slabs.CoupledOperator([[A, None], [None, other]]))
    text = "blocks has rows of lengths [2], but must be a square array"
    refuses(comm, ValueError, text, lambda: slabs.CoupledOperator([[A, A]]))
    for wrong in ([A, A], [[A, 3], [3, A]], [A, [A]]):
        blocks = wrong if is_last else [[A, None], [None, A]]
        text = f"rank {last}: blocks" + ("[0][1] is of type int" if wrong[0] is not A else " is [")
        refuses(comm, TypeError, text, lambda blocks=blocks: slabs.CoupledOperator(blocks))
    for wrong in (3, [], [3], "xx"):
        text = f"blocks is {wrong!r}, but must have rows of ToeplitzOperator"
        refuses(comm, TypeError, text, lambda wrong=wrong: slabs.CoupledOperator(wrong))


def test_a_matrix_in_single_precision_takes_vectors_of_any_size_in_double(comm):
    slab, c = slabs.Slab(comm, (30, 17)), kernel((30, 17))
    A = slabs.ToeplitzOperator(c[slab.rows].astype(np.float32), slab)
    P = slabs.fsai_preconditioner(slabs.ToeplitzOperator(c[slab.rows], slab), dtype=np.float32)
    x = np.random.default_rng(comm.rank).random(A.shape[0])
    for M in (A, P):
        y = M @ x
        largest = slab.vectors.peak(y)
        for size in (1e-300, 1e-60, 1e60, 1e300):
            error = slab.vectors.peak((M @ (size * x)) / size - y)
            assert error <= 1e-5 * largest
        assert not (M @ (0.0 * x)).any()


def test_vectors_of_any_numbers_have_products_in_the_precision_of_the_matrix(comm):
    """Integers, booleans, half precision, and bytes in the order of another machine."""
    rng = np.random.default_rng(0)
    for shape in ((40,), (40, 1), (8, 5)):
        A, serial = on_slab(comm, shape)
        slab = A.slab
        C = slabs.CoupledOperator([[A, None], [None, A]])
        for dtype in ("i8", "?", "f2", "f4", ">f8", ">i4"):
            x = (3.0 * rng.standard_normal(shape)).astype(dtype)
            whole = (serial @ x.ravel().astype(np.float64)).reshape(shape)
            own = x[slab.rows].ravel()
            y = A @ own
            assert y.dtype == np.float64
            assert_rows(slab, y, whole, 1e-14)
            for part in (C @ np.concatenate([own, own])).reshape(2, -1):
                assert_rows(slab, part, whole, 1e-14)


def test_the_bound_of_the_norm_is_one_on_all_ranks(comm):
    """The largest eigenvalue is at a frequency of one of them."""
    for shape, sign in (((12, 8), 1.0), ((12, 8), -1.0), ((7, 9), -1.0)):
        slab = slabs.Slab(comm, shape)
        c = kernel(shape) * sign ** np.indices(shape)[-1]
        A = slabs.ToeplitzOperator(c[slab.rows], slab)
        bound = A.norm_bound
        assert bound >= np.linalg.norm(tmg.ToeplitzOperator(c).toarray(), 2) * (1 - 1e-12)
        assert slab.gather(bound) == [bound] * comm.size


def test_blocks_that_are_not_transposes_are_refused_by_all(comm):
    shape, rng = (12, 8), np.random.default_rng(0)
    slab = slabs.Slab(comm, shape)
    A = slabs.ToeplitzOperator(kernel(shape)[slab.rows], slab)
    u, v, w = (1e-3 * rng.random((3, *shape)))[:, slab.rows]
    v[:, 0] = w[:, 0] = u[:, 0]
    if slab.rows.start == 0:
        v[0] = w[0] = u[0]

    def check(b, c):
        return slabs.CoupledOperator([[A, b], [c, A]]).check_symmetric

    def block(c, behind=None, parity=(1, 1)):
        return slabs.ToeplitzOperator(c, slab, parity=parity, behind=behind)

    check(block(u, v), block(v, u))()
    full, rest = slabs.CoupledOperator, (np.arange(12)[slab.rows] > 0)[:, np.newaxis]
    near, far = (u * (1.0 + change * rest) for change in (1e-15, 1e-9))
    for b, c in ((block(u, v), block(v, near)), (block(u), block(near))):
        C = full([[A, b], [c, A]])  # They are but for rounding, and averaged.
        C.check_symmetric()
        assert slab.vectors.max(np.abs(C.blocks[0][1].c - C.blocks[1][0].opposite)) == 0.0
    assert not full([[A, block(u, v)], [block(v, far), A]]).is_symmetric
    text = "its blocks (1, 0) and (0, 1) are not each other's transpose"
    refuses(comm, ValueError, text, check(block(u, v), block(v, w)))
    refuses(comm, ValueError, text, check(block(u, v), block(w, u)))
    none_at_zero = np.where(np.arange(8) > 0, u, 0.0)
    odd = block(none_at_zero, parity=(1, -1))
    refuses(comm, ValueError, text, check(block(none_at_zero), odd))
