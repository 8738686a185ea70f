"""Random first columns of positive definite matrices, in any units, random grids and masks.

They are positive definite by what they are made of: a symbol that is nowhere negative, a
covariance, a dominant diagonal. Each comes of a generator, so that a seed gives it again.
"""

from collections.abc import Callable

import numpy as np
from numpy.random import Generator
from scipy import fft
from scipy.sparse.linalg import LinearOperator
from scipy.special import gamma, kv

from comparisons.systems.masks import restrict
from toeplitz_mg import ToeplitzOperator, halfspace
from toeplitz_mg._typing import Array

Shape = tuple[int, ...]


def log_uniform(rng: Generator, low: float, high: float) -> float:
    """Return a random number between these, all decades alike."""
    return float(10.0 ** rng.uniform(np.log10(low), np.log10(high)))


def random_grid(rng: Generator, unknowns: int, axes: int) -> Shape:
    """Return a grid of one to three axes with at most so many unknowns, also of one element."""
    shape = []
    left = float(max(unknowns, 1))
    for axis in range(axes, 0, -1):
        n = int(np.clip(round(left ** (1.0 / axis) * rng.uniform(0.5, 1.5)), 1, left))
        n = 1 if axes > 1 and rng.random() < 0.05 else n
        shape.append(n)
        left /= n
    rng.shuffle(shape)
    return tuple(shape)


def half_space(rng: Generator, shape: Shape) -> Array:
    """Return the influence of normal or tangential tractions, for elements of any shape."""
    element = (1.0, log_uniform(rng, 0.05, 20.0) * (100.0 if len(shape) == 1 else 1.0))
    x, y = halfspace.offsets((shape[0], shape[1] if len(shape) > 1 else 1), element)
    influence = halfspace.influence_zz if rng.random() < 0.5 else halfspace.influence_xx
    c = influence(x, y, element, G=1.0, nu=float(rng.uniform(0.0, 0.5)))
    return c.reshape(shape)


def matern(rng: Generator, shape: Shape) -> Array:
    """Return a stationary covariance: Matérn or Gaussian, with a nugget or without."""
    lengths = [log_uniform(rng, 0.2, 30.0) for _ in shape]
    r = np.sqrt(sum((k / s) ** 2 for k, s in zip(np.indices(shape), lengths, strict=True)))
    if rng.random() < 0.25:
        c = np.exp(-(r**2) / 2.0)
    else:
        order = rng.choice([0.5, 1.5, rng.uniform(0.3, 3.0)])
        safe = np.maximum(np.sqrt(2.0 * order) * r, 1e-9)
        c = 2.0 ** (1.0 - order) / gamma(order) * safe**order * kv(order, safe)
        c = np.where(r == 0.0, 1.0, c)
    c.flat[0] += log_uniform(rng, 1e-10, 1.0) if rng.random() < 0.9 else 0.0
    return c


def of_positive_symbol(rng: Generator, shape: Shape) -> Array:
    """Return the autocorrelation of a random array, even in each axis, and a part of I."""
    size = [int(rng.integers(1, n + 1)) for n in shape]
    a = rng.standard_normal(size) * np.exp(-np.indices(size).sum(axis=0) * rng.uniform(0.0, 1.0))
    power = np.abs(fft.fftn(a, [2 * n for n in shape])) ** 2
    for axis in range(len(shape)):  # It is made even in each axis.
        power = (power + np.roll(np.flip(power, axis), 1, axis)) / 2.0
    c = np.fft.ifftn(power).real[tuple(map(slice, shape))]
    c.flat[0] *= 1.0 + log_uniform(rng, 1e-8, 1.0)
    return c


