"""Toeplitz and masked operators: construction and what they refuse."""

import re

import numpy as np
import pytest
import scipy.linalg
import scipy.signal
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from tests.cases import checkered, dense_of_column, dense_of_lags, random_lags
from tests.systems import refuses


@pytest.mark.parametrize("shape", [(1,), (2,), (9,), (3, 4), (1, 5), (2, 3, 2)], ids=str)
def test_toarray_is_the_definition(shape):
    lags = random_lags(*shape)
    A = tmg.ToeplitzOperator.from_lags(lags)
    assert A.grid_shape == shape
    assert np.array_equal(A.toarray(), dense_of_lags(lags))
    assert np.array_equal(A.lags, lags)
    c = np.abs(random_lags(*shape))[tuple(slice(n) for n in shape)]
    A = tmg.ToeplitzOperator(c)
    assert A.is_even
    assert np.array_equal(A.c, c)
    assert np.array_equal(A.toarray(), dense_of_column(c))
    mask = checkered(*shape)
    expected = dense_of_column(c)[np.ix_(mask.ravel(), mask.ravel())]
    assert np.array_equal(tmg.MaskedOperator(A, mask).toarray(), expected)


def test_knows_its_symmetry():
    assert tmg.ToeplitzOperator([2.0, 1.0]).is_symmetric
    assert tmg.ToeplitzOperator([2.0, 1.0], [2.0, 1.0]).is_even
    assert not tmg.ToeplitzOperator([2.0, 1.0], [2.0, 0.0]).is_symmetric
    lags = np.zeros((3, 3))
    lags[0, 0] = lags[2, 2] = 1.0
    A = tmg.ToeplitzOperator.from_lags(lags)
    assert A.is_symmetric
    assert not A.is_even


def test_complex_matrices_know_their_symmetry():
    c = np.array([2.0, 1j, 0.5])
    A = tmg.ToeplitzOperator(c)
    assert np.array_equal(A.toarray(), scipy.linalg.toeplitz(c))
    assert (A.is_hermitian, A.is_symmetric, A.is_even) == (True, False, False)
    assert A.H is A
    B = tmg.ToeplitzOperator(c, c)
    assert (B.is_hermitian, B.is_symmetric, B.is_even) == (False, True, True)
    assert B.T is B
    C = tmg.ToeplitzOperator(c + 0.1j)  # As SciPy has it, with what is on its diagonal.
    assert np.array_equal(C.toarray(), scipy.linalg.toeplitz(c + 0.1j))
    assert (C.is_hermitian, C.is_symmetric) == (False, False)
    D = tmg.ToeplitzOperator(c.real.astype(np.complex64))
    assert (D.is_hermitian, D.is_symmetric, D.dtype) == (True, True, np.complex64)
    assert [repr(X) for X in (A, B, C)] == [
        f"<ToeplitzOperator 3, {kind}, complex128>"
        for kind in ("Hermitian", "symmetric", "general")
    ]
    for X, dense in ((A, A.toarray()), (B, B.toarray()), (C, C.toarray())):
        assert isinstance(X.T, tmg.ToeplitzOperator)
        assert np.array_equal(X.T.toarray(), dense.T)
        assert np.array_equal(X.H.toarray(), dense.conj().T)
        assert np.array_equal(X.astype(np.complex64).toarray(), dense.astype(np.complex64))


@pytest.mark.parametrize("dtype", ["f", "d", "F", "D"])
@pytest.mark.parametrize("shape", [(500,), (30, 40), (5, 6, 7)], ids=str)
def test_autocorrelations_by_fft_are_symmetric(shape, dtype):
    rng = np.random.default_rng(0)
    y = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)).astype(np.complex128)
    y = y.astype(dtype) if dtype in "FD" else y.real.astype(dtype)
    lags = scipy.signal.correlate(y, y, method="fft")
    assert not np.array_equal(lags, np.flip(lags).conj())
    A = tmg.ToeplitzOperator.from_lags(lags)
    assert A.is_hermitian
    assert np.abs(A.lags - lags).max() <= 8 * np.finfo(dtype).eps * np.abs(lags).max()
    assert tmg.default_preconditioner(A).shape == A.shape


