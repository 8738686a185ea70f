"""Slabs of arrays of other libraries: local transforms by the library, rows moved by mpi4py."""

import array_api_strict
import jax
import numpy as np
import pytest

import toeplitz_mg as tmg
from toeplitz_mg import halfspace, slabs

jax.config.update("jax_enable_x64", True)
ELEMENT = (0.02, 0.03)


def of(slab):
    """The coefficients of the whole grid, and of the rows of a rank."""
    if len(slab.shape) == 3:
        c = np.exp(-np.indices(slab.shape).sum(axis=0) / 2.0)
    else:
        c = halfspace.influence_zz(*halfspace.offsets(slab.shape, ELEMENT), ELEMENT, G=1.0, nu=0.28)
    return c / c.flat[0], (c / c.flat[0])[slab.rows]


def error(comm, actual, expected):
    """The largest error on any rank, relative to the largest entry of all."""
    actual = np.asarray(getattr(actual, "_array", actual))
    assert actual.dtype == expected.dtype
    sizes = (np.abs(actual - expected).max(initial=0.0), np.abs(expected).max(initial=0.0))
    wrong, largest = np.max(comm.allgather(sizes), axis=0)
    return wrong / largest


def test_products_are_the_serial_ones(comm):
    # Each shape takes JAX a second or two.
    libraries = [
        (array_api_strict, ((12, 15), (7, 5), (6, 4, 5), (4, 2))),
        (jax.numpy, ((12, 15),)),
    ]
    for xp, shapes in libraries:
        for shape in shapes:
            for dtype, bound in ((np.float64, 1e-14), (np.float32, 2e-6))[: len(shapes)]:
                slab = slabs.Slab(comm, shape, unit=1)
                c, own = (part.astype(dtype) for part in of(slab))
                x = np.random.default_rng(0).standard_normal(shape).astype(dtype)
                y = (tmg.ToeplitzOperator(c) @ x.ravel()).reshape(shape)
                A = slabs.ToeplitzOperator(xp.asarray(own), slab)
                product = A @ xp.asarray(x[slab.rows].ravel())
                assert type(product) is type(xp.ones(1))
                assert error(comm, product, y[slab.rows].ravel()) <= bound


def test_coefficients_that_are_neither_even_nor_odd(comm):
    """Both parts are of one library, also where a rank has changed them since."""
    slab = slabs.Slab(comm, (12, 15), unit=1)
    _, own = of(slab)
    behind = own.copy()
    if comm.rank:
        behind *= 0.5
    expected = slabs.ToeplitzOperator(own, slab, behind=behind) @ np.ones(own.size)
    a, b = array_api_strict.asarray(own, copy=True), array_api_strict.asarray(behind, copy=True)
    A = slabs.ToeplitzOperator(a, slab, behind=b)
    a[...] = 0.0
    assert np.array_equal(A.c, own)
    product = A @ array_api_strict.ones(own.size)
    assert error(comm, product, expected) <= 1e-14
    with pytest.raises(TypeError, match="behind is an array of numpy"):
        slabs.ToeplitzOperator(array_api_strict.asarray(own), slab, behind=behind)


def test_a_product_moves_no_more_than_on_numpy(comm):
    slab = slabs.Slab(comm, (64, 48), unit=1)
    _, own = of(slab)
    sent = []
    for a in (np.asarray, array_api_strict.asarray):
        A, x = slabs.ToeplitzOperator(a(own), slab), a(np.ones(own.size))
        comm.reset()
        A.apply(x)
        sent.append(comm.sent)
    assert sent[0] == sent[1]


def test_sums_and_extents_and_what_fsai_refuses(comm):
    slab = slabs.Slab(comm, (12, 15), unit=1)
    _, own = of(slab)
    field = array_api_strict.asarray(own)
    assert slab.sum(field) == pytest.approx(slab.sum(own), rel=1e-14)
    assert slab.extent(field) == slab.extent(own)
    A = slabs.ToeplitzOperator(field, slab)
    with pytest.raises(TypeError, match=r"fft, cosine and sine of toeplitz_mg\.slabs") as refusal:
        slabs.fsai_preconditioner(A)
    assert "and fsai" not in str(refusal.value)


