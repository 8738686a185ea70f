"""A cycle corrects the coarse unknowns exactly, is positive definite, and does not depend on n.

The coarse matrices are R A P, for restriction and interpolation by their dense definitions.
"""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse.linalg import LinearOperator, aslinearoperator, cg

import toeplitz_mg as tmg
from comparisons.preconditioners.cycles import KERNELS
from comparisons.systems.masks import FRAGMENTED
from comparisons.systems.punch import influence
from comparisons.systems.symbols import column
from tests.budgets import assert_within_budget
from tests.cases import checkered, contact, exponential
from tests.systems import refuses
from toeplitz_mg.paper.problems import test1, test2, test3

TESTS = [test1, test2, test3]
SHAPES = [(2,), (3,), (8,), (31,), (1, 6), (6, 8), (5, 8), (7, 7), (2, 2, 4), (3, 2, 4)]
MOST_LEFTOVER = 16  # Unknowns up to which what no coarse element covers is corrected with these.

INTERPOLATIONS = [
    tmg.piecewise_constant,
    tmg.linear_interpolation,
    tmg.modulated_interpolation,
    tmg.Interpolation((0.1, 0.5, 0.7, 0.2)),
]


def has_area_weights(A, interpolation):
    """Whether copies go to an odd number of elements of several axes, so that areas weigh them."""
    H = tmg.galerkin(A, interpolation)
    is_odd = any(n % 2 and m < n for n, m in zip(A.grid_shape, H.grid_shape, strict=True))
    several = sum(n > 1 for n in A.grid_shape) > 1
    return is_odd and several and interpolation == tmg.piecewise_constant


def overlap(n, m):
    """The parts of n fine elements that lie in m coarse ones, all of which cover one length."""
    fine, coarse = np.arange(n)[:, None], np.arange(m) * n / m
    return np.maximum(np.minimum(fine + 1, coarse + n / m) - np.maximum(fine, coarse), 0.0)


def copies(n, m, weights):
    """The interpolation whose coarse elements begin 2 fine ones further on."""
    P = np.zeros((n, m))
    for i, weight in enumerate(weights):
        P[2 * np.arange(m) + i, np.arange(m)] = weight
    return P


def interpolation_by_definition(A, interpolation):
    """P on all elements, and s of Pᵀ = s R; axes with as many coarse elements are left alone."""
    H, P, s = tmg.galerkin(A, interpolation), np.eye(1), 1.0
    by_area = has_area_weights(A, interpolation)
    for n, m in zip(A.grid_shape, H.grid_shape, strict=True):
        is_odd, is_left = by_area and n % 2, m == n
        P = np.kron(P, overlap(n, m) if is_odd or is_left else copies(n, m, interpolation.weights))
        s *= 1.0 if is_left else n / m if is_odd else 2.0
    return P, s


def on_masks(P, A, H):
    """The part of a matrix that is of the unknowns of A and H."""
    rows, columns = (getattr(B, "mask", np.ones(B.grid_shape, bool)).ravel() for B in (A, H))
    return P[rows][:, columns]


def restriction_and_interpolation(A, interpolation):
    P, s = interpolation_by_definition(A, interpolation)
    P = on_masks(P, A, tmg.galerkin(A, interpolation))
    return P.T / s, P


def operators():
    for shape in SHAPES:
        A = tmg.ToeplitzOperator(contact(*shape) if len(shape) < 3 else exponential(*shape))
        mask = checkered(*shape)
        wide = np.arange(A.shape[0]).reshape(shape) % 7 > 0
        for B in (A, tmg.MaskedOperator(A, mask), tmg.MaskedOperator(A, wide | mask)):
            for interpolation in INTERPOLATIONS:
                try:
                    H = tmg.galerkin(B, interpolation)
                except ValueError:  # No coarse element is active.
                    continue
                if H.grid_shape != shape:
                    yield pytest.param(B, interpolation, id=f"{B} {interpolation.weights}")


OPERATORS = list(operators())
NESTED = [case for case in OPERATORS if not has_area_weights(*case.values)]
BY_AREA = [case for case in OPERATORS if has_area_weights(*case.values)]


def iterations(solve, A, M, b=None):
    """The iterations with M, for a right-hand side of ones if none is given."""
    b, iterates = np.ones(A.shape[0]) if b is None else b, []
    x, info = solve(A, b, M=M, rtol=1e-8, maxiter=100, callback=iterates.append)
    assert info == 0
    assert np.linalg.norm(b - A @ x) <= 1.1e-8 * np.linalg.norm(b)
    return len(iterates)


