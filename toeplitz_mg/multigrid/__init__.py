"""Multigrid: transfer of vectors and matrices between grids, the levels, the cycle."""

from toeplitz_mg.multigrid.cycle import Multigrid, multigrid
from toeplitz_mg.multigrid.hierarchy import Level
from toeplitz_mg.multigrid.interpolation import (
    Interpolation,
    linear_interpolation,
    modulated_interpolation,
    piecewise_constant,
)
from toeplitz_mg.multigrid.transfer import galerkin, rediscretised

__all__ = [
    "Interpolation",
    "Level",
    "Multigrid",
    "galerkin",
    "linear_interpolation",
    "modulated_interpolation",
    "multigrid",
    "piecewise_constant",
    "rediscretised",
]
