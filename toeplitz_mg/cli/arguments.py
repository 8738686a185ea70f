"""The arguments of the command line, and what cannot be meant by them."""

import argparse
import os
import re
from pathlib import Path
from typing import Any, NamedTuple

import toeplitz_mg as tmg
from toeplitz_mg._typing import Preconditioner
from toeplitz_mg.cli import contact_arguments, files
from toeplitz_mg.cli.parsing import DPI, Parser, check_dpi, whole_number
from toeplitz_mg.cli.report import EXIT_STATUS
from toeplitz_mg.paper.problems import TESTS

PRECONDITIONERS: dict[str, Preconditioner] = {
    "default": tmg.default_preconditioner,
    "fsai": tmg.fsai_preconditioner,
    "fft": tmg.fft_preconditioner,
    "fft-rsm": tmg.fft_rsm_preconditioner,
    "fft-sd": tmg.fft_sd_preconditioner,
    "strang": tmg.strang_preconditioner,
    "chan": tmg.chan_preconditioner,
    "cosine": tmg.cosine_preconditioner,
    "sine": tmg.sine_preconditioner,
    "spectral": tmg.spectral_preconditioner,
}

MOST_THREADS = 1024  # More than any one machine has cores.
MOST = 2**40  # Most elements of a problem of the paper: no memory holds a vector of 8 TiB.


class Cycle(NamedTuple):
    """A multigrid cycle: its kind, V or W, and the smoothing steps before and after."""

    kind: str
    pre: int
    post: int

    def __str__(self) -> str:
        return f"{self.kind}({self.pre},{self.post})"

    @classmethod
    def of(cls, text: str) -> "Cycle":
        """Read a cycle like V(0,1); more than 999 steps are a mistake that would never end."""
        match = re.fullmatch(r"([VW])\((\d{1,3}),(\d{1,3})\)", text.replace(" ", ""))
        if match is None:
            raise ValueError(
                f"--cycle is {text}, but must be like V(0,1) or W(1,1), of at most 999 steps each"
            )
        return cls(match[1], int(match[2]), int(match[3]))


def _method_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("method")
    group.add_argument(
        "--solver",
        choices=("multigrid", "richardson", "cg"),
        help="multigrid cycles, Richardson with a preconditioner, or conjugate gradients "
        "(default: multigrid; of solve: cg, unless a cycle is given)",
    )
    group.add_argument(
        "--preconditioner",
        choices=("none", *PRECONDITIONERS, "multigrid"),
        help="for richardson (default: fft-rsm) and cg (default: default, which depends on the "
        "matrix and the mask)",
    )
    group.add_argument(
        "--cycle",
        help="V(pre,post) or W(pre,post), at most 999 smoothing steps each "
        "(default: V(0,1), and V(1,1) for cg)",
    )
    group.add_argument(
        "--smoother",
        choices=tuple(PRECONDITIONERS),
        help="of the multigrid cycle (default: fft-rsm)",
    )
    group.add_argument("--rtol", type=float, help="relative residual (default: 1e-8)")
    group.add_argument("--maxiter", type=whole_number, help="most iterations (default: 200)")
    group.add_argument(
        "--seed",
        type=whole_number,
        help="start from a random guess, as the paper does, not from zero",
    )
    group.add_argument("--plot", type=Path, metavar="FILE", help="draw solution and convergence")
    group.add_argument("--dpi", type=whole_number, help=f"dots an inch of it (default: {DPI})")


def _add_threads(*parsers: argparse.ArgumentParser) -> None:
    for parser in parsers:
        parser.add_argument(
            "--threads", type=whole_number, help="threads that share the work (default: all cores)"
        )


def take_threads(given: argparse.Namespace) -> int:
    """Take the number of threads from what is given, and return it: by default all cores."""
    number: int = vars(given).pop("threads", None)
    if number is None:
        return _count_cores()
    if not 1 <= number <= MOST_THREADS:
        raise ValueError(f"--threads is {number}, but must be 1 to {MOST_THREADS}")
    return number


def _count_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return getattr(os, "process_cpu_count", os.cpu_count)() or 1  # It is since Python 3.13.


DEFAULTS: dict[str, Any] = {
    "test": 1,
    "n": 2**20,
    "solver": "multigrid",
    "preconditioner": None,
    "cycle": None,
    "smoother": "fft-rsm",
    "rtol": 1e-8,
    "maxiter": 200,
    "seed": None,
    "plot": None,
    "dpi": DPI,
}


