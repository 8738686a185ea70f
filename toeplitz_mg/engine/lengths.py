"""Lengths whose transforms are fast."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import count
from math import isqrt

from scipy.fft import next_fast_len

# Prime factors of the lengths whose transforms are called fast.
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61)
# Sum of prime factors that takes as long as what is done for each number whatever the factors are.
PASSES_OF_ANY = 40


def near_fast_length(n: int) -> int:
    """Return the next length whose transform is not slow, but not always among the fastest.

    No prime factor is above 61. The next length without one above 5 may be some percent longer.
    """
    return next(m for m in count(n) if _is_fast(m))


def _is_fast(m: int) -> bool:
    return max(prime_factors(m), default=1) <= PRIMES[-1]


def work_of_transform(m: int) -> int:
    """Return what the time of a transform of length m is in proportion to, nearly.

    Each prime factor is a pass over all numbers, with as many operations for each. What is done
    before and behind these passes takes as long for any factors.
    """
    return m * (PASSES_OF_ANY + sum(prime_factors(m)))


def prime_factors(m: int) -> list[int]:
    """Return the prime factors, and what is left where one of them is too large to look for."""
    found = []
    for p in PRIMES:
        while m % p == 0:
            m //= p
            found.append(p)
    return [*found, m] if m > 1 else found


def embedding_lengths(grid_shape: Sequence[int], *, is_complex: bool = False) -> tuple[int, ...]:
    """Return the lengths of the transforms along each axis for a product on a grid.

    All axes but the last are extended by zeros; of a complex matrix the last one too.
    """
    *others, last = grid_shape
    last = 2 * last - 1 if is_complex else last
    return (*(next_fast_len(2 * n - 1) for n in others), next_fast_len(last))


@lru_cache(maxsize=64)
def near_square(length: int) -> tuple[int, int]:
    """Return two fast lengths, not far from each other, whose product is hardly above `length`."""
    root = isqrt(length)
    shapes = []
    rows = next_fast_len(max(1, root // 2))
    while rows <= 2 * root + 1:
        shapes.append((rows, next_fast_len(-(-length // rows))))
        rows = next_fast_len(rows + 1)
    # Fewer rows have longer pieces in a panel.
    return min(shapes, key=lambda s: (s[0] * s[1], abs(s[0] - 2 * root // 3)))
