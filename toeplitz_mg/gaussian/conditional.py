"""The distribution of unobserved points given observed ones: means, variances, samples."""

import warnings
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.linalg import LinAlgWarning
from scipy.special import ndtri

from toeplitz_mg._typing import Array, Mask, Rows
from toeplitz_mg.gaussian.observed import MOST, Observed, doubt_of_gaps
from toeplitz_mg.values import real

if TYPE_CHECKING:
    from toeplitz_mg.gaussian.normal import ToeplitzNormal

DRAWS = 256  # Number of samples for the variances if too many points are missing.
IMPRECISE = 1e-4  # Relative error of variances above which there is a warning.


def quantile(confidence: float) -> float:
    """Return the half width, in standard deviations, of an interval of this probability."""
    confidence = real("confidence", confidence)
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence is {confidence}, but must be between 0 and 1")
    return float(ndtri(0.5 + 0.5 * confidence))


class Prediction(NamedTuple):
    """Means and standard deviations of unknown values.

    Attributes
    ----------
    mean, std : ndarray, or pandas.Series
    """

    mean: Any
    std: Any

    def interval(self, confidence: float = 0.95) -> tuple[Any, Any]:
        """Return the limits of intervals that each contain the value with this probability."""
        half = quantile(confidence) * self.std
        return self.mean - half, self.mean + half


@dataclass(frozen=True, repr=False)
class Conditional:
    """The distribution of all points of a process given the observed ones (kriging)."""

    process: "ToeplitzNormal"
    known: Observed  # The covariance of the observed points.
    mask: Mask  # Which points are observed.
    residual: Array  # Observations minus the mean of the process; zero elsewhere.

    @cached_property
    def mean(self) -> Array:
        """The mean at each point; at observed points, the observed value."""
        mean: Array = self._estimate(self.residual[np.newaxis])[0] + self.process.mean
        mean.flags.writeable = False
        return mean

    @property
    def variance(self) -> Array:
        """The variance at each point; zero where it is observed.

        Exact if at most 4096 points are missing. Otherwise it is estimated from 256 samples, with a
        relative standard error of 9 % and a warning.
        """
        return self.warned_variance()

    @property
    def std(self) -> Array:
        """The standard deviation at each point, from `variance`."""
        return np.sqrt(self.warned_variance())

    def interval(self, confidence: float = 0.95) -> tuple[Array, Array]:
        """Return the limits of intervals that each contain the value with this probability."""
        return Prediction(self.mean, np.sqrt(self.warned_variance())).interval(confidence)

    def rvs(self, size: int | tuple[int, ...] | None = 1, random_state: Any = None) -> Array:
        """Draw samples, as `ToeplitzNormal.rvs` does; each takes one solve."""
        process = self.process
        X = process.rvs(size, random_state) - process.mean
        fields = X.reshape(prod(X.shape[: -len(process.shape)]), *process.shape)
        return X + self._estimate(self.residual - fields).reshape(X.shape) + process.mean

    def __repr__(self) -> str:
        return f"<Conditional {self.process!r}, {np.count_nonzero(self.mask)} observed>"

    def warned_variance(self) -> Array:
        """Return the variances; a warning points to the caller of the method that needs them."""
        variance, warning = self._variance
        if warning is not None:
            warnings.warn(warning, stacklevel=3)
        return variance

    @cached_property
    def _variance(self) -> tuple[Array, Warning | None]:
        """The variances, and a warning if they are estimates."""
        missing = ~self.mask.ravel()
        number, variance, warning = np.count_nonzero(missing), np.zeros(missing.size), None
        if number <= MOST:
            variance[missing] = self.known.variances()
            if doubt := doubt_of_gaps("the variances", self.known.rounding, IMPRECISE):
                warning = LinAlgWarning(doubt)
        else:
            random = np.random.default_rng(0)
            for _ in range(DRAWS):
                variance += (self.rvs(random_state=random) - self.mean).ravel() ** 2 / DRAWS
            variance[~missing] = 0.0
            warning = UserWarning(
                f"{number} points are missing: of more than {MOST} the variances are those of "
                f"{DRAWS} draws, with a standard error of {(2 / DRAWS) ** 0.5:.0%}"
            )
        variance.flags.writeable = False
        return variance.reshape(self.mask.shape), warning

    def _estimate(self, fields: Array) -> Array:
        """Return the means at all points, given fields at the observed points."""
        inside = self.mask.ravel()
        Y: Rows = np.where(inside, fields.reshape(len(fields), inside.size), 0.0)
        X = self.known.estimate(Y)
        X[:, inside] = Y[:, inside]
        return X.reshape(fields.shape)
