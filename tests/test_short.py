"""Short systems: what is solved in the fewest calls is what all others are."""

import warnings

import numpy as np
import pytest
from scipy.linalg import LinAlgWarning

import toeplitz_mg as tmg
from toeplitz_mg.solvers import short, solve


def system(kind, n, columns):
    """Return a matrix and right-hand sides, of which 0 columns are a vector."""
    rng = np.random.default_rng(n)
    c, r = 1.0 / np.arange(1.0, n + 1), 0.5 / np.arange(1.0, n + 1) ** 2
    b = rng.standard_normal((n, columns) if columns else n)
    match kind:
        case "symmetric":
            return c, b
        case "ill-conditioned":
            return np.exp(-((np.arange(n) / 3.0) ** 2)), b
        case "nonsymmetric":
            return (c, r), b
        case "random":
            return tuple(rng.uniform(-1.0, 1.0, (2, n))), b
        case "symmetric by its row":
            return (c, c.copy()), b
        case "Hermitian":
            return c * np.exp(0.3j * np.arange(n)), b + 1j * b[::-1]
        case "complex":
            return (c * 1j, r + 0.1j), b + 0j
    raise ValueError(kind)


KINDS = (
    "symmetric",
    "ill-conditioned",
    "nonsymmetric",
    "random",
    "symmetric by its row",
    "Hermitian",
    "complex",
)


@pytest.mark.parametrize("columns", [0, 1, 3])
@pytest.mark.parametrize("n", [1, 2, 17, 256, 600])
@pytest.mark.parametrize("kind", KINDS)
def test_the_answer_is_that_of_the_way_for_all(kind, n, columns, monkeypatch):
    matrix, b = system(kind, n, columns)
    monkeypatch.setenv("TOEPLITZ_MG_COSINE_OVER_LEVINSON", "1e9")  # The recursion is the way.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # That it is ill-conditioned.
        x, info = tmg.solve_toeplitz(matrix, b, full_output=True)
        monkeypatch.setattr(solve, "solve_short", lambda *args: (None, None))
        expected, other = tmg.solve_toeplitz(matrix, b, full_output=True)
    assert x.shape == b.shape
    assert x.flags.c_contiguous
    assert np.array_equal(x, expected)
    assert (info.method, info.iterations) == (other.method, other.iterations)
    # Of the same x: what is left of b, but for rounding of A x, which is of n terms.
    rounding = 2 * n * np.finfo(float).eps
    assert info.backward_error == pytest.approx(other.backward_error, abs=rounding)


@pytest.mark.parametrize("layout", [lambda b: np.repeat(b, 2, axis=0)[::2], np.asfortranarray])
@pytest.mark.parametrize("columns", [1, 3])
def test_any_layout_is_read_and_nothing_written(layout, columns):
    c, b = system("symmetric", 60, columns)
    expected = tmg.solve_toeplitz(c, b)
    other = layout(b)
    other.flags.writeable = False
    assert np.array_equal(tmg.solve_toeplitz(np.repeat(c, 2)[::2], other), expected)
    assert np.array_equal(other, b)


def test_the_recursion_is_made_once_where_its_answer_is_in_doubt(monkeypatch):
    c, b = system("ill-conditioned", 60, 0)
    x, info = short.solve_short(c, c, b, None)
    assert x is not None
    assert info is None
    calls = []

    def recur(lags, B):
        calls.append(B)
        return short.levinson(lags, B)

    monkeypatch.setattr("toeplitz_mg.solvers.choice.levinson", recur)
    with pytest.warns(match="ill-conditioned"):
        tmg.solve_toeplitz(c, b)
    assert all(B is not b and not np.array_equal(B, b) for B in calls)  # Corrections only.


@pytest.mark.parametrize("size", [1e-300, 1.0, 1e308])
@pytest.mark.parametrize("kind", KINDS)
def test_no_warning_of_numpy_escapes(kind, size):
    matrix, b = system(kind, 40, 1)
    scaled = tuple(size * a for a in matrix) if isinstance(matrix, tuple) else size * matrix
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", LinAlgWarning)
        with np.errstate(all="raise"):
            x = tmg.solve_toeplitz(scaled, 0.1 * size * b)
        expected = tmg.solve_toeplitz(matrix, 0.1 * b)
    if kind != "ill-conditioned":
        assert np.allclose(x, expected, rtol=1e-6, atol=1e-9 * abs(expected).max())
