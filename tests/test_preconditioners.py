"""Theorems of M, M̄, P M and the circulants, and what they refuse.

Row sums are constant, subspaces are lost, iterations do not grow; what is built is positive
definite, or refused with advice.
"""

from functools import partial

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from comparisons.systems.symbols import NONSYMMETRIC
from tests.budgets import assert_within_budget
from tests.cases import checkered, contact, exponential
from tests.systems import count_iterations, preconditioners, refuses
from toeplitz_mg.paper import problems

ALL = preconditioners("fft fft_rsm fft_sd strang chan cosine sine")
HALF_A_UNIT = ALL[3:]
each = pytest.mark.parametrize("preconditioner", ALL, ids=lambda f: f.__name__)
GRIDS = [(1,), (2,), (33,), (257,), (1000,), (12, 12), (7, 20), (64, 64)]


@pytest.mark.parametrize("shape", GRIDS, ids=str)
@pytest.mark.parametrize("with_mask", [False, True])
def test_rsm_row_sums_are_constant(shape, with_mask):
    A = tmg.ToeplitzOperator(contact(*shape))
    if with_mask:
        A = tmg.MaskedOperator(A, checkered(*shape))
    M_bar = tmg.fft_rsm_preconditioner(A)
    assert_allclose(M_bar @ np.ones(A.shape[0]), M_bar.gamma, rtol=1e-9)


@pytest.mark.parametrize("preconditioner", [*ALL[:2], *HALF_A_UNIT], ids=lambda f: f.__name__)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("n", [509, 2**10])
def test_symmetric_positive_definite_at_larger_sizes(preconditioner, n, dtype):
    A = tmg.ToeplitzOperator(contact(n).astype(dtype))
    M = preconditioner(A)
    dense = M @ np.eye(n, dtype=dtype)
    assert dense.dtype == dtype
    dense = dense.astype(np.float64)
    scale = abs(dense).max() * (1e-4 if dtype == np.float32 else 1e-10)
    assert_allclose(dense, dense.T, atol=scale)
    np.linalg.cholesky((dense + dense.T) / 2)  # It raises where that is not positive definite.


PAPERS = [problems.test1, problems.test2, problems.test3]


@pytest.mark.parametrize("preconditioner", [*ALL[:2], *ALL[3:5]], ids=lambda f: f.__name__)
@pytest.mark.parametrize("test", PAPERS)
def test_iterations_of_cg(test, preconditioner):
    problem = test(2048)
    count = count_iterations(tmg.cg, problem.A, problem.b, M=preconditioner(problem.A))
    of_what = "on an area with holes" if test is problems.test3 else "on an interval"
    case = f"{preconditioner.__name__}, {of_what}"
    assert_within_budget(case, iterations=count)


@pytest.mark.parametrize("test", PAPERS)
def test_the_papers_problems_are_certain_on_every_grid(test):
    A = test(4096).A
    for B in (A, tmg.galerkin(A)):
        assert tmg.fft_rsm_preconditioner(B).certified


@settings(deadline=None, max_examples=40)
@given(st.integers(1, 200), st.floats(0.05, 5.0), st.floats(0.0, 1.0), st.integers(0, 9))
@example(198, 1.9, 0.88, 5)  # The spectral factor was indefinite.
@example(122, 2.64, 0.26, 1)
def test_whatever_is_built_is_positive_definite_or_refused(n, length, weight, seed):
    """Random mixtures of covariances: no preconditioner for CG is silently indefinite."""
    k = np.arange(n)
    c = weight * np.exp(-k / length) + (1 - weight) / (1 + k) ** 1.5
    c += 0.3 * np.random.default_rng(seed).standard_normal(n) / (1 + k)
    A = tmg.ToeplitzOperator(c)
    for preconditioner in (*ALL, tmg.spectral_preconditioner, tmg.jacobi_preconditioner):
        if preconditioner is tmg.fft_sd_preconditioner:
            continue
        try:
            M = preconditioner(A) @ np.eye(n)
        except np.linalg.LinAlgError:
            continue
        positive = np.linalg.eigvalsh((M + M.T) / 2).min() > 0
        # Lanczos's method in the inner product of A can only see where A has one.
        assert positive or np.linalg.eigvalsh(A.toarray()).min() <= 0


