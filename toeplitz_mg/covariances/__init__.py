"""Stationary covariances with their derivatives, on one axis and on grids."""

from toeplitz_mg.covariances.base import Covariance, Custom
from toeplitz_mg.covariances.kernels import Exponential, Matern, WhiteNoise

__all__ = [
    "Covariance",
    "Custom",
    "Exponential",
    "Matern",
    "WhiteNoise",
]
