"""Operations with vectors, part by part, and the steps of conjugate gradients."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest
from numpy.testing import assert_allclose

from toeplitz_mg.engine.conjugate_gradients import ConjugateGradients
from toeplitz_mg.engine.threads import WORTH_THREADS
from toeplitz_mg.engine.vectors import (
    ALONE,
    PART,
    Vectors,
    add_combination,
    axpy,
    aypx,
    combine,
    dot,
    dots,
    norm,
)

SHAPES = [(1,), (3, 4, 5), (PART,), (PART + 1,), (2, PART, 3)]
DTYPES = [np.float32, np.float64, np.complex64, np.complex128]


def vectors(k, shape, dtype):
    X = np.random.default_rng(0).random((k, *shape))
    if np.dtype(dtype).kind == "c":
        X = X + 1j * np.random.default_rng(1).random(X.shape)
    return X.astype(dtype)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("dtype", DTYPES)
def test_sums_over_all_parts(shape, dtype):
    X = vectors(3, shape, dtype)
    double = np.result_type(dtype, np.float64)
    flat = X.reshape(3, -1).astype(double)
    rtol = 1e-6 if np.finfo(dtype).bits == 32 else 1e-12
    assert_allclose(dot(X[0], X[1]), np.vdot(flat[0], flat[1]).real, rtol=rtol)
    assert isinstance(dot(X[0], X[1]), float)
    assert_allclose(dots(X, X[2]), flat.conj() @ flat[2], rtol=rtol)
    assert dots(X, X[2]).dtype == double
    assert_allclose(norm(X[0]), np.linalg.norm(flat[0]), rtol=rtol)
    weights = np.arange(3.0) if double == np.float64 else np.array([0.0, 1.0, 2.0j])
    expected = X[1] + X.dtype.type(weights[2]) * X[2]
    assert_allclose(combine(weights, X), expected, rtol=rtol)
    assert combine(weights, X).dtype == dtype
    y = X[0].copy()
    add_combination(weights, X, y)
    assert_allclose(y, X[0] + expected, rtol=rtol)
    assert not combine(weights[:0], X[:0]).any()


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("dtype", DTYPES)
def test_an_update_changes_one_vector_in_place(shape, dtype):
    x, y = vectors(2, shape, dtype)
    x0, y0 = x.copy(), y.copy()
    rounding = 100 * np.finfo(dtype).eps
    axpy(0.3, x, y)
    assert_allclose(y, y0 + 0.3 * x0.astype(np.result_type(x0, float)), rtol=0, atol=rounding)
    assert np.array_equal(x, x0)
    x = np.asfortranarray(x)
    axpy(-0.3, x, y)
    assert_allclose(y, y0, rtol=0, atol=rounding)


def test_what_cannot_be_changed_in_place_is_refused():
    with pytest.raises(ValueError, match="y is not C-contiguous"):
        axpy(1.0, np.ones((2, 3)), np.asfortranarray(np.ones((2, 3))))
    with pytest.raises(ValueError, match="y is not C-contiguous"):
        axpy(1.0, np.ones(3), np.ones(6)[::2])
    with pytest.raises(ValueError, match="y is not C-contiguous"):
        add_combination(np.ones(2), np.ones((2, 3)), np.ones(6)[::2])


@pytest.mark.parametrize("size", [1e-250, 1e250])
@pytest.mark.parametrize("n", [5, PART + 5])
def test_no_square_over_or_underflows_in_a_norm(n, size):
    x = np.full(n, size)
    assert_allclose(norm(x), np.sqrt(n) * size)
    assert_allclose(norm(1j * x), np.sqrt(n) * size)


def test_steps_lead_to_the_solution_and_leave_the_residual_alone():
    rng = np.random.default_rng(0)
    X = rng.standard_normal((12, 12))
    A, M = X @ X.T + np.eye(12), np.diag(rng.uniform(0.5, 2.0, 12))
    x, b = np.zeros((3, 4)), rng.standard_normal((3, 4))
    iteration = ConjugateGradients(
        lambda d, out: (A @ d.ravel()).reshape(3, 4), lambda r, out: (M @ r.ravel()).reshape(3, 4)
    )
    r = b.copy()
    for _ in range(12):
        before = r.copy()
        length = iteration.step(r)
        assert np.array_equal(r, before)
        x += length * iteration.direction
        r -= length * iteration.product
        assert_allclose(r.ravel(), b.ravel() - A @ x.ravel(), atol=1e-9)
    assert_allclose(x.ravel(), np.linalg.solve(A, b.ravel()), rtol=1e-6)


def test_steps_for_a_hermitian_matrix_lead_to_the_solution():
    rng = np.random.default_rng(0)
    X = rng.standard_normal((12, 12)) + 1j * rng.standard_normal((12, 12))
    A, M = X @ X.conj().T + np.eye(12), np.diag(rng.uniform(0.5, 2.0, 12))
    b = rng.standard_normal(12) + 1j * rng.standard_normal(12)
    x, r = np.zeros_like(b), b.copy()
    iteration = ConjugateGradients(lambda d, out: A @ d, lambda r, out: M @ r)
    for _ in range(12):
        length = iteration.step(r)
        assert isinstance(length, float)
        x += length * iteration.direction
        r -= length * iteration.product
    assert_allclose(x, np.linalg.solve(A, b), rtol=1e-6)


@pytest.mark.parametrize("bad", [-1.0, 0.0, np.nan, np.inf])
def test_a_step_has_no_length_where_a_matrix_is_not_positive_definite(bad):
    r = np.ones(3)
    of_A = ConjugateGradients(lambda d, out: bad * d, lambda r, out: r)
    assert of_A.step(r) == 0.0
    assert_allclose(of_A.curvature, 3 * bad)
    of_M = ConjugateGradients(lambda d, out: d, lambda r, out: bad * r)
    assert of_M.step(r) == 0.0
    assert_allclose(of_M.rho, 3 * bad)


def on_two_processes(work):
    """What `work` returns in two processes, here threads, called with the vectors of each."""
    numbers, meeting = [None, None], Barrier(2, timeout=30)

    def vectors_of(own):
        def gather(number):
            numbers[own] = number
            meeting.wait()
            both = list(numbers)
            meeting.wait()  # Before one of them writes its next number.
            return both

        return Vectors(gather)

    with ThreadPoolExecutor(2) as threads:
        return list(threads.map(lambda k: work(vectors_of(k), k), range(2)))


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("cut", [0, 1, 40, PART + 60])
def test_two_processes_find_the_numbers_of_the_whole_vectors(dtype, cut):
    X = vectors(3, (2 * PART,), dtype) - 0.5

    def measure(of, k):
        x, y, z = X[:, cut:] if k else X[:, :cut]
        numbers = [of.dot(x, y), *of.dots(np.stack([x, y]), z), of.norm(x)]
        if x.dtype.kind == "f":
            numbers += [of.sum(x), of.min(x), of.max(x), of.count(x > 0.0)]
        return numbers

    of_0, of_1 = on_two_processes(measure)
    rtol = 1e-5 if np.finfo(dtype).bits == 32 else 1e-12
    assert of_0 == of_1
    assert_allclose(of_0, measure_whole(X), rtol=rtol, atol=100 * rtol)


def measure_whole(X):
    x, y, z = X.astype(np.result_type(X, np.float64))
    numbers = [np.vdot(x, y).real, np.vdot(x, z), np.vdot(y, z), np.linalg.norm(x)]
    if X.dtype.kind == "f":
        numbers += [x.sum(), x.min(), x.max(), np.count_nonzero(x > 0.0)]
    return numbers


def test_alone_the_numbers_are_those_of_the_functions():
    X = vectors(3, (PART + 5,), np.float64)
    assert ALONE.dot(X[0], X[1]) == dot(X[0], X[1])
    assert np.array_equal(ALONE.dots(X, X[1]), dots(X, X[1]))
    assert ALONE.norm(X[0]) == norm(X[0])


@pytest.mark.parametrize("shape", [(WORTH_THREADS + 5,), (3, WORTH_THREADS // 2 + 1)])
@pytest.mark.parametrize("dtype", DTYPES)
def test_long_vectors_are_updated_and_reduced_as_numpy_does(shape, dtype):
    """In pieces that threads share, the first and the last number too."""
    rng = np.random.default_rng(0)
    X = rng.standard_normal((2, *shape))
    if np.dtype(dtype).kind == "c":
        X = X + 1j * rng.standard_normal(X.shape)
    x, y = X.astype(dtype)
    rounding = {"rtol": 0, "atol": 100 * np.finfo(dtype).eps}
    assert_allclose(axpy(0.3, x, y.copy()), y + 0.3 * x, **rounding)
    assert_allclose(aypx(0.3, x, y.copy()), x + 0.3 * y, **rounding)
    weights = np.array([0.1, -2.3, 0.7])
    combination = combine(weights, np.stack([x, y, x]))
    assert_allclose(combination, 0.8 * x - 2.3 * y, rtol=0, atol=1e3 * np.finfo(dtype).eps)
    if np.dtype(dtype).kind == "f":
        for k in (0, -1):
            spike = np.abs(x)
            spike.reshape(-1)[k] = 99.0
            assert ALONE.max(spike) == 99.0 == -ALONE.min(-spike)
            assert ALONE.peak(-spike) == 99.0
            assert ALONE.count(spike > 98.0) == 1
            assert_allclose(ALONE.sum(spike), spike.sum(dtype=np.float64), rtol=1e-4)
        assert ALONE.min(1.0 + np.abs(x)) >= 1.0
        assert ALONE.max(-1.0 - np.abs(x)) <= -1.0


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize(("of_single", "of_double"), [(-80, -600), (-74, -537), (60, 600)])
def test_the_norm_of_a_long_vector_of_any_precision_is_that_of_double(dtype, of_single, of_double):
    """Squares of these numbers are zero, have lost their digits, or are not finite."""
    power = of_single if np.finfo(dtype).bits == 32 else of_double
    x = np.random.default_rng(0).standard_normal(WORTH_THREADS + 5).astype(dtype)
    exact = np.linalg.norm(x.astype(np.complex128))
    x *= x.dtype.type(2.0) ** power
    assert_allclose(norm(x), exact * 2.0**power, rtol=1e-5)


def test_the_updates_of_views_are_refused_at_any_length():
    for n in (3, WORTH_THREADS):
        with pytest.raises(ValueError, match="y is not C-contiguous"):
            aypx(1.0, np.ones(n), np.ones(2 * n)[::2])


@pytest.mark.parametrize("size", [5, 2 * WORTH_THREADS])
def test_a_number_that_is_none_is_the_least_and_the_largest_of_all(size):
    """Wherever it is, and whichever process has it."""
    for of in (ALONE, Vectors(lambda number: [number, 1.0]), Vectors(lambda number: [1.0, number])):
        for k in (0, size - 1):
            x = np.random.default_rng(0).standard_normal(size)
            x[k] = np.nan
            assert np.isnan([of.min(x), of.max(x), of.peak(x), of.peak(1j * x)]).all()


@pytest.mark.parametrize("size", [1e-300, 1.0, 1e300])
def test_the_sizes_of_what_two_processes_have_do_not_overflow(size):
    z = size * np.array([1.0, -2.0 + 2.5j, -3.0j])
    both = Vectors(lambda number: [number, 2.0 * size])
    assert_allclose(both.norm(z), np.sqrt(24.25) * size)
    assert both.peak(z) == 3.0 * size
    assert both.peak(z[:1]) == 2.0 * size
