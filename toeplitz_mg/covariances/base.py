"""Base classes of covariances with parameters, their derivatives, sums and products."""

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import reduce
from itertools import chain
from math import comb, inf
from operator import add, mul
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.values import count, finite, in_range, numbers, positive

POSITIVE = (0.0, inf)
BOUNDS = {"nu": (0.0, 100.0), "hurst": (0.0, 1.0), "d": (-1.0, 0.5)}  # Others are positive.
# Polynomials with one coefficient per lag and roots outside the unit circle; their signs.
LAGGED = {"ar": -1.0, "ma": 1.0}
SEVERAL = dict.fromkeys(("length", "period"), ", or one for each axis")
SEVERAL |= dict.fromkeys(LAGGED, ", or a sequence of them")
STEP = 6e-6  # Step of central differences relative to the parameter: eps^(1/3).


@dataclass(frozen=True)
class Parameter:
    """A parameter of a covariance; several values of one argument form a group."""

    name: str
    group: str
    value: float
    low: float
    high: float
    is_free: bool = True

    def __post_init__(self) -> None:
        finite(self.name, self.value)
        if not self.low < self.value < self.high:
            rules = {POSITIVE: "be positive", (-inf, inf): "be finite"}
            rule = rules.get((self.low, self.high), f"lie between {self.low:g} and {self.high:g}")
            raise ValueError(f"{self.name} is {self.value!r}, but must {rule}")
        if (self.low, self.high) == POSITIVE:
            in_range(self.name, self.value)


class Lags:
    """The lags of a grid: its shape and spacing."""

    def __init__(self, n: Any, spacing: Any) -> None:
        shape = n if isinstance(n, tuple | list) else (n,)
        self.shape = tuple(count("n", each) for each in shape)
        if not self.shape:
            raise ValueError("n is (), but must be a number of points, or one for each axis")
        given = spacing if isinstance(spacing, tuple | list) else (spacing,) * len(shape)
        self.spacing = tuple(positive("spacing", each) for each in given)
        if len(self.spacing) != len(self.shape):
            raise ValueError(
                f"spacing is {spacing!r}, but must be a number or have {len(self.shape)}, "
                "one for each axis"
            )
        for each in self.spacing:
            in_range("spacing", each)

    def by_axis(self, values: tuple[Any, ...], group: str) -> tuple[Any, ...]:
        """Return one value per axis, from one for all axes or one each."""
        if len(values) not in (1, len(self.shape)):
            raise ValueError(
                f"{group} has {len(values)} values, but the grid has {len(self.shape)} axes: "
                "give one for all of them, or one for each"
            )
        return values if len(values) > 1 else values * len(self.shape)

    def counts(self) -> Sequence[Array]:
        """Return the indices 0, 1, … along each axis, for broadcasting."""
        return np.meshgrid(*map(np.arange, map(float, self.shape)), indexing="ij", sparse=True)

    def distances(self) -> Iterator[Array]:
        """Yield the lags along each axis, for broadcasting."""
        for k, spacing in zip(self.counts(), self.spacing, strict=True):
            yield k * spacing if spacing != 1.0 else k

    def turns(self, periods: tuple[float, ...]) -> Iterator[Array]:
        """Yield xᵢ/Tᵢ minus whole turns along each axis, accurate to rounding at any lag."""
        for k, spacing, T in zip(self.counts(), self.spacing, periods, strict=True):
            period = T / spacing
            error = float(Fraction(T) / Fraction(spacing) - Fraction(period))
            yield np.fmod(k, period) / period - k * (error / period**2)

    def steps(self, kind: str) -> int:
        """Return the number of points, for a covariance on one axis."""
        if len(self.shape) > 1:
            raise ValueError(f"{kind} is a process of one axis, but the grid has {self.shape}")
        return self.shape[0]


Derivatives = dict[str, Array]  # By parameter name.


