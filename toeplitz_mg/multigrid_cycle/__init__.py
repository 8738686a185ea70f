"""Multigrid: transfer of vectors and matrices between grids, the levels, the cycle."""

from toeplitz_mg.multigrid_cycle.build import multigrid
from toeplitz_mg.multigrid_cycle.cycle import Multigrid
from toeplitz_mg.multigrid_cycle.hierarchy import Level
from toeplitz_mg.multigrid_cycle.interpolation import (
    Interpolation,
    linear_interpolation,
    modulated_interpolation,
    piecewise_constant,
)
from toeplitz_mg.multigrid_cycle.transfer import galerkin, rediscretised

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
