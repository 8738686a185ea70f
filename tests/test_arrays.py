"""Arrays of other libraries: the operators, preconditioners and iterations are those on NumPy's."""

import gc
import operator
import os
import pickle
import re
import subprocess
import sys
import tracemalloc
from functools import partial
from math import prod
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import diags_array
from scipy.sparse.linalg import aslinearoperator

import toeplitz_mg as tmg
from tests.array_libraries import LIBRARIES, ON_GPU, load_library, record_numbers, to_numpy
from tests.systems import preconditioners, refuses, seeded
from toeplitz_mg import contact, halfspace

strict = pytest.importorskip("array_api_strict")
ROUNDING = {"float64": 1e-14, "float32": 2e-6}


@pytest.fixture(params=LIBRARIES, scope="module")
def xp(request):
    return load_library(request.param)


def kernel(*shape, dtype=np.float64):
    """Coefficients of a half-space on two axes, of covariances on other numbers of axes."""
    if len(shape) == 2 and min(shape) > 1:
        x, y = halfspace.offsets(shape, (0.5, 0.6))
        c = halfspace.influence_zz(x, y, (0.5, 0.6), G=1.0, nu=0.28)
        return (c / c[0, 0]).astype(dtype)
    return (1.0 / (1.0 + np.indices(shape).sum(axis=0)) ** len(shape)).astype(dtype)


def error(actual, expected):
    actual = to_numpy(actual)
    assert actual.dtype == expected.dtype
    assert actual.shape == expected.shape
    return float(np.abs(actual - expected).max() / np.abs(expected).max())


def tangential(a, t, nu=0.5, shape=(24, 20), element=(1.0, 1.0)):
    """Components that are strongly coupled."""
    x, y = halfspace.all_offsets(shape, element)
    xx, xy, yy = (
        tmg.ToeplitzOperator.from_lags(a(f(x, y, element, G=1.0, nu=nu).astype(t)))
        for f in (halfspace.influence_xx, halfspace.influence_xy, halfspace.influence_yy)
    )
    return tmg.CoupledOperator([[xx, xy], [xy, yy]])


MASK = np.indices((13, 11)).sum(axis=0) % 5 != 1
OPERATORS = {
    "one axis": lambda a, t: tmg.ToeplitzOperator(a(kernel(300, dtype=t))),
    "one unknown": lambda a, t: tmg.ToeplitzOperator(a(kernel(1, dtype=t))),
    "1 x n": lambda a, t: tmg.ToeplitzOperator(a(kernel(1, 9, dtype=t))),
    "two axes": lambda a, t: tmg.ToeplitzOperator(a(kernel(13, 11, dtype=t))),
    "three axes": lambda a, t: tmg.ToeplitzOperator(a(kernel(3, 5, 4, dtype=t))),
    "general": lambda a, t: tmg.ToeplitzOperator.from_lags(a(seeded(9, 13, dtype=t))),
    "column and row": lambda a, t: tmg.ToeplitzOperator(*map(a, seeded(2, 7, dtype=t))),
    "complex": lambda a, t: tmg.ToeplitzOperator.from_lags(
        a(seeded(9, 13, dtype=np.result_type(t, np.complex64)))
    ),
    "components": lambda a, t: tangential(a, t, 0.28, (6, 9), (0.3, 0.4)),
    "mask": lambda a, t: tmg.MaskedOperator(OPERATORS["two axes"](a, t), MASK),
    "mask of components": lambda a, t: tmg.MaskedOperator(
        OPERATORS["components"](a, t), MASK[:6, :9]
    ),
    "decaying": lambda a, t: tmg.ToeplitzOperator(a((0.5 ** np.arange(300)).astype(t))),
    "times an array": lambda a, t: OPERATORS["one axis"](a, t) * a(np.array(2.0, t)),
    "scaled": lambda a, t: 2 * OPERATORS["two axes"](a, t) - OPERATORS["two axes"](a, t) / 4,
}
MAKERS = {maker.__name__: maker for maker in preconditioners("fft cosine sine chan strang")}


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("name", OPERATORS)
def test_products_are_those_on_numpy(xp, name, dtype):
    A, B = (OPERATORS[name](a, np.dtype(dtype)) for a in (np.asarray, xp.asarray))
    assert B.dtype == A.dtype
    assert isinstance(B.dtype, np.dtype)
    assert (A.H is A) == (B.H is B)
    x, X = seeded(A.shape[0], dtype=dtype), seeded(A.shape[0], 2, dtype=dtype)
    Z = X + 1j * X[::-1]
    for actual, expected in (
        (B @ xp.asarray(x), A @ x),
        (B.matvec(xp.asarray(x)), A.matvec(x)),
        (B.dot(xp.asarray(X)), A @ X),
        (B.matmat(xp.asarray(Z.astype(np.result_type(Z, A.dtype)))), A @ Z),
        (B.H @ xp.asarray(x), A.H @ x),
        (B.rmatvec(xp.asarray(x)), A.rmatvec(x)),
    ):
        assert error(actual, expected) <= ROUNDING[dtype]
    if A.dtype.kind != "c":
        assert error(B.__rmatmul__(xp.asarray(x)), x @ A) <= ROUNDING[dtype]
    assert error(pickle.loads(pickle.dumps(B)) @ xp.asarray(x), A @ x) <= ROUNDING[dtype]
    with pytest.raises(ValueError, match="shape"):
        B @ xp.zeros(A.shape[0] + 1)


