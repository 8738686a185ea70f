"""Stationary Gaussian processes on a grid: likelihoods, gaps, samples."""

from toeplitz_mg.gaussian.normal import ToeplitzNormal

__all__ = ["ToeplitzNormal"]
