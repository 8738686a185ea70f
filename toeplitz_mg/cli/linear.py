"""The command line: the paper's problems, a system of the user's own, or a contact problem."""

import argparse
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from scipy.linalg import norm
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from toeplitz_mg import startup
from toeplitz_mg._typing import Array
from toeplitz_mg.cli import contact as contact_cli
from toeplitz_mg.cli import files
from toeplitz_mg.cli.arguments import PRECONDITIONERS, TESTS, UsageError, checked, parser
from toeplitz_mg.paper import published


@dataclass
class System:
    """A system to solve, and where its unknowns lie."""

    title: str
    A: LinearOperator
    b: Array
    mask: Array | None
    x: Array | None = None  # centres of the elements, for the plot
    test: int | None = None  # of the paper
    on_grid: bool = False  # whether the solution is wanted on the whole grid of the mask


@dataclass
class Progress:
    """Prints the true residual after each iteration; what that costs is not in the figures."""

    system: System
    residuals: list[float] = field(default_factory=list)
    products: tmg.ProductCount = field(default_factory=tmg.ProductCount)
    seconds: float = 0.0

    def __call__(self, x: Array) -> None:
        """Take the iterate `x`."""
        start = perf_counter()
        with tmg.count_products() as work:
            residual = self.system.b - self.system.A @ x
        self.residuals.append(_size(residual) / _size(self.system.b))
        print(f"{len(self.residuals):10d}   {self.residuals[-1]:.3e}", flush=True)
        self.products.points += work.points
        self.seconds += perf_counter() - start


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        ``sys.argv[1:]`` by default.

    Returns
    -------
    int
        0 where it has converged, 1 where it has not, 2 for what cannot be done, 130 where
        it was interrupted.
    """
    try:
        startup.raise_again()
        files.print_any_character()
        status = _run(parser().parse_args(arguments))
        print(end="", flush=True)  # so that a full disk is noticed here, not at exit
        return status
    except (UsageError, ValueError, TypeError, np.linalg.LinAlgError, OSError) as error:
        return _failed(f"toeplitz-mg: error: {error}")
    except MemoryError:
        return _failed("toeplitz-mg: error: not enough memory for this system")
    except KeyboardInterrupt:
        return _failed(startup.MESSAGE, startup.STATUS)


def _run(given: argparse.Namespace) -> int:
    if given.command == "contact":
        return contact_cli.run(given)
    options = checked(given)
    system = _users_system(options) if options.command == "solve" else _papers_system(options)
    return _solve(system, options)


def _failed(message: str, status: int = 2) -> int:
    """Say in one line why there is no result, and return the exit status."""
    with suppress(OSError):  # Where not even this can be printed, the status says it.
        print(" ".join(message.splitlines()), file=sys.stderr)
    try:
        print(end="", flush=True)
    except OSError:  # At exit Python would try once more, with a traceback.
        with suppress(OSError):  # of a stream without a file
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return status


def _papers_system(options: argparse.Namespace) -> System:
    problem = TESTS[options.test](options.n)
    title = f"Test {options.test} of the paper with {options.n} elements"
    mask = problem.A.mask if isinstance(problem.A, tmg.MaskedOperator) else None
    return System(title, problem.A, problem.b, mask, problem.x, options.test)


def _users_system(options: argparse.Namespace) -> System:
    A: LinearOperator = tmg.ToeplitzOperator(files.load(options.column))
    mask = None
    if options.mask is not None:
        mask = files.load(options.mask)
        A = tmg.MaskedOperator(A, mask)
    b = files.load(options.rhs)
    if b.dtype.kind not in "buif":
        raise UsageError(f"{options.rhs} has dtype {b.dtype}, but must be of real numbers")
    if not np.isfinite(b).all():
        raise UsageError(f"{options.rhs} has entries that are not finite")
    b = b.astype(np.float32 if b.dtype == np.float32 else np.float64)
    on_grid = mask is not None and b.shape == A.grid_shape
    if on_grid:
        b = b[mask]
    elif b.size == A.shape[0] and b.shape in (A.grid_shape, (A.shape[0],)):
        b = b.ravel()
    else:
        raise UsageError(
            f"{options.rhs} has shape {b.shape}, but the unknowns are {A.shape[0]} "
            f"on the grid {A.grid_shape}"
        )
    return System(f"{options.column} with {A.shape[0]} unknowns", A, b, mask, on_grid=on_grid)


def _method(system: System, options: argparse.Namespace) -> tuple[LinearOperator | None, str]:
    """The approximate inverse and the name of what it makes of an iteration."""
    name = options.preconditioner
    if options.solver == "multigrid":
        if name not in (None, "multigrid"):
            raise UsageError("--preconditioner is for --solver richardson and cg; see --smoother")
        name = "multigrid"
    cycle = options.cycle
    if options.solver == "cg" and (
        name == "fft-sd"
        or (name == "multigrid" and (cycle.pre != cycle.post or options.smoother == "fft-sd"))
    ):
        raise UsageError("cg needs a symmetric preconditioner: neither fft-sd nor pre unlike post")
    if name == "none":
        return None, "plain"
    if name == "multigrid":
        M = tmg.multigrid(
            system.A,
            smoother=PRECONDITIONERS[options.smoother],
            pre=cycle.pre,
            post=cycle.post,
            gamma=1 if cycle.kind == "V" else 2,
        )
        return M, str(cycle)
    return PRECONDITIONERS[name](system.A), name


def _solve(system: System, options: argparse.Namespace) -> int:
    if not system.b.any():
        raise UsageError("the right-hand side is zero: there is nothing to solve")
    if not np.isfinite(_size(system.b)):
        raise UsageError("the norm of the right-hand side is not a number of float64: scale it")
    start = perf_counter()
    M, label = _method(system, options)
    setup = perf_counter() - start
    solver = tmg.cg if options.solver == "cg" else tmg.richardson
    method = M if M is not None else label
    print(f"{system.title}\n{'CG with ' if options.solver == 'cg' else ''}{method}\n")
    print(" iteration   residual / right-hand side", flush=True)

    progress = Progress(system)
    guess = None
    if options.seed is not None:
        guess = np.random.default_rng(options.seed).random(len(system.b))
    first = system.b if guess is None else system.b - system.A @ guess
    start = perf_counter()
    with tmg.count_products() as work:
        x, info = solver(
            system.A,
            system.b,
            guess,
            M=M,
            rtol=options.rtol,
            maxiter=options.maxiter,
            callback=progress,
        )
    seconds = perf_counter() - start - progress.seconds
    n = system.A.shape[0] if system.mask is None else system.mask.size
    work.points -= progress.products.points
    size = _size(system.b)
    residual = _size(system.b - system.A @ x) / size
    # The recurrence of cg may have drifted from the true residual: the latter decides.
    converged = info == 0 and residual <= 1.01 * options.rtol
    count = len(progress.residuals)
    before = _size(first) / size
    factor = (residual / before) ** (1.0 / max(count, 1))
    written = converged and options.output is not None
    if written:  # first of all, so that the solution does not depend on what can be printed
        files.save(options.output, _wanted(system, x))
    print(
        f"\n{'converged' if converged else 'NOT CONVERGED'}: residual {residual:.2e}\n"
        f"{'':12s}iterations   factor   work units   seconds\n"
        f"{'this run':12s}{count:10d}   {factor:6.4f}   {work.units(n):10.1f}   {seconds:7.2f}"
        f"   and {setup:.2f} to set up"
    )
    if system.test is not None and (line := _papers_line(system.test, label, options)):
        print(line)
    if written:
        print(f"written to {options.output}")
    if options.plot is not None:
        residuals = [before, *progress.residuals]
        files.plot(options.plot, system.title, x, system.x, system.mask, residuals)
        print(f"drawn in {options.plot}")
    return 0 if converged else 1


def _size(v: Array) -> float:
    # In float64, whatever v is: numbers of float32 may have a norm that is none.
    return float(norm(v.astype(np.float64, copy=False), check_finite=False))


def _wanted(system: System, x: Array) -> Array:
    """The solution as the right-hand side was given: of the unknowns, or on the mask's grid."""
    if not system.on_grid or system.mask is None:
        return x
    grid = np.zeros(system.mask.shape, x.dtype)
    grid[system.mask] = x
    return grid