class Covariance:
    """A stationary covariance on a regular grid, with its parameters.

    ``k(n)`` returns the covariances at the lags 0, 1, …, n - 1, the first column of a Toeplitz
    matrix, and ``k((n1, n2))`` those on a grid. ``spacing=`` is the distance between neighbours
    (default 1), or one per axis. ``k + l``, ``k * l`` and ``2.0 * k`` are sums, products and
    multiples. Parameter names start with the number of the term, as in ``"1.length"``, or
    ``"0.1.length"`` if the term is a sum itself. Covariances are immutable.

    Raises
    ------
    ValueError
        If a parameter is outside of its bounds, or its magnitude is below 1e-40 or above 1e40.

    See Also
    --------
    Custom : a covariance given by your own function.
    toeplitz_mg.ToeplitzNormal : the normal distribution, ``ToeplitzNormal(k(n))``.

    Examples
    --------
    >>> from toeplitz_mg import covariances
    >>> k = covariances.Exponential(2.0, length=5.0) + covariances.WhiteNoise(0.1)
    >>> k.names
    ('0.variance', '0.length', '1.variance')
    >>> k(3).round(4)
    array([2.1   , 1.6375, 1.3406])
    >>> k.fix("1.variance").theta
    array([2., 5.])
    """

    __array_ufunc__ = None  # So that NumPy scalars leave multiplication to this class.
    _parameters: tuple[Parameter, ...]

    def _evaluate(self, lags: Lags, wants_gradient: bool) -> tuple[Array, list[Array]]:
        """Return the values and, if requested, the derivatives by the free parameters."""
        raise NotImplementedError

    def _replaced(self, parameters: tuple[Parameter, ...]) -> Self:
        """Return a copy with other values of the parameters, or other free parameters."""
        other = copy(self)
        other._parameters = parameters
        other._check()
        return other

    def _check(self) -> None:
        """Raise an error if the parameters together do not give a covariance."""

    @property
    def _free(self) -> list[Parameter]:
        return [p for p in self._parameters if p.is_free]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the free parameters, one for each value.

        ``"length[0]"`` is the length along the first axis, ``"ar.L1"`` the first autoregressive
        coefficient.
        """
        return tuple(p.name for p in self._free)

    @property
    def theta(self) -> Array:
        """The values of the free parameters, of shape (p,)."""
        return np.array([p.value for p in self._free], dtype=np.float64)

    @property
    def bounds(self) -> Array:
        """The open intervals for the free parameters, of shape (p, 2)."""
        return np.array([(p.low, p.high) for p in self._free], dtype=np.float64).reshape(-1, 2)

    @property
    def _polynomials(self) -> tuple[tuple[float, slice], ...]:
        """Where in `theta` the coefficients of 1 ± c₁ z ± … stand, several and all free; ±1."""
        free, found = [p.group for p in self._free], []
        for group in dict.fromkeys(free):
            lagged, size = group.rpartition(".")[2], free.count(group)
            if lagged in LAGGED and 1 < size == [p.group for p in self._parameters].count(group):
                first = free.index(group)
                found.append((LAGGED[lagged], slice(first, first + size)))
        return tuple(found)

    def with_theta(self, theta: ArrayLike) -> Self:
        """Return a copy with other values of the free parameters, of shape (p,).

        Raises a ValueError if the number of values is wrong, or a value is outside of its bounds.
        """
        values, names = numbers("theta", theta), self.names
        if values.shape != (len(names),):
            raise ValueError(
                f"theta has shape {values.shape}, but must have {(len(names),)}: {', '.join(names)}"
            )
        given = iter(values.tolist())
        return self._replaced(
            tuple(replace(p, value=next(given)) if p.is_free else p for p in self._parameters)
        )

    def fix(self, *names: str) -> Self:
        """Return a copy in which these parameters are held at their values.

        ``"length"`` also means ``"length[0]"``, ``"length[1]"``, …. Raises a ValueError for an
        unknown name.
        """
        for name in names:
            if not any(name in (p.name, p.group) for p in self._parameters):
                known = ", ".join(p.name for p in self._parameters)
                raise ValueError(f"{name!r} is no parameter, but must be one of {known}")
        return self._replaced(
            tuple(
                replace(p, is_free=p.is_free and not {p.name, p.group} & {*names})
                for p in self._parameters
            )
        )

    def __call__(self, n: Any, *, spacing: Any = 1.0) -> Array:
        """Return the covariances at the lags of a grid: the first column of a Toeplitz matrix."""
        return self._evaluate(Lags(n, spacing), False)[0]

    def gradient(self, n: Any, *, spacing: Any = 1.0) -> Array:
        """Return the derivatives by the free parameters, as `values_and_gradient` does."""
        return self.values_and_gradient(n, spacing=spacing)[1]

    def values_and_gradient(self, n: Any, *, spacing: Any = 1.0) -> tuple[Array, Array]:
        """Return the covariances and their derivatives, which share much of the work.

        Returns
        -------
        values : ndarray of shape (n,) or (n1, n2, ...)
        gradient : ndarray of shape (p, n) or (p, n1, n2, ...)
            One row for each parameter. The derivative of a log-likelihood by `theta` is the inner
            product of each row with `by_c` of `ToeplitzNormal.logpdf_and_grad`.
        """
        lags = Lags(n, spacing)
        values, rows = self._evaluate(lags, True)
        return values, np.array(rows).reshape(len(rows), *lags.shape)

    def __add__(self, other: Any) -> "Covariance":
        return Sum(self, other) if isinstance(other, Covariance) else NotImplemented

    def __mul__(self, other: Any) -> "Covariance":
        if isinstance(other, Covariance):
            return Product(self, other)
        return Product(self, factor=positive("factor", other))

    __rmul__ = __mul__


class Kernel(Covariance):
    """A covariance whose parameters are its constructor's arguments, starting with σ²."""

    def __init__(self, **given: Any) -> None:
        parameters: list[Parameter] = []
        for group, value in given.items():
            array, bounds = numbers(group, value), BOUNDS.get(group, POSITIVE)
            rule = SEVERAL.get(group, "")
            if array.ndim > bool(rule) or (array.size == 0 and group not in LAGGED):
                raise ValueError(f"{group} is {value!r}, but must be a number{rule}")
            for i, each in enumerate(array.ravel().tolist()):
                name = f"{group}[{i}]" if array.ndim else group
                if group in LAGGED:
                    name = f"{group}.L{i + 1}"
                    bounds = -float(comb(array.size, i + 1)), float(comb(array.size, i + 1))
                parameters.append(Parameter(name, group, each, *bounds))
        self._parameters = tuple(parameters)
        self._check()

    def _derive(self, lags: Lags, wanted: frozenset[str]) -> tuple[Array, Derivatives]:
        """Return ρ = c/σ² and its derivatives by the other parameters in `wanted`."""
        raise NotImplementedError

    def _evaluate(self, lags: Lags, wants_gradient: bool) -> tuple[Array, list[Array]]:
        variance, wanted = self._parameters[0], self.names if wants_gradient else ()
        rho, by = self._derive(lags, frozenset(wanted))
        rows = [rho if name == variance.name else variance.value * by[name] for name in wanted]
        return variance.value * rho, rows

    def _values(self, group: str) -> tuple[float, ...]:
        """Return the values of a constructor argument."""
        return tuple(p.value for p in self._parameters if p.group == group)

    def _names(self, group: str) -> tuple[str, ...]:
        return tuple(p.name for p in self._parameters if p.group == group)

    def __repr__(self) -> str:
        shown = []
        for group in dict.fromkeys(p.group for p in self._parameters):
            values = self._values(group)
            is_vector = self._names(group) != (group,)
            shown.append(f"{group}={values if is_vector else values[0]!r}")
        held = [repr(p.name) for p in self._parameters if not p.is_free]
        fixed = f".fix({', '.join(held)})" if held else ""
        return f"{type(self).__name__}({', '.join(shown)}){fixed}"