def cg_iterations(A, **options):
    return iterations(cg, A, tmg.multigrid(A, **options))


def spectrum(A, M):
    """The eigenvalues of M A, for a symmetric cycle M."""
    assert M.H is M
    dense = M @ np.eye(A.shape[0])
    assert_allclose(dense, dense.T, atol=1e-12 * abs(dense).max())
    half = np.linalg.cholesky(A.toarray())
    return np.linalg.eigvalsh(half.T @ (dense + dense.T) @ half / 2)


# Coarse matrices ----------------------------------------------------------------------------


@pytest.mark.parametrize(("A", "interpolation"), NESTED)
def test_galerkin_is_r_a_p(A, interpolation):
    H = tmg.galerkin(A, interpolation)
    R, P = restriction_and_interpolation(A, interpolation)
    assert type(H) is type(A)
    assert_allclose(H.toarray(), R @ A.toarray() @ P, atol=1e-13 * abs(A.toarray()).max())


@pytest.mark.parametrize(("A", "interpolation"), BY_AREA)
def test_by_area_the_coarse_matrix_is_positive_definite_and_hardly_below_r_a_p(A, interpolation):
    H = tmg.galerkin(A, interpolation).toarray()
    R, P = restriction_and_interpolation(A, interpolation)
    assert np.linalg.eigvalsh(H).min() > 0
    assert np.linalg.eigvals(np.linalg.solve(H, R @ A.toarray() @ P)).real.max() < 1.1


@pytest.mark.parametrize(("A", "interpolation"), OPERATORS)
def test_a_coarse_element_is_an_unknown_where_its_fine_ones_are(A, interpolation):
    """By area, where those are that lie in it by more than half."""
    H = tmg.galerkin(A, interpolation)
    P, _ = interpolation_by_definition(A, interpolation)
    needed = P > 0.5 + 1e-9 if has_area_weights(A, interpolation) else P != 0.0
    mask = getattr(A, "mask", np.ones(A.grid_shape, bool)).ravel()
    coarse = getattr(H, "mask", np.ones(H.grid_shape, bool)).ravel()
    assert np.array_equal(coarse, ~needed[~mask].any(axis=0))


@pytest.mark.parametrize("n", [3, 5, 9, 21])
def test_coarse_lags_by_area_are_those_of_the_mean_over_all_aggregations(n):
    """Each fine element goes to the coarse one in which its point at x is, for all x."""
    a = np.random.default_rng(n).standard_normal(n)
    m = (n + 1) // 2
    index = np.arange(n)
    A = a[abs(index[:, None] - index)]
    mean = np.zeros((m, m))
    for x in (np.arange(m) + 0.5) / m:  # Nothing changes in between.
        P = np.floor((index[:, None] + x) * m / n) == np.arange(m)
        mean += P.T @ A @ P / n  # Here s m = n.
    # On the other axis, where neighbours are coupled as much, two elements become one.
    b = np.array([1.0, abs(a[1] / a[0])])
    coarse = tmg.galerkin(tmg.ToeplitzOperator(np.outer(a, b))).c[:, 0] / b.sum()
    for k in range(m):
        assert_allclose(np.diag(mean, k), mean[0, k])  # It is a Toeplitz matrix.
        hat = 2 - 1 / n if k == 0 else 2 - 2 / n
        assert coarse[k] == pytest.approx(mean[0, k] * n / m / hat)


def test_galerkin_of_a_matrix_that_is_symmetric_only():
    rng = np.random.default_rng(0)
    lags = rng.standard_normal((7, 11))
    A = tmg.ToeplitzOperator.from_lags(lags + np.flip(lags))
    R, P = restriction_and_interpolation(A, tmg.piecewise_constant)
    assert_allclose(tmg.galerkin(A).toarray(), R @ A.toarray() @ P, atol=1e-13)
    lags = rng.standard_normal((9, 13))
    odd = tmg.galerkin(tmg.ToeplitzOperator.from_lags(lags + np.flip(lags)))
    assert odd.grid_shape == (3, 4)
    assert odd.is_hermitian


def test_an_axis_of_weak_coupling_is_not_coarsened():
    def shapes(element):
        x, y = tmg.halfspace.offsets((32, 32), element)
        A = tmg.ToeplitzOperator(tmg.halfspace.influence_zz(x, y, element, G=1.0, nu=0.28))
        M = tmg.multigrid(A, coarsest=16)
        cycles = iterations(tmg.cg, A, M)
        assert_within_budget("cycles on stretched elements, 32 x 32", iterations=cycles)
        return [level.A.grid_shape for level in M.levels]

    assert shapes((1.0, 1.0)) == [(32, 32), (16, 16), (8, 8), (4, 4)]
    # Until the elements are as wide as long, or nearly.
    assert shapes((1.0, 4.0)) == [(32, 32), (16, 32), (8, 16), (4, 8), (2, 4)]
    assert shapes((20.0, 1.0))[:4] == [(32, 32), (32, 16), (32, 8), (32, 4)]