def test_coefficients_that_are_even_but_for_rounding_are_even():
    c = np.exp(-np.hypot(*np.indices((9, 8))))
    lags = tmg.ToeplitzOperator(c).lags
    noise = np.random.default_rng(0).uniform(-1.0, 1.0, lags.shape)
    rounded = tmg.ToeplitzOperator.from_lags(lags + 2e-16 * noise)
    assert rounded.is_even
    assert_allclose(rounded.c, c, rtol=0.0, atol=1e-15)
    assert not tmg.ToeplitzOperator.from_lags(lags + 1e-13 * noise).is_symmetric


def test_what_is_hermitian_but_for_rounding_is_hermitian():
    c = np.array([2.0 + 4e-16j, 1j, 0.5])
    A = tmg.ToeplitzOperator(c)
    assert A.is_hermitian
    assert np.array_equal(A.c, [2.0, 1j, 0.5])
    assert not tmg.ToeplitzOperator(c + 1e-14j).is_hermitian
    even = tmg.ToeplitzOperator(c, c)  # Symmetric, and so not Hermitian, to the last bit.
    assert even.is_symmetric
    assert np.array_equal(even.c, c)


@pytest.mark.parametrize(
    ("a", "allowed", "dtypes"),
    [
        (1.0, "float32 or float64", (int, np.float16, complex)),
        # A real one would have no imaginary parts.
        (1j, "complex64 or complex128, as A is complex", (int, np.float32, np.float64)),
    ],
)
def test_a_precision_that_it_has_not(a, allowed, dtypes):
    A = tmg.ToeplitzOperator([4.5, a, 0.5])
    for dtype in dtypes:
        rule = rf"dtype is {np.dtype(dtype)}, but must be {allowed}"
        for B in (A, tmg.MaskedOperator(A, [True, False, True]), tmg.CoupledOperator([[A]])):
            refuses(TypeError, rule, B.astype, dtype)
        for f in (tmg.chan_preconditioner, tmg.fft_preconditioner, tmg.default_preconditioner):
            refuses(TypeError, rule, f, A, dtype=dtype)
            less = np.complex64 if a == 1j else np.float32
            assert f(A, dtype=less).dtype == less


def test_keeps_a_copy_of_what_it_is_given():
    c, mask = np.array([2.0, 1.0, 0.5]), np.array([True, False, True])
    A = tmg.ToeplitzOperator(c)
    B = tmg.MaskedOperator(A, mask)
    lags = np.array([1.0, 2.0, 3.0])
    C = tmg.ToeplitzOperator.from_lags(lags)
    c[:], mask[:], lags[:] = 7.0, True, 7.0
    assert np.array_equal(C.lags, [1.0, 2.0, 3.0])
    assert np.array_equal(A.c, [2.0, 1.0, 0.5])
    assert B.shape == (2, 2)
    with pytest.raises(ValueError, match="read-only"):
        B.mask[0] = False


@pytest.mark.parametrize(
    ("values", "error", "match"),
    [
        ([], ValueError, r"shape \(0,\)"),
        (3.0, ValueError, r"shape \(\)"),
        (np.ones((3, 0)), ValueError, r"shape \(3, 0\)"),
        ([1.0, np.nan], ValueError, r"coefficient nan at \(1,\)"),
        ([[1.0, 2.0], [np.inf, 0.0]], ValueError, r"coefficient inf at \(1, 0\)"),
        (["a"], TypeError, "dtype <U1"),
        ([None], TypeError, "object"),
    ],
)
def test_refuses_bad_coefficients(values, error, match):
    refuses(error, f"c has .*{match}", tmg.ToeplitzOperator, values)
    refuses(error, f"lags has .*{match}", tmg.ToeplitzOperator.from_lags, values)
    refuses(error, f"r has .*{match}", tmg.ToeplitzOperator, [1.0, 2.0], values)