class Composed(Covariance):
    """A multiple of a sum or product of terms; its parameters are those of the terms."""

    _terms: tuple[Covariance, ...]
    _factor: Any  # A number.

    def __init__(self, *given: Covariance, factor: float = 1.0) -> None:
        terms: list[Covariance] = []
        for term in given:
            if isinstance(term, Composed) and type(term) is type(self):
                terms += term._terms  # (a + b) + c is a + b + c.
                factor *= term._factor
            else:
                terms.append(term)
        self._terms, self._factor = tuple(terms), factor

    @property
    def _parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        is_one = len(self._terms) == 1
        return tuple(
            p if is_one else replace(p, name=f"{i}.{p.name}", group=f"{i}.{p.group}")
            for i, term in enumerate(self._terms)
            for p in term._parameters
        )

    def _replaced(self, parameters: tuple[Parameter, ...]) -> Self:
        given, terms = iter(parameters), []
        for term in self._terms:
            pairs = zip(term._parameters, given, strict=False)
            changed = (replace(p, value=new.value, is_free=new.is_free) for p, new in pairs)
            terms.append(term._replaced(tuple(changed)))
        return type(self)(*terms, factor=self._factor)


class Sum(Composed):
    """The sum of covariances, which is that of a sum of independent processes."""

    def _evaluate(self, lags: Lags, wants_gradient: bool) -> tuple[Array, list[Array]]:
        values, rows = zip(*(t._evaluate(lags, wants_gradient) for t in self._terms), strict=True)
        return reduce(add, values), [*chain(*rows)]

    def __repr__(self) -> str:
        return " + ".join(map(repr, self._terms))


