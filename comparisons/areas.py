"""Contact areas, as masks on a grid: of rectangles the grid is the area."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def square(N: int) -> Array:
    """N x N elements."""
    return np.ones((N, N), dtype=bool)


def two_to_one(N: int) -> Array:
    """A rectangle of 2:1, N elements long."""
    return np.ones((N, N // 2), dtype=bool)


def four_to_one(N: int) -> Array:
    """A rectangle of 4:1, N elements long."""
    return np.ones((N, N // 4), dtype=bool)


def _radius(N: int) -> Array:
    """The distance of the element's centres from the middle, in half sides."""
    x = (2.0 * np.arange(N) + 1.0) / N - 1.0
    return np.hypot(x[:, None], x[None, :])


def circle(N: int) -> Array:
    """The elements whose centre is in a circle across the grid."""
    return np.asarray(_radius(N) < 1.0)


def annulus(N: int) -> Array:
    """That circle, without one of half its radius."""
    r = _radius(N)
    return np.asarray((r > 0.5) & (r < 1.0))


def rough(fraction: float, N: int, seed: int = 0) -> Array:
    """The highest part of a self-affine surface of Hurst exponent 0.8, in many islands."""
    q = np.hypot(np.fft.fftfreq(N)[:, None], np.fft.rfftfreq(N)[None, :]) * N
    # The same surface for all N, but for what is shorter than an element; rolled off below 4 waves.
    size = np.where(q > 0.0, np.maximum(q, 4.0), np.inf) ** -1.8
    rng = np.random.default_rng(seed)
    height = np.fft.irfft2(size * np.fft.rfft2(rng.standard_normal((N, N))), (N, N))
    return np.asarray(height > np.quantile(height, 1.0 - fraction))


AREAS: dict[str, Callable[[int], Array]] = {
    "square": square,
    "2:1": two_to_one,
    "4:1": four_to_one,
    "circle": circle,
    "annulus": annulus,
    "rough, 30 %": lambda N: rough(0.3, N),
}
