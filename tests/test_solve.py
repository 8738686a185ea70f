"""solve_toeplitz takes what SciPy's takes, returns what that returns, and refuses the rest."""

import warnings

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from comparisons.systems.symbols import HERMITIAN, column
from tests.systems import random, refuses, residual

KERNEL = 1 / (1.0 + np.arange(3000))

FORMS = {
    "list": ([4.0, 2.0, 1.0], [1.0, 2.0, 3.0]),
    "integers": ([4, 2, 1], [1, 2, 3]),
    "one": ([4.0], [2.0]),
    "two": ([2.0, 0.5], [1.0, 2.0]),
    "float32": (np.float32([4, 2, 1]), np.float32([1, 2, 3])),
    "column": ([4.0, 2.0, 1.0], [[1.0], [2.0], [3.0]]),
    "columns": ([4.0, 2.0, 1.0], random(3, 5)),
    "no columns": ([4.0, 2.0, 1.0], np.zeros((3, 0))),
    "pair": (([4.0, 2.0, 1.0], [9.0, 2.0, 1.0]), [1.0, 2.0, 3.0]),
    "not symmetric": (([4.0, 2.0, 1.0], [9.0, 3.0, 0.5]), [1.0, 2.0, 3.0]),
    "Hermitian": ([4.0, 2.0j, 1.0], [1.0, 2.0, 3.0]),
    "complex": (([4.0j, 2.0, 1.0], [0.0, 1.0j, 0.5]), [1.0, 2.0j, 3.0]),
    "complex b": ([4.0, 2.0, 1.0], [1.0, 2.0j, 3.0]),
    "batch of c": ([[4.0, 2.0, 1.0], [3.0, 1.0, 0.0]], random(3, 5)),
    "batch of b": ([4.0, 2.0, 1.0], random(2, 3, 5)),
    "batch of both": (random(2, 1, 3) + 5 * np.eye(1, 3), random(4, 3, 2)),
    "Hermitian, columns": (KERNEL[:256] * np.exp(0.3j * np.arange(256)), random(256, 3)),
    "complex, columns": ((1j * KERNEL[:600], KERNEL[:600] ** 2 + 0.01j), random(600, 3) + 0j),
    "large": (KERNEL, random(3000)),
    "large, float32": (np.float32(KERNEL), np.float32(random(3000))),
    "large, columns": (KERNEL, random(3000, 3)),
    "large, complex b": (KERNEL, random(3000) + 1j * random(3000)),
    "large, column": (KERNEL, random(3000, 1)),
    "large, not symmetric": ((KERNEL, KERNEL**2), random(3000)),
    "large, Hermitian": (np.where(np.arange(1500) > 0, 1j, 1.0) * KERNEL[:1500], random(1500)),
    "zero": (KERNEL, np.zeros(3000)),
    "a zero column": (KERNEL, random(3000, 3) * [1.0, 0.0, 1.0]),
    "huge and tiny": (1e-250 * KERNEL, 1e-200 * random(3000)),
    "columns huge and tiny": (KERNEL[:40], random(40, 3) * [1e-200, 1.0, 1e200]),
}


def solve_by_scipy(c_or_cr, b):
    """SciPy's answer; before version 1.17, which takes batches, one by one of a batch."""
    solve = scipy.linalg.solve_toeplitz
    is_batch = not isinstance(c_or_cr, tuple) and (np.ndim(c_or_cr) > 1 or np.ndim(b) > 2)
    if is_batch and tuple(map(int, scipy.__version__.split(".")[:2])) < (1, 17):
        return np.vectorize(solve, signature="(n),(n,k)->(n,k)")(c_or_cr, b)
    return solve(c_or_cr, b)


@pytest.mark.parametrize("form", FORMS)
def test_takes_and_returns_what_scipy_does(form):
    c_or_cr, b = FORMS[form]
    expected = solve_by_scipy(c_or_cr, b)
    x = tmg.solve_toeplitz(c_or_cr, b)
    assert x.shape == expected.shape
    assert x.dtype == expected.dtype
    assert x.flags.c_contiguous
    # Each column is as large as it is.
    scale = abs(expected).max(axis=-1 if x.ndim == 1 else -2, keepdims=True, initial=0.0)
    assert (abs(x - expected) <= 1e-9 * scale).all()
    y, info = tmg.solve_toeplitz(c_or_cr, b, True, full_output=True)
    assert_allclose(y, x, rtol=1e-9)
    assert np.max(info.residual) <= 1e-12


