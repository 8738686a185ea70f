"""The answers of methods: they are measured, corrected, compared, and refused."""

import warnings

import numpy as np
import pytest
import scipy.linalg

import toeplitz_mg as tmg
from toeplitz_mg.solvers import refinement
from toeplitz_mg.solvers.choice import Method
from toeplitz_mg.solvers.system import ToeplitzSystem

EPS = 2.0**-52


def nearly_singular(power):
    """The matrix of ones but for 2^-power, and a right-hand side of which x is 2^power b."""
    c, b = np.array([1.0, 1.0 - 2.0**-power]), np.array([1.0, -1.0])
    return ToeplitzSystem(c, c, b), 2.0**power * b


def solve_with(monkeypatch, power, *errors):
    """Solve by methods that are wrong by such parts of x, and that correct nothing."""
    system, exact = nearly_singular(power)

    def wrong_by(error):
        x = exact + error * np.abs(exact)
        return lambda B, rtol: (x if B is system.B else 0.0 * B, 1)

    made = [Method(f"wrong by {error}", wrong_by(error)) for error in errors]
    monkeypatch.setattr(refinement, "methods", lambda system: iter(made))
    x, info = refinement.solve_system(system, None)
    assert info.method == f"wrong by {x[0] / exact[0] - 1.0:.0e}".replace("e-0", "e-")
    return info


@pytest.mark.parametrize("errors", [(1e-13, 1e-12), (1e-12, 1e-13), (1e-9, 1e-13, 1e-12, 1e-5)])
def test_the_best_of_the_answers_is_taken(monkeypatch, errors):
    assert solve_with(monkeypatch, 10, *errors).method == "wrong by 1e-13"


def test_another_method_is_tried_where_an_answer_is_not_that_of_a_direct_one(monkeypatch):
    """Its backward error is above 64 ε; below that no other method need be tried."""
    assert solve_with(monkeypatch, 10, 1e-12, 1e-15).method == "wrong by 1e-15"
    assert solve_with(monkeypatch, 10, 1e-14, 0.0).method == "wrong by 1e-14"


@pytest.mark.parametrize(
    ("power", "error"), [(10, 1e-5), (10, 1e-10), (10, 1e-11), (40, 2e-13), (45, 1e-14)]
)
def test_an_answer_that_is_no_solution_is_none(monkeypatch, power, error):
    """The backward error is above 2e-12, or that is below, and the residual above 0.1 ‖b‖."""
    with pytest.raises(np.linalg.LinAlgError, match=rf"A is singular.*; by wrong by {error}"):
        solve_with(monkeypatch, power, error)


@pytest.mark.parametrize("power", range(24, 46))
def test_a_residual_is_not_told_to_be_below_its_rounding(power):
    """Where rounding of A x may be above 1e-8 ‖b‖ the residual that is told has its size."""
    system, _ = nearly_singular(power)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        x, info = tmg.solve_toeplitz(system.c, system.B, full_output=True)
    rounding = EPS * np.linalg.norm(x) / np.linalg.norm(system.B)
    if rounding * np.abs(system.lags).sum() > 1.001e-8:
        assert info.residual >= 0.999 * rounding * np.linalg.norm(system.lags)
    if rounding * np.linalg.norm(system.lags) > 1.001e-8:
        assert [warning.category for warning in told] == [scipy.linalg.LinAlgWarning]


def test_a_residual_is_corrected_wherever_rounding_allows_a_smaller_one():
    """Of nearly singular matrices that of Levinson's recursion is 1e-5 ‖b‖, of 1e-9 to be had."""
    seen = 0
    for seed in range(4):
        c, r, b = np.random.default_rng([seed, 300]).standard_normal((3, 300))
        r[0] = c[0]
        eigenvalues = np.linalg.eigvals(scipy.linalg.toeplitz(c, r))
        real = eigenvalues[eigenvalues.imag == 0.0].real
        if not len(real):
            continue
        c[0] -= real[np.abs(real).argmin()] - 1e-6
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            x, info = tmg.solve_toeplitz((c, r), b, full_output=True)
        residual = np.linalg.norm(b - scipy.linalg.toeplitz(c, r) @ x) / np.linalg.norm(b)
        assert max(residual, info.residual) <= 1e-6
        seen += 1
    assert seen


@pytest.mark.parametrize("power", range(44, 52))
def test_no_residual_beyond_the_largest_is_returned_however_exact_x_seems(power):
    """Of this matrix rounding of A x may be more than what is measured of it."""
    system, _ = nearly_singular(power)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
        try:
            _, info = tmg.solve_toeplitz(system.c, system.B, full_output=True)
        except np.linalg.LinAlgError:
            assert power > 45  # The residual may be 2^power ε.
        else:
            assert info.residual <= refinement.SINGULAR
