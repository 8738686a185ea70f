"""Sums over vectors are those of all their parts, whoever has them and however many there are.

Inner products by rows of a grid are exact sums of those of the rows, rounded once, so that they
have the same bits on one process and on several.
"""

from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from itertools import pairwise
from threading import Barrier

import numpy as np
import pytest
import scipy.fft
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from toeplitz_mg.engine.threads import WORTH_THREADS
from toeplitz_mg.engine.vectors import (
    PART,
    VECTORS,
    Vectors,
    add_combination,
    axpy,
    aypx,
    combine,
    dot,
    dots,
    norm,
)
from toeplitz_mg.slabs.row_vectors import RowVectors, row_dots, rows_of

SHAPES = [(1,), (3, 4, 5), (PART,), (PART + 1,), (2, PART, 3)]
DTYPES = [np.float32, np.float64, np.complex64, np.complex128]
each_dtype = pytest.mark.parametrize("dtype", DTYPES)


def vectors(k, shape, dtype):
    X = np.random.default_rng(0).random((k, *shape))
    if np.dtype(dtype).kind == "c":
        X = X + 1j * np.random.default_rng(1).random(X.shape)
    return X.astype(dtype)


@pytest.mark.parametrize("shape", SHAPES)
@each_dtype
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
    assert VECTORS.dot(X[0], X[1]) == dot(X[0], X[1])
    assert VECTORS.norm(X[0]) == norm(X[0])
    weights = np.arange(3.0) if double == np.float64 else np.array([0.0, 1.0, 2.0j])
    expected = X[1] + X.dtype.type(weights[2]) * X[2]
    assert_allclose(combine(weights, X), expected, rtol=rtol)
    assert combine(weights, X).dtype == dtype
    y = X[0].copy()
    add_combination(weights, X, y)
    assert_allclose(y, X[0] + expected, rtol=rtol)
    assert not combine(weights[:0], X[:0]).any()


@pytest.mark.parametrize("shape", SHAPES)
@each_dtype
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
    for n in (3, WORTH_THREADS):
        view, weights, X = np.ones(2 * n)[::2], np.ones(2), np.ones((2, n))
        for update in (
            lambda x, y: axpy(1.0, x, y),
            lambda x, y: aypx(1.0, x, y),
            lambda x, y, X=X, weights=weights: add_combination(weights, X, y),
        ):
            with pytest.raises(ValueError, match="y is not C-contiguous"):
                update(np.ones(n), view)
    with pytest.raises(ValueError, match="y is not C-contiguous"):
        axpy(1.0, np.ones((2, 3)), np.asfortranarray(np.ones((2, 3))))