@pytest.mark.parametrize("layout", [lambda b: np.repeat(b, 2, axis=0)[::2], np.asfortranarray])
@pytest.mark.parametrize("columns", [1, 3])
def test_any_layout_is_read_and_nothing_written(layout, columns):
    c, b = KERNEL[:60], random(60, columns)
    expected = tmg.solve_toeplitz(c, b)
    other = layout(b)
    other.flags.writeable = False
    assert np.array_equal(tmg.solve_toeplitz(np.repeat(c, 2)[::2], other), expected)
    assert np.array_equal(other, b)


LAG = np.arange(40.0)
MATRICES = {
    "symmetric": KERNEL[:40],
    "symmetric by its row": (KERNEL[:40], KERNEL[:40].copy()),
    "ill-conditioned": np.exp(-((LAG / 3.0) ** 2)),
    "not symmetric": (KERNEL[:40], 0.5 * KERNEL[:40] ** 2),
    "random": tuple(random(2, 40) / 4.0),
    "Hermitian": KERNEL[:40] * np.exp(0.3j * LAG),
    "complex": (1j * KERNEL[:40], KERNEL[:40] ** 2 + 0.1j),
}


@pytest.mark.parametrize("size", [1e-300, 1.0, 1e308])
@pytest.mark.parametrize("name", MATRICES)
def test_no_warning_of_numpy_escapes(name, size):
    matrix, b = MATRICES[name], random(40)
    scaled = tuple(size * a for a in matrix) if isinstance(matrix, tuple) else size * matrix
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
        with np.errstate(all="raise"):
            x = tmg.solve_toeplitz(scaled, 0.1 * size * b)
        expected = tmg.solve_toeplitz(matrix, 0.1 * b)
    if name != "ill-conditioned":
        assert np.allclose(x, expected, rtol=1e-6, atol=1e-9 * abs(expected).max())


def test_refuses_bad_arguments():
    solve = tmg.solve_toeplitz
    for c, b in (
        ([1.0, 0.0], [1.0, 2.0, 3.0]),
        (([1.0, 0.0], [1.0]), [1.0, 2.0]),
        (1.0, [1.0]),
        ([1.0], 1.0),
        (1.0, 1.0),
    ):
        refuses(ValueError, "must have the length of c", solve, c, b)
    for n in (2, 3000):
        for bad in (np.nan, np.inf):
            c, b = np.zeros(n), np.ones(n)
            c[0], c[1] = 1.0, bad
            refuses(ValueError, r"finite|infs or NaNs", solve, c, b)
            refuses(ValueError, r"finite|infs or NaNs", solve, b, c)
    for parts in (([1.0],), ([1.0], [1.0], [1.0])):
        with pytest.raises(ValueError, match=r"c_or_cr is a tuple of [13], but must be \(c, r\)"):
            solve(parts, [1.0])
    refuses(TypeError, "b is None, but must be of numbers", solve, [1.0], None)
    refuses(TypeError, "c has dtype", solve, ["a"], [1.0])
    masked = np.ma.masked_array([2.0, 1.0], [False, True])
    for c, b in ((masked, [1.0, 2.0]), (([2.0, 1.0], masked), [1.0, 2.0]), ([2.0, 1.0], masked)):
        refuses(TypeError, r"[crb] is a masked array, but must have a value", solve, c, b)
    for b in ("ab", ["1", "2"]):
        refuses(TypeError, r"b (has dtype|is 'ab')", solve, [2.0, 1.0], b)
    refuses(ValueError, "batch has shape", solve, [1.0], np.zeros((0, 1, 1)))
    for rtol in (0.0, -1.0, 1.0, np.inf, np.nan):
        refuses(ValueError, "rtol is", solve, [1.0], [1.0], rtol=rtol)
    with pytest.raises(ValueError, match=r"c has shape \(2, 4\), .* and b \(3, 4, 1\), but"):
        tmg.solve_toeplitz(np.ones((2, 4)), np.ones((3, 4, 1)))
    for c, b, error in (
        ([1.0, 0.0], [1.0], "must have the length of c"),
        ([[1.0, 0.0]], [1.0, 2.0], "must have the length of c"),
        ([1.0], np.zeros((1, 0)), "must not be empty"),
    ):
        refuses(ValueError, error, tmg.select_method, c, b)
    for c in (tmg.ToeplitzOperator([2.0, 1.0]), scipy.sparse.eye_array(2)):
        with pytest.raises(TypeError, match="but must be an array: for a ToeplitzOperator"):
            tmg.solve_toeplitz(c, np.ones(2))


