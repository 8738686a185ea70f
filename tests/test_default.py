"""default_preconditioner makes CG take few iterations, of whatever matrix, at a set-up that pays.

What it takes is positive definite, and not worse than none; few unknowns are solved for directly;
select_preconditioner names it, and builds nothing.
"""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import toeplitz_mg as tmg
from comparisons.systems import masks
from comparisons.systems.random_matrices import random_matrix
from comparisons.systems.symbols import column
from tests.budgets import assert_within_budget
from tests.cases import contact, exponential
from tests.systems import count_iterations, refuses
from tests.test_fsai import tangential
from toeplitz_mg.paper import problems


def iterations(A, M, most=40, seed=0):
    """Iterations of CG to 1e-8 for a random right-hand side; it must converge in so many."""
    rng = np.random.default_rng(seed)
    b = rng.standard_normal(A.shape[0])
    if A.dtype.kind == "c":
        b = b + 1j * rng.standard_normal(A.shape[0])
    return count_iterations(tmg.cg, A, b, M=M, maxiter=most)


def check(case, A, **options):
    """Check the iterations, and the work of the set-up and of them."""
    with tmg.count_products() as work:
        count = iterations(A, tmg.default_preconditioner(A, **options))
    units = work.units(getattr(A, "full", A).shape[0])
    assert_within_budget(f"default, {case}", work_units=units)
    return count


def half_space(influence, shape, *element, nu=0.28):
    x, y = tmg.halfspace.offsets(shape, element)
    return tmg.ToeplitzOperator(influence(x, y, element, G=1.0, nu=nu))


def gaussian(shape, length, nugget):
    c = np.exp(-((np.hypot(*np.indices(shape)) / length) ** 2))
    c[0, 0] += nugget
    return tmg.ToeplitzOperator(c)


def of_symbol(name, n):
    return tmg.ToeplitzOperator(column(name, n))


K = np.indices((79, 79)) - 39
MATRICES = {
    "slow decay, n = 900": of_symbol("contact", 900),
    "slow decay, n = 2^14": of_symbol("contact", 2**14),
    "0.9^k, n = 2^14": of_symbol("0.9^k", 2**14),
    "zero at an end, n = 900": of_symbol("2 - 2 cos θ", 900),
    "zero at π, n = 900": of_symbol("2 + 2 cos θ", 900),
    "θ², n = 900": of_symbol("θ²", 900),
    "test 3": problems.test3(2048).A,
    "131 x 131": tmg.ToeplitzOperator(contact(131, 131)),
    "132 x 132": tmg.ToeplitzOperator(contact(132, 132)),
    "exponential, 131 x 131": tmg.ToeplitzOperator(exponential(131, 131)),
    "three axes": tmg.ToeplitzOperator(exponential(12, 9, 10)),
    "a mask in three axes": tmg.MaskedOperator(
        tmg.ToeplitzOperator(exponential(12, 9, 10) ** 2),
        np.indices((12, 9, 10)).sum(axis=0) % 3 > 0,
    ),
    "a large circle": tmg.MaskedOperator(
        half_space(tmg.halfspace.influence_zz, (256, 256), 1.0, 1.0), masks.circle(256)
    ),
    "stretched elements": tmg.MaskedOperator(
        half_space(tmg.halfspace.influence_zz, (64, 64), 1.0, 20.0), masks.circle(64)
    ),
    "not even, on a mask": tmg.MaskedOperator(
        tmg.ToeplitzOperator.from_lags(np.exp(-(K[0] ** 2 + K[0] * K[1] + K[1] ** 2) / 1.5)),
        masks.circle(40),
    ),
    "wide exponential": tmg.ToeplitzOperator(np.exp(-np.hypot(*np.indices((64, 64))) / 10.0)),
    "coupled": tangential((40, 40), 0.28),
    "coupled, on a mask": tmg.MaskedOperator(
        tangential((64, 64), 0.28), [masks.rough(0.3, 64)] * 2
    ),
    "strongly coupled, on a mask": tmg.MaskedOperator(
        tangential((64, 64), 0.5), [masks.rough(0.3, 64)] * 2
    ),
}


