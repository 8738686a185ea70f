"""The command line: the paper's problems, or a system of the user's own."""

import argparse
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, cg

import toeplitz_mg as tmg
from toeplitz_mg import output
from toeplitz_mg.contact import problems, published

Array = NDArray[Any]
Preconditioner = Callable[[LinearOperator], LinearOperator]

TESTS = {1: problems.test1, 2: problems.test2, 3: problems.test3}
PRECONDITIONERS: dict[str, Preconditioner] = {
    "fft": tmg.fft_preconditioner,
    "fft-rsm": tmg.fft_rsm_preconditioner,
    "fft-sd": tmg.fft_sd_preconditioner,
    "strang": tmg.strang_preconditioner,
    "chan": tmg.chan_preconditioner,
}


class UsageError(Exception):
    """What the user asked for cannot be done; the message says why."""


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
        self.residuals.append(float(np.linalg.norm(residual) / np.linalg.norm(self.system.b)))
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
        0 where it has converged, 1 where it has not, 2 for what cannot be done.
    """
    options = _parser().parse_args(arguments)
    try:
        if options.plot is not None:
            output.check_plotting()
        for path in filter(None, (options.plot, getattr(options, "output", None))):
            output.check_writable(path)
        system = _users_system(options) if options.command == "solve" else _papers_system(options)
        return _solve(system, options)
    except (UsageError, ValueError, TypeError, np.linalg.LinAlgError, OSError) as error:
        print(f"toeplitz-mg: error: {error}", file=sys.stderr)
    except MemoryError:
        print("toeplitz-mg: error: not enough memory for this system", file=sys.stderr)
    except KeyboardInterrupt:
        print("toeplitz-mg: interrupted, nothing was written", file=sys.stderr)
        return 130
    return 2


def _parser() -> argparse.ArgumentParser:
    common = argparse.ArgumentParser(add_help=False)
    group = common.add_argument_group("method")
    group.add_argument(
        "--solver",
        choices=("multigrid", "richardson", "cg"),
        default="multigrid",
        help="multigrid cycles, Richardson with a preconditioner, or conjugate gradients "
        "(default: %(default)s)",
    )
    group.add_argument(
        "--preconditioner",
        choices=("none", *PRECONDITIONERS, "multigrid"),
        help="for richardson (default: fft-rsm) and cg (default: multigrid)",
    )
    group.add_argument(
        "--cycle",
        help="V(pre,post) or W(pre,post) (default: V(0,1), and V(1,1) for cg)",
    )
    group.add_argument(
        "--smoother",
        choices=tuple(PRECONDITIONERS),
        default="fft-rsm",
        help="of the multigrid cycle (default: %(default)s)",
    )
    group.add_argument(
        "--rtol", type=float, default=1e-8, help="relative residual (default: %(default)s)"
    )
    group.add_argument(
        "--maxiter", type=int, default=200, help="most iterations (default: %(default)s)"
    )
    group.add_argument(
        "--seed", type=int, help="start from a random guess, as the paper does, not from zero"
    )
    common.add_argument("--plot", type=Path, metavar="FILE", help="draw solution and convergence")

    parser = argparse.ArgumentParser(
        prog="toeplitz-mg",
        parents=[common],
        description="Solve a contact problem of Zhao, Vollebregt and Oosterlee (2014): by default "
        "test 1 with 2^20 unknowns, by the V(0,1) cycle with the FFT+RSM smoother. "
        "The command solve takes a system of your own.",
        epilog="Exit status: 0 converged, 1 not converged, 2 not possible.",
    )
    parser.add_argument("--version", action="version", version=f"toeplitz-mg {tmg.__version__}")
    parser.add_argument(
        "--test", type=int, choices=tuple(TESTS), default=1, help="problem (default: %(default)s)"
    )
    parser.add_argument(
        "-n", type=int, default=2**20, help="number of elements (default: %(default)s)"
    )
    commands = parser.add_subparsers(dest="command", metavar="{solve}")
    solve = commands.add_parser(
        "solve",
        parents=[common],
        help="solve a system of your own",
        description="Solve A x = b, A symmetric positive definite Toeplitz.",
        epilog="X is written whole or not at all, and only where the solver has converged.",
    )
    solve.add_argument(
        "column", type=Path, metavar="COLUMN.npy", help="first column, of one or several levels"
    )
    solve.add_argument(
        "rhs", type=Path, metavar="RHS.npy", help="b, on the grid or flat; with a mask also (N,)"
    )
    solve.add_argument("-o", "--output", type=Path, required=True, metavar="X.npy", help="solution")
    solve.add_argument("--mask", type=Path, metavar="MASK.npy", help="where A is restricted")
    return parser


def _papers_system(options: argparse.Namespace) -> System:
    problem = TESTS[options.test](options.n)
    title = f"Test {options.test} of the paper with {options.n} elements"
    mask = problem.A.mask if isinstance(problem.A, tmg.MaskedOperator) else None
    return System(title, problem.A, problem.b, mask, problem.x, options.test)


def _users_system(options: argparse.Namespace) -> System:
    A: LinearOperator = tmg.ToeplitzOperator(output.load(options.column))
    mask = None
    if options.mask is not None:
        mask = output.load(options.mask)
        A = tmg.MaskedOperator(A, mask)
    b = output.load(options.rhs)
    if b.dtype.kind not in "buif":
        raise UsageError(f"{options.rhs} has dtype {b.dtype}, but must be of real numbers")
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
    elif name is None:
        name = "fft-rsm" if options.solver == "richardson" else "multigrid"
    cycle = options.cycle or ("V(1,1)" if options.solver == "cg" else "V(0,1)")
    match = re.fullmatch(r"([VW])\((\d+),(\d+)\)", cycle.replace(" ", ""))
    if match is None:
        raise UsageError(f"--cycle is {cycle}, but must be like V(0,1) or W(1,1)")
    pre, post = int(match[2]), int(match[3])
    if options.solver == "cg" and (
        name == "fft-sd" or (name == "multigrid" and (pre != post or options.smoother == "fft-sd"))
    ):
        raise UsageError("cg needs a symmetric preconditioner: neither fft-sd nor pre unlike post")
    if name == "none":
        return None, "plain"
    if name == "multigrid":
        M = tmg.multigrid(
            system.A,
            smoother=PRECONDITIONERS[options.smoother],
            pre=pre,
            post=post,
            gamma=1 if match[1] == "V" else 2,
        )
        return M, f"{match[1]}({pre},{post})"
    return PRECONDITIONERS[name](system.A), name


def _solve(system: System, options: argparse.Namespace) -> int:
    if not 0.0 < options.rtol < 1.0:
        raise UsageError(f"--rtol is {options.rtol}, but must lie between 0 and 1")
    if options.maxiter < 1:
        raise UsageError(f"--maxiter is {options.maxiter}, but must be at least 1")
    if not np.linalg.norm(system.b) > 0.0:
        raise UsageError("the right-hand side is zero or not finite: there is nothing to solve")
    start = perf_counter()
    M, label = _method(system, options)
    setup = perf_counter() - start
    solver = cg if options.solver == "cg" else tmg.richardson
    print(f"{system.title}\n{'CG with ' if solver is cg else ''}{M if M is not None else label}\n")
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
    size = float(np.linalg.norm(system.b))
    residual = float(np.linalg.norm(system.b - system.A @ x)) / size
    # The recurrence of cg may have drifted from the true residual: the latter decides.
    converged = info == 0 and residual <= 1.01 * options.rtol
    count = len(progress.residuals)
    before = float(np.linalg.norm(first)) / size
    factor = (residual / before) ** (1.0 / max(count, 1))
    print(
        f"\n{'converged' if converged else 'NOT CONVERGED'}: residual {residual:.2e}\n"
        f"{'':12s}iterations   factor   work units   seconds\n"
        f"{'this run':12s}{count:10d}   {factor:6.4f}   {work.units(n):10.1f}   {seconds:7.2f}"
        f"   and {setup:.2f} to set up"
    )
    if system.test is not None and (line := _papers_line(system.test, label, options)):
        print(line)
    if options.plot is not None:
        residuals = [before, *progress.residuals]
        output.plot(options.plot, system.title, x, system.x, system.mask, residuals)
        print(f"drawn in {options.plot}")
    if not converged:
        return 1
    if options.command == "solve":
        if system.on_grid and system.mask is not None:
            x, inside = np.zeros(system.mask.shape, x.dtype), x
            x[system.mask] = inside
        output.save(options.output, x)
        print(f"written to {options.output}")
    return 0


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