def test_what_is_refused():
    with pytest.raises(ValueError, match=r"use ToeplitzOperator\.from_lags"):
        tmg.ToeplitzOperator(np.ones((2, 2)), np.ones((2, 2)))
    refuses(ValueError, "which is odd", tmg.ToeplitzOperator.from_lags, np.ones((3, 4)))
    with pytest.raises(ValueError, match=r"a\[k\] and a\[-k\] differ by up to 5e-14 of the larg"):
        tmg.default_preconditioner(tmg.ToeplitzOperator([2.0, 1.0], [2.0, 1.0 + 1e-13]))
    with pytest.raises(ValueError, match=r"the conjugate of a\[-k\] differ by up to 0.1 of the"):
        tmg.default_preconditioner(tmg.ToeplitzOperator([2.0 + 0.1j, 1j]))
    with pytest.raises(ValueError, match=r"c is complex and has shape \(2, 2\).*use .*from_lags"):
        tmg.ToeplitzOperator(np.full((2, 2), 1j))
    with pytest.raises(ValueError, match=r"coefficient \(nan\+1j\) at \(1,\)"):
        tmg.ToeplitzOperator([1.0, complex(np.nan, 1.0)])
    A = tmg.ToeplitzOperator([2.0, 1.0])
    for wrong in (np.eye(2), tmg.MaskedOperator(A, [True] * 2), A @ A @ A):
        refuses(TypeError, "an operator on a whole grid", tmg.MaskedOperator, wrong, [True] * 2)
    refuses(ValueError, "sizes add up to inf", tmg.ToeplitzOperator, [1e308] * 9)
    refuses(ValueError, "sizes add up to inf", tmg.ToeplitzOperator, [1.0, 1.5e308 * (1.0 + 1.0j)])


@pytest.mark.parametrize(
    ("mask", "error", "match"),
    [
        (np.ones(4, dtype=bool), ValueError, r"shape \(4,\), but A lives on the grid \(3,\)"),
        (np.ones((3, 1), dtype=bool), ValueError, r"shape \(3, 1\)"),
        (np.ones(3), TypeError, "dtype float64, but must be of booleans"),
        ([0, 1, 2], TypeError, "dtype int64"),
        ([False] * 3, ValueError, "nowhere true"),
    ],
)
def test_refuses_bad_masks(mask, error, match):
    refuses(error, match, tmg.MaskedOperator, tmg.ToeplitzOperator([2.0, 1.0, 0.0]), mask)


def test_products_are_counted():
    A = tmg.ToeplitzOperator(np.ones((4, 6)))
    C = tmg.chan_preconditioner(tmg.ToeplitzOperator(0.5 ** np.arange(24)))
    with tmg.count_products() as outer:
        A @ np.ones(24)
        with tmg.count_products() as inner:
            A @ np.ones((24, 5))
            A @ (1j * np.ones(24))
        C @ np.ones(24)
    A @ np.ones(24)
    assert (inner.products, inner.units(24)) == (7, 7.0)
    assert (outer.products, outer.units(24)) == (9, 8.5)


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.complex128, np.complex64])
@pytest.mark.parametrize("shape", [(3,), (400,), (2, 3), (20, 30)])
@pytest.mark.parametrize("turn", [0.0, 6.0])
def test_a_product_of_accepted_coefficients_does_not_overflow(shape, dtype, turn):
    """The largest that are accepted multiply as others do, and larger ones are refused."""
    rng, is_complex = np.random.default_rng(0), np.dtype(dtype).kind == "c"

    def numbers(*shape):
        z = np.exp(1j * turn * rng.random(shape))
        return (z if is_complex else z.real).astype(dtype)

    lags = numbers(*(2 * n - 1 for n in shape))
    lags /= lags.size * 2 ** len(shape)  # Rows add up to less than 1.
    x, large = numbers(np.prod(shape)), np.finfo(dtype).max / 2**9
    A, B = tmg.ToeplitzOperator.from_lags(lags), tmg.ToeplitzOperator.from_lags(large * lags)
    expected = (A @ x).astype(np.complex128)
    atol = 50 * np.finfo(dtype).eps * abs(lags).sum()
    assert_allclose((B @ x) / float(large), expected, rtol=0, atol=atol)
    assert np.isfinite(tmg.CoupledOperator([[B, B], [B, B]]) @ np.ones(2 * x.size, dtype)).all()
    with pytest.raises(ValueError, match="so that no product overflows"):
        tmg.ToeplitzOperator.from_lags(lags * large * 2 ** (4 + len(shape)))


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("n", [3, 400, 50000])
def test_the_smallest_coefficients_that_are_accepted_lose_no_digits(n, dtype):
    c = (0.9 ** np.arange(n)).astype(dtype)
    x = np.random.default_rng(0).standard_normal(n).astype(dtype)
    small = np.finfo(dtype).tiny * 4.0 * n
    y = tmg.ToeplitzOperator((2.0 * small * c).astype(dtype)) @ x
    expected = tmg.ToeplitzOperator(c) @ x
    atol = 1e3 * np.finfo(dtype).eps * np.abs(expected).max()
    assert_allclose(y / (2.0 * small), expected, rtol=0, atol=atol)
    with pytest.raises(ValueError, match="so that no product loses digits"):
        tmg.ToeplitzOperator((0.5 * small * c).astype(dtype))