def spikes(n):
    """Eigenvalues 2.3 to 9.3 for n = 160, of which those of the cut spectral factor have -0.1."""
    c = np.zeros(n)
    c[np.array([0, 51, 65, 67, 92]) * n // 160] = [5.877, -0.835, -0.391, -1.31, -0.386]
    return tmg.ToeplitzOperator(c)


def test_the_spectral_factor_is_positive_definite_where_its_first_n_terms_are_not():
    A = spikes(160)
    M = tmg.spectral_preconditioner(A) @ np.eye(160)
    assert np.linalg.eigvalsh((M + M.T) / 2).min() > 0
    assert tmg.toeplitz_inverse(A).residual <= 1e-10


@pytest.mark.parametrize("columns", [1, 3])
def test_an_easy_system_is_not_refused_for_an_indefinite_spectral_factor(columns):
    A = spikes(20_002)
    B = np.random.default_rng(0).standard_normal((20_002, columns))
    X, info = tmg.solve_toeplitz(A.c, B, full_output=True)
    assert info.residual <= 1e-12
    assert np.linalg.norm(A @ X - B) <= 1e-11 * np.linalg.norm(B)


@pytest.mark.parametrize(
    "preconditioner",
    [tmg.spectral_preconditioner, partial(tmg.fsai_preconditioner, neighbours=12)],
    ids=["spectral", "fsai"],
)
@pytest.mark.parametrize("shape", [(100,), (200,), (20, 20)], ids=str)
def test_in_float32_they_are_positive_definite_or_refused(preconditioner, shape):
    """A smooth covariance with less and less of a nugget: from a condition of 1e8 on refused."""
    if preconditioner is tmg.spectral_preconditioner and len(shape) > 1:
        shape = (400,)
    r = np.sqrt(sum(k.astype(float) ** 2 for k in np.indices(shape)))
    refused = []
    for nugget in (1e-3, 1e-7, 1e-8, 1e-9, 1e-11):
        A = tmg.ToeplitzOperator(np.exp(-((r / 3.0) ** 2) / 2.0) + nugget * (r == 0.0))
        if shape == (200,):
            A = tmg.MaskedOperator(A, np.arange(200) % 7 > 0)
        try:
            M = preconditioner(A, dtype=np.float32) @ np.eye(A.shape[0], dtype=np.float32)
        except np.linalg.LinAlgError as error:
            refused.append(str(error))
            continue
        M = M.astype(np.float64)
        assert np.linalg.eigvalsh((M + M.T) / 2).min() > 0
    assert 0 < len(refused) < 5
    assert all("float32 may make it indefinite: use float64" in message for message in refused)


def test_chan_is_positive_definite_where_the_embeddings_are_not():
    theta_squared = np.array([np.pi**2 / 3, *(2.0 * (-1.0) ** k / k**2 for k in range(1, 64))])
    A = tmg.ToeplitzOperator(theta_squared)
    with pytest.raises(np.linalg.LinAlgError, match=r"eigenvalue -.*use spectral_preconditioner"):
        tmg.fft_preconditioner(A)
    for preconditioner in (tmg.fft_rsm_preconditioner, tmg.fft_sd_preconditioner):
        refuses(np.linalg.LinAlgError, "use spectral_preconditioner", preconditioner, A)
    assert np.linalg.eigvalsh(tmg.chan_preconditioner(A) @ np.eye(64)).min() > 0


def test_circulants_and_rsm_refuse_what_is_not_positive():
    with pytest.raises(np.linalg.LinAlgError, match=r"Strang's circulant has the eigenvalue -"):
        tmg.strang_preconditioner(tmg.ToeplitzOperator([1.0, 0.7, 0.1, 0.0]))
    with pytest.raises(np.linalg.LinAlgError, match=r"T. Chan's circulant .* use .*gmres.*matrix$"):
        tmg.chan_preconditioner(tmg.ToeplitzOperator([1.0, 2.0, 3.0]))
    for gamma in (0.0, -1.0, np.inf, np.nan):
        rule = f"gamma is {gamma:.3g}, but must be positive"
        refuses(np.linalg.LinAlgError, rule, tmg.fft_rsm_preconditioner, A_FEW, gamma=gamma)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_rsm_refuses_a_gamma_below_the_rounding_of_row_sums(dtype):
    """M̄ 1 = γ 1 would be zero: it is singular, whatever the signs of its coefficients certify."""
    A = tmg.ToeplitzOperator(contact(64).astype(dtype))
    largest = float((tmg.fft_preconditioner(A) @ np.ones(64, dtype)).max())
    eps = float(np.finfo(dtype).eps)
    for B in (A, tmg.MaskedOperator(A, np.arange(64) % 3 > 0)):
        for gamma in (1e-20, eps * largest):
            with pytest.raises(np.linalg.LinAlgError, match="above the rounding error of the row"):
                tmg.fft_rsm_preconditioner(B, gamma=gamma)
        M_bar = tmg.fft_rsm_preconditioner(B, gamma=100 * eps * largest)
        assert M_bar.certified
        assert (M_bar @ np.ones(B.shape[0], dtype)).min() > 0.0


K = np.arange(420)
THETA = np.minimum(np.arange(4096), 4096 - np.arange(4096)) * 2 * np.pi / 4096
INDEFINITE = [  # Coefficients, mask, γ and what is said.
    # Of the first two a few steps of Lanczos's method do not see it.
    ((np.cos(2.7 * K) * np.exp(-K / 22.8) + 0.04 * (K == 0))[:202], K**2 % 6 < 4, None, None),
    (np.exp(-((K / 7.473) ** 2) / 2) + 1.2472e-6 * (K == 0), K % 10 >= 2, 1e-3, None),
    (np.fft.ifft(THETA**3 + 0.01).real[:300], K >= 0, None, "is not positive definite"),
    (np.exp(-K / 400), K >= 0, None, r"gamma is -"),
]


@pytest.mark.parametrize(("c", "mask", "gamma", "message"), INDEFINITE)
def test_rsm_refuses_what_is_indefinite(c, mask, gamma, message):
    A = tmg.MaskedOperator(tmg.ToeplitzOperator(c), mask[: len(c)])
    refuses(np.linalg.LinAlgError, message, tmg.fft_rsm_preconditioner, A, gamma=gamma)


def test_rsm_says_what_is_certified():
    """Incompressible, the tangential kernel has coefficients that nothing certain outweighs."""
    for n, certified in ((20, True), (33, False)):  # 400 unknowns are few enough to make sure.
        x, y = tmg.halfspace.offsets((n, n), (1.0, 1.0))
        A = tmg.ToeplitzOperator(tmg.halfspace.influence_xx(x, y, (1.0, 1.0), G=1.0, nu=0.5))
        M_bar = tmg.fft_rsm_preconditioner(A)
        assert M_bar.certified == certified
        assert np.linalg.eigvalsh(M_bar.toarray()).min() > 0
    for full in (tmg.ToeplitzOperator(contact(4096)), tmg.ToeplitzOperator(contact(40, 40))):
        assert tmg.fft_rsm_preconditioner(full).certified


@pytest.mark.parametrize("shape", [(20,), (3000,), (6, 7), (20, 30), (3, 4, 5)], ids=str)
@pytest.mark.parametrize("scale", [2.0**-1000, 2.0**1000])
def test_they_scale_as_the_matrix_does(shape, scale):
    c = exponential(*shape)
    of_lines = [tmg.spectral_preconditioner] * (len(shape) == 1)
    for preconditioner in (*ALL, tmg.jacobi_preconditioner, tmg.default_preconditioner, *of_lines):
        M, scaled = (preconditioner(tmg.ToeplitzOperator(s * c)) for s in (1.0, scale))
        x = np.random.default_rng(0).standard_normal(c.size)
        y = M @ x
        assert_allclose(scale * (scaled @ x), y, rtol=0, atol=1e-10 * abs(y).max())


@pytest.mark.parametrize("shape", [(1,), (1, 1)])
def test_deflation_of_one_unknown_leaves_nothing(shape):
    A = tmg.ToeplitzOperator(np.full(shape, 3.0))
    assert abs(tmg.fft_sd_preconditioner(A) @ np.ones(1)) <= 1e-15
    for m in (0, 2):
        with pytest.raises(ValueError, match=f"n_subdomains is {m}, but must (be|lie)"):
            tmg.fft_sd_preconditioner(A, n_subdomains=m)


@each
def test_refuse_what_is_no_toeplitz_operator(preconditioner):
    A = tmg.ToeplitzOperator(exponential(4))
    for wrong in (np.eye(4), A @ A @ A, A.toarray()):
        refuses(TypeError, "must be a ToeplitzOperator", preconditioner, wrong)


OF_HERMITIAN = preconditioners("fft jacobi default")
OF_ONE_COMPONENT = tmg.jacobi_preconditioner, tmg.multigrid
OF_SYMMETRIC = [*preconditioners("fft_rsm fft_sd cosine sine fsai"), tmg.multigrid]


def kinds(A):
    """A matrix, on the whole of its grid and on a mask; and twice, as coupled components."""
    yield A
    yield tmg.MaskedOperator(A, np.arange(A.shape[0]) != 1)
    yield tmg.CoupledOperator([[A, None], [None, A]])


@pytest.mark.parametrize("f", OF_SYMMETRIC + OF_HERMITIAN, ids=lambda f: f.__name__)
def test_what_is_not_symmetric_is_refused_with_advice(f):
    for c, r in (([4.0, 1.0, 0.5], [4.0, 2.0, 0.5]), ([4.0, 1j, 0.5], [4.0, 1j, 0.5])):
        rule = "(Hermitian|real)" if np.iscomplexobj(c) else "symmetric"
        for A in kinds(tmg.ToeplitzOperator(c, r)):
            if isinstance(A, tmg.CoupledOperator) and f in OF_ONE_COMPONENT:
                continue
            advice = rf"must be {rule}: use chan_preconditioner\(A\).* with gmres"
            refuses(ValueError, advice, f, A)


# τ is that of the symmetric part.
@pytest.mark.parametrize("f", [*OF_SYMMETRIC, tmg.tau_preconditioner], ids=lambda f: f.__name__)
def test_what_is_complex_is_refused_with_advice(f):
    for A in kinds(tmg.ToeplitzOperator([4.0, 1j, 0.5])):
        if isinstance(A, tmg.CoupledOperator) and f is tmg.multigrid:
            continue
        refuses(ValueError, r"but must be real: use chan_preconditioner\(A\)", f, A)


@pytest.mark.parametrize("dtype", [np.float64, np.complex128])
@pytest.mark.parametrize("f", [tmg.strang_preconditioner, tmg.chan_preconditioner])
def test_a_circulant_that_is_zero_on_an_interval_is_refused(f, dtype):
    """The circulant is that of ones, which has eigenvalues of zero next to each other."""
    c, r = np.ones((2, 9), dtype)
    if f is tmg.chan_preconditioner:  # The means, by 8/9 and 1/9, of two lags are one again.
        c[1], r[8] = 2.0, -7.0
    else:  # The outermost lags are not in the circulant.
        c[8] = 2.0
    with pytest.raises(np.linalg.LinAlgError, match=r"has the eigenvalue .* use gmres without M"):
        f(tmg.ToeplitzOperator(c, r))


@pytest.mark.parametrize("dtype", [np.float64, np.complex128])
@pytest.mark.parametrize(
    ("f", "below"), [(tmg.strang_preconditioner, -1.0), (tmg.chan_preconditioner, -64 / 63)]
)
@pytest.mark.parametrize("axes", [1, 2])
def test_one_eigenvalue_of_zero_is_no_obstacle(f, below, dtype, axes):
    """The matrix is triangular; its circulant has the first column (1, -1, 0, …)."""
    lags = np.zeros(127, dtype)
    lags[63:65] = 1.0, below
    if axes == 2:  # Along the second axis it is a multiple of the identity matrix.
        lags = np.multiply.outer(lags, [0.0, 0.0, 2.0, 0.0, 0.0])
    A = tmg.ToeplitzOperator.from_lags(lags)
    b = np.random.default_rng(0).standard_normal(A.shape[0])
    x, info = tmg.gmres(A, b, M=f(A), rtol=1e-10, maxiter=6)
    assert info == 0
    assert np.linalg.norm(b - A @ x) <= 1e-10 * np.linalg.norm(b)


@each
def test_one_product_costs_one_work_unit_or_half(preconditioner):
    A = tmg.ToeplitzOperator(contact(64))
    M = preconditioner(A)
    with tmg.count_products() as work:
        M @ np.ones(64)
    assert work.units(64) == (0.5 if preconditioner in HALF_A_UNIT else 1.0)


A_FEW = tmg.ToeplitzOperator(contact(8))
WRONG = [
    *((f, {"dtype": d}) for f in (*ALL[:2], *ALL[3:]) for d in ("x", 3.5, np.int64)),
    *((tmg.spectral_preconditioner, {"dtype": d}) for d in ("x", np.complex64)),
    *((tmg.fsai_preconditioner, {"dtype": d}) for d in ("x", np.float16)),
    *((tmg.default_preconditioner, {"dtype": d}) for d in ("x", np.int32)),
    *((tmg.default_preconditioner, {"solves": s}) for s in ("a", 1.5)),
    *((tmg.jacobi_preconditioner, {"omega": w}) for w in ("a", [1.0], 1j)),
    *((tmg.fft_rsm_preconditioner, {"gamma": g}) for g in ("a", [1.0], 1j)),
    *((tmg.fft_sd_preconditioner, {"n_subdomains": m}) for m in ("a", 1.5)),
    *((tmg.fsai_preconditioner, {"neighbours": k}) for k in ("a", 1.5)),
    *((tmg.multigrid, {"smoother": s}) for s in ("fft", 3)),
    *((tmg.multigrid, {"interpolation": t}) for t in ("linear", 3, None)),
    *((tmg.multigrid, {"coarsen": c}) for c in ("galerkin", 3)),
    *((tmg.multigrid, {k: "a"}) for k in ("pre", "post", "gamma", "coarsest")),
    (lambda A, weights: tmg.Interpolation(weights), {"weights": 1.0}),
    (lambda A, weights: tmg.Interpolation(weights), {"weights": "ab"}),
    (lambda A, coarser: tmg.Interpolation((1.0, 1.0), coarser), {"coarser": "linear"}),
]


@pytest.mark.parametrize(
    ("function", "argument"), WRONG, ids=lambda a: getattr(a, "__name__", str(a))
)
def test_an_argument_of_the_wrong_type_is_named(function, argument):
    (name,) = argument
    refuses(TypeError, rf"^{name} (is|are|has) .*, but must (be|map) ", function, A_FEW, **argument)


@pytest.mark.parametrize("name", NONSYMMETRIC)
def test_iterations_with_a_circulant_of_a_general_matrix_do_not_depend_on_its_size(name):
    """GMRES with T. Chan's circulant, to 1e-8."""
    counts = []
    for n in (2**10, 2**12, 2**14):
        A = tmg.ToeplitzOperator(*NONSYMMETRIC[name](n))
        b = np.random.default_rng(n).standard_normal(n)
        counts.append(count_iterations(tmg.gmres, A, b, M=tmg.chan_preconditioner(A)))
    assert counts[2] <= counts[0] + 1
    assert_within_budget("chan_preconditioner, general matrices", iterations=counts[2])
