"""Linear systems of the paper (`toeplitz-mg paper`) and from files (`toeplitz-mg solve`)."""

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
from toeplitz_mg.cli.arguments import PRECONDITIONERS, complete_linear
from toeplitz_mg.cli.report import format_error, print_step
from toeplitz_mg.operators.base import grid_of
from toeplitz_mg.operators.lifting import unwrap
from toeplitz_mg.paper import published
from toeplitz_mg.paper.problems import TESTS
from toeplitz_mg.tables import load_table


@dataclass(frozen=True)
class System:
    """A linear system, and the positions of its unknowns."""

    title: str
    A: LinearOperator
    b: Array
    x: Array | None = None  # Element centres for the plot, mm.
    on_grid: bool = False  # Whether to return the solution on the whole grid of the mask.

    @property
    def mask(self) -> Mask | None:
        """The grid points that are unknowns, or None if all are."""
        return unwrap(self.A)[1]

    def residual(self, x: Array) -> float:
        """Return ‖b - A x‖ / ‖b‖."""
        return _size(self.b - self.A @ x) / _size(self.b)

    def plot(self, x: Array, residuals: Sequence[float], options: argparse.Namespace) -> None:
        """Plot a solution and the residuals, and report the file."""
        grid = self._spread(x).reshape(grid_of(self.A))
        places = None if self.x is None else self._spread(self.x)
        where, over = (options.plot, options.dpi), bool(options.overwrite)
        files.plot(*where, self.title, grid, places, residuals, overwrite=over)
        print(f"drawn in {options.plot}")

    def _spread(self, values: Array) -> Array:
        return files.spread(values, self.mask, np.nan)

    def on_its_grid(self, x: Array) -> Array:
        """Return a solution in the shape of the right-hand side: the unknowns, or the grid."""
        return files.spread(x, self.mask if self.on_grid else None, 0.0)


@dataclass(frozen=True)
class Solution:
    """The result of an iteration, and its cost."""

    x: Array
    residuals: list[float]  # ‖b - A x‖/‖b‖ for the initial guess, and after each iteration.
    residual: float  # ‖b - A x‖/‖b‖ for the solution.
    converged: bool
    units: float  # The work in units of a product with the matrix on the whole grid.
    seconds: float  # The time of the iteration, without the progress display.


@dataclass
class Progress:
    """Prints the true residual after each iteration; its cost is not part of the figures."""

    system: System
    waiting: report.Waiting
    residuals: list[float] = field(default_factory=list)
    points: float = 0.0  # Number of points of the transforms for the display.
    seconds: float = 0.0

    def __call__(self, x: Array) -> None:
        """Print the residual of the iterate `x`."""
        start = perf_counter()
        with tmg.count_products() as work:
            self.residuals.append(self.system.residual(x))
        self.waiting.before_line()
        print_step(len(self.residuals), self.residuals[-1])
        self.points += work.points
        self.seconds += perf_counter() - start


def run_paper(given: argparse.Namespace) -> tuple[int, dict[str, Any]]:
    """Run the command, and return the exit status and the figures by name."""
    options = complete_linear(given)
    problem = TESTS[options.test](options.n)
    title = f"Test {options.test} of the paper with {options.n} elements"
    system = System(title, problem.A, problem.b, problem.x)
    return _run(system, options, lambda label: _format_published(label, options))


def run_solve(given: argparse.Namespace) -> tuple[int, dict[str, Any]]:
    """Run the command, and return the exit status and the figures by name."""
    options = complete_linear(given)
    A: LinearOperator = tmg.ToeplitzOperator(_load_real(options.column))
    if options.mask is not None:
        A = tmg.MaskedOperator(A, _load_mask(options.mask))
    b = _load_real(options.rhs)
    on_grid = options.mask is not None and b.shape == A.grid_shape
    if on_grid:
        b = b[A.mask]
    elif b.size == A.shape[0] and b.shape in (A.grid_shape, (A.shape[0],)):
        b = b.ravel()
    else:
        raise ValueError(
            f"{options.rhs} has shape {b.shape}, but the unknowns are {A.shape[0]} "
            f"on the grid {A.grid_shape}"
        )
    title = f"{options.column} with {A.shape[0]} unknowns"
    return _run(System(title, A, b, on_grid=on_grid), options)


def _run(
    system: System,
    options: argparse.Namespace,
    of_others: Callable[[str], str] = lambda label: "",
) -> tuple[int, dict[str, Any]]:
    """Solve a system, and return the exit status and the figures by name.

    `of_others` returns a line of the report with published values, or an empty string.
    """
    _check_right_hand_side(system.b)
    if not system.b.any():
        return _answer_zero(system, options)
    start = perf_counter()
    with report.Waiting("setting up"):
        M, label = _set_up(system.A, options)
    setup = perf_counter() - start
    method = label if M is None else M
    print(f"{system.title}\n{'CG with ' if options.solver == 'cg' else ''}{method}\n")
    solution = _iterate(system, M, options)
    written, over = solution.converged and options.output is not None, bool(options.overwrite)
    if written:  # First, so that a failure to print does not prevent it.
        files.save(options.output, system.on_its_grid(solution.x), overwrite=over)
    _print_report(solution, setup, of_others(label))
    if not solution.converged:
        advice = f"--rtol {options.rtol:g} is out of reach: take a larger one"
        if len(solution.residuals) > options.maxiter:
            advice = f"--maxiter {options.maxiter} is used up: allow more iterations"
        others = "" if options.solver == "cg" else ", or --solver cg"
        print(f"{advice}, or take another --preconditioner{others}")
    figures = _figures(solution, setup)
    if written:
        print(f"written to {options.output}")
    elif solution.converged and options.column is not None:
        figures["solution"] = _print_solution(system.on_its_grid(solution.x))
    if options.plot is not None:
        system.plot(solution.x, solution.residuals, options)
    return (0 if solution.converged else 1), figures