class Product(Composed):
    """The product of covariances and a number."""

    def _evaluate(self, lags: Lags, wants_gradient: bool) -> tuple[Array, list[Array]]:
        values, each = zip(*(t._evaluate(lags, wants_gradient) for t in self._terms), strict=True)
        rows: list[Array] = []
        for i, own in enumerate(each):
            others = reduce(mul, values[:i] + values[i + 1 :], self._factor)
            rows += [others * row for row in own]
        return reduce(mul, values, self._factor), rows

    def __repr__(self) -> str:
        terms = [f"({t!r})" if isinstance(t, Sum) else repr(t) for t in self._terms]
        return " * ".join([repr(self._factor)] * (self._factor != 1.0) + terms)


class Custom(Covariance):
    """A covariance given by your own function.

    Parameters
    ----------
    function : callable
        ``function(lags, *theta)`` returns the covariances at `lags`, an array of shape (n,). On a
        grid with d axes, `lags` has shape (d, n1, n2, ...) and the result (n1, n2, ...).
    names : sequence of str
    theta : array_like of shape (p,)
        The names and the values of the parameters.
    bounds : array_like of shape (p, 2), optional
        Open intervals for the parameters; by default unbounded.
    gradient : callable, optional
        ``gradient(lags, *theta)`` returns the derivatives by the parameters, as an array with p
        rows. By default central differences are used, accurate to some ten digits.

    See Also
    --------
    Covariance : the methods of all covariances.

    Examples
    --------
    >>> import numpy as np
    >>> from toeplitz_mg.covariances import Custom
    >>> def cauchy(lags, variance, length):
    ...     return variance / (1.0 + (lags / length) ** 2)
    >>> k = Custom(cauchy, ["variance", "length"], [1.0, 2.0], [(0.0, np.inf), (0.0, np.inf)])
    >>> k(4)
    array([1.        , 0.8       , 0.5       , 0.30769231])
    >>> k.gradient(4).shape
    (2, 4)
    """

    def __init__(
        self,
        function: Callable[..., ArrayLike],
        names: Sequence[str],
        theta: ArrayLike,
        bounds: ArrayLike | None = None,
        gradient: Callable[..., ArrayLike] | None = None,
    ) -> None:
        values, p = numbers("theta", theta), len(names)
        limits = numbers("bounds", [(-inf, inf)] * p if bounds is None else bounds)
        for name, array, shape in (("theta", values, (p,)), ("bounds", limits, (p, 2))):
            if array.shape != shape:
                raise ValueError(f"{name} has shape {array.shape}, but must have {shape}")
        if len(set(names)) < p:
            raise ValueError(f"names are {names!r}, but must differ")
        self._function, self._gradient = function, gradient
        self._parameters = tuple(
            Parameter(name, name, *each)
            for name, *each in zip(names, values.tolist(), *limits.T.tolist(), strict=True)
        )

    def _evaluate(self, lags: Lags, wants_gradient: bool) -> tuple[Array, list[Array]]:
        x = np.stack(np.broadcast_arrays(*lags.distances()))
        x = x[0] if len(lags.shape) == 1 else x
        theta = [p.value for p in self._parameters]
        values = self._shaped("function", self._function(x, *theta), lags.shape)
        free = [i for i, p in enumerate(self._parameters) if p.is_free and wants_gradient]
        if self._gradient is not None and free:
            shape = (len(theta), *lags.shape)
            return values, [*self._shaped("gradient", self._gradient(x, *theta), shape)[free]]
        rows = []
        for i in free:
            p = self._parameters[i]
            step = STEP * (abs(p.value) or 1.0)
            step = min(step, 0.5 * (p.value - p.low), 0.5 * (p.high - p.value))
            above, below = p.value + step, p.value - step
            high = self._function(x, *theta[:i], above, *theta[i + 1 :])
            low = self._function(x, *theta[:i], below, *theta[i + 1 :])
            rows.append((np.asarray(high) - np.asarray(low)) / (above - below))
        return values, rows

    @staticmethod
    def _shaped(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Array:
        array = numbers(name, values)
        if array.shape != shape:
            raise ValueError(
                f"{name} returns an array of shape {array.shape}, but must return {shape}"
            )
        return array

    def __repr__(self) -> str:
        name = getattr(self._function, "__name__", repr(self._function))
        shown = ", ".join(f"{p.name}={p.value!r}" for p in self._parameters)
        return f"Custom({name}, {shown})"