@pytest.mark.parametrize("shape", [(WORTH_THREADS + 5,), (3, WORTH_THREADS // 2 + 1)])
@each_dtype
def test_long_vectors_are_updated_and_reduced_as_numpy_does(shape, dtype):
    """In pieces that threads share, the first and the last number too; with the same bits."""
    X = vectors(2, shape, dtype) - dtype(0.5)
    x, y = X
    rounding = {"rtol": 0, "atol": 100 * np.finfo(dtype).eps}
    weights = np.array([0.1, -2.3, 0.7])
    found = []
    for workers in (1, 2, 3):
        with scipy.fft.set_workers(workers):
            updated = axpy(0.3, x, y.copy()), aypx(0.3, x, y.copy())
            combined = combine(weights, np.stack([x, y, x]))
            numbers = np.array([dot(x, y), norm(y), *dots(X, y)])
            found.append([*updated, combined, numbers])
    for one in found[1:]:
        assert all(map(np.array_equal, one, found[0]))
    assert_allclose(updated[0], y + 0.3 * x, **rounding)
    assert_allclose(updated[1], x + 0.3 * y, **rounding)
    assert_allclose(combined, 0.8 * x - 2.3 * y, rtol=0, atol=1e3 * np.finfo(dtype).eps)
    if np.dtype(dtype).kind == "f":
        for k in (0, -1):
            spike = np.abs(x)
            spike.reshape(-1)[k] = 99.0
            assert VECTORS.max(spike) == 99.0 == -VECTORS.min(-spike)
            assert VECTORS.peak(-spike) == 99.0
            assert VECTORS.count(spike > 98.0) == 1
            assert_allclose(VECTORS.sum(spike), spike.sum(dtype=np.float64), rtol=1e-4)
        assert VECTORS.min(1.0 + np.abs(x)) >= 1.0
        assert VECTORS.max(-1.0 - np.abs(x)) <= -1.0


@pytest.mark.parametrize("n", [5, PART + 5, WORTH_THREADS])
@each_dtype
@pytest.mark.parametrize(("of_single", "of_double"), [(-80, -600), (-74, -537), (60, 600)])
def test_no_square_over_or_underflows_in_a_norm(n, dtype, of_single, of_double):
    """Squares of these numbers are zero, have lost their digits, or are not finite."""
    power = of_single if np.finfo(dtype).bits == 32 else of_double
    x = vectors(1, (n,), dtype)[0]
    exact = np.linalg.norm(x.astype(np.complex128))
    x *= x.dtype.type(2.0) ** power
    assert_allclose(norm(x), exact * 2.0**power, rtol=1e-5)
    for bad in (np.inf, np.nan):
        x[-2] = bad
        np.testing.assert_equal(norm(x), bad)


# Several processes --------------------------------------------------------------------------


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


@each_dtype
@pytest.mark.parametrize("cut", [0, 1, 40, PART + 60])
def test_two_processes_find_the_numbers_of_the_whole_vectors(dtype, cut):
    X = vectors(3, (2 * PART,), dtype) - dtype(0.5)

    def measure(of, k):
        x, y, z = X[:, cut:] if k else X[:, :cut]
        numbers = [of.dot(x, y), *of.dots(np.stack([x, y]), z), of.norm(x)]
        if x.dtype.kind == "f":
            numbers += [of.sum(x), of.min(x), of.max(x), of.count(x > 0.0)]
        return numbers

    x, y, z = X.astype(np.result_type(X, np.float64))
    exact = [np.vdot(x, y).real, np.vdot(x, z), np.vdot(y, z), np.linalg.norm(x)]
    if X.dtype.kind == "f":
        exact += [x.sum(), x.min(), x.max(), np.count_nonzero(x > 0.0)]
    of_0, of_1 = on_two_processes(measure)
    rtol = 1e-5 if np.finfo(dtype).bits == 32 else 1e-12
    assert of_0 == of_1
    assert_allclose(of_0, exact, rtol=rtol, atol=100 * rtol)


@pytest.mark.parametrize("workers", [1, 3])
@pytest.mark.parametrize("size", [5, 2 * WORTH_THREADS])
def test_a_number_that_is_none_is_the_least_and_the_largest_of_all(size, workers):
    """Wherever it is, and whichever process has it."""
    first, second = Vectors(lambda number: [number, 1.0]), Vectors(lambda number: [1.0, number])
    for of in (VECTORS, first, second):
        for k in (0, size - 1):
            x = np.random.default_rng(0).standard_normal(size)
            x[k] = np.nan
            with scipy.fft.set_workers(workers):
                assert np.isnan([of.min(x), of.max(x), of.peak(x), of.peak(1j * x)]).all()


@pytest.mark.parametrize("size", [1e-300, 1.0, 1e300])
def test_the_sizes_of_what_two_processes_have_do_not_overflow(size):
    z = size * np.array([1.0, -2.0 + 2.5j, -3.0j])
    both = Vectors(lambda number: [number, 2.0 * size])
    assert_allclose(both.norm(z), np.sqrt(24.25) * size)
    assert both.peak(z) == 3.0 * size
    assert both.peak(z[:1]) == 2.0 * size


# By rows ------------------------------------------------------------------------------------


def share_of_rows(fields, mask, rows):
    """What a process has that has these rows: its vectors, and where their rows are."""
    shape = mask.shape
    some = mask[rows]
    vectors = [field[rows][some] for field in fields]
    return vectors, rows_of(shape, None if mask.all() else some)


class Told(Exception):
    """A process would wait here for what others gather."""


def dot_alone(x, y, rows):
    return RowVectors(lambda number: [number], rows).dot(x, y)


def dot_on_processes(shares):
    """Inner products by `RowVectors` of each process."""
    rounds = []

    def replay(number):
        if len(said) == len(rounds):
            raise Told(number)
        said.append(number)
        return rounds[len(said) - 1]

    while True:
        results, told = [], []
        for (x, y), rows in shares:
            said = []
            try:
                results.append(RowVectors(replay, rows).dot(x, y))
            except Told as number:
                told.append(*number.args)
        if results:
            return results
        rounds.append(told)


@pytest.mark.parametrize("shape", [(20, 32), (12, 100), (2, 9, 40), (3, PART + 2)])
@pytest.mark.parametrize("share", [0.02, 0.6, 1.0])
@settings(max_examples=30)
@given(cuts=st.lists(st.integers(0, 20), max_size=3))
def test_inner_products_by_rows_are_the_same_bits_on_all_processes(shape, share, cuts):
    rng = np.random.default_rng(0)
    fields = rng.standard_normal((2, *shape)) * 10.0 ** rng.integers(-9, 9, (2, *shape))
    mask = rng.random(shape) < share
    (x, y), rows = share_of_rows(fields, mask, slice(None))
    alone = dot_alone(x, y, rows)
    sums = map(Fraction, row_dots(x, y, rows).tolist())
    assert alone == float(sum(sums))  # That of the rows is exact, and rounded once.
    ends = [0, *sorted(min(k, shape[0]) for k in cuts), shape[0]]
    parts = [share_of_rows(fields, mask, slice(*cut)) for cut in pairwise(ends)]
    assert set(dot_on_processes(parts)) == {alone}


def test_inner_products_by_rows():
    mask = np.random.default_rng(0).random((50, 64)) < 0.5
    fields = np.random.default_rng(1).random((2, 50, 64))
    for own in (mask, np.ones_like(mask)):
        (x, y), rows = share_of_rows(fields, own, slice(None))
        for dtype, rtol in ((np.float64, 1e-14), (np.float32, 1e-6)):
            expected = sum(map(Fraction, (x * y).tolist()))
            found = dot_alone(x.astype(dtype), y.astype(dtype), rows)
            assert_allclose(found, float(expected), rtol=rtol)


def test_fields_without_rows():
    """Lines, short rows, and rows that are too long and have no pieces of one length."""
    assert [rows_of(s) for s in ((999,), (1, 999), (99, 31), (9, 8209))] == [None] * 4
    assert [rows_of(s) for s in ((9, 32), (2, 9, PART), (9, 2 * PART))] == [32, PART, PART]


@pytest.mark.parametrize("size", [1e200, np.inf, np.nan])
@pytest.mark.parametrize("share", [0.9, 1.0])
def test_inner_products_by_rows_that_are_not_finite(size, share):
    fields = np.ones((2, 9, 32))
    fields[:, 0, 5] = fields[0, 8, 5] = size
    fields[1, 8, 5] = -size
    mask = np.random.default_rng(1).random((9, 32)) < share
    mask[:, 5] = True
    with np.errstate(over="ignore", invalid="ignore"):
        parts = [share_of_rows(fields, mask, slice(*cut)) for cut in ((0, 3), (3, 9))]
        (x, y), rows = share_of_rows(fields, mask, slice(None))
        assert not np.isfinite([dot_alone(x, y, rows), *dot_on_processes(parts)]).any()