def test_rediscretised_keeps_the_mask():
    problem = test3(64)
    H = tmg.rediscretised(problem.operator_of_grid_shape)(problem.A)
    assert_allclose(H.toarray(), test3(32).A.toarray(), rtol=1e-14)


# Cycle --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("A", "interpolation"), OPERATORS)
def test_two_grids_correct_the_coarse_and_the_leftover_unknowns_exactly(A, interpolation):
    """The error propagates by S^post (I - Q (QᵀAQ)⁻¹ QᵀA) S^pre, Q = [P, the border's vectors].

    By area the coarse matrix stands for PᵀAP.
    """
    n, H = A.shape[0], tmg.galerkin(A, interpolation)
    R, P = restriction_and_interpolation(A, interpolation)
    extra = np.eye(n)[:, ~P.any(axis=1)]
    if isinstance(A, tmg.ToeplitzOperator) and len(A.grid_shape) == 1 and extra.size:
        # At the end of the grid one vector: what there is room for of the next coarse element.
        beyond = np.zeros((n + 3, 1))
        beyond[2 * H.shape[0] :][: len(interpolation.weights), 0] = interpolation.weights
        extra = beyond[:n]
    Q = np.hstack([P, extra[:, : 0 if extra.shape[1] > MOST_LEFTOVER else None]])
    dense = A.toarray()
    galerkin = Q.T @ dense @ Q
    if has_area_weights(A, interpolation):
        s = P.max() / R.max()
        galerkin[: H.shape[0], : H.shape[0]] = s * H.toarray()
    coarse = np.eye(n) - Q @ np.linalg.solve(galerkin, Q.T @ dense)
    # Of a dense matrix nothing is asked: it may diverge, but its algebra matters.
    S = tmg.chan_preconditioner(A) @ np.eye(n)
    smooth = np.eye(n) - S @ dense
    grids = {"coarsest": H.shape[0], "interpolation": interpolation}
    for pre, post in ((1, 1), (0, 1), (1, 0)):
        M = tmg.multigrid(A, smoother=lambda _: S, pre=pre, post=post, **grids)
        assert len(M.levels) == 2 or n <= H.shape[0]
        before, after = (np.linalg.matrix_power(smooth, k) for k in (pre, post))
        error = np.eye(n) - M @ dense
        assert_allclose(error, after @ coarse @ before, atol=1e-10, err_msg=f"{pre}, {post}")


def by_jacobi(A, interpolation, coarsest=16):
    smoother = tmg.jacobi_preconditioner
    return tmg.multigrid(A, smoother=smoother, interpolation=interpolation, coarsest=coarsest)


ZEROS = {
    "2 - 2 cos θ": tmg.linear_interpolation,
    "θ²": tmg.linear_interpolation,
    "2 + 2 cos θ": tmg.modulated_interpolation,
    "|θ|": tmg.linear_interpolation,
    "|θ|^1.5": tmg.linear_interpolation,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ZEROS)
def test_symbols_with_a_zero_take_a_number_of_cycles_independent_of_n(name):
    counts = []
    for n in (300, 511, 512, 1009, 4096, 20000, 2**15 + 1, 2**17):
        A = tmg.ToeplitzOperator(column(name, n))
        M = by_jacobi(A, ZEROS[name])
        assert M.H is M
        b = np.random.default_rng(1).standard_normal(n)
        counts.append(iterations(tmg.richardson, A, M, b))
        assert_within_budget("CG, symbol with a zero", iterations=iterations(cg, A, M, b))
    assert_within_budget(f"cycles, symbol {name}", iterations=max(counts))
    assert max(counts) - min(counts) <= 2


def test_a_zero_on_two_axes():
    counts = []
    for shape in ((31, 31), (63, 127), (255, 255)):
        c = np.zeros(shape)
        c[0, 0], c[0, 1], c[1, 0] = 4.0, -1.0, -1.0
        A = tmg.ToeplitzOperator(c)
        M = by_jacobi(A, tmg.linear_interpolation, coarsest=9)
        b = np.random.default_rng(1).standard_normal(A.shape[0])
        counts.append(iterations(cg, A, M, b))
    assert_within_budget("CG, a zero on two axes", iterations=max(counts))
    assert max(counts) - min(counts) <= 1