def test_not_finite_in_not_finite_out():
    for n in (5, 3000):
        for position in (0, 1):
            c_and_b = [column("contact", n), random(n)]
            c_and_b[position][1] = np.nan
            assert np.isnan(tmg.solve_toeplitz(*c_and_b, check_finite=False)).all()
            refuses(ValueError, r"finite|infs or NaNs", tmg.solve_toeplitz, *c_and_b)
        c = np.r_[column("contact", n - 1), np.nan]
        assert np.isnan(tmg.solve_toeplitz(c, np.zeros(n), check_finite=False)).all()


@pytest.mark.parametrize("n", [5, 300, 3001])
@pytest.mark.parametrize("kind", [float, complex])
def test_the_first_number_of_the_row_is_ignored(n, kind):
    """Whatever it is, where nobody looks whether numbers are finite."""
    c, r = 0.5 ** np.arange(n).astype(kind), 0.3 ** np.arange(n).astype(kind)
    wanted = tmg.solve_toeplitz((c, r), np.ones(n))
    r[0] = np.nan
    found = tmg.solve_toeplitz((c, r), np.ones(n), check_finite=False)
    np.testing.assert_allclose(found, wanted, rtol=1e-10)


def test_a_negative_definite_system_is_as_good_as_its_negative():
    c, b = column("contact", 5000), random(5000)
    assert np.array_equal(tmg.solve_toeplitz(-c, b), -tmg.solve_toeplitz(c, b))


# Complex numbers --------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 30, 256, 257, 600])
def test_both_parts_of_a_right_hand_side_are_those_alone(n):
    """A real matrix is one of complex numbers too; small ones are solved as such."""
    rng = np.random.default_rng(0)
    symmetric = 0.5 ** np.arange(n)
    b = rng.standard_normal(n) + 1e-9j * rng.standard_normal(n)
    c, r = rng.standard_normal((2, n))
    c[0] = r[0] = 2.0 * (np.abs(c).sum() + np.abs(r).sum())
    for matrix in (symmetric, (c, r)):
        x = tmg.solve_toeplitz(matrix, b)
        assert x.dtype == np.complex128
        assert_allclose(x.real, tmg.solve_toeplitz(matrix, b.real), rtol=1e-9)
        assert_allclose(x.imag, tmg.solve_toeplitz(matrix, b.imag), rtol=1e-9)
        assert np.array_equal(tmg.solve_toeplitz(matrix, b[:, np.newaxis])[:, 0], x)


@pytest.mark.parametrize("n", [60, 300, 3000])
@pytest.mark.parametrize("size", [1e-200, 1.0, 1e200])
def test_a_part_that_is_rounding_counts_by_the_whole(n, size):
    """The imaginary part of what inverse transforms give must not decide how good x is."""
    k = np.arange(n)
    c = np.exp(-((k / 8.0) ** 2)) + 1e-11 * (k == 0)
    A = tmg.ToeplitzOperator(c)
    b = A @ np.ones(n)
    x, info = tmg.solve_toeplitz(c, size * (b + 1e-17j * (-1.0) ** k), full_output=True)
    assert info.residual <= 1e-10
    assert np.linalg.norm(b - A @ x.real / size) <= 1e-10 * np.linalg.norm(b)