@pytest.mark.parametrize("case", MATRICES)
def test_few_iterations_and_a_set_up_that_pays(case):
    check(case, MATRICES[case])


@pytest.mark.parametrize("area", masks.FRAGMENTED)
def test_areas_of_a_half_space(area):
    A = tmg.MaskedOperator(tmg.ToeplitzOperator(contact(96, 96)), masks.FRAGMENTED[area](96))
    for options in ({}, {"dtype": np.float32}, {"solves": 10}):
        count = iterations(A, tmg.default_preconditioner(A, **options))
        assert_within_budget("default, areas of 96 x 96", iterations=count)


def test_what_is_refused_is_followed_by_the_next(caplog):
    A = tmg.MaskedOperator(
        gaussian((48, 48), 50.0**0.5, 1e-3), masks.FRAGMENTED["checkerboard"](48)
    )
    with pytest.raises(np.linalg.LinAlgError):
        tmg.fsai_preconditioner(A)
    caplog.set_level("INFO")
    tmg.default_preconditioner(A)
    assert "fsai_preconditioner is refused" in caplog.text


def test_a_covariance_that_is_too_smooth_for_few_neighbours():
    full = MATRICES["wide exponential"]
    A = tmg.MaskedOperator(full, masks.rough(0.3, 64))
    refuses(np.linalg.LinAlgError, "on a mask sine_preconditioner", tmg.fsai_preconditioner, A)
    once = check("wide exponential, on a mask", A)
    assert iterations(A, tmg.default_preconditioner(A, solves=10)) < once
    b = np.random.default_rng(0).standard_normal(A.shape[0])
    _, info = tmg.cg(A, b, M=tmg.sine_preconditioner(A), rtol=1e-8, maxiter=60)
    assert info > 0


def small(shape):
    A = tmg.ToeplitzOperator(exponential(*shape))
    return A, tmg.MaskedOperator(A, np.indices(shape).sum(axis=0) % 3 > 0)


FEW = [
    *small((600,)),
    *small((20, 30)),
    *small((8, 7, 9)),
    tangential((17, 17), 0.28),
    tmg.MaskedOperator(tangential((30, 30), 0.28), [masks.rough(0.3, 30)] * 2),
]


@pytest.mark.parametrize("A", FEW, ids=repr)
def test_few_unknowns_are_solved_for_directly(A):
    x = np.random.default_rng(0).standard_normal(A.shape[0])
    for dtype, error in ((np.float64, 1e-10), (np.float32, 1e-3)):
        M = tmg.default_preconditioner(A, dtype=dtype)
        assert M.dtype == dtype
        assert np.linalg.norm(M @ (A @ x) - x) <= error * np.linalg.norm(x)


def test_few_unknowns_and_less_precision_than_the_condition_needs():
    """A factor in float32 of a matrix with the condition 1e9 would be no inverse at all."""
    c = np.exp(-((np.arange(300) / 20.0) ** 2))
    c[0] += 1e-8
    A = tmg.ToeplitzOperator(c)
    x = np.random.default_rng(0).standard_normal(300)
    assert np.linalg.norm(tmg.default_preconditioner(A) @ (A @ x) - x) <= 1e-4 * np.linalg.norm(x)
    M = tmg.default_preconditioner(A, dtype=np.float32) @ np.eye(300, dtype=np.float32)
    assert np.linalg.eigvalsh((M + M.T).astype(np.float64)).min() > 0.0
    singular = tmg.ToeplitzOperator(np.ones(300))
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite, or nearly singular"):
        tmg.default_preconditioner(singular)


def spike(shape, *lags):
    """Coefficients at isolated lags, with a diagonal that dominates."""
    c = np.zeros(shape)
    for lag in lags:
        c[lag] = -1.0
    c.flat[0] = 1.1 * 2 ** len(shape) * len(lags)
    return tmg.ToeplitzOperator(c)


