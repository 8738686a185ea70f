"""Lengths of transforms are fast, and hardly longer than they must be."""

import pytest
from scipy.fft import next_fast_len

from toeplitz_mg.engine.lengths import embedding_lengths, near_fast_length, near_square


def largest_prime_factor(n):
    p = 2
    while p * p <= n:
        if n % p:
            p += 1
        else:
            n //= p
    return n


def test_a_near_fast_length_is_the_next_without_a_prime_factor_above_61():
    for n in [*range(1, 700), 4093, 65537, 10**6 + 3]:
        m = near_fast_length(n)
        assert n <= m <= 1.06 * n
        assert largest_prime_factor(m) <= 61
        assert all(largest_prime_factor(k) > 61 for k in range(n, m))


@pytest.mark.parametrize("grid_shape", [(1,), (7, 1), (101, 64), (13, 4093, 33)], ids=str)
def test_all_axes_but_the_last_are_extended_by_zeros(grid_shape):
    *others, last = zip(grid_shape, embedding_lengths(grid_shape), strict=True)
    assert last[1] >= last[0]
    assert all(length >= 2 * n - 1 for n, length in others)
    assert all(next_fast_len(length) == length for _, length in (*others, last))


@pytest.mark.parametrize("length", [1, 2, 1000, 2**15, 99991, 10**6 + 3, 2**24])
def test_two_near_factors_are_fast_and_hardly_longer(length):
    rows, columns = near_square(length)
    assert length <= rows * columns <= max(1.02 * length, length + 1)
    assert all(next_fast_len(n) == n for n in (rows, columns))
    assert max(rows, columns) <= 5 * min(rows, columns) + 1