def _figures(solution: Solution, setup: float) -> dict[str, Any]:
    """Return the figures of a solution that are printed, by name."""
    return {
        "converged": solution.converged,
        "residual": solution.residual,
        "iterations": len(solution.residuals) - 1,
        "work_units": solution.units,
        "seconds": solution.seconds,
        "setup_seconds": setup,
        "residuals": solution.residuals,
    }


def _print_solution(x: Array) -> Array:
    """Print the solution if no file takes it; if long, only its first and last values."""
    print(f"\nsolution\n{np.array2string(x, threshold=1000)}")
    return x


def _check_right_hand_side(b: Array) -> None:
    """Refuse a zero right-hand side, for which relative residuals are undefined."""
    if not np.isfinite(_size(b)):
        raise ValueError("the norm of the right-hand side is not a number of float64: scale it")


def _answer_zero(system: System, options: argparse.Namespace) -> tuple[int, dict[str, Any]]:
    """Write the solution of A x = 0, and return the exit status and the figures by name."""
    figures: dict[str, Any] = {"converged": True, "residual": 0.0, "iterations": 0}
    print(f"{system.title}\n\nconverged: the right-hand side is zero, and so is the solution")
    if options.output is not None:
        over = bool(options.overwrite)
        files.save(options.output, system.on_its_grid(system.b), overwrite=over)
        print(f"written to {options.output}")
    elif options.column is not None:
        figures["solution"] = _print_solution(system.on_its_grid(system.b))
    if options.plot is not None:
        system.plot(system.b, [], options)
    return 0, figures


def _set_up(A: LinearOperator, options: argparse.Namespace) -> tuple[LinearOperator | None, str]:
    """Return the requested approximate inverse and its name."""
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


def _iterate(system: System, M: LinearOperator | None, options: argparse.Namespace) -> Solution:
    """Iterate from zero or a random initial guess, and print the residuals."""
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
    # The recurrence of cg may have drifted from the true residual, which decides.
    converged = info == 0 and residual <= 1.01 * options.rtol
    residuals = [first, *progress.residuals]
    return Solution(x, residuals, residual, converged, work.units(prod(grid_of(system.A))), seconds)


def _print_report(solution: Solution, setup: float, of_others: str) -> None:
    """Print the result, and published values beside it."""
    count = len(solution.residuals) - 1
    factor = (solution.residual / solution.residuals[0]) ** (1.0 / max(count, 1))
    found = "converged" if solution.converged else "NOT CONVERGED"
    print(
        f"\n{found}: residual {format_error(solution.residual, 2)}\n"
        f"{'':12s}iterations   factor   work units   seconds\n"
        f"{'this run':12s}{count:10d}   {factor:6.4f}   {solution.units:10.1f}   "
        f"{solution.seconds:7.2f}   and {setup:.2f} to set up"
    )
    if of_others:
        print(of_others)


def _size(v: Array) -> float:
    # The norm is computed in float64, as it may overflow in float32.
    return float(norm(v.astype(np.float64, copy=False), check_finite=False))


def _format_published(label: str, options: argparse.Namespace) -> str:
    """Return the published last line, as far as it is legible."""
    log_n = options.n.bit_length() - 1
    if options.n != 2**log_n or options.rtol != 1e-8 or options.solver == "cg":
        return ""
    is_solver = options.solver == "richardson" and label == "fft-rsm"
    key = (options.test, "solver" if is_solver else label)
    table = {"fft-rsm": published.ROW_SUM, "fft-sd": published.DEFLATION}.get(options.smoother, {})
    cell = (published.SOLVER[options.test] if is_solver else table.get(key, {})).get(log_n)
    at_the_end = log_n == 20 and (is_solver or options.smoother == "fft-rsm")
    units = published.WORK_UNITS.get(key) if at_the_end else None
    seconds = published.CPU_SECONDS.get(key) if at_the_end else None
    if cell is None and units is None:
        return ""
    if cell is not None:
        iterations, factor = str(cell.iterations), f"{cell.factor:.4f}"
    else:  # The cell is illegible, but its value follows from Table VI.
        factor, a_step = "", 2 if is_solver else published.UNITS_PER_CYCLE[label]
        iterations = str((units or 0) // a_step)
    line = f"{'the paper':12s}{iterations:>10s}   {factor:>6s}   {units or '':>10}"
    return line + (f"   {seconds:>7}   in Matlab, at 3.17 GHz" if seconds else "")


def _load_real(path: Path) -> Array:
    """Read real numbers in double precision, which the requested residual needs."""
    array = load_table(path)
    if array.dtype.kind not in "buif":
        raise ValueError(f"{path} has dtype {array.dtype}, but must be of real numbers")
    wrong = np.argwhere(~np.isfinite(array))
    if wrong.size:
        place = tuple(wrong[0].tolist())
        raise ValueError(f"{path} has the value {array[place]} at {place}, but must be finite")
    return array.astype(np.float64)


def _load_mask(path: Path) -> Array:
    """Read a mask of booleans, or of 0 and 1."""
    mask = load_table(path)
    if mask.dtype == np.bool_:
        return mask
    if mask.dtype.kind not in "uif":
        raise ValueError(f"{path} has dtype {mask.dtype}, but must be of booleans, or of 0 and 1")
    others = mask[(mask != 0) & (mask != 1)]
    if others.size:
        raise ValueError(f"{path} has the value {others[0]:g}, but must be of 0 and 1")
    return mask.astype(bool)