def dominant(rng: Generator, shape: Shape) -> Array:
    """Return a dominant diagonal and a few coefficients of any sign at isolated lags."""
    c = np.zeros(shape)
    for k in rng.integers(0, c.size, size=rng.integers(1, 6)):
        c.flat[k] = rng.standard_normal()
    c.flat[0] = 0.0
    c.flat[0] = 2.0 ** len(shape) * np.abs(c).sum() * rng.uniform(1.0, 1.5) + 1e-3
    return c


def slow(rng: Generator, shape: Shape) -> Array:
    """Return coefficients that decay by a power of the distance."""
    r = np.sqrt(sum(k.astype(float) ** 2 for k in np.indices(shape)))
    c = (1.0 + r / log_uniform(rng, 0.3, 10.0)) ** -rng.uniform(0.2, 4.0)
    c.flat[0] *= 1.0 + log_uniform(rng, 1e-6, 1.0)
    return c


def differences(rng: Generator, shape: Shape) -> Array:
    """Return a difference operator of second order, nearly singular, or with the other sign."""
    c = np.zeros(shape)
    c.flat[0] = log_uniform(rng, 1e-9, 1.0)
    sign = rng.choice([-1.0, 1.0])
    for axis, n in enumerate(shape):
        if n > 1:
            weight = log_uniform(rng, 0.01, 1.0)
            c.flat[0] += 2.0 * weight
            c[tuple(int(axis == k) for k in range(len(shape)))] = sign * weight
    return c


POSITIVE: dict[str, Callable[[Generator, Shape], Array]] = {
    "half-space": half_space,
    "covariance": matern,
    "positive symbol": of_positive_symbol,
    "dominant diagonal": dominant,
    "slow decay": slow,
    "differences": differences,
}


def random_column(rng: Generator, shape: Shape) -> tuple[str, Array]:
    """Return the name of a family and the first column of a matrix of it, in any units.

    Nearly all are positive definite; those of `slow` need not be.
    """
    names = [name for name in POSITIVE if name != "half-space" or len(shape) <= 2]
    name = str(rng.choice(names))
    c = POSITIVE[name](rng, shape)
    return name, c * (log_uniform(rng, 1e-12, 1e12) if rng.random() < 0.3 else 1.0)


def random_mask(rng: Generator, shape: Shape) -> Array:
    """Return a mask: half of the times full, else by chance, of islands, one piece, or lines."""
    kind = rng.integers(8)
    height = rng.standard_normal(shape)
    if kind < 4:
        return np.ones(shape, dtype=bool)
    if kind == 4:
        mask = height > rng.uniform(-2, 1)
    elif kind == 5:  # The part of a smooth surface above some height.
        waves = np.meshgrid(*(np.fft.fftfreq(n) * n for n in shape), indexing="ij")
        rough = (1 + sum(k**2 for k in waves)) ** -rng.uniform(0.5, 1.2)
        height = fft.ifftn(rough * fft.fftn(height)).real
        mask = height > np.quantile(height, rng.uniform(0.05, 0.8))
    elif kind == 6:
        x = np.meshgrid(*(np.linspace(-1, 1, n) for n in shape), indexing="ij")
        mask = np.square(x).sum(axis=0) <= 1.0
    else:
        mask = np.zeros(shape, dtype=bool)
        mask[..., :: int(rng.integers(2, 4))] = True
    mask.flat[rng.integers(mask.size)] = True
    return mask


def random_matrix(seed: int) -> LinearOperator:
    """Return the random matrix of this number, most of them too large to be solved for directly."""
    rng = np.random.default_rng([15, seed])
    few, many = (700, 6000) if rng.random() < 0.85 else (1, 700)
    shape = random_grid(rng, int(log_uniform(rng, few, many)), int(rng.integers(1, 4)))
    names = [name for name in POSITIVE if name != "half-space" or len(shape) <= 2]
    c = POSITIVE[names[seed % len(names)]](rng, shape)
    c.flat[0] *= 1.0 + 1e-6  # What is known to rounding only is certain so.
    return restrict(ToeplitzOperator(c), random_mask(rng, shape))
