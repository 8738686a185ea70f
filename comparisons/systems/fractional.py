"""Standard problems of fractional diffusion, on one axis and on two, of any order.

The domain is the unit interval or square, with zero outside of it. A time step is one of the
length of an element, by Euler's implicit rule.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import gamma
from typing import Any

import numpy as np
from scipy.sparse import diags_array, eye_array
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from toeplitz_mg._typing import Array
from toeplitz_mg.fractional import grunwald_coefficients, riesz_coefficients

Coefficient = Callable[[Array, float], Any]  # Of x and the order.


@dataclass(frozen=True)
class Flow:
    """Coefficients of the derivative from the left and of that from the right, along each axis."""

    left: Coefficient
    right: Coefficient


# The last three are those of the literature on variable coefficients.
FLOWS = {
    "constant": Flow(lambda x, order: 0.7 + 0.0 * x, lambda x, order: 0.3 + 0.0 * x),
    "smooth": Flow(lambda x, order: 1.0 + x**2, lambda x, order: 1.0 + (1.0 - x) ** 2),
    "degenerate": Flow(
        lambda x, order: gamma(3.0 - order) * x**order,
        lambda x, order: gamma(3.0 - order) * (1.0 - x) ** order,
    ),
    "jump 1:100": Flow(*2 * (lambda x, order: np.where(x < 0.5, 1.0, 100.0),)),
}


def along(axis: int, axes: int, c: Array, r: Array) -> tmg.ToeplitzOperator:
    """Return the matrix that has a Toeplitz matrix along one axis, and the unit matrix else."""
    n = len(c)
    lags = np.zeros((2 * n - 1,) * axes)
    line = tuple(slice(None) if k == axis else n - 1 for k in range(axes))
    lags[line] = np.concatenate([r[:0:-1], c])
    return tmg.ToeplitzOperator.from_lags(lags)


def riesz(axes: int, steps: float, order: float, n: int) -> LinearOperator:
    """Return -h^α times Riesz derivatives along each axis, plus a multiple of the unit matrix."""
    c = riesz_coefficients(order, n)
    A = sum(along(axis, axes, c, c) for axis in range(axes))
    return A + _of_time(steps, order, n) * eye_array(n**axes)


def varied_riesz(axes: int, steps: float, order: float, n: int) -> LinearOperator:
    """Return Riesz derivatives with a coefficient that varies by a factor of e^2."""
    x = np.mean(np.meshgrid(*[_points(n)] * axes, indexing="ij"), axis=0)
    c = riesz_coefficients(order, n)
    D = diags_array(np.exp(2.0 * x.ravel()))
    A = sum(along(axis, axes, c, c) for axis in range(axes))
    return D @ A + _of_time(steps, order, n) * eye_array(n**axes)


def two_sided(flow: str, axes: int, steps: float, order: float, n: int) -> LinearOperator:
    """Return -h^α times Riemann-Liouville derivatives, from both sides of each axis."""
    S: Any = _of_time(steps, order, n) * eye_array(n**axes)
    for axis, x in enumerate(np.meshgrid(*[_points(n)] * axes, indexing="ij")):
        A = along(axis, axes, *grunwald_coefficients(order, n))
        left, right = (
            diags_array(f(x.ravel(), order)) for f in (FLOWS[flow].left, FLOWS[flow].right)
        )
        S = S + left @ A + right @ A.T
    return S


def _points(n: int) -> Array:
    return np.arange(1, n + 1) / (n + 1)


def _of_time(steps: float, order: float, n: int) -> float:
    """Return h^α over the length of a time step, of which `steps` are as long as an element."""
    return steps * float(n + 1) ** (1.0 - order)


def _problems(axes: int) -> dict[str, Callable[[float, int], LinearOperator]]:
    result: dict[str, Callable[[float, int], LinearOperator]] = {}
    for time, steps in (("steady", 0.0), ("time step", 1.0)):
        result[f"Riesz, {time}"] = partial(riesz, axes, steps)
        result[f"Riesz e^2x, {time}"] = partial(varied_riesz, axes, steps)
        for flow in FLOWS:
            result[f"two-sided {flow}, {time}"] = partial(two_sided, flow, axes, steps)
    return result


PROBLEMS = {axes: _problems(axes) for axes in (1, 2)}
