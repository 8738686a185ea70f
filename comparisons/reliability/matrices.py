"""Random matrices for the campaign: symmetric positive definite ones, and others, of any size."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.special import gamma, kv

import toeplitz_mg as tmg
from toeplitz_mg import halfspace

Array = NDArray[np.float64]
Generator = np.random.Generator


def log_uniform(rng: Generator, low: float, high: float) -> float:
    """A number between these, all decades alike."""
    return float(10.0 ** rng.uniform(np.log10(low), np.log10(high)))


def grid(rng: Generator, unknowns: int, axes: int) -> tuple[int, ...]:
    """A grid of one to three axes with at most so many unknowns, single elements among them."""
    shape = []
    left = float(max(unknowns, 1))
    for axis in range(axes, 0, -1):
        n = int(np.clip(round(left ** (1.0 / axis) * rng.uniform(0.5, 1.5)), 1, left))
        n = 1 if axes > 1 and rng.random() < 0.05 else n
        shape.append(n)
        left /= n
    rng.shuffle(shape)
    return tuple(shape)


def half_space(rng: Generator, shape: tuple[int, ...]) -> Array:
    """The influence of normal or tangential tractions, for elements of any shape."""
    element = (1.0, log_uniform(rng, 0.05, 20.0) * (100.0 if len(shape) == 1 else 1.0))
    x, y = halfspace.offsets((shape[0], shape[1] if len(shape) > 1 else 1), element)
    influence = halfspace.influence_zz if rng.random() < 0.5 else halfspace.influence_xx
    c = influence(x, y, element, G=1.0, nu=float(rng.uniform(0.0, 0.5)))
    return np.asarray(c, dtype=np.float64).reshape(shape)


def covariance(rng: Generator, shape: tuple[int, ...]) -> Array:
    """A stationary covariance: Matérn, exponential or Gaussian, with a nugget."""
    lengths = [log_uniform(rng, 0.2, 30.0) for _ in shape]
    r = np.sqrt(sum((k / s) ** 2 for k, s in zip(np.indices(shape), lengths, strict=True)))
    kind = rng.integers(4)
    if kind == 0:
        c = np.exp(-(r**2) / 2.0)
    elif kind == 1:
        c = np.exp(-r)
    elif kind == 2:
        c = (1.0 + r) * np.exp(-r)
    else:
        order = rng.uniform(0.3, 3.0)
        safe = np.maximum(np.sqrt(2.0 * order) * r, 1e-9)
        c = 2.0 ** (1.0 - order) / gamma(order) * safe**order * kv(order, safe)
        c = np.where(r == 0.0, 1.0, c)
    c.flat[0] += log_uniform(rng, 1e-10, 1.0) if rng.random() < 0.9 else 0.0
    return np.asarray(c)


def of_positive_symbol(rng: Generator, shape: tuple[int, ...]) -> Array:
    """The autocorrelation of a random array, even in each axis, and a part of the unit matrix."""
    size = [int(rng.integers(1, n + 1)) for n in shape]
    a = rng.standard_normal(size) * np.exp(-np.indices(size).sum(axis=0) * rng.uniform(0.0, 1.0))
    power = np.abs(np.fft.fftn(a, [2 * n for n in shape])) ** 2
    for axis in range(len(shape)):  # even in each axis
        power = (power + np.roll(np.flip(power, axis), 1, axis)) / 2.0
    c = np.fft.ifftn(power).real[tuple(map(slice, shape))]
    c.flat[0] *= 1.0 + log_uniform(rng, 1e-8, 1.0)
    return np.asarray(c)


def dominant(rng: Generator, shape: tuple[int, ...]) -> Array:
    """A dominant diagonal and a few coefficients of any sign at isolated lags."""
    c = np.zeros(shape)
    for k in rng.integers(0, c.size, size=rng.integers(1, 6)):
        c.flat[k] = rng.standard_normal()
    c.flat[0] = 0.0
    c.flat[0] = 2.0 ** len(shape) * np.abs(c).sum() * rng.uniform(1.0, 1.5) + 1e-3
    return c


def slow(rng: Generator, shape: tuple[int, ...]) -> Array:
    """Coefficients that decay by a power of the distance."""
    r = np.sqrt(sum(k.astype(float) ** 2 for k in np.indices(shape)))
    c = (1.0 + r / log_uniform(rng, 0.3, 10.0)) ** -rng.uniform(0.2, 4.0)
    c.flat[0] *= 1.0 + log_uniform(rng, 1e-6, 1.0)
    return np.asarray(c)


def differences(rng: Generator, shape: tuple[int, ...]) -> Array:
    """A difference operator of second order, nearly singular, or with the other sign."""
    c = np.zeros(shape)
    c.flat[0] = log_uniform(rng, 1e-9, 1.0)
    sign = rng.choice([-1.0, 1.0])
    for axis, n in enumerate(shape):
        if n > 1:
            weight = log_uniform(rng, 0.01, 1.0)
            c.flat[0] += 2.0 * weight
            c[tuple(int(axis == k) for k in range(len(shape)))] = sign * weight
    return c


POSITIVE: dict[str, Callable[[Generator, tuple[int, ...]], Array]] = {
    "half-space": half_space,
    "covariance": covariance,
    "positive symbol": of_positive_symbol,
    "dominant diagonal": dominant,
    "slow decay": slow,
    "differences": differences,
}


def positive(rng: Generator, shape: tuple[int, ...]) -> tuple[str, Array]:
    """The name of a family and the first column of a matrix of it, in any units.

    Nearly all are positive definite; `slow` need not be.
    """
    names = [name for name in POSITIVE if name != "half-space" or len(shape) <= 2]
    name = str(rng.choice(names))
    c = POSITIVE[name](rng, shape)
    return name, c * (log_uniform(rng, 1e-12, 1e12) if rng.random() < 0.3 else 1.0)


def area(rng: Generator, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """A mask: random elements, a disc, a comb, or runs."""
    points = np.indices(shape)
    kind = rng.integers(4)
    if kind == 0:
        mask = rng.random(shape) < rng.uniform(0.05, 0.95)
    elif kind == 1:
        middle = [(n - 1) / 2.0 for n in shape]
        far = [((k - m) / (m + 1.0)) ** 2 for k, m in zip(points, middle, strict=True)]
        mask = np.sum(far, axis=0) < rng.uniform(0.2, 1.5)
    elif kind == 2:
        mask = points.sum(axis=0) % rng.integers(2, 6) != 0
    else:
        mask = points[0] // rng.integers(1, 6) % 2 == 0
    mask.flat[rng.integers(mask.size)] = True
    return np.asarray(mask)


def dense(A: tmg.ToeplitzOperator | tmg.MaskedOperator | tmg.CoupledOperator) -> Array:
    """The matrix by its entries, free of transforms."""
    return np.asarray(A.toarray(), dtype=np.float64)