def test_cg_takes_the_serial_iterations(comm):
    slab = slabs.Slab(comm, (12, 15), unit=1)
    c, own = of(slab)
    b = np.random.default_rng(1).standard_normal(slab.shape)
    expected, residuals = [], []
    x, _ = tmg.cg(tmg.ToeplitzOperator(c), b.ravel(), rtol=1e-8, residuals=expected)
    A = slabs.ToeplitzOperator(jax.numpy.asarray(own), slab)
    right = jax.numpy.asarray(b[slab.rows].ravel())
    y, info = tmg.cg(A, right, rtol=1e-8, residuals=residuals)
    assert info == 0
    assert len(residuals) == len(expected)
    assert error(comm, y, x.reshape(slab.shape)[slab.rows].ravel()) <= 1e-6
    for wrong in (lambda: A @ b[slab.rows].ravel(), lambda: tmg.cg(A, b[slab.rows].ravel())):
        with pytest.raises(TypeError, match=r"numpy.* jax\.numpy"):
            wrong()


def test_ranks_may_have_no_column(comm):
    """Of a grid of fewer columns than ranks some have none to transform along the first axis."""
    for shape in ((7, 3), (4, 2)):
        slab = slabs.Slab(comm, shape, unit=1)
        c, own = of(slab)
        x = np.random.default_rng(0).standard_normal(shape)
        A = slabs.ToeplitzOperator(array_api_strict.asarray(own), slab)
        for name in ("cosine_preconditioner", "sine_preconditioner", "fft_preconditioner"):
            y = getattr(tmg, name)(tmg.ToeplitzOperator(c)) @ x.ravel()
            own_y = getattr(slabs, name)(A) @ array_api_strict.asarray(x[slab.rows].ravel())
            assert error(comm, own_y, y.reshape(shape)[slab.rows].ravel()) <= 1e-13


def test_masks_components_and_preconditioners_are_the_serial_ones(comm):
    slab = slabs.Slab(comm, (12, 15), unit=1)
    c, own = of(slab)
    mask = np.random.default_rng(0).random(slab.shape) < 0.6
    island = np.zeros(slab.shape, bool)  # The other ranks have no unknown.
    island[-2:, 3:6] = True
    x = np.random.default_rng(1).standard_normal((2, *slab.shape))

    S, B = tmg.ToeplitzOperator(c), slabs.ToeplitzOperator(array_api_strict.asarray(own), slab)
    serial, A = (
        package.CoupledOperator([[block, None], [None, block]])
        for package, block in ((tmg, S), (slabs, B))
    )
    cases = [(serial, A, np.ones(x.shape, bool))]
    for cells in (mask, island):
        ours = slabs.MaskedOperator(B, cells[slab.rows])
        cases.append((tmg.MaskedOperator(S, cells), ours, cells))
    for serial, A, cells in cases:
        rows, v = slab.rows, (x[0] if cells.ndim == 2 else x)[cells]
        mine = (x[0, rows] if cells.ndim == 2 else x[:, rows])[cells[..., rows, :]]
        makers = [(lambda B: B, lambda B: B)]
        for name in ("fft_preconditioner", "cosine_preconditioner", "sine_preconditioner"):
            make = getattr(tmg, name)
            is_whole = cells.ndim == 2 or name == "fft_preconditioner"
            makers.append((make if is_whole else tmg.componentwise(make), getattr(slabs, name)))
        for of_serial, of_ours in makers:
            whole = np.zeros(cells.shape)
            whole[cells] = of_serial(serial) @ v
            y = of_ours(A) @ array_api_strict.asarray(mine)
            expected = whole[..., rows, :][cells[..., rows, :]]
            assert error(comm, y, expected) <= 1e-14
    residuals, expected = [], []
    b = array_api_strict.asarray(np.ones(A.shape[0]))
    _, info = tmg.cg(A, b, M=slabs.cosine_preconditioner(A), rtol=1e-8, residuals=residuals)
    ones = np.ones(serial.shape[0])
    tmg.cg(serial, ones, M=tmg.cosine_preconditioner(serial), rtol=1e-8, residuals=expected)
    assert info == 0
    assert len(residuals) == len(expected)
