"""Covariances of processes in continuous time or space, and white noise."""

from collections.abc import Iterable
from functools import reduce
from math import pi, sqrt
from operator import mul
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.covariances.base import Derivatives, Kernel, Lags
from toeplitz_mg.covariances.bessel import matern

FAR = 800.0  # For larger x, exp(-x) underflows to zero in double precision.


class WhiteNoise(Kernel):
    """White noise, for example of a measurement: σ² at lag zero, zero elsewhere.

    See Also
    --------
    Covariance : the methods of all covariances.

    Examples
    --------
    >>> from toeplitz_mg.covariances import Exponential, WhiteNoise
    >>> (Exponential(length=20.0) + WhiteNoise(variance=0.5))(3).round(4)
    array([1.5   , 0.9512, 0.9048])
    """

    def __init__(self, variance: Any = 1.0) -> None:
        super().__init__(variance=variance)

    def _derive(self, lags: Lags, wanted: frozenset[str]) -> tuple[Array, Derivatives]:
        unit = np.zeros(lags.shape)
        unit.flat[0] = 1.0
        return unit, {}


class Radial(Kernel):
    """A covariance σ² ρ(r) of the scaled distance r = (Σ (xᵢ/ℓᵢ)²)^½."""

    def __init__(self, variance: Any = 1.0, length: Any = 1.0) -> None:
        super().__init__(variance=variance, length=length)

    def _profile(self, r: Array, wanted: frozenset[str]) -> tuple[Array, Array, Derivatives]:
        """Return ρ(r), -r ρ'(r), and the derivatives of ρ by parameters other than the length."""
        raise NotImplementedError

    def _derive(self, lags: Lags, wanted: frozenset[str]) -> tuple[Array, Derivatives]:
        lengths = self._values("length")
        each = lags.by_axis(lengths, "length")
        parts = [x / scale for x, scale in zip(lags.distances(), each, strict=True)]
        r = reduce(np.hypot, parts)
        rho, slope, by = self._profile(r, wanted)
        if len(lengths) == 1:
            by[self._names("length")[0]] = slope / lengths[0]
        elif wanted:
            for name, part, scale in zip(self._names("length"), parts, lengths, strict=True):
                share = np.divide(part, r, out=np.zeros(lags.shape), where=r > 0.0)
                by[name] = slope * share**2 / scale
        return rho, by


class Exponential(Radial):
    """The exponential covariance of an Ornstein-Uhlenbeck process: σ² exp(-r), r = distance/ℓ.

    Parameters
    ----------
    variance, length : float
        σ², and ℓ in the units of `spacing`. On a grid, ℓ may be a sequence with one length per
        axis; then r = (Σ (xᵢ/ℓᵢ)²)^½.

    See Also
    --------
    Matern : smoother processes; this is the case ν = ½.

    Examples
    --------
    >>> from toeplitz_mg.covariances import Exponential
    >>> Exponential(2.0, length=10.0)(3).round(4)
    array([2.    , 1.8097, 1.6375])
    >>> Exponential(length=(10.0, 20.0))((4, 4), spacing=0.5).shape
    (4, 4)
    """

    def _profile(self, r: Array, wanted: frozenset[str]) -> tuple[Array, Array, Derivatives]:
        r = np.minimum(r, FAR)
        rho = np.exp(-r)
        return rho, r * rho, {}


class Matern(Radial):
    """The Matérn covariance, σ² 2^(1-ν)/Γ(ν) x^ν K_ν(x), x = (2ν)^½ r, r = distance/ℓ.

    Parameters
    ----------
    variance, length : float
        σ² and ℓ, as for `Exponential`.
    nu : float
        ν, below 100; a free parameter unless held by ``.fix("nu")``. The process is k times
        differentiable for ν > k.

    See Also
    --------
    Exponential, SquaredExponential : the cases ν = ½ and ν → ∞.

    References
    ----------
    M. L. Stein, Interpolation of Spatial Data, Springer (1999).

    Examples
    --------
    >>> from toeplitz_mg.covariances import Matern
    >>> Matern(length=10.0, nu=1.5).fix("nu")(3).round(4)
    array([1.    , 0.9866, 0.9522])
    """

    def __init__(self, variance: Any = 1.0, length: Any = 1.0, nu: Any = 1.5) -> None:
        Kernel.__init__(self, variance=variance, length=length, nu=nu)

    def _profile(self, r: Array, wanted: frozenset[str]) -> tuple[Array, Array, Derivatives]:
        (nu,) = self._values("nu")
        by: Derivatives = {}
        if nu not in CLOSED_FORMS or "nu" in wanted:
            near = (r > 0.0) & (sqrt(2.0 * nu) * r < FAR)
            rho, slope, by_nu = np.zeros((3, *r.shape))
            rho[r == 0.0] = 1.0
            if near.any():
                rho[near], slope[near], by_nu[near] = matern(r[near], nu)
            by["nu"] = by_nu
        if nu in CLOSED_FORMS:
            x = np.minimum(sqrt(2.0 * nu) * r, FAR)
            rho, slope = CLOSED_FORMS[nu](x, np.exp(-x))
        return rho, slope, by