@pytest.mark.parametrize("library", ["array_api_strict", *ON_GPU])
@pytest.mark.parametrize("shape", [(300,), (20, 13), (1, 9), (3, 5, 4), (182, 181)])
@pytest.mark.parametrize("name", MAKERS)
def test_preconditioners_are_those_on_numpy(name, shape, library):
    """On 182 x 181, M inverts the longer circulant that it takes where 2 n - 1 is slow."""
    xp = load_library(library)
    for dtype in ROUNDING:
        c, x = kernel(*shape, dtype=dtype), seeded(prod(shape), dtype=dtype)
        A, B = tmg.ToeplitzOperator(c), tmg.ToeplitzOperator(xp.asarray(c))
        P, Q = MAKERS[name](A), MAKERS[name](B)
        for M in (Q, pickle.loads(pickle.dumps(Q))):
            assert error(M @ xp.asarray(x), P @ x) <= ROUNDING[dtype]
        assert (P.H is P) == (Q.H is Q)


@pytest.mark.parametrize(
    ("solve", "name", "case"),
    [
        *((tmg.cg, f"{name}_preconditioner", case)
          for name in ("fft", "cosine", "chan") for case in ("two axes", "mask", "components")),
        (tmg.richardson, "cosine_preconditioner", "decaying"),
    ],
)  # fmt: skip
def test_iterations_are_those_on_numpy(xp, solve, name, case):
    for dtype, rtol in (("float64", 1e-9), ("float32", 1e-5)):
        A, B = (OPERATORS[case](a, np.dtype(dtype)) for a in (np.asarray, xp.asarray))
        b, expected, residuals = seeded(A.shape[0], dtype=dtype), [], []
        x, info = solve(A, b, M=MAKERS[name](A), rtol=rtol, residuals=expected)
        y, same = solve(B, xp.asarray(b), M=MAKERS[name](B), rtol=rtol, residuals=residuals)
        assert info == same == 0
        assert len(residuals) == len(expected)
        assert error(y, x) <= 10 * rtol