def _papers_line(test: int, label: str, options: argparse.Namespace) -> str:
    """What the paper has in the place of the last line, as far as it is legible."""
    log_n = options.n.bit_length() - 1
    if options.n != 2**log_n or options.rtol != 1e-8 or options.solver == "cg":
        return ""
    solver = options.solver == "richardson" and label == "fft-rsm"
    key = (test, "solver" if solver else label)
    table = {"fft-rsm": published.ROW_SUM, "fft-sd": published.DEFLATION}.get(options.smoother, {})
    cell = (published.SOLVER[test] if solver else table.get(key, {})).get(log_n)
    at_the_end = log_n == 20 and (solver or options.smoother == "fft-rsm")
    units = published.WORK_UNITS.get(key) if at_the_end else None
    seconds = published.CPU_SECONDS.get(key) if at_the_end else None
    if cell is None and units is None:
        return ""
    if cell is not None:
        iterations, factor = str(cell.iterations), f"{cell.factor:.4f}"
    else:  # the cell is illegible, but Table VI gives it away
        factor, a_step = "", 2 if solver else published.UNITS_PER_CYCLE[label]
        iterations = str((units or 0) // a_step)
    line = f"{'the paper':12s}{iterations:>10s}   {factor:>6s}   {units or '':>10}"
    return line + (f"   {seconds:>7}   in Matlab, at 3.17 GHz" if seconds else "")