@pytest.mark.parametrize("n", [20, 300, 3000])
@pytest.mark.parametrize(("real", "imag"), [(1e-200, 0.0), (0.0, 1e-200), (1e-300, 1e300), (0, 0)])
def test_both_parts_of_a_right_hand_side_may_have_any_size(n, real, imag):
    c = 1.0 / (1.0 + np.arange(n))
    u, v = np.random.default_rng(0).standard_normal((2, n))
    x, info = tmg.solve_toeplitz(c, real * u + 1j * imag * v, full_output=True)
    for part, size, w in ((x.real, real, u), (x.imag, imag, v)):
        alone = tmg.solve_toeplitz(c, size * w)
        assert_allclose(part, alone, rtol=0.0, atol=1e-10 * np.abs(alone).max())
    assert info.residual <= 1e-12


def test_a_complex_matrix_of_any_size_may_have_an_imaginary_part_of_zero():
    for size in (1e-200, 1e200):
        for turn in (1.0 + 0.0j, 1.0j):
            c, b = size * turn * np.array([3.0, 1.0]), turn * np.array([1.0, 3.0])
            assert_allclose(tmg.solve_toeplitz((c, c), b) * size, [0.0, 1.0], atol=1e-15)


# Sizes ------------------------------------------------------------------------------------------

HARD = np.array([1e-13, 1.0, 0.5])

RIGHT = np.random.default_rng(1).standard_normal(3)

SIZES = [-300, -200, -165, -150, -139, -60, 0, 60, 139, 150, 165, 200, 300]


@pytest.mark.parametrize("of_b", SIZES)
@pytest.mark.parametrize("of_A", [-290, -200, -165, -100, -20, 0, 20, 100, 165, 200, 290])
def test_an_answer_is_right_whatever_the_sizes_or_there_is_none(of_A, of_b):
    exact = np.linalg.solve(scipy.linalg.toeplitz(HARD), RIGHT)
    c, b = 10.0**of_A * HARD, 10.0**of_b * RIGHT
    if not -305 < of_b - of_A < 305:
        with pytest.raises(np.linalg.LinAlgError, match="must be within the range of float64"):
            tmg.solve_toeplitz(c, b)
        return
    assert_allclose(tmg.solve_toeplitz(c, b) / 10.0 ** (of_b - of_A), exact, rtol=1e-9)
    # All at once, with one of a size whose squares are zero, and one of zeros.
    others = np.stack([b, 0.0 * b, 1e-165 * RIGHT], axis=1)
    if -305 < -165 - of_A < 305:
        x = tmg.solve_toeplitz(c, others)
        assert_allclose(x[:, 0] / 10.0 ** (of_b - of_A), exact, rtol=1e-9)
        assert_allclose(x[:, 2] / 10.0 ** (-165 - of_A), exact, rtol=1e-9)
        assert not x[:, 1].any()


def test_errors_of_columns_in_proportion_do_not_cancel():
    """Their sums with weights may; once the weights were 1, √2, √3, 2, …"""
    exact = np.linalg.solve(scipy.linalg.toeplitz(HARD), RIGHT)
    for factors in (
        [2.0, 0.0, 0.0, -1.0],
        [1.0, -1.0],
        [2.0, -1.0],
        [0.0, 2.0] + 5 * [0.0] + [-1.0],
    ):
        x = tmg.solve_toeplitz(HARD, np.outer(RIGHT, factors))
        assert_allclose(x, np.outer(exact, factors), rtol=1e-9)


@pytest.mark.parametrize("n", [1, 2, 300, 3000])
@pytest.mark.parametrize(("of_c", "of_b"), [(-300, 10), (200, -200), (-160, 160), (300, -10)])
@pytest.mark.parametrize("full_output", [False, True])
def test_a_solution_out_of_range_is_an_error(n, of_c, of_b, full_output):
    c = 10.0**of_c * 0.5 ** np.arange(n)
    b = 10.0**of_b * (1.0 + 0.25 * np.cos(np.arange(n)))  # So that no solution is small by chance.
    for rhs in (b, b[:, None], b * (1.0 + 2.0j), np.stack([b, b])[..., None]):
        with pytest.raises(np.linalg.LinAlgError, match=r"is of size 1e[-+][34]\d\d, but must be"):
            tmg.solve_toeplitz(c, rhs, full_output=full_output)