SPARSE = {
    "grid": lambda a, t: tmg.ToeplitzOperator(a(kernel(60, 50, dtype=t))),
    "mask": lambda a, t: tmg.MaskedOperator(SPARSE["grid"](a, t), seeded(60, 50) > 0.3),
    "few unknowns": lambda a, t: tmg.ToeplitzOperator(a(kernel(20, 13, dtype=t))),
    "line": lambda a, t: tmg.ToeplitzOperator(a(kernel(3000, dtype=t) ** 0.5)),
    "mask of a line": lambda a, t: tmg.MaskedOperator(SPARSE["line"](a, t), seeded(3000) > 0.3),
    "components": lambda a, t: tangential(a, t, nu=0.28),
    "mask of components": lambda a, t: tmg.MaskedOperator(
        tangential(a, t), seeded(2, 24, 20) > -0.5
    ),
}


@pytest.mark.parametrize("name", SPARSE)
def test_fsai_is_that_on_numpy(name):
    for dtype, rtol in (("float64", 1e-9), ("float32", 1e-5)):
        A, B = (SPARSE[name](a, np.dtype(dtype)) for a in (np.asarray, strict.asarray))
        P, Q = tmg.fsai_preconditioner(A), tmg.fsai_preconditioner(B)
        x, X = seeded(A.shape[0], dtype=dtype), seeded(A.shape[0], 2, dtype=dtype)
        assert error(Q @ strict.asarray(x), P @ x) <= 10 * ROUNDING[dtype]
        assert error(Q @ strict.asarray(X), P @ X) <= 10 * ROUNDING[dtype]
        assert error(pickle.loads(pickle.dumps(Q)) @ strict.asarray(x), P @ x) <= 1e-4
        assert Q.H is Q
        assert Q.work == P.work or name == "line"  # On NumPy rows that are alike are one.
        counts = []
        for C, M, b in ((A, P, x), (B, Q, strict.asarray(x))):
            residuals = []
            _, info = tmg.cg(C, b, M=M, rtol=rtol, residuals=residuals)
            assert info == 0
            counts.append(len(residuals))
        assert counts[0] == counts[1]


@pytest.mark.parametrize("library", LIBRARIES[1:])
def test_fsai_on_jax_and_gpus(library):
    xp = load_library(library)
    A, B = (SPARSE["mask"](a, np.float64) for a in (np.asarray, xp.asarray))
    x = seeded(A.shape[0])
    Q = tmg.fsai_preconditioner(B)
    assert error(Q @ xp.asarray(x), tmg.fsai_preconditioner(A) @ x) <= 1e-14


def test_cg_in_less_precision_and_from_a_guess(xp):
    A, B = (OPERATORS["mask"](a, np.float64) for a in (np.asarray, xp.asarray))
    b, guess = seeded(2, A.shape[0])
    given, kept = xp.asarray(guess), guess.copy()
    iterations = []
    for C, v, x0 in ((A, b, guess), (B, xp.asarray(b), given)):
        residuals = []
        C32 = C.astype(np.float32)
        x, info = tmg.cg(
            C, v, x0, M=tmg.cosine_preconditioner(C32), inner=C32, rtol=1e-8, residuals=residuals
        )
        assert info == 0
        iterations.append(len(residuals))
    assert iterations[0] == iterations[1]
    assert np.linalg.norm(A @ to_numpy(x) - b) <= 1e-8 * np.linalg.norm(b)
    assert np.array_equal(to_numpy(given), kept)


def test_an_iteration_takes_three_numbers_to_the_host(monkeypatch):
    looked = record_numbers(monkeypatch, type(strict.ones(1)))
    A = OPERATORS["mask"](strict.asarray, np.float64)
    M, b = tmg.fft_preconditioner(A), strict.asarray(seeded(A.shape[0]))
    counts = []
    for rtol in (1e-2, 1e-10):
        looked.clear()
        residuals = []
        _, info = tmg.cg(A, b, M=M, rtol=rtol, residuals=residuals)
        assert info == 0
        counts.append((len(looked), len(residuals)))
    (few, first), (many, last) = counts
    assert many - few == 3 * (last - first)
    assert set(looked) == {()}
    looked.clear()
    _ = A @ b
    _ = M @ b
    assert not looked