def test_the_modulated_transfer_moves_the_zero_to_the_other_end():
    A = tmg.ToeplitzOperator(column("2 + 2 cos θ", 255))
    M = by_jacobi(A, tmg.modulated_interpolation)
    # It is proportional to 2 - 2 cos θ.
    assert_allclose(M.levels[1].A.c[:3], [0.5, -0.25, 0.0], atol=1e-15)
    for fine, coarse in zip(M.levels[1:], M.levels[2:], strict=False):
        assert_allclose(coarse.A.c, tmg.galerkin(fine.A, tmg.linear_interpolation).c)


def test_jacobi():
    A = tmg.ToeplitzOperator([4.0, -1.0, 0.5])
    assert_allclose(tmg.jacobi_preconditioner(A, omega=0.5) @ np.eye(3), 0.125 * np.eye(3))
    S = tmg.jacobi_preconditioner(A)
    assert 1.0 < np.linalg.eigvalsh(A.toarray()).max() * S.factor <= 4 / 3
    assert S.T is S
    assert S.H is S
    assert repr(S) == f"<ScaledIdentity 3, {S.factor:.3g}>"
    single = tmg.jacobi_preconditioner(A.astype(np.float32))
    assert (single @ np.ones(3, np.float32)).dtype == np.float32
    for omega in (0.0, -1.0, np.nan, np.inf):
        refuses(np.linalg.LinAlgError, "omega is", tmg.jacobi_preconditioner, A, omega=omega)
    with pytest.raises(np.linalg.LinAlgError, match="diagonal of A is -1"):
        tmg.jacobi_preconditioner(tmg.ToeplitzOperator([-1.0, 0.0]))


def test_interpolation_refuses_bad_weights():
    for weights in ((1.0,), (1.0, np.nan)):
        refuses(ValueError, "weights are", tmg.Interpolation, weights)
    refuses(TypeError, "must be called", tmg.rediscretised, 3)


@pytest.mark.parametrize("n", [37, 64, 101, 255, 256, 257])
@pytest.mark.parametrize("gamma", [1, 2])
@pytest.mark.parametrize("test", TESTS)
def test_equal_smoothing_is_symmetric_positive_definite(n, gamma, test):
    A = test(n).A
    M = tmg.multigrid(A, coarsest=8, gamma=gamma)
    assert len(M.levels) > 2
    eigenvalues = spectrum(A, M)
    assert eigenvalues[0] > 0
    assert eigenvalues[-1] < 1 + 1e-9  # Below A⁻¹ as well: the cycle never over-corrects.


@pytest.mark.parametrize(
    "shape", [(15, 15), (17, 33), (21, 9), (16, 25), (5, 61), (1, 60)], ids=str
)
def test_so_it_is_on_odd_grids_of_two_axes(shape):
    A = tmg.ToeplitzOperator(contact(*shape))
    disc = sum(((i + 0.5) / n - 0.5) ** 2 for i, n in zip(np.indices(shape), shape, strict=True))
    for B in (A, tmg.MaskedOperator(A, disc < 0.25)):
        M = tmg.multigrid(B, coarsest=4)
        assert len(M.levels) > 2
        eigenvalues = spectrum(B, M)
        assert eigenvalues[0] > 0.5
        assert eigenvalues[-1] < 1.001


@pytest.mark.parametrize("n", [64, 101])
@pytest.mark.parametrize("gamma", [1, 2])
@pytest.mark.parametrize("smoother", [tmg.fft_rsm_preconditioner, tmg.fft_sd_preconditioner])
def test_the_adjoint_smooths_on_the_other_side(n, gamma, smoother):
    A = test3(n).A
    arguments = {"coarsest": 8, "gamma": gamma, "smoother": smoother}
    before = tmg.multigrid(A, pre=1, post=0, **arguments)
    after = tmg.multigrid(A, pre=0, post=1, **arguments)
    eye = np.eye(A.shape[0])
    scale = abs(before @ eye).max()
    assert_allclose((before.H @ eye) / scale, (before @ eye).T / scale, atol=1e-10)
    if smoother is tmg.fft_rsm_preconditioner:
        assert_allclose((before.H @ eye) / scale, (after @ eye) / scale, atol=1e-10)