def test_subnormal_numbers_are_solved_for_where_no_digit_is_lost():
    b = np.array([3.0, -1.0, 2.0]) * 2.0**-1060
    assert np.array_equal(tmg.solve_toeplitz([4.0, 0.0, 0.0], b), b / 4.0)
    assert np.array_equal(tmg.solve_toeplitz([0.25, 0.0, 0.0], b), b * 4.0)
    with pytest.raises(np.linalg.LinAlgError, match="must be within the range of float64"):
        tmg.solve_toeplitz([3.0, 1.0, 0.0], b)
    # What is lost of a small part of a number is no part of its digits.
    z = np.array([1.0 + 1e-320j, 2.0, 3.0])
    assert_allclose(tmg.solve_toeplitz([3.0, 1.0, 0.0], z).real, [5 / 21, 2 / 7, 19 / 21])
    # Nor is a small entry beside a large one.
    x = tmg.solve_toeplitz([3.0, 0.0, 0.0], [3.0, 1e-320, 0.0])
    assert_allclose(x, [1.0, 0.0, 0.0], atol=1e-300)


@pytest.mark.parametrize("size", [1e-50, 1.0, 1e50])
def test_a_column_of_zeros_beside_one_of_any_size(size):
    c, _ = HERMITIAN["nonuniform Fourier"](2048)
    B = (random(2048, 2) + 1j * random(2048, 2)[::-1]) * [size, 0.0]
    X = tmg.solve_toeplitz(c, B)
    assert residual(c, X[:, 0], B[:, 0]) <= 1e-12
    assert not X[:, 1].any()


@pytest.mark.parametrize("n", [4, 300])
def test_a_solution_in_range_although_the_quotient_of_the_sizes_is_not(n):
    """A is (1 + J)/2, J all ones: a constant is (n + 1)/2 times itself, the size of A is 1."""
    c = 2.0**-520 * np.where(np.arange(n) > 0, 0.5, 1.0)
    x = tmg.solve_toeplitz(c, np.full(n, 2.0**504 * 1.5))
    assert_allclose(x / 2.0**1000, 3.0 / (n + 1.0) * 2.0**24, rtol=1e-12)


def test_a_subnormal_solution_although_the_quotient_of_the_sizes_is_zero():
    """A has the eigenvalue 2^-20, of a vector on which no digit is lost."""
    c, b = 2.0**100 * np.array([1.0, 1.0 - 2.0**-20]), np.array([1.0, -1.0])
    assert np.array_equal(tmg.solve_toeplitz(c, 2.0**-980 * b), 2.0**-1060 * b)


@pytest.mark.parametrize("n", [3, 300])
@pytest.mark.parametrize("small", ["real", "imag"])
def test_one_part_may_lose_its_digits_where_the_other_has_them(n, small):
    c = np.where(np.arange(n) > 0, 0.0, 3.0)
    c[1] = 1.0
    u, v = np.random.default_rng(0).standard_normal((2, n))
    u, v = 1e-290 * u, 1e-319 * v
    x = tmg.solve_toeplitz(c, u + 1j * v if small == "imag" else v + 1j * u)
    large, lost = (x.real, x.imag) if small == "imag" else (x.imag, x.real)
    assert_allclose(large, tmg.solve_toeplitz(c, u), rtol=1e-10)
    assert np.abs(lost).max() <= 1e-317


def test_small_entries_beside_large_ones_may_underflow():
    """Those of the inverse decay as 0.38 to the power of the distance."""
    c, b = np.eye(1, 100)[0] * 3.0 + np.eye(1, 100, 1)[0], np.eye(1, 100)[0]
    x = tmg.solve_toeplitz(1e200 * c, 1e-90 * b)
    assert_allclose(x * 1e290, tmg.solve_toeplitz(c, b), rtol=0, atol=1e-12)


