"""Symmetric positive definite matrices of one to three axes, as they come in practice.

The random ones are in `random_matrices`.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from scipy.sparse.linalg import LinearOperator

from comparisons.systems import masks
from comparisons.systems.punch import KINDS, influence
from comparisons.systems.symbols import column, fractional_noise
from toeplitz_mg import ToeplitzOperator
from toeplitz_mg._typing import Array

Shape = tuple[int, ...]


@dataclass(frozen=True)
class Case:
    """A matrix, not built yet."""

    name: str
    operator: Callable[[], LinearOperator]


GRIDS: dict[str, Shape] = {"line": (2000,), "40 x 40": (40, 40), "12 x 12 x 12": (12, 12, 12)}
LENGTHS = (2.0, 5.0, 10.0, 30.0, 100.0)  # Lengths of correlation, in elements.
NUGGETS = (1e-2, 1e-4)  # Variances of the noise on top of a covariance of variance 1.
ELEMENTS = (1.0, 0.25, 4.0, 20.0, 100.0)  # Sides of elements along y over those along x.
AREAS = ("full", "circle", "rough, 30 %", "random, 50 %", "stripes")
COVARIANCES: dict[str, Callable[[Array], Array]] = {
    "Matérn 1/2": lambda r: np.exp(-r),
    "Matérn 3/2": lambda r: (1 + np.sqrt(3.0) * r) * np.exp(-np.sqrt(3.0) * r),
    "Gaussian": lambda r: np.exp(-(r**2) / 2),
}


def half_space(kind: str, ratio: float, area: str) -> LinearOperator:
    """Return the matrix of a contact area of elements of some shape."""
    return influence(kind, masks.FRAGMENTED[area](48), (1.0, ratio))


def of_column(c: Array, share: float = 1.0) -> LinearOperator:
    """Return the matrix of a first column, on all elements or a share of them, by chance."""
    mask = np.random.default_rng(7).random(c.shape) <= share
    mask.flat[0] = True
    return masks.restrict(ToeplitzOperator(c), mask)


def covariance(
    name: str, length: float, nugget: float, shape: Shape, share: float
) -> LinearOperator:
    """Return a stationary covariance, on all of a grid or with gaps."""
    c = COVARIANCES[name](np.sqrt((np.indices(shape) ** 2).sum(axis=0)) / length)
    c.flat[0] += nugget
    return of_column(c, share)


def typical() -> Iterator[Case]:
    """Yield matrices as they come in practice."""
    for kind, ratio, area in product(KINDS, ELEMENTS, AREAS):
        name = f"half-space, {kind}, elements 1:{ratio:g}, {area}"
        yield Case(name, partial(half_space, kind, ratio, area))
    for name, length, nugget in product(COVARIANCES, LENGTHS, NUGGETS):
        for grid, share in (*((grid, 1.0) for grid in GRIDS), ("40 x 40", 0.6)):
            title = f"{name}, length {length:g}, nugget {nugget:g}, {share:.0%} of {grid}"
            matrix = partial(covariance, name, length, nugget, GRIDS[grid], share)
            yield Case(title, matrix)
    for hurst, n, share in product((0.6, 0.75, 0.9), (1000, 3000), (1.0, 0.7)):
        c = fractional_noise(np.arange(n), hurst)
        yield Case(f"H = {hurst}, {share:.0%} of {n}", partial(of_column, c, share))
    names = ("contact", "(1+k)^-1.1", "cos k/(k+1)")
    for name, share in (*product(names, (1.0, 0.8)), ("1/(1 + k²/100)", 1.0)):
        yield Case(f"{name}, {share:.0%} of 1500", partial(of_column, column(name, 1500), share))
