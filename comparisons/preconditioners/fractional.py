"""Fractional diffusion: iterations of τ and of its rivals on the standard problems.

The domain is the unit interval or square, with zero outside of it: steady, and one step in time by
Euler's implicit rule, as long as an element; derivatives of Riesz and two-sided ones of Riemann and
Liouville, constant and variable coefficients. CG for symmetric matrices, GMRES for others, from a
zero guess to a true residual of 1e-8, for a random right-hand side. Of a matrix that is not
symmetric all but T. Chan's circulant are those of the symmetric part. For Riesz derivatives the
eigenvalues with τ lie between 1/2 and 3/2 (Huang, Lin, Ng, Sun 2022): at most 15 iterations of CG.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import gamma
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import diags_array, eye_array
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import PRECONDITIONERS, Choice, Run, solve
from comparisons.harness.report import Row
from toeplitz_mg._typing import Array
from toeplitz_mg.fractional import grunwald_coefficients, riesz_coefficients

MAXITER = 100  # Iterations after which a method has not converged.
ORDERS = (1.2, 1.5, 1.8)
SIZES = {1: (2**11 - 1, 2**14 - 1), 2: (2**5 - 1, 2**7 - 1)}
METHODS: dict[str, Choice] = {"tau": tmg.tau_preconditioner}
METHODS |= {name: PRECONDITIONERS[name] for name in ("sine", "cosine", "T. Chan", "default")}

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


def run_one(S: LinearOperator, preconditioner: Choice) -> Run:
    """Set up and solve, by CG where the matrix is symmetric, else by GMRES."""
    b = np.random.default_rng(0).standard_normal(S.shape[0])
    if S.H is S:
        return solve(S, b, preconditioner, maxiter=MAXITER)
    # The second cycle is for what the recurrence for the residual has missed by.
    cycles = {"restart": MAXITER, "maxiter": 2, "callback_type": "pr_norm"}

    def of_part(S: LinearOperator) -> LinearOperator | None:
        try:
            return preconditioner(S)
        except ValueError:  # It needs a symmetric matrix.
            return preconditioner((S + S.T) / 2)

    return solve(S, b, of_part, solver=tmg.gmres, **cycles)


def measure(problem: str, axes: int, order: float, n: int) -> Iterator[Row]:
    """Solve a problem with each of the methods."""
    S = PROBLEMS[axes][problem](order, n)
    for method, choice in METHODS.items():
        row: Row = {"problem": problem, "axes": axes, "order": order, "n": n, "method": method}
        try:
            solved = run_one(S, choice)
        except np.linalg.LinAlgError as error:
            yield row | {"note": str(error)[:60]}
        else:
            measured = {"iterations": solved.count, "units": solved.units, "cpu_s": solved.seconds}
            yield row | measured | {"residual": solved.residual, "note": ""}


def run(
    folder: Path,
    sizes: Mapping[int, Sequence[int]] = SIZES,
    problems: Sequence[str] = tuple(PROBLEMS[1]),
    orders: Sequence[float] = ORDERS,
) -> None:
    """Measure every problem by all methods."""
    room = {"problem": 33, "method": 8}
    table = report.Table("Iterations to a residual of 1e-8", folder / "fractional.csv", form, room)
    for axes, lengths in sizes.items():
        for problem in problems:
            for order in orders:
                for n in lengths:
                    table.extend(measure(problem, axes, order, n))


def form(row: Row) -> Row:
    """Return a row as it is printed."""
    formats = {"iterations": "", "units": ".1f", "cpu_s": ".3g", "note": ""}
    names = {key: row[key] for key in ("problem", "axes", "order", "n", "method")}
    return names | report.format_cells(row, formats)


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of docs/which_method.md: a line for each problem, of its largest matrices.

    The iterations are those of each order, one after the other.
    """
    table: list[Row] = []
    for (axes, problem), own in report.group(rows, "axes", "problem").items():
        n = max(row["n"] for row in own)
        line: Row = {"problem": problem, "n": f"{n}" + " squared" * (axes > 1)}
        largest = [row for row in own if row["n"] == n]
        for method, measured in report.group(largest, "method").items():
            counts = [row.get("iterations") for row in measured]
            line[method] = ", ".join("refused" if k is None else str(k) for k in counts)
        table.append(line)
    return table
