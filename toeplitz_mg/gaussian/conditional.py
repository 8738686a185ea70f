"""What is known of a process where some of it was observed: kriging."""

from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array, Mask, Rows
from toeplitz_mg.gaussian.observed import Observed


@dataclass(frozen=True, repr=False)
class Conditional:
    """The distribution of all points of a process, given those that are observed.

    Attributes
    ----------
    process : ToeplitzNormal
    known : Observed
        What is known of the covariance of the observed points.
    mask : ndarray of bool
        Where it is observed.
    residual : ndarray of the shape of `process`
        What was observed less the mean of the process, zero elsewhere.
    """

    process: Any  # The file of this class imports this one.
    known: Observed
    mask: Mask
    residual: Array

    @cached_property
    def mean(self) -> Array:
        """The mean at each point: where it is observed, the value itself."""
        mean: Array = self._estimate(self.residual[np.newaxis])[0] + self.process.mean
        mean.flags.writeable = False
        return mean

    def rvs(self, size: int | tuple[int, ...] | None = 1, random_state: Any = None) -> Array:
        """Draw samples, as `ToeplitzNormal.rvs` does; each costs a solve."""
        process = self.process
        X = process.rvs(size, random_state) - process.mean
        fields = X.reshape(prod(X.shape[: -len(process.shape)]), *process.shape)
        return X + self._estimate(self.residual - fields).reshape(X.shape) + process.mean

    def __repr__(self) -> str:
        return f"<Conditional {self.process!r}, {np.count_nonzero(self.mask)} observed>"

    def _estimate(self, fields: Array) -> Array:
        """Return the means of the points, given fields at those that are observed."""
        inside = self.mask.ravel()
        Y: Rows = np.where(inside, fields.reshape(len(fields), inside.size), 0.0)
        X = self.known.estimate(Y)
        X[:, inside] = Y[:, inside]
        return X.reshape(fields.shape)
