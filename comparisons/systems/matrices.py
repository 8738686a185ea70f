"""Symmetric positive definite matrices of one to three axes: typical ones, and random ones.

Each comes with the name of its family. Random ones are made from a seed, and positive definite by
what they are made of: a symbol that is nowhere negative, a covariance, a dominant diagonal.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import prod

import numpy as np
from scipy import fft
from scipy.sparse.linalg import LinearOperator

from comparisons.systems import masks
from comparisons.systems.punch import KINDS, influence
from comparisons.systems.symbols import column, fourier
from toeplitz_mg import MaskedOperator, ToeplitzOperator
from toeplitz_mg._typing import Array

Shape = tuple[int, ...]


@dataclass(frozen=True)
class Case:
    """A matrix, not built yet."""

    family: str
    name: str
    operator: Callable[[], LinearOperator]


def restricted(full: LinearOperator, mask: Array) -> LinearOperator:
    """Return the matrix on a mask, or as it is where the mask leaves nothing out."""
    return full if mask.all() else MaskedOperator(full, mask)


# Typical ones -------------------------------------------------------------------------------

GRIDS: dict[str, Shape] = {"line": (2000,), "40 x 40": (40, 40), "12 x 12 x 12": (12, 12, 12)}
LENGTHS = (2.0, 5.0, 10.0, 30.0, 100.0)  # of correlation, in elements
NUGGETS = (1e-2, 1e-4)
ELEMENTS = (1.0, 0.25, 4.0, 20.0, 100.0)  # their shape
AREAS = ("full", "circle", "rough, 30 %", "random, 50 %", "stripes")
COVARIANCES: dict[str, Callable[[Array], Array]] = {
    "Matérn 1/2": lambda r: np.exp(-r),
    "Matérn 3/2": lambda r: (1 + np.sqrt(3.0) * r) * np.exp(-np.sqrt(3.0) * r),
    "Gaussian": lambda r: np.exp(-(r**2) / 2),
}


def distances(shape: Shape) -> Array:
    """The distance from the first element."""
    return np.asarray(np.sqrt((np.indices(shape) ** 2).sum(axis=0)))


def half_space(kind: str, ratio: float, area: str) -> LinearOperator:
    """A contact area of elements of some shape."""
    return influence(kind, masks.FRAGMENTED[area](48), (1.0, ratio))


def some_of(shape: Shape, share: float) -> Array:
    """A mask of this share of the elements, by chance."""
    mask = np.random.default_rng(7).random(shape) <= share
    mask.flat[0] = True
    return np.asarray(mask)


def of_column(c: Array, share: float = 1.0) -> LinearOperator:
    """The matrix of a first column, on all elements or a share of them."""
    return restricted(ToeplitzOperator(c), some_of(c.shape, share))


def of_symbol(name: str, share: float) -> LinearOperator:
    """One of the matrices that are known by the name of their symbol."""
    return of_column(column(name, 1500), share)


def covariance(
    name: str, length: float, nugget: float, shape: Shape, share: float
) -> LinearOperator:
    """A stationary covariance, on all of a grid or with gaps."""
    c = COVARIANCES[name](distances(shape) / length)
    c.flat[0] += nugget
    return of_column(c, share)


def noise(hurst: float, n: int, share: float) -> LinearOperator:
    """Fractional Gaussian noise."""
    k, power = np.arange(float(n)), 2 * hurst
    return of_column(((k + 1) ** power - 2 * k**power + abs(k - 1) ** power) / 2, share)


def laplacian(alpha: float, shift: float, shape: Shape, share: float) -> LinearOperator:
    """The sum over the axes of the powers |2 sin θ/2|^α, and a shift."""
    c = np.zeros(shape)
    for axis, n in enumerate(shape):
        line = [0] * len(shape)
        line[axis] = slice(None)  # type: ignore[call-overload]
        c[tuple(line)] += fourier(lambda t: abs(2 * np.sin(t / 2)) ** alpha, n)
    c.flat[0] += shift
    return of_column(c, share)


def spikes(parts: tuple[float, ...], shape: Shape, share: float) -> LinearOperator:
    """Few coefficients, at isolated lags: these parts of the lengths of a grid."""
    c = np.zeros(shape)
    for k, part in enumerate(parts):
        c[tuple(int(part * n) for n in shape)] = (-1.0) ** k / (k + 1)
    c.flat[0] = 1.05 * 2 ** len(shape) * np.abs(c).sum()
    return of_column(c, share)


def typical() -> Iterator[Case]:
    """Yield 250 matrices as they come in practice."""
    for kind, ratio, area in product(KINDS, ELEMENTS, AREAS):
        name = f"{kind}, elements 1:{ratio:g}, {area}"
        yield Case("half-space", name, partial(half_space, kind, ratio, area))
    for name, length, nugget in product(COVARIANCES, LENGTHS, NUGGETS):
        for grid, share in (*((grid, 1.0) for grid in GRIDS), ("40 x 40", 0.6)):
            title = f"{name}, length {length:g}, nugget {nugget:g}, {share:.0%} of {grid}"
            matrix = partial(covariance, name, length, nugget, GRIDS[grid], share)
            yield Case("covariance", title, matrix)
    for hurst, n, share in product((0.6, 0.75, 0.9), (1000, 3000), (1.0, 0.7)):
        title = f"H = {hurst}, {share:.0%} of {n}"
        yield Case("fractional noise", title, partial(noise, hurst, n, share))
    for alpha, shift, grid in product((1.0, 1.5, 2.0), (0.0, 1e-2), GRIDS):
        title = f"α = {alpha}, shift {shift:g}, {grid}"
        yield Case("Laplacian", title, partial(laplacian, alpha, shift, GRIDS[grid], 1.0))
    for parts, grid, share in product(((0.3,), (0.1, 0.5, 0.95), (0.02, 0.4)), GRIDS, (1.0, 0.7)):
        title = f"at {parts} of the lengths, {share:.0%} of {grid}"
        yield Case("spikes", title, partial(spikes, parts, GRIDS[grid], share))
    names = ("contact", "(1+k)^-1.1", "cos k/(k+1)")
    for name, share in (*product(names, (1.0, 0.8)), ("1/(1 + k²/100)", 1.0)):
        yield Case("symbol", f"{name}, {share:.0%} of 1500", partial(of_symbol, name, share))


# Random ones --------------------------------------------------------------------------------


def random_spikes(rng: np.random.Generator, shape: Shape) -> ToeplitzOperator:
    """Some coefficients at any lags."""
    c = np.zeros(shape)
    number = int(rng.integers(1, 7))
    c.flat[rng.integers(0, c.size, number)] = rng.standard_normal(number)
    return with_a_diagonal(rng, c)


def with_a_diagonal(rng: np.random.Generator, c: Array) -> ToeplitzOperator:
    """Return the matrix whose symbol is nowhere negative, by a diagonal hardly larger than that."""
    c.flat[0] = 0.0
    lowest = fft.fftn(ToeplitzOperator(c).circulant(tuple(2 * n for n in c.shape))).real.min()
    c.flat[0] = 1e-9 - lowest * (1 + 10.0 ** -rng.uniform(-1, 5))
    return ToeplitzOperator(c)


def random_symbol(rng: np.random.Generator, shape: Shape) -> ToeplitzOperator:
    """The exponential of a random function of θ, smooth or rough."""
    lengths = tuple(2 * n for n in shape)
    waves = np.meshgrid(*(np.fft.fftfreq(m) * m for m in lengths), indexing="ij")
    # All that has fewer waves than some, in either direction.
    size = (1.0 + sum(k**2 for k in waves)) ** -rng.uniform(0.2, 2.0)
    f = fft.ifftn(size * fft.fftn(rng.standard_normal(lengths))).real
    f = (f + np.roll(np.flip(f), 1, tuple(range(f.ndim)))) / 2  # f(-θ) = f(θ)
    f *= rng.uniform(0.2, 2.0) / f.std()
    return of_samples(np.exp(f), shape)


def random_powers(rng: np.random.Generator, shape: Shape) -> ToeplitzOperator:
    """A symbol with a zero or a pole anywhere, and a constant."""
    lengths = tuple(2 * n for n in shape)
    f = np.zeros(lengths)
    for axis, m in enumerate(lengths):
        theta = 2 * np.pi * np.arange(m) / m
        at = rng.choice([0.0, np.pi, rng.uniform(0, np.pi)])
        wave = abs(4 * np.sin((theta - at) / 2) * np.sin((theta + at) / 2)) + 1.0 / m**2
        f += rng.uniform(0.1, 1.0) * wave.reshape([-1 if k == axis else 1 for k in range(f.ndim)])
    return of_samples(f ** rng.uniform(-0.45, 2.0) + 10.0 ** -rng.uniform(0, 6), shape)


def of_samples(f: Array, shape: Shape) -> ToeplitzOperator:
    """The matrix whose circulant of twice the size has these eigenvalues."""
    lags = fft.ifftn(f).real
    for axis, n in enumerate(shape):
        lags = np.take(lags, np.arange(1 - n, n), axis)
    return ToeplitzOperator.from_lags((lags + np.flip(lags)) / 2)


def random_waves(rng: np.random.Generator, shape: Shape) -> ToeplitzOperator:
    """Plane waves with or without damping, and a nugget."""
    k = np.stack(np.meshgrid(*(np.arange(1.0 - n, n) for n in shape), indexing="ij"), axis=-1)
    lags = np.zeros(k.shape[:-1])
    for _ in range(rng.integers(1, 6)):
        damped = np.exp(-np.abs(k) @ rng.uniform(0, 3, len(shape)) / max(shape))
        lags += rng.exponential() * damped * np.cos(k @ rng.uniform(0, np.pi, len(shape)))
    lags[tuple(n - 1 for n in shape)] += 10.0 ** -rng.uniform(-1, 6)
    return ToeplitzOperator.from_lags((lags + np.flip(lags)) / 2)


def random_covariance(rng: np.random.Generator, shape: Shape) -> ToeplitzOperator:
    """A covariance of any smoothness, stretched and turned, and a nugget."""
    k = np.stack(np.meshgrid(*(np.arange(1.0 - n, n) for n in shape), indexing="ij"), axis=-1)
    axes = len(shape)
    turned = rng.standard_normal((axes, axes)) if rng.random() < 0.5 else np.eye(axes)
    length = np.exp(rng.uniform(np.log(0.5), np.log(2.0 * max(shape)), axes))
    r = np.linalg.norm(k @ turned / length, axis=-1)
    kind = rng.integers(4)
    if kind == 3:  # the rational quadratic one
        lags = (1 + r**2) ** -rng.uniform(0.2, 3.0)
    else:
        lags = list(COVARIANCES.values())[kind](r)
    lags[tuple(n - 1 for n in shape)] += 10.0 ** -rng.uniform(0, 6)
    return ToeplitzOperator.from_lags((lags + np.flip(lags)) / 2)


def random_signs(rng: np.random.Generator, shape: Shape) -> ToeplitzOperator:
    """Coefficients of any sign that decay or do not, on a diagonal just large enough."""
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


def random_mask(rng: np.random.Generator, shape: Shape) -> Array:
    """All elements, half of the times; else by chance, in islands, in one piece, in a line."""
    kind = rng.integers(8)
    height = rng.standard_normal(shape)
    if kind < 4:
        return np.ones(shape, dtype=bool)
    if kind == 4:
        mask = height > rng.uniform(-2, 1)
    elif kind == 5:  # what is above a level, of a smooth surface
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
    return np.asarray(mask)


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
    return restricted(kernel(rng, shape), random_mask(rng, shape))


def random_ones(number: int) -> Iterator[Case]:
    """Yield so many random matrices."""
    for seed in range(number):
        family = list(KERNELS)[seed % len(KERNELS)]
        yield Case(f"random {family}", f"seed {seed}", partial(random_matrix, seed))