def test_arrays_of_two_libraries_are_refused_by_name(xp):
    A, B = (tmg.ToeplitzOperator(a(kernel(7))) for a in (np.asarray, xp.asarray))
    name, ones = xp.__name__, np.ones(7)
    for f in (
        lambda: A @ xp.asarray(ones),
        lambda: A.matvec(xp.asarray(ones)),
        lambda: B @ ones,
        lambda: B.rmatvec(ones),
        lambda: tmg.cg(A, xp.asarray(ones)),
        lambda: tmg.solve_toeplitz(xp.asarray(ones), ones),
        lambda: tmg.cg(B, xp.asarray(ones), ones),
        lambda: tmg.cg(B, xp.asarray(ones), M=A),
        lambda: tmg.cg(B, xp.asarray(ones), M=aslinearoperator(np.eye(7))),
        lambda: tmg.cg(B, xp.asarray(ones), inner=A),
        lambda: tmg.CoupledOperator([[A, None], [None, B]]),
        lambda: tmg.ToeplitzOperator(xp.asarray(ones), ones),
        *(lambda f=f: f(A, B) for f in (operator.add, operator.sub, operator.matmul)),
        *(lambda f=f: f(B, A) for f in (operator.add, operator.sub, operator.matmul)),
        lambda: B + diags_array(np.arange(7.0)),
        lambda: tmg.multigrid(B),
        lambda: tmg.spectral_preconditioner(B),
        lambda: tmg.tau_preconditioner(B),
        lambda: tmg.jacobi_preconditioner(B),
    ):
        with pytest.raises(TypeError, match=name) as refusal:
            f()
        assert "numpy" in str(refusal.value).replace("jax.numpy", "")
    with pytest.raises(TypeError, match=f"M is an array of {name}, but must be an operator"):
        tmg.cg(B, xp.asarray(ones), M=xp.asarray(np.eye(7)))


STEEL = contact.Material(E=210000.0, nu=0.28)
KERNEL = {"element": (1.0, 1.0), "G": 1.0, "nu": 0.28}
PRESS = {"element": (0.1, 0.1), "material": STEEL}
ON_NUMPY_ALONE = {
    "solve_block_toeplitz c": lambda x: tmg.solve_block_toeplitz(x, np.ones(4)),
    "normal_contact": lambda x: contact.normal_contact(x, force=1.0, periodic=True, **PRESS),
    "friction": lambda x: contact.friction(bound=x, shift=(1.0, 0.0), **PRESS),
    "friction shift": lambda x: contact.friction(bound=np.ones((4, 4)), shift=x, **PRESS),
    "rolling": lambda x: contact.rolling(bound=x, longitudinal=0.1, **PRESS),
    "influence x": lambda x: halfspace.influence_zz(x, np.arange(4.0), **KERNEL),
    "influence y": lambda x: halfspace.influence_xx(np.arange(4.0), x, **KERNEL),
}


@pytest.mark.parametrize("name", ON_NUMPY_ALONE)
def test_what_needs_numpys_arrays_names_both_libraries_and_the_way(xp, name):
    with pytest.raises(TypeError, match=f"is an array of {xp.__name__}, but .* numpy") as refusal:
        ON_NUMPY_ALONE[name](xp.asarray(np.ones(4)))
    assert "x.get()" in str(refusal.value)


