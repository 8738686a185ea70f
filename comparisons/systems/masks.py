"""Contact areas, as masks on a grid."""

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg import MaskedOperator
from toeplitz_mg._typing import Array, Mask


def restrict(full: LinearOperator, mask: Mask) -> LinearOperator:
    """Return the matrix on a mask, or as it is where the mask leaves nothing out."""
    return full if mask.all() else MaskedOperator(full, mask)


def _radius(N: int) -> Array:
    """Return the distances of the elements' centres from the middle, in half sides."""
    x = (2.0 * np.arange(N) + 1.0) / N - 1.0
    return np.hypot(x[:, None], x[None, :])


def circle(N: int) -> Array:
    """Return the mask of the elements whose centre is in a circle across the grid."""
    return _radius(N) < 1.0


def rough(fraction: float, N: int, seed: int = 0) -> Array:
    """Return the highest part of a self-affine surface, Hurst exponent 0.8, in many islands."""
    q = np.hypot(np.fft.fftfreq(N)[:, None], np.fft.rfftfreq(N)[None, :]) * N
    # The surface is the same for all N, up to what is shorter than an element. Waves longer than a
    # quarter of the side are not higher than that one.
    size = np.where(q > 0.0, np.maximum(q, 4.0), np.inf) ** -1.8
    rng = np.random.default_rng(seed)
    height = np.fft.irfft2(size * np.fft.rfft2(rng.standard_normal((N, N))), (N, N))
    return height > np.quantile(height, 1.0 - fraction)


def random(fraction: float, N: int) -> Array:
    """Return a mask that each element is in by chance."""
    return np.random.default_rng(1).random((N, N)) < fraction


def two_patches(N: int) -> Array:
    """Return the mask of two small circles in opposite corners."""
    x = (2.0 * np.arange(N) + 1.0) / N - 1.0
    corners = [np.hypot(x[:, None] - a, x[None, :] - a) < 0.15 for a in (-0.8, 0.8)]
    return corners[0] | corners[1]


FRAGMENTED: dict[str, Callable[[int], Array]] = {
    "full": lambda N: np.ones((N, N), dtype=bool),
    "circle": circle,
    "annulus": lambda N: circle(N) & (_radius(N) > 0.5),
    "two patches": two_patches,
    "one line": lambda N: np.tile((np.arange(N) == N // 2)[:, np.newaxis], N),
    **{f"rough, {share} %": partial(rough, share / 100) for share in (1, 5, 30, 60, 99)},
    "random, 50 %": partial(random, 0.5),
    "stripes": lambda N: np.tile(np.arange(N) % 2 == 0, (N, 1)),  # Every other line.
    "checkerboard": lambda N: np.indices((N, N)).sum(axis=0) % 2 == 0,
}


def islands(number: int, n: int) -> Array:
    """Return the mask of intervals at random places of one axis, that cover half of it."""
    ends = np.sort(np.random.default_rng(2).choice(n, 2 * number, replace=False))
    return np.searchsorted(ends, np.arange(n), side="right") % 2 == 1


ON_A_LINE: dict[str, Callable[[int], Array]] = {
    "paper's test 3": lambda n: (np.arange(n) // (n // 8)) % 8 != 3,
    "100 islands": partial(islands, 100),
    "n/100 islands": lambda n: islands(n // 100, n),
    "random line, 50 %": lambda n: np.random.default_rng(1).random(n) < 0.5,
}