def parser() -> Parser:
    """Return the parser of the command line."""
    main = Parser(
        prog="toeplitz-mg",
        description="Solve a contact problem of Zhao, Vollebregt and Oosterlee (2014): by default "
        "test 1 with 2^20 unknowns, by the V(0,1) cycle with the FFT+RSM smoother. "
        "The command solve takes a system of your own, the command contact solves a contact "
        "problem.",
        epilog=EXIT_STATUS,
    )
    main.add_argument("--version", action="version", version=f"toeplitz-mg {tmg.__version__}")
    main.add_argument("--test", type=int, choices=tuple(TESTS), help="problem (default: 1)")
    main.add_argument("-n", type=whole_number, help="number of elements (default: 2^20)")
    _method_options(main)
    commands = main.add_subparsers(dest="command", metavar="{solve,contact}")
    solve = commands.add_parser(
        "solve",
        help="solve a system of your own",
        description="Solve A x = b, A symmetric positive definite Toeplitz.",
        epilog="Files are NumPy's (.npy) or tables of numbers in text (.txt, .csv, .dat). "
        "X is written whole or not at all, and only where the solver has converged.",
    )
    solve.add_argument(
        "column", type=Path, metavar="COLUMN.npy", help="first column, of one or several axes"
    )
    solve.add_argument(
        "rhs", type=Path, metavar="RHS.npy", help="b, on the grid or flat; with a mask also (N,)"
    )
    solve.add_argument("-o", "--output", type=Path, required=True, metavar="X.npy", help="solution")
    solve.add_argument(
        "--mask", type=Path, metavar="MASK.npy", help="where A is restricted to: true or 1"
    )
    _method_options(solve)
    contact = contact_arguments.add_parser(commands)
    _add_threads(main, solve, contact)
    main.commands = {"solve": solve, "contact": contact}
    return main


def complete(given: argparse.Namespace) -> argparse.Namespace:
    """Fill in the defaults, and refuse what cannot be meant."""
    if given.command == "solve" and (hasattr(given, "test") or hasattr(given, "n")):
        raise ValueError("--test and -n choose a problem of the paper, which solve does not solve")
    no_files = dict.fromkeys(("column", "rhs", "mask", "output"))
    options = argparse.Namespace(**(DEFAULTS | no_files | vars(given)))
    _choose_method(given, options)
    if options.n > MOST:
        raise ValueError(f"-n is {options.n}, but must be at most {MOST}")
    if not 0.0 < options.rtol < 1.0:
        raise ValueError(f"--rtol is {options.rtol}, but must lie between 0 and 1")
    if options.maxiter < 1:
        raise ValueError(f"--maxiter is {options.maxiter}, but must be at least 1")
    if options.seed is not None and options.seed < 0:
        raise ValueError(f"--seed is {options.seed}, but must not be negative")
    if options.plot is not None:
        files.check_plotting(options.plot)
    check_dpi(vars(given))
    read = (options.column, options.rhs, options.mask)
    files.check_files((options.output, options.plot), read)
    return options


def _choose_method(given: argparse.Namespace, options: argparse.Namespace) -> None:
    """Choose what was left open of the solver, the preconditioner and the cycle."""
    of_cycles = hasattr(given, "cycle") or hasattr(given, "smoother")
    if given.command == "solve" and not hasattr(given, "solver") and not of_cycles:
        options.solver = "cg"
    options.cycle = Cycle.of(options.cycle or ("V(1,1)" if options.solver == "cg" else "V(0,1)"))
    if options.solver == "multigrid":
        if options.preconditioner not in (None, "multigrid"):
            raise ValueError("--preconditioner is for --solver richardson and cg; see --smoother")
        options.preconditioner = "multigrid"
    elif options.preconditioner is None:
        by_default = "fft-rsm" if options.solver == "richardson" else "default"
        options.preconditioner = "multigrid" if of_cycles else by_default
    if options.solver == "cg":
        is_cycle, (_, pre, post) = options.preconditioner == "multigrid", options.cycle
        deflates = "fft-sd" in (options.preconditioner, options.smoother if is_cycle else None)
        if deflates or (is_cycle and pre != post):
            raise ValueError(
                "cg needs a symmetric preconditioner: neither fft-sd nor pre unlike post"
            )
