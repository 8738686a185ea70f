"""Transform lengths that are fast."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import count
from math import isqrt

from scipy.fft import next_fast_len

# Prime factors that a fast length may have.
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61)
# Cost per number that does not depend on the length, in units of one prime factor's value.
PASSES_OF_ANY = 40


def near_fast_length(n: int) -> int:
    """Return the least length ≥ n without prime factors above 61.

    Lengths without prime factors above 5 are faster, but the next one may be some percent longer.
    """
    return next(m for m in count(n) if _is_fast(m))


def _is_fast(m: int) -> bool:
    return max(prime_factors(m), default=1) <= PRIMES[-1]


def work_of_transform(m: int) -> int:
    """Return the work of a transform of length m, roughly proportional to its time.

    Each prime factor p is a pass over all numbers with p operations for each. The work before and
    after these passes does not depend on the factors.
    """
    return m * (PASSES_OF_ANY + sum(prime_factors(m)))


def prime_factors(m: int) -> list[int]:
    """Return the prime factors up to 61, and the remaining cofactor if it is not 1."""
    found = []
    for p in PRIMES:
        while m % p == 0:
            m //= p
            found.append(p)
    return [*found, m] if m > 1 else found


def embedding_lengths(grid_shape: Sequence[int], *, is_complex: bool = False) -> tuple[int, ...]:
    """Return the transform lengths along each axis for a product on a grid.

    All axes except the last are extended by zeros; if the matrix is complex, the last one too.
    """
    *others, last = grid_shape
    last = 2 * last - 1 if is_complex else last
    return (*(next_fast_len(2 * n - 1) for n in others), next_fast_len(last))


@lru_cache(maxsize=64)
def near_square(length: int) -> tuple[int, int]:
    """Return two fast lengths of similar size whose product is at least, but close to, `length`."""
    root = isqrt(length)
    shapes = []
    rows = next_fast_len(max(1, root // 2))
    while rows <= 2 * root + 1:
        shapes.append((rows, next_fast_len(-(-length // rows))))
        rows = next_fast_len(rows + 1)
    # Prefer fewer rows than columns: panels then contain longer pieces of each row.
    return min(shapes, key=lambda s: (s[0] * s[1], abs(s[0] - 2 * root // 3)))
