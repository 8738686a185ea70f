"""Stationary covariances with derivatives, on one axis and on grids."""

from toeplitz_mg.covariances.arma import ARFIMA, ARMA
from toeplitz_mg.covariances.base import Covariance, Custom
from toeplitz_mg.covariances.kernels import (
    DampedCosine,
    Exponential,
    Matern,
    Periodic,
    SquaredExponential,
    WhiteNoise,
)
from toeplitz_mg.covariances.long_memory import FractionalGaussianNoise

__all__ = [
    "ARFIMA",
    "ARMA",
    "Covariance",
    "Custom",
    "DampedCosine",
    "Exponential",
    "FractionalGaussianNoise",
    "Matern",
    "Periodic",
    "SquaredExponential",
    "WhiteNoise",
]


def __dir__() -> list[str]:
    return __all__