@pytest.mark.parametrize(
    "full",
    [
        gaussian((40, 40), 1800.0**0.5, 1e-2),  # Nearly as wide as its grid:
        gaussian((40, 40), 1800.0**0.5, 1e-4),  # of few large eigenvalues.
        spike((1000,), 900),
        spike((1300,), 51, 999),
        spike((30, 40), (29, 39)),
        spike((30, 40), (29, 39), (17, 0)),
        spike((10, 12, 9), (9, 0, 0), (0, 5, 8)),
    ],
    ids=["smooth, 1e-2", "smooth, 1e-4", "a lag", "lags", "of two axes", "lags of two", "of three"],
)
@pytest.mark.parametrize("share", [1.0, 0.8])
def test_it_is_not_worse_than_none(full, share):
    mask = np.random.default_rng(2).random(full.grid_shape) <= share
    A = full if mask.all() else tmg.MaskedOperator(full, mask)
    M = tmg.default_preconditioner(A)
    for b in (np.ones(A.shape[0]), np.random.default_rng(1).standard_normal(A.shape[0])):
        none, ours = [], []
        for matrix, residuals in ((None, none), (M, ours)):
            tmg.cg(A, b, M=matrix, rtol=1e-8, maxiter=300, residuals=residuals)
        assert len(ours) <= max(1.1 * len(none), len(none) + 2)


@pytest.mark.parametrize("ratio", [0.01, 0.25, 1.0, 4.0, 100.0])
@pytest.mark.parametrize("nu", [0.0, 0.5])
def test_the_set_up_of_half_space_kernels_has_no_products(ratio, nu):
    """What they take follows from their coefficients."""
    for influence in (tmg.halfspace.influence_zz, tmg.halfspace.influence_xx):
        full = half_space(influence, (32, 40), 1.0, ratio, nu=nu)
        for mask in (masks.rough(0.6, 40)[:32], np.ones((32, 40), dtype=bool)):
            with tmg.count_products() as work:
                tmg.default_preconditioner(tmg.MaskedOperator(full, mask))
            units = work.units(full.shape[0])
            assert_within_budget("set-up of default, half-space", work_units=units)


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 40), st.integers(1, 40), st.floats(0.0, 1.0), st.integers(0, 99))
@example(21, 29, 1.0, 0)
@example(34, 37, 0.9929702808991003, 90)
def test_any_mask(n1, n2, density, seed):
    rng = np.random.default_rng(seed)
    mask = rng.random((n1, n2)) < density
    mask.flat[rng.integers(mask.size)] = True
    A = tmg.MaskedOperator(tmg.ToeplitzOperator(contact(n1, n2)), mask)
    M = tmg.default_preconditioner(A)
    assert_within_budget("default, any mask", iterations=iterations(A, M))
    if A.shape[0] <= 200:
        dense = M @ np.eye(A.shape[0])
        assert np.linalg.eigvalsh((dense + dense.T) / 2).min() > 0.0


def test_what_it_refuses():
    A = tmg.ToeplitzOperator([2.0, 1.0])
    for function in (tmg.default_preconditioner, tmg.select_preconditioner):
        refuses(ValueError, "solves is 0, but must be at least 1", function, A, solves=0)
        refuses(TypeError, "must be a ToeplitzOperator", function, tmg.cosine_preconditioner(A))
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        tmg.default_preconditioner(tmg.ToeplitzOperator([[1.0, 2.0], [2.0, 3.0]]))
    c = np.zeros((30, 40))
    c[0, 0], c[29, 39] = 1.0, -1.5
    with pytest.raises(np.linalg.LinAlgError, match="A is not positive definite: for some vector"):
        tmg.default_preconditioner(tmg.ToeplitzOperator(c))
    with pytest.raises(np.linalg.LinAlgError, match="or gmres, which takes any matrix, or cg"):
        tmg.default_preconditioner(tmg.ToeplitzOperator(np.eye(1, 900).reshape(30, 30) - 2.0))
    for n in (10, 1000):
        A = tmg.ToeplitzOperator(np.r_[1.0, 0.9j, np.full(n - 2, 0.01j)])
        refuses(np.linalg.LinAlgError, "not positive definite", tmg.default_preconditioner, A)