@pytest.mark.parametrize("test", TESTS)
def test_cg_takes_few_iterations_on_every_grid(test):
    sizes = [*range(2**8, 2**8 + 24), 509, 512, 997, 1000, 1024, 4093, 4096, 10007, 2**14, 2**16]
    problems = {n: test(n) for n in sizes}
    counts = {n: iterations(cg, p.A, tmg.multigrid(p.A), p.b) for n, p in problems.items()}
    assert_within_budget("CG with V(1,1), tests 1 to 3", iterations=max(counts.values()))
    # Odd and prime n: at most one more than at the power of two beside.
    for n, near in ((509, 512), (997, 1024), (4093, 4096), (10007, 2**14)):
        assert counts[n] <= counts[near] + 1


@pytest.mark.parametrize("test", TESTS)
@pytest.mark.parametrize(
    "cycle",
    [{"pre": 0}, *(pytest.param(x, marks=pytest.mark.slow) for x in ({"post": 0}, {}))],
    ids=str,
)
def test_the_stationary_cycle_does_not_depend_on_n(test, cycle):
    def count(n):
        problem = test(n)
        return iterations(tmg.richardson, problem.A, tmg.multigrid(problem.A, **cycle), problem.b)

    powers = [count(2**k) for k in range(10, 18, 2)]
    odd = [count(n) for n in (1023, 4093, 5003, 65537)]
    assert max(powers) - min(powers) <= 2
    assert max(odd) <= max(powers) + 1


@pytest.mark.parametrize("n", range(1, 18))
@pytest.mark.parametrize("coarsest", [1, 2, 256])
def test_every_small_n(n, coarsest):
    for test in TESTS:
        if n == 1 and test is test3:
            continue
        problem = test(n)
        M = tmg.multigrid(problem.A, coarsest=coarsest)
        count = iterations(tmg.richardson, problem.A, M, problem.b)
        assert_within_budget("cycles, n = 1 to 17", iterations=count)


def half_space(kind, shape, element=None):
    return influence(kind, np.ones(shape, bool), element or tuple(2.0 / n for n in shape))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["normal", "tangential"])
@pytest.mark.parametrize("area", ["full", "circle"])
def test_cg_takes_as_many_iterations_on_even_and_odd_squares(kind, area):
    sizes = (64, 65, 85, 100, 101, 127, 128, 129, 200, 255, 256)
    counts = [cg_iterations(influence(kind, FRAGMENTED[area](n), (2 / n, 2 / n))) for n in sizes]
    assert_within_budget("CG with V(1,1), punch of 64 to 256 squared", iterations=max(counts))
    assert max(counts) - min(counts) <= 1


@pytest.mark.parametrize(
    ("even", "odd", "element"),
    [
        ((128, 64), (127, 65), (1.0, 1.0)),
        ((32, 500), (31, 501), (1.0, 1.0)),
        ((4, 300), (3, 301), (1.0, 1.0)),
        ((64, 64), (63, 65), (1.0, 4.0)),
        ((64, 64), (65, 63), (1.0, 1.6)),
        ((64, 64), (63, 63), (20.0, 1.0)),
    ],
)
def test_odd_grids_take_no_more_iterations_than_even_ones(even, odd, element):
    for kind in ("normal", "tangential"):
        beside = cg_iterations(half_space(kind, even, element))
        count = cg_iterations(half_space(kind, odd, element))
        assert count <= beside + 1
        assert_within_budget("CG with V(1,1), odd grids", iterations=count)


def test_odd_grids_of_three_axes():
    counts = []
    for n in (15, 16, 17, 31, 32):
        A = tmg.ToeplitzOperator(np.exp(-1.5 * np.linalg.norm(np.indices((n, n, n)), axis=0)))
        counts.append(cg_iterations(A))
    assert_within_budget("CG with V(1,1), three axes", iterations=max(counts))
    assert max(counts) - min(counts) <= 1


def test_odd_grids_of_coupled_components():
    for n in (64, 65, 100, 101):
        A = half_space("coupled", (n, n))
        count = iterations(tmg.cg, A, tmg.componentwise(tmg.multigrid)(A))
        assert_within_budget("CG with V(1,1) of coupled components", iterations=count)


def test_float32_cycle():
    problem = test1(4096)
    A = tmg.ToeplitzOperator(problem.A.c.astype(np.float32))
    M = tmg.multigrid(A, pre=0)
    b = problem.b.astype(np.float32)
    x, info = tmg.richardson(A, b, M=M, rtol=1e-5)
    assert info == 0
    assert x.dtype == np.float32
    M = tmg.multigrid(half_space("normal", (33, 35)).astype(np.float32))
    assert {level.A.dtype for level in M.levels} == {np.dtype(np.float32)}
    assert (M @ np.ones(33 * 35, np.float32)).dtype == np.float32


