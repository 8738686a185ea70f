"""Covariances of processes in continuous time or space, and white noise."""

from math import sqrt
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.covariances.base import Derivatives, Kernel, Lags
from toeplitz_mg.covariances.bessel import matern

FAR = 800.0  # Of larger arguments exp(-x) is zero, in double precision.


class WhiteNoise(Kernel):
    """White noise, of a measurement for example: the variance at lag zero, zero elsewhere.

    Parameters
    ----------
    variance : float

    See Also
    --------
    Covariance : what can be done with it.

    Examples
    --------
    >>> from toeplitz_mg.covariances import Exponential, WhiteNoise
    >>> WhiteNoise(0.5)(3)
    array([0.5, 0. , 0. ])
    >>> k = Exponential(length=20.0) + WhiteNoise(0.1)
    """

    def __init__(self, variance: Any = 1.0) -> None:
        super().__init__(variance=variance)

    def _evaluate(self, lags: Lags, wanted: frozenset[str]) -> tuple[Array, Derivatives]:
        unit = np.zeros(lags.shape)
        unit.flat[0] = 1.0
        return self._values("variance")[0] * unit, {"variance": unit}


class Radial(Kernel):
    """A covariance σ² ρ(r) of the distance in lengths, r = (Σ (xᵢ/ℓᵢ)²)^½."""

    def _profile(self, r: Array, wanted: frozenset[str]) -> tuple[Array, Array, Derivatives]:
        """Return ρ(r), -r ρ'(r), and the derivatives of ρ by parameters beside the length."""
        raise NotImplementedError

    def _evaluate(self, lags: Lags, wanted: frozenset[str]) -> tuple[Array, Derivatives]:
        lengths, (variance,) = self._values("length"), self._values("variance")
        each = lags.by_axis(lengths, "length")
        parts = [x / scale for x, scale in zip(lags.distances(), each, strict=True)]
        r = parts[0]
        for part in parts[1:]:
            r = np.hypot(r, part)
        rho, slope, by = self._profile(r, wanted)
        by = {name: variance * derivative for name, derivative in by.items()}
        by["variance"] = rho
        if len(lengths) == 1:
            by[self._names("length")[0]] = (variance / lengths[0]) * slope
        elif wanted:
            for name, part, scale in zip(self._names("length"), parts, lengths, strict=True):
                share = np.divide(part, r, out=np.zeros(lags.shape), where=r > 0.0)
                by[name] = (variance / scale) * slope * share**2
        return variance * rho, by


class Exponential(Radial):
    """The exponential covariance of an Ornstein-Uhlenbeck process: σ² exp(-r), r = distance/ℓ.

    Parameters
    ----------
    variance : float
        σ².
    length : float, or sequence of float
        ℓ, in the units of `spacing`; on a grid also one for each axis, r being (Σ (xᵢ/ℓᵢ)²)^½.

    See Also
    --------
    Matern : of which it is that with ν = ½; the others are smoother.

    Examples
    --------
    >>> from toeplitz_mg.covariances import Exponential
    >>> Exponential(2.0, length=10.0)(3).round(4)
    array([2.    , 1.8097, 1.6375])
    >>> Exponential(length=(10.0, 20.0))((4, 4), spacing=0.5).shape
    (4, 4)
    """

    def __init__(self, variance: Any = 1.0, length: Any = 1.0) -> None:
        super().__init__(variance=variance, length=length)

    def _profile(self, r: Array, wanted: frozenset[str]) -> tuple[Array, Array, Derivatives]:
        r = np.minimum(r, FAR)
        rho = np.exp(-r)
        return rho, r * rho, {}


class Matern(Radial):
    """The Matérn covariance, σ² 2^(1-ν)/Γ(ν) x^ν K_ν(x), x = (2ν)^½ r, r = distance/ℓ.

    A process is differentiable in the mean square k times where ν > k.

    Parameters
    ----------
    variance : float
        σ².
    length : float, or sequence of float
        ℓ, in the units of `spacing`; on a grid also one for each axis, r being (Σ (xᵢ/ℓᵢ)²)^½.
    nu : float
        ν, below 100; it is a free parameter unless held by ``.fix("nu")``. With ½, 3/2 and 5/2 the
        values are in closed form.

    See Also
    --------
    Exponential, SquaredExponential : of which they are those with ν = ½ and of ν → ∞.

    Notes
    -----
    K_ν and its derivative by ν are integrals, by the trapezoidal rule, of up to some 1000
    distances; of more by interpolation in the logarithm of the distance. The errors are below
    1e-12 σ².

    References
    ----------
    M. L. Stein, Interpolation of Spatial Data, Springer (1999).

    Examples
    --------
    >>> from toeplitz_mg.covariances import Matern
    >>> k = Matern(length=10.0, nu=1.5).fix("nu")
    >>> k.names
    ('variance', 'length')
    >>> k(3).round(4)
    array([1.    , 0.9866, 0.9522])
    """

    def __init__(self, variance: Any = 1.0, length: Any = 1.0, nu: Any = 1.5) -> None:
        super().__init__(variance=variance, length=length, nu=nu)

    def _profile(self, r: Array, wanted: frozenset[str]) -> tuple[Array, Array, Derivatives]:
        (nu,) = self._values("nu")
        by: Derivatives = {}
        if nu not in CLOSED_FORMS or "nu" in wanted:
            near = (r > 0.0) & (sqrt(2.0 * nu) * r < FAR)
            rho, slope, by_nu = np.zeros((3, *r.shape))
            rho[r == 0.0] = 1.0
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