# Complex matrices -----------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1000, 4096])
def test_of_a_complex_line_it_is_the_inverse_whatever_the_symbol(n):
    k = np.arange(n)
    waves = 10.0 * np.exp(0.3j * k) + 5.0 * np.exp(1.1j * k) + np.exp(-2j * k) + (k == 0)
    for c in (waves, 0.99**k * np.exp(0.7j * k) + 0.01 * (k == 0)):
        A = tmg.ToeplitzOperator(c)
        M = tmg.default_preconditioner(A)
        assert M.dtype == np.complex128
        assert_within_budget("default, complex lines", iterations=iterations(A, M))


@pytest.mark.parametrize("masked", [False, True])
def test_of_a_complex_grid_it_is_better_than_none(masked):
    """Two damped plane waves on a grid: neither is even."""
    k1, k2 = np.meshgrid(np.arange(-59, 60), np.arange(-39, 40), indexing="ij")
    size = np.exp(-np.hypot(k1, k2) / 3.0)
    lags = size * (np.exp(1j * (0.3 * k1 + 0.1 * k2)) + 0.5 * np.exp(1j * (0.8 * k2 - k1)))
    A = tmg.ToeplitzOperator.from_lags((lags + np.flip(lags).conj()) / 2)
    if masked:
        A = tmg.MaskedOperator(A, np.random.default_rng(1).random(A.grid_shape) < 0.9)
    M = tmg.default_preconditioner(A)
    assert iterations(A, M, 400) <= 0.7 * iterations(A, None, 400)


# What select_preconditioner says ---------------------------------------------------------------


def products(candidates, A, x):
    """Yield the candidates that are not refused, with their products."""
    for candidate in candidates:
        with suppress(np.linalg.LinAlgError):
            yield candidate, candidate.make(A) @ x


@pytest.mark.parametrize("seed", range(30))
@pytest.mark.parametrize("solves", [1, 5])
def test_it_names_what_is_taken_of_matrices_of_every_kind(seed, solves):
    A = random_matrix(seed)
    try:
        M = tmg.default_preconditioner(A, solves=solves)
    except np.linalg.LinAlgError:
        return  # It is not positive definite, in float64.
    selection = tmg.select_preconditioner(A, solves=solves)
    x = np.random.default_rng(3).standard_normal(A.shape[0])
    accepted, others = ([*products(c, A, x)] for c in (selection.candidates, selection.others))
    if accepted and (accepted[0][0].is_exact or not selection.needs_trial):
        assert np.array_equal(M @ x, accepted[0][1])
    elif others:  # The best in a trial, or none.
        is_taken = [np.array_equal(M @ x, y) for _, y in accepted + others]
        assert any(is_taken) or np.ptp((M @ x) / x) == 0.0


def test_it_builds_nothing():
    """It makes no product on a grid, nor a transform; on a line that of the symbol."""
    grid = tmg.ToeplitzOperator(contact(256, 256))
    for A in (grid, tmg.MaskedOperator(grid, masks.rough(0.3, 256))):
        with tmg.count_products() as work:
            tmg.select_preconditioner(A)
        assert work.products == 0
    with tmg.count_products() as work:
        tmg.select_preconditioner(tmg.ToeplitzOperator(exponential(2**16)))
    assert_within_budget("select, a line", work_units=work.units(2**16))


def test_it_prints_what_is_taken_first_and_what_follows_a_refusal():
    two = tmg.MaskedOperator(tangential((40, 40), 0.3), [masks.rough(0.9, 40)] * 2)
    isolated = tmg.ToeplitzOperator(np.where(np.arange(900) % 400, 0.0, 1.0).reshape(30, 30))
    for A in (tmg.ToeplitzOperator(contact(40, 40)), two, isolated):
        selection = tmg.select_preconditioner(A)
        first, *others = repr(selection).splitlines()
        assert first == f"{selection.candidates[0].name}: {selection.candidates[0].reason}"
        assert others
        starts = ("if refused, ", "if all are refused, the best of ", "and then the best of it, ")
        assert all(line.startswith((*starts, "    ")) for line in others)