# ρ and -x dρ/dx by x and exp(-x).
CLOSED_FORMS = {
    0.5: lambda x, e: (e, x * e),
    1.5: lambda x, e: ((1.0 + x) * e, x * x * e),
    2.5: lambda x, e: ((1.0 + x * (1.0 + x / 3.0)) * e, x * x * (1.0 + x) / 3.0 * e),
}


class SquaredExponential(Radial):
    """The squared exponential, or Gaussian, covariance: σ² exp(-r²/2), r = distance/ℓ.

    If ℓ is several spacings, add `WhiteNoise`: otherwise the matrix is not positive definite in
    double precision.

    Parameters
    ----------
    variance, length : float
        σ² and ℓ, as for `Exponential`.

    See Also
    --------
    Matern : less smooth processes, with better conditioned matrices.

    Examples
    --------
    >>> from toeplitz_mg.covariances import SquaredExponential
    >>> SquaredExponential(length=2.0)(3).round(4)
    array([1.    , 0.8825, 0.6065])
    """

    def _profile(self, r: Array, wanted: frozenset[str]) -> tuple[Array, Array, Derivatives]:
        squares = np.minimum(r, FAR) ** 2
        rho = np.exp(-0.5 * squares)
        return rho, squares * rho, {}


class Periodic(Kernel):
    """A periodic covariance, σ² exp(-2/ℓ² Σ sin²(π xᵢ/Tᵢ)), summed over the axes.

    Its matrix is singular if the lags cover several periods: add `WhiteNoise`, or multiply by a
    covariance that decays, ``Periodic(period=12.0) * Exponential(length=100.0).fix("variance")``.

    Parameters
    ----------
    variance, length, period : float
        σ²; the dimensionless ℓ (below 1 the process has many waves per period); T in the units of
        `spacing`, on a grid also one per axis.

    See Also
    --------
    DampedCosine : waves whose phase decorrelates.

    Examples
    --------
    >>> from toeplitz_mg.covariances import Periodic
    >>> Periodic(period=4.0)(5).round(4)
    array([1.    , 0.3679, 0.1353, 0.3679, 1.    ])
    """

    def __init__(self, variance: Any = 1.0, length: Any = 1.0, period: Any = 1.0) -> None:
        super().__init__(variance=variance, length=length, period=period)

    def _derive(self, lags: Lags, wanted: frozenset[str]) -> tuple[Array, Derivatives]:
        (length,) = self._values("length")
        periods = lags.by_axis(self._values("period"), "period")
        turns = list(lags.turns(periods))
        exponent = sum(2.0 * (np.sin(pi * turn) / length) ** 2 for turn in turns)
        rho, by = np.exp(-np.minimum(exponent, FAR)), Derivatives()
        if wanted:
            slopes = (rho / length**2 * np.sin(2.0 * pi * turn) for turn in turns)
            by = differentiate_by_periods(self._names("period"), lags, periods, slopes)
            by["length"] = 2.0 / length * exponent * rho
        return rho, by


class DampedCosine(Exponential):
    """A damped cosine, σ² exp(-r) Π cos(2π xᵢ/Tᵢ) over the axes, with r = distance/ℓ.

    It is positive definite for any length and period; on grids it is a product of covariances.

    Parameters
    ----------
    variance, length, period : float
        σ², ℓ and T, in the units of `spacing`; on a grid, ℓ and T may be one per axis.

    See Also
    --------
    Periodic : waves with a constant phase.

    Examples
    --------
    >>> from toeplitz_mg.covariances import DampedCosine
    >>> DampedCosine(length=10.0, period=4.0)(3).round(4)
    array([ 1.    ,  0.    , -0.8187])
    """

    def __init__(self, variance: Any = 1.0, length: Any = 1.0, period: Any = 1.0) -> None:
        Kernel.__init__(self, variance=variance, length=length, period=period)

    def _derive(self, lags: Lags, wanted: frozenset[str]) -> tuple[Array, Derivatives]:
        periods = lags.by_axis(self._values("period"), "period")
        angles = [2.0 * pi * turn for turn in lags.turns(periods)]
        cosines = [np.cos(angle) for angle in angles]
        damping, by = super()._derive(lags, wanted)
        cosine = reduce(mul, cosines)
        by = {name: derivative * cosine for name, derivative in by.items()}
        if wanted:
            others = (cosines[:i] + cosines[i + 1 :] for i in range(len(cosines)))
            slopes = (
                reduce(mul, other, damping) * np.sin(angle)
                for other, angle in zip(others, angles, strict=True)
            )
            by |= differentiate_by_periods(self._names("period"), lags, periods, slopes)
        return damping * cosine, by


def differentiate_by_periods(
    names: tuple[str, ...], lags: Lags, periods: tuple[float, ...], slopes: Iterable[Array]
) -> Derivatives:
    """Return the derivatives by Tᵢ from those by the angles -2π xᵢ/Tᵢ."""
    by: Derivatives = {}
    names = names * len(periods) if len(names) == 1 else names  # One period for all axes.
    for name, x, T, slope in zip(names, lags.distances(), periods, slopes, strict=True):
        by[name] = by.get(name, 0.0) + slope * (2.0 * pi / T**2 * x)
    return by