SYSTEMS = {
    "symmetric": (kernel(700) ** 0.5,),
    "general": ((1.0 + np.arange(700.0)) ** -1.1, 0.5 * (1.0 + np.arange(700.0)) ** -2.0),
    "indefinite": (0.7 / (1.0 + np.arange(700.0)) - np.eye(1, 700)[0],),
    "complex": (np.exp(0.3j * np.arange(700.0)) / (1.0 + np.arange(700.0)),),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_systems_and_inverses_are_those_on_numpy(xp, name):
    given = SYSTEMS[name]
    there, B = tuple(map(xp.asarray, given)), seeded(700, 2)
    x, info = tmg.solve_toeplitz(there, xp.asarray(B), full_output=True)
    expected = tmg.solve_toeplitz(given if len(given) == 2 else given[0], B)
    assert info.residual <= 1e-11
    assert_allclose(to_numpy(x), expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    one = tmg.solve_toeplitz(there if len(there) == 2 else there[0], xp.asarray(B[:, 0]))
    assert_allclose(to_numpy(one), to_numpy(x)[:, 0], rtol=0, atol=1e-9 * np.abs(expected).max())
    if name == "indefinite":
        return
    inverse = tmg.toeplitz_inverse(tmg.ToeplitzOperator(*there))
    assert_allclose(to_numpy(inverse @ xp.asarray(B)), expected, rtol=0, atol=1e-8)
    if name == "symmetric":
        assert_allclose(inverse.logdet, tmg.toeplitz_logdet(*given))


@pytest.mark.parametrize("name", ["two axes", "mask", "components", "general"])
def test_the_default_preconditioner_is_at_hand(xp, name):
    A = OPERATORS[name](xp.asarray, np.float64)
    b = xp.asarray(seeded(A.shape[0]))
    if name == "general":
        refuses(ValueError, "must be symmetric", tmg.default_preconditioner, A)
        return
    residuals = []
    _, info = tmg.cg(A, b, M=tmg.default_preconditioner(A), rtol=1e-8, residuals=residuals)
    assert info == 0
    assert len(residuals) <= 40


@pytest.mark.parametrize("library", LIBRARIES[1:])
def test_the_blocks_of_the_readme_run_with_arrays_of_jax_and_on_gpus(library):
    load_library(library)
    grid = 'np.meshgrid(np.arange(200.0), np.arange(300.0), indexing="ij")'  # As torch says it.
    text = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(import numpy as np\n.*?)```", text, re.DOTALL)
    assert len(blocks) >= 2
    for block in blocks:
        names = {}
        block = block.replace("np.indices((200, 300))", grid)
        exec(block.replace("import numpy as np", f"import {library} as np"), names)
        assert all(not isinstance(value, np.ndarray) for value in names.values())


def test_likelihoods_are_those_on_numpy(xp):
    c, y = kernel(50) ** 0.5 + np.eye(1, 50)[0], seeded(3, 50)
    theirs, ours = tmg.ToeplitzNormal(xp.asarray(c), 0.5), tmg.ToeplitzNormal(c, 0.5)
    assert_allclose(theirs.logpdf(xp.asarray(y)), ours.logpdf(y))
    _, *derivatives = theirs.logpdf_and_grad(xp.asarray(y))
    for actual, expected in zip(derivatives, ours.logpdf_and_grad(y)[1:], strict=True):
        assert_allclose(to_numpy(actual), expected)
    refuses(TypeError, "y is an array of numpy", theirs.logpdf, y)
    y = np.where(np.arange(50) % 7, y[0], np.nan)
    given, expected = theirs.conditional(xp.asarray(y)), ours.conditional(y)
    ahead, known = theirs.forecast(xp.asarray(y[:40]), 3), ours.forecast(y[:40], 3)
    for a, b in ((given, expected), (ahead, known)):
        for x, exact in zip((a.mean, *a.interval()), (b.mean, *b.interval()), strict=True):
            assert_allclose(to_numpy(x), exact)
    for a, b in ((given, expected), (theirs, ours)):
        assert_allclose(to_numpy(a.rvs(2, random_state=0)), b.rvs(2, random_state=0))


@pytest.mark.slow
def test_jax_differentiates_likelihoods():
    jnp = load_library("jax.numpy")
    jax = sys.modules["jax"]
    k, y = np.arange(60), seeded(2, 60)

    def loss(t, y, logpdf):
        return logpdf(jnp.exp(-k / t[0]) + t[1] * (k == 0), jnp.asarray(y) - t[2]).sum()

    def by_dense(c, y):
        A = c[jnp.abs(k[:, None] - k)]
        squares = (y * jnp.linalg.solve(A, y.T).T).sum(-1)
        return -0.5 * (squares + jnp.linalg.slogdet(A)[1] + 60 * np.log(2 * np.pi))

    ours = partial(loss, logpdf=lambda c, y: tmg.ToeplitzNormal(c).logpdf(y))
    theirs = partial(loss, logpdf=by_dense)
    t = jnp.asarray([9.0, 0.5, 0.1])
    for f in (jax.grad, lambda f: jax.jit(jax.grad(f))):
        for series in (y, y[0]):
            assert_allclose(f(ours)(t, series), f(theirs)(t, series), rtol=1e-8)
    many = jnp.stack([t, 1.1 * t])
    assert_allclose(*(jax.vmap(f, (0, None))(many, y) for f in (ours, theirs)), rtol=1e-9)
    density = jax.jit(lambda c: tmg.ToeplitzNormal(c).logpdf(jnp.ones(2)))
    assert np.isnan(density(jnp.asarray([1.0, 2.0])))
    with pytest.raises(ValueError, match=r"y has shape \(2,\), .* those of c, \(3,\)"):
        density(jnp.ones(3))
    known = tmg.ToeplitzNormal(0.5**k, mean=0.1)
    assert_allclose(jax.grad(known.logpdf)(jnp.asarray(y[0])), known.logpdf_and_grad(y[0])[2])


@pytest.mark.slow
def test_jax_differentiates_solutions_and_compiles_products():
    jnp = load_library("jax.numpy")
    jax = sys.modules["jax"]
    k = np.arange(60)

    def loss(t, solve):
        c, r = jnp.exp(-k / t[0]) + t[1] * (k == 0), jnp.exp(-k / t[2])
        return (solve(c, r, jnp.stack([jnp.sin(t[0] * k / 60.0), k / 60.0], axis=1)) ** 2).sum()

    def by_dense(c, r, b):
        lags = jnp.concatenate([r[:0:-1], c])
        return jnp.linalg.solve(lags[k[:, None] - k + 59], b)

    ours = partial(loss, solve=lambda c, r, b: tmg.solve_toeplitz((c, r), b))
    theirs = partial(loss, solve=by_dense)
    t = jnp.asarray([20.0, 0.5, 10.0])
    for f in (jax.grad, lambda f: jax.jit(jax.grad(f))):
        assert_allclose(f(ours)(t), f(theirs)(t), rtol=1e-9)
    many = jnp.stack([t, 1.1 * t])
    assert_allclose(jax.vmap(ours)(many), jax.vmap(theirs)(many), rtol=1e-9)
    solve = jax.jit(lambda c: tmg.solve_toeplitz(c, np.ones(60, int)))
    assert np.isnan(solve(jnp.zeros(60))).all()
    A = tmg.ToeplitzOperator(jnp.exp(-k / 9.0))
    assert_allclose(jax.jit(lambda x: A @ x)(1.0 * k), A @ jnp.asarray(1.0 * k), rtol=1e-12)
    with pytest.raises(TypeError, match=r"c is traced by JAX.* make operators outside of jit"):
        jax.jit(lambda c: tmg.ToeplitzOperator(c) @ c)(jnp.ones(4))


def test_what_is_wrong_with_coefficients_is_told_as_on_numpy(xp):
    for wrong in ([1.0, np.nan], [1e200, 1e306], np.zeros((0,))):
        messages = []
        for a in (np.asarray, xp.asarray):
            with pytest.raises(ValueError, match="but") as refusal:
                tmg.ToeplitzOperator(a(np.asarray(wrong)))
            messages.append(str(refusal.value))
        assert messages[0] == messages[1]
    for maker in MAKERS.values():
        with pytest.raises(np.linalg.LinAlgError, match="but all must be above"):
            maker(tmg.ToeplitzOperator(xp.asarray(np.array([1.0, 3.0, 0.0, 0.0]))))
    with pytest.raises(ValueError, match="not finite"):
        tmg.cg(OPERATORS["two axes"](xp.asarray, np.float64), xp.asarray(np.full(143, np.inf)))


def test_entries_and_work_are_those_on_numpy(xp):
    for name in ("two axes", "general", "components", "mask"):
        A, B = (OPERATORS[name](a, np.float64) for a in (np.asarray, xp.asarray))
        assert np.array_equal(A.toarray(), B.toarray())
        assert np.array_equal(A.diagonal(), B.diagonal())
        assert A[1, 2] == B[1, 2]
        with tmg.count_products() as ours:
            A @ np.ones(A.shape[0])
        with tmg.count_products() as theirs:
            B @ xp.ones(A.shape[0])
        assert ours.points == theirs.points
    for shape in ((1009,), (101, 103)):  # Transforms are longer than the grid.
        P, Q = (
            tmg.cosine_preconditioner(tmg.ToeplitzOperator(a(kernel(*shape))))
            for a in (np.asarray, xp.asarray)
        )
        assert Q.work == P.work > 0.5 ** len(shape)


@pytest.mark.slow
def test_a_large_grid_is_multiplied_in_parts_with_little_memory():
    """At most 90 bytes an unknown in single precision, with c and x, in set-up and product."""
    c, x = kernel(2100, 2100, dtype=np.float32), seeded(2100**2, dtype=np.float32)
    ours = tmg.ToeplitzOperator(c)
    there = tuple(map(strict.asarray, (c, x)))
    tracemalloc.start()
    try:
        A = tmg.ToeplitzOperator(there[0])
        y, z = A @ there[1], tmg.cosine_preconditioner(A) @ there[1]
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert error(y, ours @ x) <= ROUNDING["float32"]
    assert error(z, tmg.cosine_preconditioner(ours) @ x) <= ROUNDING["float32"]
    assert peak <= 90 * x.size


@pytest.mark.slow
def test_a_product_may_be_compiled():
    jnp = load_library("jax.numpy")
    import jax

    A = OPERATORS["mask"](jnp.asarray, np.float64)
    M, x = tmg.cosine_preconditioner(A), jnp.asarray(seeded(A.shape[0]))
    compiled = jax.jit(lambda v: M @ (A @ v))(x)
    assert_allclose(to_numpy(compiled), to_numpy(M @ (A @ x)), rtol=0, atol=1e-12)


SCRIPT = """
import sys
import numpy as np
import toeplitz_mg as tmg
tmg.solve_toeplitz(np.array([2.0, 1.0]), np.ones(2))
libraries = {"array_api_compat", "array_api_strict", "jax", "mpi4py", "torch", "cupy"}
assert not libraries & {*sys.modules}
import array_api_strict as xp
A = tmg.ToeplitzOperator(xp.asarray(np.array([2.0, 1.0, 0.5])))
for y in (A @ xp.ones(3), A.matvec(xp.ones(3)), A.H @ xp.ones(3), (2 * A) @ xp.ones(3)):
    assert type(y) is type(xp.ones(3))
x, info = tmg.cg(A, A @ xp.ones(3), M=tmg.chan_preconditioner(A), rtol=1e-12)
assert info == 0 and float(xp.max(xp.abs(x - xp.ones(3)))) < 1e-10
assert (tmg.ToeplitzOperator([2.0, 1.0]) @ np.ones(2)).tolist() == [3.0, 3.0]
"""


@pytest.mark.parametrize("flag", ["0", "1"])
def test_with_and_without_scipys_flag(flag):
    """Nothing is imported unless asked for, and SciPy's own support makes no difference."""
    environment = {**os.environ, "SCIPY_ARRAY_API": flag}
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", SCRIPT],
        env=environment,
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("size", [1e-300, 1e-60, 1.0, 1e60, 1e300])
@pytest.mark.parametrize("dtype", [np.float64, np.complex128])
def test_a_matrix_in_single_precision_takes_vectors_of_any_size_in_double(size, dtype):
    c = kernel(6, 7)
    A = tmg.ToeplitzOperator(strict.asarray(c.astype(np.float32)))
    x = seeded(42, dtype=dtype)
    y = to_numpy(A @ strict.asarray(size * x)) / size
    expected = tmg.ToeplitzOperator(c) @ x
    assert_allclose(y, expected, atol=1e-5 * np.abs(expected).max())
    assert not to_numpy(A @ strict.asarray(0.0 * x)).any()


@pytest.mark.parametrize("make", [tmg.chan_preconditioner, tmg.strang_preconditioner])
def test_transposes_of_complex_circulants_are_those_on_numpy(xp, make):
    c = 0.5 ** np.arange(20) * 1j ** np.arange(20)
    ours, theirs = make(tmg.ToeplitzOperator(c)), make(tmg.ToeplitzOperator(xp.asarray(c)))
    x = seeded(20, dtype=np.complex128)
    for of in (lambda M: M.T, lambda M: M.H, lambda M: M.T.T):
        assert_allclose(to_numpy(of(theirs) @ xp.asarray(x)), of(ours) @ x, rtol=0, atol=1e-13)


def test_what_scipy_would_compose_is_refused(xp):
    A = tmg.ToeplitzOperator(xp.asarray(kernel(20)))
    M = tmg.chan_preconditioner(A)
    for compose in (lambda: A @ M, lambda: A * M, lambda: A**2, lambda: A + M):
        refuses(TypeError, r"cannot be combined on arrays of .*A @ \(B @ x\)", compose)


def test_a_product_that_was_made_is_kept_by_nobody(xp):
    """A program that a library compiles of it has its arrays as arguments."""
    kind = type(xp.ones(1))

    def count_arrays():
        gc.collect()
        if xp.__name__ == "jax.numpy":
            return len(sys.modules["jax"].live_arrays())
        return sum(type(thing) is kind for thing in gc.get_objects())

    before = count_arrays()
    A = tmg.ToeplitzOperator(xp.asarray(kernel(9, 7)))
    operators = A, tmg.cosine_preconditioner(A), tmg.chan_preconditioner(A)
    for M in operators:
        M @ xp.asarray(seeded(63))
    assert count_arrays() >= before + 3
    del A, M, operators
    assert count_arrays() <= before


ON_DEVICES = """
import jax, numpy as np, pytest, toeplitz_mg as tmg
from jax.sharding import NamedSharding, PartitionSpec
one, other = jax.devices()
c = np.array([2.0, 1.0, 0.5, 0.25], np.float32)
mesh = jax.make_mesh((2,), ("x",))
with pytest.raises(TypeError, match="an array of jax.numpy lies on 2 devices"):
    tmg.ToeplitzOperator(jax.device_put(c, NamedSharding(mesh, PartitionSpec("x"))))
A, B = (tmg.ToeplitzOperator(jax.device_put(c, device)) for device in (one, other))
for wrong in (
    lambda: A + B,
    lambda: tmg.cg(A, jax.device_put(c, one), M=tmg.cosine_preconditioner(B)),
):
    with pytest.raises(TypeError, match="both must have arrays of one library on one device"):
        wrong()
assert (A @ jax.device_put(c, one)).device == one
assert (B @ jax.device_put(c, other)).device == other
"""


@pytest.mark.slow
def test_arrays_lie_on_one_device():
    pytest.importorskip("jax")
    flag = {"XLA_FLAGS": "--xla_force_host_platform_device_count=2"}
    subprocess.run([sys.executable, "-c", ON_DEVICES], env=os.environ | flag, check=True)
