"""Inner products by rows: dense definitions, and the same bits on all processes."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from toeplitz_mg.engine.row_sums import PART, row_dots, rows_of
from toeplitz_mg.engine.vectors import Vectors


def share_of_rows(fields, mask, rows):
    """What a process has that has these rows: its vectors, and where their rows are."""
    shape = mask.shape
    some = mask[rows]
    vectors = [field[rows][some] for field in fields]
    return vectors, rows_of(shape, None if mask.all() else some)


class Told(Exception):
    """A process would wait here for what others gather."""


def dot_on_processes(shares, near=0.0):
    """Inner products by `Vectors` of each process, and what they have gathered until then."""
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
                results.append(Vectors(replay, rows).dot_near(x, y, near))
            except Told as number:
                told.append(*number.args)
        if results:
            return results, rounds
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
    alone = Vectors(None, rows).dot(x, y)
    sums = map(Fraction, row_dots(x, y, rows).tolist())
    assert alone == float(sum(sums))  # That of the rows is exact, and rounded once.
    ends = [0, *sorted(min(k, shape[0]) for k in cuts), shape[0]]
    parts = [share_of_rows(fields, mask, slice(*cut)) for cut in pairwise(ends)]
    assert set(dot_on_processes(parts)[0]) == {alone}


@pytest.mark.parametrize("share", [0.02, 0.6, 1.0])
@given(
    cuts=st.lists(st.integers(0, 20), max_size=3),
    size=st.floats(-300.0, 300.0),
    dtype=st.sampled_from([np.float32, np.float64]),
)
def test_inner_products_about_another_are_the_same_bits_too(share, cuts, size, dtype):
    """Also where they are not about it; where they are, each process tells one number."""
    rng = np.random.default_rng(0)
    fields = rng.standard_normal((2, 20, 100)).astype(dtype)
    mask = rng.random(fields.shape[1:]) < share
    (x, y), rows = share_of_rows(fields, mask, slice(None))
    ends = [0, *sorted(cuts), 20]
    parts = [share_of_rows(fields, mask, slice(*cut)) for cut in pairwise(ends)]
    sums = float(np.abs(row_dots(x, y, rows)).sum())
    for near in (sums, sums / 8.0, sums * 10.0**size):
        alone = Vectors(None, rows).dot_near(x, y, near)
        found, rounds = dot_on_processes(parts, near)
        assert set(found) == {alone}
        assert_allclose(alone, Vectors(None, rows).dot(x, y), rtol=1e-15, atol=1e-15 * near)
        if sums / 8.0 <= near <= 1e290:
            assert {type(number) for number in np.ravel(rounds).tolist()} == {int}
            assert len(rounds) == 1


def test_inner_products_by_rows():
    mask = np.random.default_rng(0).random((50, 64)) < 0.5
    fields = np.random.default_rng(1).random((2, 50, 64))
    for own in (mask, np.ones_like(mask)):
        (x, y), rows = share_of_rows(fields, own, slice(None))
        for dtype, rtol in ((np.float64, 1e-14), (np.float32, 1e-6)):
            expected = sum(map(Fraction, (x * y).tolist()))
            found = Vectors(None, rows).dot(x.astype(dtype), y.astype(dtype))
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
        for near in (0.0, 1.0):
            found, _ = dot_on_processes(parts, near)
            assert not np.isfinite([Vectors(None, rows).dot_near(x, y, near), *found]).any()