def test_a_smoother_of_ones_own():
    A = test1(300).A

    def damped_jacobi(A):
        n = A.shape[0]
        d = 0.05 / A.block(np.array([0]))[0, 0]
        return LinearOperator(
            (n, n), matvec=lambda r: d * r, rmatvec=lambda r: d * r, dtype=A.dtype
        )

    M = tmg.multigrid(A, smoother=damped_jacobi, coarsest=16)
    dense = M @ np.eye(300)
    columns = np.stack([M @ e for e in np.eye(300)], axis=1)
    assert_allclose(dense, columns, rtol=1e-10, atol=1e-10 * abs(columns).max())
    assert abs(np.linalg.eigvals(np.eye(300) - dense @ A.toarray())).max() < 1
    assert_allclose(M.H @ np.eye(300), dense.T, atol=1e-10 * abs(dense).max())
    # A dense matrix will do as well.
    for wrap in (aslinearoperator, np.asarray):
        inverse = tmg.multigrid(A, smoother=lambda A, wrap=wrap: wrap(np.linalg.inv(A.toarray())))
        assert_allclose(inverse @ (A @ np.ones(300)), 1.0, rtol=1e-7)
    assert (inverse @ np.zeros((300, 0))).shape == (300, 0)


def test_repr_is_a_diagnosis():
    M = tmg.multigrid(test1(4096).A, pre=0)
    assert repr(M) == (
        "<Multigrid V(0,1) RowSumModified  4096 > 2048 > 1024 > ... > 256 (dense)  3.8 work units>"
    )
    assert "W(1,1)" in repr(tmg.multigrid(test1(600).A, gamma=2))


def test_a_cycle_may_be_made_of_the_levels_of_another():
    A = test1(601).A
    given = tmg.multigrid(A, coarsest=80)
    x = np.random.default_rng(0).standard_normal(601)
    before = given @ x
    for pre, post in ((1, 1), (0, 2)):
        M = tmg.Multigrid(given.levels, pre, post, 1)
        assert np.array_equal(M @ x, tmg.multigrid(A, coarsest=80, pre=pre, post=post) @ x)
    assert np.array_equal(given @ x, before)


def test_pickles_with_borders():
    A = test3(1001).A
    M = tmg.multigrid(A)
    x = np.random.default_rng(0).standard_normal(A.shape[0])
    assert np.array_equal(pickle.loads(pickle.dumps(M)) @ x, M @ x)


# What is refused ----------------------------------------------------------------------------


LINE = tmg.ToeplitzOperator(contact(600))
PART = tmg.MaskedOperator(LINE, np.arange(600) < 500)


@pytest.mark.parametrize(
    ("A", "arguments", "error", "match"),
    [
        (LINE, {"pre": 0, "post": 0}, ValueError, "must smooth at least once"),
        (LINE, {"pre": -1}, ValueError, "pre is -1, but must be at least 0"),
        (LINE, {"post": 0.5}, TypeError, "is 0.5, but must be an integer"),
        (LINE, {"gamma": 0}, ValueError, "gamma is 0, but must be at least 1"),
        (LINE, {"coarsest": 0}, ValueError, "coarsest is 0, but must be at least 1"),
        (np.eye(300), {}, TypeError, "must be a ToeplitzOperator"),
        (tmg.ToeplitzOperator([4.0, 1.0], [4.0, 2.0]), {}, ValueError, "must be symmetric"),
        (LINE, {"coarsen": lambda A: A}, ValueError, r"the grid \(600,\), but it must be \(300,\)"),
        (LINE, {"coarsen": 3}, TypeError, "coarsen is 3, but must map a matrix to the next"),
        (PART, {"coarsen": lambda A: tmg.galerkin(A.full)}, ValueError, "its mask must be that"),
        (LINE, {"coarsen": lambda A: np.eye(300)}, TypeError, "must be a ToeplitzOperator"),
        (LINE, {"smoother": lambda A: np.eye(2)}, ValueError, r"smoother has shape \(2, 2\)"),
        (LINE, {"smoother": lambda A: None}, TypeError, "type not understood"),
        (LINE, {"smoother": LINE}, TypeError, "must be a function of the matrix of a level"),
        (tmg.ToeplitzOperator([1.0, 2.0]), {}, np.linalg.LinAlgError, "coarsest grid, .*not pos"),
        # It would make a cycle for a real matrix complex.
        (LINE, {"smoother": lambda A: 1j * np.eye(600)}, TypeError, "complex128, but its"),
    ],
)
def test_refuses_what_does_not_fit(A, arguments, error, match):
    refuses(error, match, tmg.multigrid, A, **arguments)