@pytest.mark.parametrize(("of_c", "of_b", "size"), [(200, -150, "-350"), (-200, 150, "[+]350")])
@pytest.mark.parametrize("column", [0, 1])
def test_an_error_names_the_size_that_is_out_of_range(of_c, of_b, size, column):
    """It is that of the column of which it is told."""
    B = np.ones((3, 2)) * 10.0 ** (of_c // 2)
    B[:, column] = 10.0**of_b
    with pytest.raises(np.linalg.LinAlgError, match=f"the solution is of size 1e{size}, but must"):
        tmg.solve_toeplitz(10.0**of_c * np.eye(1, 3)[0], B)


@pytest.mark.parametrize("kind", [float, complex])
def test_both_parts_may_be_as_large_as_float64_has_numbers(kind):
    """Though the absolute value of such a complex number overflows."""
    c, b = np.array([1, 0], kind), np.array([1.5e308 * (1 + 1j), 0])
    np.testing.assert_array_equal(tmg.solve_toeplitz(c, b), b)


# Batches ----------------------------------------------------------------------------------------


def frames(systems, n, seed=5):
    """Autocorrelations of random signals: the systems of linear prediction."""
    signals = np.random.default_rng(seed).standard_normal((systems, 8 * n)).cumsum(axis=1)
    spectrum = np.fft.rfft(signals, 16 * n)
    lags = np.fft.irfft(abs(spectrum) ** 2)[:, : n + 1]
    return lags[:, :n], lags[:, 1:]


@pytest.mark.parametrize("columns", [1, 3])
@pytest.mark.parametrize("kind", ["symmetric", "Hermitian", "general"])
@pytest.mark.parametrize(("systems", "n"), [(60, 1), (200, 12), (8000, 9), (150, 64)])
def test_every_system_is_solved(systems, n, columns, kind):
    c, b = frames(systems, n)
    r = {"symmetric": c, "Hermitian": c, "general": c * 0.7 ** np.arange(n)}[kind]
    if kind == "Hermitian":
        c = c * np.exp(0.3j * np.arange(n))
        r = c.conj()
    b = b[..., np.newaxis] * (1.0 + np.arange(columns))
    x, info = tmg.solve_toeplitz((c, r), b, full_output=True)
    A = np.stack([scipy.linalg.toeplitz(*pair) for pair in zip(c, r, strict=True)])
    residuals = (np.linalg.norm(A @ x - b, axis=1) / np.linalg.norm(b, axis=1)).max(axis=1)
    assert residuals.max() <= 1e-10
    assert info.residual.shape == (systems,)
    assert_allclose(info.residual, residuals, rtol=0, atol=1e-11)
    assert (info.backward_error <= info.residual).all()


def test_a_singular_system_leaves_the_others_of_a_batch():
    c, b = frames(100, 5)
    c[7] = 0.0
    expected = tmg.solve_toeplitz(np.delete(c, 7, axis=0), np.delete(b, 7, axis=0)[..., np.newaxis])
    with pytest.raises(np.linalg.LinAlgError, match=r"system \(7,\)"):
        tmg.solve_toeplitz(c, b[..., np.newaxis])
    x, info = tmg.solve_toeplitz(c, b[..., np.newaxis], on_singular="nan", full_output=True)
    assert np.isnan(x[7]).all()
    assert np.isnan(info.residual[7])
    assert_allclose(np.delete(x, 7, axis=0), expected, rtol=1e-12)
    assert np.isnan(tmg.solve_toeplitz(c[7], b[7], on_singular="nan")).all()
    with pytest.raises(ValueError, match="on_singular is 'zero', but must be"):
        tmg.solve_toeplitz(c, b, on_singular="zero")


def test_leading_axes_and_one_right_hand_side_for_all():
    c, b = frames(120, 5)
    x = tmg.solve_toeplitz(c.reshape(4, 30, 5), b.reshape(4, 30, 5, 1))
    assert_allclose(x.reshape(120, 5), tmg.solve_toeplitz(c, b[..., np.newaxis])[..., 0])
    of_one = tmg.solve_toeplitz((c, c), b[0])
    assert of_one.shape == (120, 5)
    assert_allclose(of_one[7], tmg.solve_toeplitz(c[7], b[0]), rtol=1e-9)


def test_what_the_recursion_does_not_solve_is_solved_alone():
    c, b = frames(100, 3)
    b = b[..., np.newaxis].copy()
    c[1] = 1e-300, 0.0, 0.0  # Squares underflow.
    c[2] = 1e-13, 1.0, 0.5  # The recursion loses 13 digits.
    c[3] = 0.0, 1.0, 0.5  # It divides by zero.
    c[4] *= -1.0
    b[5] = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        x, info = tmg.solve_toeplitz(c, b, full_output=True)
    assert info.residual.max() <= 1e-12
    for k in range(10):
        exact = np.linalg.solve(scipy.linalg.toeplitz(c[k]), b[k])
        assert_allclose(x[k], exact, rtol=1e-9)


def test_one_bad_system_is_an_error_as_it_is_alone():
    c, b = frames(100, 4)
    b = b[..., np.newaxis]
    singular = c.copy()
    singular[40] = 1.0
    refuses(np.linalg.LinAlgError, "A is singular", tmg.solve_toeplitz, singular, b)
    bad = c.copy()
    bad[40, 2] = np.nan
    refuses(ValueError, "c has entries that are not finite", tmg.solve_toeplitz, bad, b)
    x = tmg.solve_toeplitz(bad, b, check_finite=False)
    assert np.isnan(x[40]).all()
    assert np.isfinite(np.delete(x, 40, axis=0)).all()


def test_batches_are_their_systems():
    c, b = random(7, 4, 9), random(7, 4, 9, 2)
    c[..., 0] += 20
    X = tmg.solve_toeplitz(c, b)
    for k in np.ndindex(7, 4):
        assert_allclose(X[k], tmg.solve_toeplitz(c[k], b[k]), rtol=1e-12)


# Bands ------------------------------------------------------------------------------------------

BANDS = {  # The diagonals from the main one down, and from it to the right.
    "definite, tridiagonal": ([2.0, -1.0], [2.0, -1.0]),
    "definite, five diagonals": ([6.5, -4.0, 1.0], [6.5, -4.0, 1.0]),
    "indefinite": ([1.0, -2.0, 0.5], [1.0, -2.0, 0.5]),
    "skew-symmetric": ([0.1, 1.0], [0.1, -1.0]),
    "not symmetric": ([4.0, -1.0, 0.5], [4.0, 2.0]),
    "upper": ([3.0], [3.0, 1.0, 1.0]),
    "diagonal": ([3.0], [3.0]),
    "Hermitian, tridiagonal": ([3.0, 1.0j], [3.0, -1.0j]),
    "Hermitian, five diagonals": ([6.5, -4.0, 1.0j], [6.5, -4.0, -1.0j]),
    "complex": ([3.0j, 1.0], [3.0j, 0.5, 0.5]),
}


@pytest.mark.parametrize("columns", [1, 3])
@pytest.mark.parametrize("n", [40, 3001])
@pytest.mark.parametrize("name", BANDS)
def test_a_band_is_solved_as_by_lapack(name, n, columns):
    below, above = map(np.array, BANDS[name])
    c, r = (np.concatenate([a, np.zeros(n - len(a))]) for a in (below, above))
    b = random(n, columns)[:, 0] if columns == 1 else random(n, columns)
    diagonals = np.concatenate([above[:0:-1], below])[:, np.newaxis]
    widths = len(below) - 1, len(above) - 1
    expected = scipy.linalg.solve_banded(widths, np.tile(diagonals, n), b)
    with tmg.count_products() as work:
        x, info = tmg.solve_toeplitz((c, r), b, full_output=True)
    assert_allclose(x, expected, atol=1e-9 * abs(expected).max())
    assert info.backward_error <= 1e-14
    if n > 1000:
        assert work.units(n) == 0  # No transform.


# The choice -------------------------------------------------------------------------------------


def test_a_method_is_named_with_its_reason():
    for c, b in ((KERNEL, random(3000)), ((KERNEL, KERNEL**2), random(3000, 5)), ([2], [1j])):
        method = tmg.select_method(c, b)
        assert str(method) == f"{method.name}: {method.why}"
        _, info = tmg.solve_toeplitz(c, b, full_output=True)
        assert info.method == method.name


def test_a_method_depends_on_no_scale_and_no_sign():
    c, b = KERNEL[:600], random(600)
    for size in (-1.0, 1e-200, 1e300):
        assert tmg.select_method(size * c, size * b) == tmg.select_method(c, b)
