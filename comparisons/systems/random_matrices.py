"""Random symmetric positive definite matrices, made from a seed, and random masks.

They are positive definite by what they are made of: a symbol that is nowhere negative, a
covariance, a dominant diagonal. Those of `random_ones` are operators on a part of a grid, of any
symbol; those of `random_column` are first columns, in any units.
"""

from collections.abc import Callable, Iterator
from functools import partial
from math import prod

import numpy as np
from numpy.random import Generator
from scipy import fft
from scipy.sparse.linalg import LinearOperator
from scipy.special import gamma, kv

from comparisons.systems.masks import restrict
from comparisons.systems.matrices import COVARIANCES, Case, Shape, distances
from toeplitz_mg import ToeplitzOperator, halfspace
from toeplitz_mg._typing import Array


def random_spikes(rng: Generator, shape: Shape) -> ToeplitzOperator:
    """Return a matrix of some coefficients at any lags."""
    c = np.zeros(shape)
    number = int(rng.integers(1, 7))
    c.flat[rng.integers(0, c.size, number)] = rng.standard_normal(number)
    return with_a_diagonal(rng, c)


def with_a_diagonal(rng: Generator, c: Array) -> ToeplitzOperator:
    """Return the matrix whose symbol is nowhere negative, by a diagonal hardly larger than that."""
    c.flat[0] = 0.0
    lowest = fft.fftn(ToeplitzOperator(c).circulant(tuple(2 * n for n in c.shape))).real.min()
    c.flat[0] = 1e-9 - lowest * (1 + 10.0 ** -rng.uniform(-1, 5))
    return ToeplitzOperator(c)


def random_symbol(rng: Generator, shape: Shape) -> ToeplitzOperator:
    """Return a matrix whose symbol is the exponential of a random function, smooth or rough."""
    lengths = tuple(2 * n for n in shape)
    waves = np.meshgrid(*(np.fft.fftfreq(m) * m for m in lengths), indexing="ij")
    # The function is smooth where long waves are much larger than short ones.
    size = (1.0 + sum(k**2 for k in waves)) ** -rng.uniform(0.2, 2.0)
    f = fft.ifftn(size * fft.fftn(rng.standard_normal(lengths))).real
    f = (f + np.roll(np.flip(f), 1, tuple(range(f.ndim)))) / 2  # So it is even: f(-θ) = f(θ).
    f *= rng.uniform(0.2, 2.0) / f.std()
    return of_samples(np.exp(f), shape)


def random_powers(rng: Generator, shape: Shape) -> ToeplitzOperator:
    """Return a matrix whose symbol has a zero or a pole anywhere, and a constant."""
    lengths = tuple(2 * n for n in shape)
    f = np.zeros(lengths)
    for axis, m in enumerate(lengths):
        theta = 2 * np.pi * np.arange(m) / m
        at = rng.choice([0.0, np.pi, rng.uniform(0, np.pi)])
        wave = abs(4 * np.sin((theta - at) / 2) * np.sin((theta + at) / 2)) + 1.0 / m**2
        f += rng.uniform(0.1, 1.0) * wave.reshape([-1 if k == axis else 1 for k in range(f.ndim)])
    return of_samples(f ** rng.uniform(-0.45, 2.0) + 10.0 ** -rng.uniform(0, 6), shape)


def of_samples(f: Array, shape: Shape) -> ToeplitzOperator:
    """Return the matrix whose circulant of twice the size has these eigenvalues."""
    lags = fft.ifftn(f).real
    for axis, n in enumerate(shape):
        lags = np.take(lags, np.arange(1 - n, n), axis)
    return ToeplitzOperator.from_lags((lags + np.flip(lags)) / 2)


def random_waves(rng: Generator, shape: Shape) -> ToeplitzOperator:
    """Return a covariance of plane waves with or without damping, and a nugget."""
    k = np.stack(np.meshgrid(*(np.arange(1.0 - n, n) for n in shape), indexing="ij"), axis=-1)
    lags = np.zeros(k.shape[:-1])
    for _ in range(rng.integers(1, 6)):
        damped = np.exp(-np.abs(k) @ rng.uniform(0, 3, len(shape)) / max(shape))
        lags += rng.exponential() * damped * np.cos(k @ rng.uniform(0, np.pi, len(shape)))
    lags[tuple(n - 1 for n in shape)] += 10.0 ** -rng.uniform(-1, 6)
    return ToeplitzOperator.from_lags((lags + np.flip(lags)) / 2)


def random_covariance(rng: Generator, shape: Shape) -> ToeplitzOperator:
    """Return a covariance of any smoothness, stretched and turned, and a nugget."""
    k = np.stack(np.meshgrid(*(np.arange(1.0 - n, n) for n in shape), indexing="ij"), axis=-1)
    axes = len(shape)
    turned = rng.standard_normal((axes, axes)) if rng.random() < 0.5 else np.eye(axes)
    length = np.exp(rng.uniform(np.log(0.5), np.log(2.0 * max(shape)), axes))
    r = np.linalg.norm(k @ turned / length, axis=-1)
    kind = rng.integers(4)
    if kind == 3:  # It is the rational quadratic covariance.
        lags = (1 + r**2) ** -rng.uniform(0.2, 3.0)
    else:
        lags = list(COVARIANCES.values())[kind](r)
    lags[tuple(n - 1 for n in shape)] += 10.0 ** -rng.uniform(0, 6)
    return ToeplitzOperator.from_lags((lags + np.flip(lags)) / 2)


def random_signs(rng: Generator, shape: Shape) -> ToeplitzOperator:
    """Return a matrix of any signs that decays or does not, its diagonal just large enough."""
    c = rng.standard_normal(shape) * (1 + distances(shape)) ** -rng.uniform(0, 3)
    return with_a_diagonal(rng, c)


KERNELS = {
    "spikes": random_spikes,
    "symbol": random_symbol,
    "powers": random_powers,
    "waves": random_waves,
    "covariance": random_covariance,
    "signs": random_signs,
}


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
    """Return the random matrix of this number."""
    rng = np.random.default_rng([15, seed])
    axes = int(rng.integers(1, 4))
    # Most are too large to be solved for directly.
    few, many = (700.0, 6000.0) if rng.random() < 0.85 else (1.0, 700.0)
    elements = np.exp(rng.uniform(np.log(few), np.log(many)))
    sides = np.exp(rng.uniform(-0.7, 0.7, axes))
    sides *= (elements / prod(sides)) ** (1 / axes)
    shape = tuple(max(1, round(side)) for side in sides)
    kernel = list(KERNELS.values())[seed % len(KERNELS)]
    return restrict(kernel(rng, shape), random_mask(rng, shape))


def random_ones(number: int) -> Iterator[Case]:
    """Yield so many random matrices."""
    for seed in range(number):
        family = list(KERNELS)[seed % len(KERNELS)]
        yield Case(f"random {family}", f"seed {seed}", partial(random_matrix, seed))


# First columns --------------------------------------------------------------------------------


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
    """Return a stationary covariance: Matérn, exponential or Gaussian, with a nugget."""
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
    return c


def of_positive_symbol(rng: Generator, shape: Shape) -> Array:
    """Return the autocorrelation of a random array, even in each axis, and a part of I."""
    size = [int(rng.integers(1, n + 1)) for n in shape]
    a = rng.standard_normal(size) * np.exp(-np.indices(size).sum(axis=0) * rng.uniform(0.0, 1.0))
    power = np.abs(np.fft.fftn(a, [2 * n for n in shape])) ** 2
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