def test_says_on_which_level_the_smoother_refused():
    A = tmg.ToeplitzOperator(np.exp(-np.arange(3000) / 1000))
    with pytest.raises(np.linalg.LinAlgError, match="gamma") as caught:
        tmg.multigrid(A, smoother=tmg.fft_rsm_preconditioner)
    assert any("level 0" in note for note in caught.value.__notes__)


# What is definite, and what is built as it is told ------------------------------------------


def test_a_cycle_whose_smoother_diverges_is_built_as_it_is_told():
    A = test1(128).A
    with pytest.warns(UserWarning, match="diverges on level 0 of multigrid"):
        M = tmg.multigrid(A, smoother=tmg.fft_preconditioner, coarsest=2)
    assert M.levels[-1].A.shape == (2, 2)
    assert spectrum(A, M)[0] < -1e3


def test_a_coarse_grid_that_a_smoother_refuses_is_solved_directly_with_a_warning():
    def refuse_small(A):
        if A.shape[0] < 100:
            raise np.linalg.LinAlgError("too small")
        return tmg.fft_rsm_preconditioner(A)

    with pytest.warns(UserWarning, match="refuses level 2 of multigrid, .* of 2 unknowns: too sma"):
        M = tmg.multigrid(test1(300).A, smoother=refuse_small, coarsest=2)
    assert [level.A.shape[0] for level in M.levels] == [300, 150, 75]


@pytest.mark.parametrize("options", [{}, {"pre": 0}, {"post": 0}, {"gamma": 2}], ids=str)
def test_a_cycle_says_whether_it_is_symmetric_and_definite(options):
    """By construction: a smoother that diverges leaves it open."""
    A = test1(101).A
    equal = options.get("pre", 1) == options.get("post", 1)
    M = tmg.multigrid(A, coarsest=4, **options)
    assert M.is_hermitian == M.is_definite == (M.H is M) == equal
    deflated = tmg.multigrid(A, smoother=tmg.fft_sd_preconditioner, coarsest=4, **options)
    assert not deflated.is_hermitian
    assert not deflated.is_definite
    with pytest.warns(UserWarning, match="diverges"):
        M = tmg.multigrid(A, smoother=tmg.fft_preconditioner, coarsest=4, **options)
    assert M.is_hermitian == equal
    assert not M.is_definite


def assert_few_iterations_and_a_cheap_set_up(A, case):
    with tmg.count_products() as work:
        M = tmg.multigrid(A)
    assert M.is_definite
    unit, b = np.prod(A.grid_shape), np.random.default_rng(1).standard_normal(A.shape[0])
    in_cycles = work.units(unit) / M.work if M.work else 0.0
    assert_within_budget(case, iterations=iterations(cg, A, M, b), cycles_of_set_up=in_cycles)


@pytest.mark.parametrize("name", KERNELS)
@pytest.mark.parametrize("n", [4096, pytest.param(2**16, marks=pytest.mark.slow)])
def test_any_kernel_of_a_line_takes_few_iterations(name, n):
    """Whether M̄ converges for it, or is not even positive definite."""
    A = tmg.ToeplitzOperator(KERNELS[name](n))
    assert_few_iterations_and_a_cheap_set_up(A, "CG with V(1,1), any kernel of a line")


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("shape", [(10_000,), (100, 100)], ids=str)
def test_any_mask_takes_few_iterations(shape, share):
    mask = np.random.default_rng(0).random(shape) < share
    A = tmg.MaskedOperator(tmg.ToeplitzOperator(contact(*shape)), mask)
    assert_few_iterations_and_a_cheap_set_up(A, "CG with V(1,1), any mask")


@pytest.mark.parametrize(
    "A",
    [
        tmg.ToeplitzOperator(np.where(np.arange(4096) == 7, -1.0, 3.0 * np.eye(1, 4096)[0])),
        tmg.MaskedOperator(tmg.ToeplitzOperator(contact(8192)), np.arange(8192) % 2 == 0),
        tmg.MaskedOperator(
            tmg.ToeplitzOperator(contact(80, 80)), np.indices((80, 80)).sum(0) % 2 == 0
        ),
    ],
    ids=["not coupled", "every other", "checkered"],
)
def test_without_a_coarse_grid_the_smoother_takes_all_steps(A):
    M = tmg.multigrid(A)
    assert M.levels[-1].A is A
    assert_few_iterations_and_a_cheap_set_up(A, "CG with V(1,1), no coarse grid")
    b = np.ones(A.shape[0])
    with tmg.count_products() as work:
        M @ b
    assert work.units(np.prod(A.grid_shape)) == pytest.approx(M.work)
    few = tmg.MaskedOperator(tmg.ToeplitzOperator(contact(64)), np.arange(64) % 2 == 0)
    assert_allclose(tmg.multigrid(few, coarsest=2) @ few.toarray(), np.eye(32), atol=1e-12)


