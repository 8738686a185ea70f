"""Matrices of small grids, and approximate inverses of them, that are kept for the next case.

Tables are made of many small cases on one grid, whose matrices take longer than a case. They are
kept by all that a grid is, never changed, and no part of any result.
"""

from functools import lru_cache
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.circulants import Circulants
from toeplitz_mg.contact.shifted_inverses import ADDITIONS, ShiftedInverses
from toeplitz_mg.contact.short_transforms import SHORT_ADDITIONS, ShortCirculants, ShortProduct
from toeplitz_mg.contact.steady_matrices import SteadyArray, subtract_operators
from toeplitz_mg.halfspace.combined import combine
from toeplitz_mg.halfspace.matrices import assemble, evaluate_all
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator
from toeplitz_mg.preconditioners.trigonometric import cosine_preconditioner

KEPT = 32  # Grids whose matrices are kept.


def scale_normal(grid: Any) -> tuple[ToeplitzOperator, float]:
    """Return the matrix of normal contact over its diagonal, and that."""
    c = grid.normal_coefficients()
    unit = float(c.flat[0])
    c /= unit
    return ToeplitzOperator(grid.library.from_numpy(c)), unit


scaled_normal = lru_cache(maxsize=KEPT)(scale_normal)


@lru_cache(maxsize=KEPT)
def inverse_by_transform(A: Any, dtype: np.dtype[Any]) -> Any:
    """Return an approximate inverse of a matrix that is kept."""
    return cosine_preconditioner(A, dtype=dtype)


@lru_cache(maxsize=KEPT)
def tangential(grid: Any, directions: str, ahead: int) -> Any:
    """Return the matrix of tangential displacements, so many elements ahead."""
    own = {name: c[: grid.shape[0] + ahead] for name, c in _coefficients(grid, directions).items()}
    A = assemble(directions, own, ahead)
    return A if ahead else _with_short_product(grid, A)


@lru_cache(maxsize=KEPT)
def _coefficients(grid: Any, directions: str) -> dict[str, Array]:
    """Return the coefficients of a grid that is one element longer, which has those ahead too."""
    longer = (grid.shape[0] + 1, *grid.shape[1:])
    bodies = combine(grid.material)
    return evaluate_all(directions, longer, grid.element, bodies, grid.reference)


@lru_cache(maxsize=KEPT)
def steady(grid: Any) -> Any:
    """Return the matrix of steady rolling."""
    return _with_short_product(grid, subtract_operators(grid.tangential(), grid.upstream()))


def _with_short_product(grid: Any, A: Any) -> Any:
    """Return a matrix of a grid with the product that is fastest there."""
    return CoupledOperator(A.blocks, product=ShortProduct.of(A)) if grid.is_short else A


@lru_cache(maxsize=KEPT)
def steady_array(grid: Any, contact: bytes) -> SteadyArray:
    """Return the matrix of steady rolling on some elements, as an array."""
    return SteadyArray(steady(grid), np.frombuffer(contact, bool).reshape(grid.shape))


@lru_cache(maxsize=KEPT)
def shifted_inverses(grid: Any, dtype: np.dtype[Any]) -> ShiftedInverses:
    """Return approximate inverses of the matrix of steady rolling with additions."""
    ways = (ShortCirculants, SHORT_ADDITIONS) if grid.is_short else (Circulants, ADDITIONS)
    return ShiftedInverses.of(steady(grid), dtype, *ways)