@pytest.mark.parametrize("n", [2, 3, 4, 40])
@pytest.mark.parametrize("row", [None, "general"])
@pytest.mark.parametrize("dtype", [np.float64, np.complex128])
def test_a_dense_matrix_is_not_taken_for_two_axes_without_a_word(n, row, dtype):
    rng = np.random.default_rng(0)
    c, r = rng.standard_normal((2, n)).astype(dtype)
    if dtype == np.complex128:
        c, r = c + 1j * rng.standard_normal(n), r + 1j * rng.standard_normal(n)
        c[0] = 1.0  # The diagonal of a Hermitian matrix is real.
    dense = scipy.linalg.toeplitz(c, r if row else None)
    A = tmg.ToeplitzOperator(dense[:, 0], dense[0] if row else None)
    assert np.array_equal(A.toarray(), dense)
    advised = re.escape("ToeplitzOperator(c[:, 0], c[0])" if row else "ToeplitzOperator(c[:, 0])")
    if dtype == np.complex128:
        refuses(ValueError, rf"looks like {advised}$", tmg.ToeplitzOperator, dense)
    else:
        message = rf"has shape \({n}, {n}\) .* {n * n} unknowns.* use {advised}$"
        with pytest.warns(UserWarning, match=message):
            tmg.ToeplitzOperator(dense)


@pytest.mark.parametrize("shape", [(1, 1), (2, 2), (5, 5), (3, 4)])
def test_coefficients_of_two_axes_are_taken_without_a_word(shape):
    i, j = np.indices(shape)
    for c in (
        *(np.exp(-(i + j) / 2.0), 1.0 / (1.0 + np.hypot(i, j)), (i == 0) * (j == 0) * 1.0),
        *(np.zeros(shape), np.ones(shape)),
    ):
        assert tmg.ToeplitzOperator(c).shape == (c.size, c.size)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_nor_is_one_that_is_computed_entry_by_entry(dtype):
    """Its diagonals are constant but for rounding."""
    x = np.linspace(0.0, 1.0, 50).astype(dtype)
    for c, advised in (
        (np.exp(-np.abs(x[:, None] - x) / dtype(0.3)), "c[:, 0]"),
        (np.exp((x[:, None] - x) / dtype(0.3)), "c[:, 0], c[0]"),
    ):
        assert not np.array_equal(c[1:, 1:], c[:-1, :-1])
        with pytest.warns(UserWarning, match=re.escape(f"use ToeplitzOperator({advised})")):
            tmg.ToeplitzOperator(c)


def test_a_tuple_of_column_and_row_is_no_grid_of_two_rows():
    c, r = np.array([2.0, 1.0, 0.5]), np.array([2.0, 0.5, 0.1])
    for pair in ((c, r), (c.tolist(), r.tolist()), (c, r.tolist())):
        refuses(ValueError, r"first row use ToeplitzOperator\(c, r\)", tmg.ToeplitzOperator, pair)
    for grid in ([c, r], np.array([c, r]), (tuple(c), tuple(r))):
        assert tmg.ToeplitzOperator(grid).grid_shape == (2, 3)


def test_the_order_of_bytes_is_no_matter():
    c = 1.0 / (1.0 + np.arange(300))
    A = tmg.ToeplitzOperator(c.astype(">f8"))
    assert A.dtype == np.float64
    assert A.astype(">f8") is A
    assert A.astype(">f4").dtype == np.float32
    assert np.array_equal(A @ c, tmg.ToeplitzOperator(c) @ c)


def test_a_grid_whose_first_diagonal_alone_is_constant_is_no_dense_matrix():
    c = np.array([[2.0, 0.5, 0.3], [0.6, 2.0, 0.1], [0.2, 0.1, 0.7]])
    assert tmg.ToeplitzOperator(c).grid_shape == (3, 3)
    c[2, 2], c[1, 2], c[2, 1] = 2.0, 0.5, 0.6
    with pytest.warns(UserWarning, match=re.escape("use ToeplitzOperator(c[:, 0], c[0])")):
        tmg.ToeplitzOperator(c)
