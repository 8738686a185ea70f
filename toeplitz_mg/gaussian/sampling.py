"""Samples of a stationary process: by circulant embedding, or point by point."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.fft import next_fast_len

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.columns.schur import schur_column
from toeplitz_mg.engine import fourier
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators.positivity import rounding

LARGEST_ERROR = 1e-6  # Allowed error of a covariance, relative to the variance: never visible.
SAMPLES = (4, 16, 64)  # Period of the process per unknown: tried in turn until accurate enough.
DECAYED = 1e-6  # If the covariance has decayed to this share of the variance, embedding works.
PART = 2**22  # Random numbers that are drawn at once.


@dataclass(frozen=True)
class Embedding:
    """A periodic process that contains the grid."""

    root: Array  # Square roots of the eigenvalues of its covariance, in the order of `rfftn`.
    period: tuple[int, ...]
    grid_shape: tuple[int, ...]
    error: float  # The largest error of a covariance on the grid, relative to the variance.

    def draw(self, rows: int, random: Any) -> Array:
        """Return independent samples, of shape (rows, ...)."""
        X = np.empty((rows, *self.grid_shape))
        cut = (slice(None), *(slice(n) for n in self.grid_shape))
        axes = tuple(range(1, X.ndim))
        size = int(np.prod(self.period))
        most = max(1, PART // size)
        for first in range(0, rows, most):
            part = X[first : first + most]
            noise = random.standard_normal((len(part), *self.period))
            count_transforms(2 * len(part), size)
            hat = fourier.rfftn(noise, axes=axes, overwrite_x=True)
            hat *= self.root
            part[...] = fourier.irfftn(hat, s=self.period, axes=axes, overwrite_x=True)[cut]
        return X


@dataclass(frozen=True)
class Recursion:
    """Samples in which each number is drawn given those before it, in O(n²): always exact.

    References
    ----------
    J. R. M. Hosking, Modeling persistence in hydrological time series using fractional
    differencing, Water Resour. Res. 20 (1984).
    """

    c: Array  # The covariances.
    gamma: Array  # The Schur parameters (see `schur_column`).

    @cached_property
    def error(self) -> float:
        """The largest error of a covariance, relative to the variance."""
        unit = np.zeros((1, len(self.c)))
        unit[0, 0] = np.sqrt(self.c[0])  # Times the Cholesky factor this is the first column of A.
        return float(np.abs(self.colour(unit)[0] - self.c).max() / self.c[0])

    def draw(self, rows: int, random: Any) -> Rows:
        """Return independent samples, of shape (rows, n)."""
        return self.colour(random.standard_normal((rows, len(self.c))))

    def colour(self, Z: Rows) -> Rows:
        """Return L z for each row z, the inverse of `whiten`; A = L Lᵀ with L lower triangular."""
        n = len(self.c)
        variances = self.c[0] * np.cumprod(np.append(1.0, 1.0 - self.gamma**2))
        Y = Z * np.sqrt(variances)
        a = np.zeros(n)  # Coefficients of the prediction error Σ a_j y_(k-j).
        a[0] = 1.0
        for k in range(1, n):
            a[1 : k + 1] += self.gamma[k - 1] * a[k - 1 :: -1]
            Y[:, k] -= Y[:, :k] @ a[k:0:-1]
        return Y


def embed(c: Array, column: Callable[[], Array]) -> Embedding | Recursion:
    """Return a sampler; `column` returns A⁻¹ e₁ of one axis.

    On one axis every positive definite covariance has one. On several axes, the error message may
    name a grid that is large enough.
    """
    embedding = embed_in_circulant(c)
    if c.ndim == 1:
        return embedding or embed_by_column(c, column()) or Recursion(c, schur_column(c)[1])
    if embedding is not None:
        return embedding
    edges = [
        float(np.abs(np.take(c, n - 1, axis)).max()) / float(c.flat[0])
        for axis, n in enumerate(c.shape)
    ]
    # The grid at whose edges the covariance has decayed, extrapolated from this one.
    shape = tuple(
        n if edge <= DECAYED else int(np.ceil(n * np.log(DECAYED) / np.log(edge)))
        for edge, n in zip(edges, c.shape, strict=True)
        if edge < 0.9
    )
    if len(shape) < c.ndim:
        advice = "the covariance does not decay over the grid, and so no size can be told"
    elif shape == c.shape:
        advice = "it has decayed there, so that no field has it: add to c[0] (a nugget)"
    else:
        advice = f"give c on a grid of some {shape}, where it has decayed, and cut the samples"
    raise np.linalg.LinAlgError(
        f"the covariance on the grid {c.shape}, continued by its mirror image, is not positive "
        f"semidefinite: {advice}"
    )


def embed_in_circulant(c: Array) -> Embedding | None:
    """Extend a covariance by its mirror image; return None if the result is not positive.

    Eigenvalues within the rounding error of the transform are set to zero.
    """
    mirrored = np.pad(c, [(0, max(n - 2, 0)) for n in c.shape], mode="reflect")
    spectrum = fourier.rfftn(mirrored).real
    if spectrum.min() < -rounding(spectrum, np.float64):
        return None
    return _embedding(np.maximum(spectrum, 0.0), mirrored.shape, c)


def embed_by_column(c: Array, x: Array) -> Embedding | None:
    """Extend a covariance by the autoregressive process of x = A⁻¹ e₁, if that decays.

    Its spectral density x₀/|x(z)|² (Bernstein and Szegő) is positive, and its first n covariances
    are those of A. Making it periodic adds to them the covariances one period away.
    """
    n = len(c)
    for samples in SAMPLES:
        period = 2 * next_fast_len(samples // 2 * n, real=True)
        z = fourier.rfft(x, period)
        embedding = _embedding(x[0] / (z.real**2 + z.imag**2), (period,), c)
        if embedding.error <= LARGEST_ERROR:
            return embedding
    return None


def _embedding(spectrum: Array, period: tuple[int, ...], c: Array) -> Embedding:
    """Return an embedding, with its error."""
    count_transforms(2, int(np.prod(period)))
    reached = fourier.irfftn(spectrum, s=period)[tuple(slice(n) for n in c.shape)]
    error = float(np.abs(reached - c).max()) / float(c.flat[0])
    return Embedding(np.sqrt(spectrum), period, c.shape, error)
