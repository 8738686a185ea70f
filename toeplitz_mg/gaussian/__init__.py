"""Stationary Gaussian processes on a grid: likelihoods, fits, kriging, samples."""

from toeplitz_mg.gaussian.fitting import NormalFit
from toeplitz_mg.gaussian.normal import ToeplitzNormal

__all__ = ["NormalFit", "ToeplitzNormal"]
