"""What the main command and `solve` share: iterating on a linear system, and the report."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import prod
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from scipy.linalg import norm
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.cli import files, report
from toeplitz_mg.cli.arguments import PRECONDITIONERS
from toeplitz_mg.cli.report import format_error, print_step
from toeplitz_mg.operators.base import grid_of
from toeplitz_mg.operators.lifting import unwrap


@dataclass(frozen=True)
class System:
    """A system to solve, and where its unknowns lie."""

    title: str
    A: LinearOperator
    b: Array
    x: Array | None = None  # The centres of the elements, mm, for the plot.
    on_grid: bool = False  # Whether the solution is wanted on the whole grid of the mask.

    @property
    def mask(self) -> Mask | None:
        """The unknowns among the points of the grid, or None where these are all."""
        return unwrap(self.A)[1]

    def residual(self, x: Array) -> float:
        """Return ‖b - A x‖ / ‖b‖."""
        return _size(self.b - self.A @ x) / _size(self.b)

    def plot(self, x: Array, residuals: Sequence[float], path: Path, dpi: int) -> None:
        """Draw a solution and the residuals, and say so."""
        grid = self._spread(x).reshape(grid_of(self.A))
        places = None if self.x is None else self._spread(self.x)
        files.plot(path, dpi, self.title, grid, places, residuals)
        print(f"drawn in {path}")

    def _spread(self, values: Array) -> Array:
        return files.spread(values, self.mask, np.nan)

    def on_its_grid(self, x: Array) -> Array:
        """Return a solution in the shape of the right-hand side: the unknowns, or the grid."""
        return files.spread(x, self.mask if self.on_grid else None, 0.0)


@dataclass(frozen=True)
class Solution:
    """What an iteration has found, and what that took."""

    x: Array
    residuals: list[float]  # ‖b - A x‖/‖b‖ of the first guess, and after each iteration.
    residual: float  # ‖b - A x‖/‖b‖ of the solution.
    converged: bool
    units: float  # The work, in products with the matrix on the whole grid.
    seconds: float  # The time of the iteration, without that of the display.


@dataclass
class Progress:
    """Prints the true residual after each iteration; what that costs is not in the figures."""

    system: System
    waiting: report.Waiting
    residuals: list[float] = field(default_factory=list)
    points: float = 0.0  # Points of the transforms that the display itself has taken.
    seconds: float = 0.0

    def __call__(self, x: Array) -> None:
        """Take the iterate `x`."""
        start = perf_counter()
        with tmg.count_products() as work:
            self.residuals.append(self.system.residual(x))
        self.waiting.before_line()
        print_step(len(self.residuals), self.residuals[-1])
        self.points += work.points
        self.seconds += perf_counter() - start


def run(
    system: System,
    options: argparse.Namespace,
    published: Callable[[str], str] = lambda label: "",
) -> int:
    """Solve a system, and return the exit status.

    `published` gives a line of the report that stands for what others have found, or nothing.
    """
    check_right_hand_side(system.b)
    if not system.b.any():
        return answer_zero(system, options)
    start = perf_counter()
    with report.Waiting("setting up"):
        M, label = set_up(system.A, options)
    setup = perf_counter() - start
    method = label if M is None else M
    print(f"{system.title}\n{'CG with ' if options.solver == 'cg' else ''}{method}\n")
    solution = iterate(system, M, options)
    written = solution.converged and options.output is not None
    if written:  # First of all, so that the solution does not depend on what can be printed.
        files.save(options.output, system.on_its_grid(solution.x))
    print_report(solution, setup, published(label))
    if not solution.converged:
        advice = f"--rtol {options.rtol:g} is out of reach: take a larger one"
        if len(solution.residuals) > options.maxiter:
            advice = f"--maxiter {options.maxiter} is used up: allow more iterations"
        others = "" if options.solver == "cg" else ", or --solver cg"
        print(f"{advice}, or take another --preconditioner{others}")
    if written:
        print(f"written to {options.output}")
    if options.plot is not None:
        system.plot(solution.x, solution.residuals, options.plot, options.dpi)
    return 0 if solution.converged else 1


def check_right_hand_side(b: Array) -> None:
    """Refuse a right-hand side that no residual can be relative to."""
    if not np.isfinite(_size(b)):
        raise ValueError("the norm of the right-hand side is not a number of float64: scale it")


def answer_zero(system: System, options: argparse.Namespace) -> int:
    """Write the solution of A x = 0, and return the exit status."""
    print(f"{system.title}\n\nconverged: the right-hand side is zero, and so is the solution")
    if options.output is not None:
        files.save(options.output, system.on_its_grid(system.b))
        print(f"written to {options.output}")
    if options.plot is not None:
        system.plot(system.b, [], options.plot, options.dpi)
    return 0


def set_up(A: LinearOperator, options: argparse.Namespace) -> tuple[LinearOperator | None, str]:
    """Return the approximate inverse that the options ask for, and its name."""
    name, cycle = options.preconditioner, options.cycle
    if name == "none":
        return None, "plain"
    try:
        if name != "multigrid":
            return PRECONDITIONERS[name](A), name
        M = tmg.multigrid(
            A,
            smoother=PRECONDITIONERS[options.smoother],
            pre=cycle.pre,
            post=cycle.post,
            gamma=1 if cycle.kind == "V" else 2,
        )
    except (ValueError, np.linalg.LinAlgError) as error:
        instead = (
            "; of what is advised the command line has the preconditioners, as --solver cg "
            "--preconditioner NAME, and none"
        )
        raise ValueError(f"{error}{instead}") from error
    return M, str(cycle)


def iterate(system: System, M: LinearOperator | None, options: argparse.Namespace) -> Solution:
    """Iterate from zero or a random guess, and print the residuals."""
    print(" iteration   residual / right-hand side", flush=True)
    progress = Progress(system, report.Waiting("iterating"))
    guess, first = None, 1.0
    if options.seed is not None:
        guess = np.random.default_rng(options.seed).random(len(system.b))
        first = system.residual(guess)
    solver = tmg.cg if options.solver == "cg" else tmg.richardson
    stop: dict[str, Any] = {"rtol": options.rtol, "maxiter": options.maxiter}
    start = perf_counter()
    with progress.waiting, tmg.count_products() as work:
        x, info = solver(system.A, system.b, guess, M=M, callback=progress, **stop)
    seconds = perf_counter() - start - progress.seconds
    work.points -= progress.points
    residual = system.residual(x)
    # The recurrence of cg may have drifted from the true residual: the latter decides.
    converged = info == 0 and residual <= 1.01 * options.rtol
    residuals = [first, *progress.residuals]
    return Solution(x, residuals, residual, converged, work.units(prod(grid_of(system.A))), seconds)


def print_report(solution: Solution, setup: float, published: str) -> None:
    """Print what was found, and beside it what others have."""
    count = len(solution.residuals) - 1
    factor = (solution.residual / solution.residuals[0]) ** (1.0 / max(count, 1))
    found = "converged" if solution.converged else "NOT CONVERGED"
    print(
        f"\n{found}: residual {format_error(solution.residual, 2)}\n"
        f"{'':12s}iterations   factor   work units   seconds\n"
        f"{'this run':12s}{count:10d}   {factor:6.4f}   {solution.units:10.1f}   "
        f"{solution.seconds:7.2f}   and {setup:.2f} to set up"
    )
    if published:
        print(published)


def _size(v: Array) -> float:
    # The norm is taken in float64, as that of numbers of float32 may be no number of float32.
    return float(norm(v.astype(np.float64, copy=False), check_finite=False))