@pytest.mark.parametrize("shift", [1e-6, 1e-5])
def test_a_certified_smoother_may_diverge(shift):
    """Positive definite is not convergent: the cycle had eigenvalues down to -3e22."""
    c = np.zeros(479)
    c[:2] = 2.0 + shift, -1.0
    A = tmg.MaskedOperator(tmg.ToeplitzOperator(c), np.random.default_rng(0).random(479) < 0.6)
    S = tmg.fft_rsm_preconditioner(A)
    assert S.certified
    half = np.linalg.cholesky(A.toarray())
    assert np.linalg.eigvalsh(half.T @ S.toarray() @ half)[-1] > 2.0
    with pytest.warns(UserWarning, match="diverges"):
        tmg.multigrid(A, smoother=tmg.fft_rsm_preconditioner, coarsest=16)
    assert spectrum(A, tmg.multigrid(A, coarsest=16))[0] > 0.0


def ragged(seed):
    """Kernels of several kinds, on grids of two axes and masks with a few leftover unknowns."""
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(3, 22, 2))
    i, j = np.indices(shape)
    r = np.hypot(i, j)
    c = [
        np.exp(-((r / 10 ** rng.uniform(-0.7, 1.0)) ** rng.uniform(0.3, 1.5))),
        (1.0 + r) ** -rng.uniform(0.3, 2.0),
        4.1 * (r == 0.0) - (r == 1.0),
    ][seed % 3]
    A = tmg.ToeplitzOperator(c)
    if seed % 2:
        mask = rng.random(shape) < rng.uniform(0.5, 0.98)
        mask.flat[:10] = True
        return tmg.MaskedOperator(A, mask)
    return A


@pytest.mark.parametrize("smoother", [None, tmg.jacobi_preconditioner, tmg.fft_rsm_preconditioner])
@pytest.mark.parametrize("gamma", [1, 2])
@pytest.mark.filterwarnings("ignore:the smoother:UserWarning")
def test_a_cycle_that_says_so_is_positive_definite(smoother, gamma):
    """The default smoother is never refused, and its cycles always are."""
    built = 0
    for seed in range(60):
        A = ragged(seed)
        try:
            M = tmg.multigrid(A, smoother=smoother, gamma=gamma, coarsest=4 + seed % 9)
        except np.linalg.LinAlgError:
            assert smoother is tmg.fft_rsm_preconditioner
            continue
        if M.is_definite:
            built += 1
            half = np.linalg.cholesky(A.toarray())
            dense = M @ np.eye(A.shape[0])
            assert np.linalg.eigvalsh(half.T @ (dense + dense.T) @ half)[0] > 0.0
    assert built >= (60 if smoother is None else 10)


def test_where_m_bar_says_that_it_converges_it_does():
    """The largest eigenvalue of M̄ A is 1, or near γ times the row sums of A."""
    told = 0
    for seed in range(120):
        A = ragged(seed)
        try:
            S = tmg.fft_rsm_preconditioner(A)
        except np.linalg.LinAlgError:
            continue
        if S.converges(A):
            told += 1
            half = np.linalg.cholesky(A.toarray())
            assert np.linalg.eigvalsh(half.T @ S.toarray() @ half)[-1] < 1.9
    assert told >= 20


@pytest.mark.parametrize("factor", [0.1, 0.02])
def test_a_border_that_would_make_the_correction_indefinite_is_left_to_the_smoother(factor):
    """The coarse matrix by area may be below R A P: these are much further below."""
    full = tmg.ToeplitzOperator(contact(9, 9))
    mask = np.ones((9, 9), dtype=bool)
    mask[1, 0] = False
    A = tmg.MaskedOperator(full, mask)

    def too_small(A):
        H = tmg.galerkin(A)
        return tmg.MaskedOperator(tmg.ToeplitzOperator(factor * H.full.c), H.mask)

    M = tmg.multigrid(A, coarsen=too_small, coarsest=30, smoother=tmg.jacobi_preconditioner)
    assert spectrum(A, M)[0] > 0.0
    with pytest.warns(UserWarning, match="gamma = 2 and coarse matrices other than .* gamma=1"):
        M = tmg.multigrid(A, coarsen=too_small, coarsest=8, gamma=2)
    assert not M.is_definite
