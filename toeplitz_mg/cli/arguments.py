"""The options of the command line as a table, and checks of their values."""

import argparse
import math
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import toeplitz_mg as tmg
from toeplitz_mg._typing import Preconditioner
from toeplitz_mg.cli import files
from toeplitz_mg.cli.report import EXIT_STATUS
from toeplitz_mg.contact import Material
from toeplitz_mg.contact.gaps import UNITS
from toeplitz_mg.contact.reading import LEVELS
from toeplitz_mg.paper.problems import TESTS
from toeplitz_mg.values import in_range

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
PAPER, SOLVE = ("paper",), ("solve",)  # The commands for linear systems.
LINEAR = (*PAPER, *SOLVE)
SHIFT, ROLLING, ROUGH = ("shift",), ("rolling",), ("rough",)
MOVED = (*SHIFT, *ROLLING)
SMOOTH = ("hertz", *MOVED)  # The cases with smooth bodies.
CASES = (*SMOOTH, *ROUGH)
HIDDEN = argparse.SUPPRESS  # The help text of options that are not listed.
FORCE = 100.0  # Default normal force, N or N/mm, if no approach is given either.
# A negative number, not an option: argparse does not recognise exponents.
NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")

Rules = dict[str, tuple[Callable[[Any], bool], str]]


def whole_number(text: str) -> int:
    """Read an integer, also in the form 1e5.

    Raises
    ------
    ValueError
        If it is not an integer; argparse then names the option.
    """
    try:
        return int(text)
    except ValueError:
        value = float(text)
    if not value.is_integer():
        raise ValueError(f"{text} is no whole number")
    return int(value)


whole_number.__name__ = "whole number"  # The name of the type in argparse's errors.


class Option(NamedTuple):
    """An option of the command line.

    `values` describes its values: "number", "positive", "whole", "word", "file" or "switch" (no
    value). A digit is the largest number of values, "inf" allows infinity. `cases` are the cases of
    `contact`, or the commands for linear systems, that accept it. `help` describes it with its unit
    and default; if it depends on the case, by the names of cases and commands, "" for the others.
    """

    values: str
    cases: tuple[str, ...]
    default: Any
    help: str | dict[str, str]

    @property
    def type(self) -> Any:
        """The function that reads a value."""
        return TYPES[self.values.split()[0]]

    def explain(self, case: str) -> str:
        """Return the help of a case or command."""
        of_case = {"": self.help} if isinstance(self.help, str) else self.help
        return of_case.get(case, of_case.get("", ""))

    @property
    def most(self) -> int:
        """The largest number of values."""
        return max(int(word) for word in ("1", *self.values.split()) if word.isdigit())


TYPES = {"number": float, "positive": float, "whole": whole_number, "word": str, "file": Path}
TYPES |= {"switch": None}
# fmt: off
OF_LINEAR = {
    "test": Option("whole", PAPER, 1, "test problem of the paper (default: 1)"),
    "n": Option("whole", PAPER, 2**20, "number of elements (default: 2^20)"),
    "output": Option("file", SOLVE, None, "write the solution to this file (default: print it)"),
    "mask": Option("file", SOLVE, None, "restrict A to the elements where this file is true or 1"),
    "solver": Option("word", LINEAR, "multigrid", {
        "paper": "multigrid cycles, preconditioned Richardson iteration, or conjugate gradients "
            "(default: multigrid)",
        "solve": "multigrid cycles, preconditioned Richardson iteration, or conjugate gradients "
            "(default: cg, or multigrid if --cycle or --smoother is given)"}),
    "preconditioner": Option("word", LINEAR, None,
        "preconditioner of richardson (default: fft-rsm) or of cg (default: default, which "
        "depends on the matrix and the mask)"),
    "cycle": Option("word", LINEAR, None,
        "multigrid cycle, V(pre,post) or W(pre,post) with at most 999 smoothing steps each "
        "(default: V(0,1); V(1,1) for cg)"),
    "smoother": Option("word", LINEAR, "fft-rsm",
        "smoother of the multigrid cycle (default: fft-rsm)"),
    "rtol": Option("number", LINEAR, 1e-8, "relative residual at which to stop (default: 1e-8)"),
    "maxiter": Option("whole", LINEAR, 200, "largest number of iterations (default: 200)"),
    "seed": Option("whole", LINEAR, None,
        "start from random numbers of this seed, as the paper does (default: start from zero)"),
    "plot": Option("file", LINEAR, None, "draw the solution and the convergence in this file"),
    "dpi": Option("whole", LINEAR, 150, "dots per inch of the picture (default: 150)"),
    "overwrite": Option("switch", LINEAR, None, "replace files that exist"),
    "json": Option("switch", LINEAR, None, "print the figures as JSON and nothing else"),
}
OF_CONTACT = {
    "radius": Option("number 4 inf", SMOOTH, (10.0,),
        "radii of curvature, mm: one of a sphere; two along x and y; or four, x and y of the "
        "first body and then of the second; inf where a body is straight, negative where it is "
        "hollow (default: 10)"),
    "line": Option("switch", SMOOTH, None,
        "press a cylinder in plane strain; forces are then in N/mm"),
    "force": Option("positive", CASES, None, {
        "": "normal force, N; with --line N/mm (default: 100)",
        "rough": "normal force, N; of a profile N/mm"}),
    "approach": Option("positive", CASES, None,
        "distance by which the bodies approach each other, mm; instead of --force"),
    "pressure": Option("positive", ROUGH, None,
        "mean pressure on the grid, N/mm²; instead of --force"),
    "G": Option("positive", CASES, 82000.0,
        "shear modulus of both bodies, N/mm² (default: 82000)"),
    "E": Option("positive", CASES, None,
        "Young's modulus of both bodies, N/mm²; instead of --G"),
    "nu": Option("number", CASES, 0.28, "Poisson's ratio of both bodies (default: 0.28)"),
    "G2": Option("positive inf", CASES, None,
        "shear modulus of the second body if it is different, N/mm²; inf if it is rigid"),
    "E2": Option("positive inf", CASES, None,
        "Young's modulus of the second body, N/mm²; instead of --G2"),
    "nu2": Option("number", CASES, None,
        "Poisson's ratio of the second body (default: that of the first)"),
    "n": Option("whole", SMOOTH, 256, "elements along the longer side of the grid (default: 256)"),
    "size": Option("positive", SMOOTH, None,
        "longer side of the grid, mm (default: 1.3 times the contact that Hertz's theory gives)"),
    "mu": Option("positive inf", MOVED, 0.3,
        "coefficient of friction; inf bonds the bodies (default: 0.3)"),
    "tangential": Option("number 2", MOVED, None, {
        "shift": "tangential force along x, or along x and y, N; with --line N/mm (default: half "
            "of what friction carries)",
        "rolling": "tangential force along x, or along x and y, N; with --line N/mm; instead of "
            "--longitudinal and --lateral (one number: no force along y)"}),
    "shift": Option("number 2", SHIFT, None,
        "rigid shift along x, or along x and y, mm; instead of --tangential"),
    "longitudinal": Option("number", ROLLING, None,
        "creepage along x, the direction of rolling: rigid slip over the distance rolled "
        "(default: -0.002 if no other creepage, force or moment is given)"),
    "lateral": Option("number", ROLLING, None, "creepage along y (default: 0)"),
    "spin": Option("number", ROLLING, None,
        "rotation over the distance rolled, 1/mm (default: 0)"),
    "moment": Option("number", ROLLING, None,
        "moment about the middle of the grid, N mm; instead of --spin"),
    "tolerance": Option("positive", CASES, 1e-8,
        "largest violation of the conditions of contact, relative to the largest displacement "
        "(default: 1e-8)"),
    "element": Option("positive 2", ROUGH, None,
        "size of a pixel along x, or along x and y, if the file does not state it; of a profile at "
        "uneven positions, the distance at which it is resampled"),
    "unit": Option("word 2", ROUGH, None,
        "unit of heights and pixels, as um, or one of each, as nm um (default: that of the file; "
        "mm if it states none)"),
    "channel": Option("word", ROUGH, None,
        "which measurement of the file to read: its number, from 0, or its name"),
    "level": Option("word", ROUGH, None,
        f"subtract the nearest surface from the heights: {', '.join(LEVELS)}"),
    "periodic": Option("switch", ROUGH, None,
        "the surface repeats, also if the file does not say so"),
    "hardness": Option("positive", ROUGH, None,
        "pressure at which the softer body yields, N/mm² (default: it does not)"),
    "output": Option("file", CASES, None,
        "write the fields to this file, as arrays by name for numpy.load"),
    "plot": Option("file", CASES, None, {
        "": "draw the pressures in this file",
        "shift": "draw pressures, tractions, stick and slip in this file",
        "rolling": "draw pressures, tractions, stick and slip in this file"}),
    "dpi": OF_LINEAR["dpi"]._replace(cases=CASES),
    "overwrite": OF_LINEAR["overwrite"]._replace(cases=CASES),
    "json": OF_LINEAR["json"]._replace(cases=CASES),
}
# fmt: on
MOST_THREADS = 1024  # More than the cores of any machine.
THREADS = Option("whole", LINEAR, None, "number of threads (default: all cores)")
MORE: dict[str, dict[str, Any]] = {  # Additional arguments for argparse.
    "test": {"choices": tuple(TESTS)},
    "mask": {"metavar": "MASK.npy"},
    "solver": {"choices": ("multigrid", "richardson", "cg")},
    "preconditioner": {"choices": ("none", *PRECONDITIONERS, "multigrid")},
    "smoother": {"choices": tuple(PRECONDITIONERS)},
    "plot": {"metavar": "FILE"},
}
METAVARS = {"output": "FIELDS.npz", "plot": "FILE"}
SHORT = {"n": ("-n",), "output": ("-o", "--output")}
# Aliases of options that the help does not list: former names, and names of keyword arguments.
OTHERS = {"mu": "--friction", "tangential": "--tangential-force"}
OF_CASE = {  # The help of each case.
    "hertz": "press a sphere, an ellipsoid or a cylinder on a flat",
    "shift": "press a sphere, an ellipsoid or a cylinder on a flat and shift it, with friction",
    "rolling": "press a sphere, an ellipsoid or a cylinder on a flat and roll it, with friction",
    "rough": "press a measured surface, from a file of heights, on a flat",
}
# Further rules for values, of options for linear systems and for contact.
RULES_OF_LINEAR: Rules = {
    "n": (lambda n: n <= 2**40, f"be at most {2**40}"),  # A vector of 8 TiB does not fit in memory.
    "rtol": (lambda x: 0.0 < x < 1.0, "lie between 0 and 1"),
    "maxiter": (lambda k: k >= 1, "be at least 1"),
    "seed": (lambda seed: seed >= 0, "not be negative"),
    "dpi": (lambda dpi: 10 <= dpi <= 1200, "be 10 to 1200"),  # More than any journal requires.
}
RULES_OF_CONTACT: Rules = {
    "nu": (lambda nu: -1.0 < nu <= 0.5, "be above -1 and at most 0.5"),
    "tolerance": (lambda x: x < 1.0, "be below 1"),
    "n": (lambda n: 8 <= n <= 2**24, f"be 8 to {2**24}"),  # A contact needs several elements.
    "output": (lambda path: path.suffix == ".npz", "end in .npz"),
    "dpi": RULES_OF_LINEAR["dpi"],
}
RULES_OF_CONTACT["nu2"] = RULES_OF_CONTACT["nu"]
# Pairs of options that determine the same quantity, so that only one may be given.
EXCLUSIVE = (
    ("force", "approach"),
    ("force", "pressure"),
    ("approach", "pressure"),
    ("tangential", "shift"),
    ("tangential", "longitudinal"),
    ("tangential", "lateral"),
    ("moment", "spin"),
    ("E", "G"),
    ("E2", "G2"),
)


class Parser(argparse.ArgumentParser):
    """A parser without abbreviations, whose errors show a short usage of the command.

    Options have no defaults in the parser, so misplaced options are detected. Abbreviations are
    off, because --n would be accepted for --nu.
    """

    def __init__(self, **options: Any) -> None:
        bare: dict[str, Any] = {"argument_default": argparse.SUPPRESS, "allow_abbrev": False}
        super().__init__(**(bare | options))
        self._negative_number_matcher: re.Pattern[str] = NEGATIVE
        self.commands: dict[str, Parser] = {}

    def parse_command(self, arguments: Sequence[str] | None = None) -> argparse.Namespace:
        """Return the given arguments; unknown arguments are an error of their command."""
        words = sys.argv[1:] if arguments is None else arguments
        for word in takewhile(lambda word: word not in self.commands, words):
            # argparse would interpret the rest as a command and reject that.
            if word.startswith("--") and word.partition("=")[0] not in self._option_string_actions:
                self.error(f"unrecognized arguments: {word}")
        given, rest = self.parse_known_args(words)
        if rest:
            command = self.commands.get(getattr(given, "command", None) or "", self)
            command = command.commands.get(getattr(given, "case", ""), command)
            command.error(f"unrecognized arguments: {' '.join(rest)}")
        return given

    def error(self, message: str) -> NoReturn:
        """Print the error, the usage of the command, and how to list its options."""
        shown = [a for a in self._actions if not a.option_strings and a.help != HIDDEN]
        if "invalid" in message and self.prog.endswith(" rough"):
            message += "; FILE goes before the options"  # Options accept all values that follow.
        words = [self.prog, "[options]", *(str(a.metavar) for a in shown)]
        self.exit(
            2,
            f"usage: {' '.join(words)}\n{self.prog}: error: {message}\n"
            f"{self.prog} --help lists the options\n",
        )


def parser() -> Parser:
    """Return the parser of the command line."""
    main = Parser(
        prog="toeplitz-mg",
        description="Fast solvers for dense Toeplitz systems, and contact mechanics.",
        epilog="Options without a command are those of paper. " + EXIT_STATUS,
    )
    main.add_argument("--version", action="version", version=f"toeplitz-mg {tmg.__version__}")
    commands = main.add_subparsers(dest="command", metavar="{paper,solve,contact}")
    paper = commands.add_parser(
        "paper",
        help="solve a problem of the paper",
        description="Solve a contact problem of Zhao, Vollebregt and Oosterlee (2014): by default "
        "test 1 with 2^20 unknowns, by the V(0,1) cycle with the FFT+RSM smoother.",
        epilog=EXIT_STATUS,
    )
    solve = commands.add_parser(
        "solve",
        help="solve a system of your own",
        description="Solve A x = b with a symmetric positive definite Toeplitz matrix A.",
        epilog="Files are NumPy's (.npy) or tables of numbers in text (.txt, .csv, .dat). "
        "X is written whole or not at all, and only if the solver has converged. " + EXIT_STATUS,
    )
    solve.add_argument(
        "column", type=Path, metavar="COLUMN.npy", help="first column of A, of one or several axes"
    )
    solve.add_argument(
        "rhs",
        type=Path,
        metavar="RHS.npy",
        help="b, of the shape of the grid or flat; with --mask also (N,)",
    )
    contact = commands.add_parser(
        "contact",
        help="contact of two elastic bodies",
        description="Solve a contact problem. Units are N and mm.",
        epilog=EXIT_STATUS,
    )
    for command, of_case in ((main, "paper"), (paper, "paper"), (solve, "solve")):
        for name, option in OF_LINEAR.items():
            more = {"metavar": "X.npy"} if name == "output" else MORE.get(name, {})
            if of_case in option.cases:
                _add(command, name, option, more, shown=command is not main)
    main.commands = {"paper": paper, "solve": solve, "contact": contact}
    contact.commands = _add_cases(contact)
    for command in (main, *main.commands.values(), *contact.commands.values()):
        _add(command, "threads", THREADS, {}, shown=command not in (main, contact))
    return main


def _add_cases(contact: Parser) -> dict[str, Parser]:
    """Add a parser for each case, and return the parsers by name.

    Each also accepts the options of the other cases, without listing them; `_check` then says which
    case they belong to. The command accepts all options before the name of the case.
    """
    found = {}
    cases = contact.add_subparsers(dest="case", metavar="CASE", required=True)
    for case, said in OF_CASE.items():
        found[case] = cases.add_parser(
            case,
            help=said,
            description=f"{said[0].upper()}{said[1:]}. Units are N and mm.",
            epilog="Files are written whole or not at all, and only if the solver has converged. "
            + EXIT_STATUS,
        )
        found[case].add_argument(
            "file",
            nargs="?",
            type=Path,
            default=None,
            metavar="FILE",
            help="file of heights, positive at summits: .npy, a text table (one column is a "
            "profile), or a file of an instrument that SurfaceTopography reads"
            if case == "rough"
            else HIDDEN,
        )
    for case, command in {"": contact, **found}.items():
        for name, option in OF_CONTACT.items():
            more = {"metavar": METAVARS[name]} if name in METAVARS else {}
            _add(command, name, option, more, shown=case in option.cases)
    return found


def _add(
    parser: Parser, name: str, option: Option, more: dict[str, Any], *, shown: bool = True
) -> None:
    """Add an option to a parser, listed in its help or not."""
    special: dict[str, Any] = {"type": option.type, "dest": name} | more
    if option.type is None:
        special = {"action": "store_true", "dest": name}
    elif option.most > 1:
        special |= {"nargs": "+", "metavar": name.upper()}
    said = option.explain(parser.prog.split()[-1]) if shown else HIDDEN
    parser.add_argument(*SHORT.get(name, (f"--{name}",)), help=said, **special)
    if name in OTHERS:
        parser.add_argument(OTHERS[name], help=HIDDEN, **special)


def take_threads(given: argparse.Namespace) -> int:
    """Remove the number of threads from the arguments and return it; by default all cores."""
    number: int | None = vars(given).pop("threads", None)
    if number is not None:
        if not 1 <= number <= MOST_THREADS:
            raise ValueError(f"--threads is {number}, but must be 1 to {MOST_THREADS}")
        return number
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))  # The cores that this process may use.
    return getattr(os, "process_cpu_count", os.cpu_count)() or 1  # The first since Python 3.13.


def _check(table: Mapping[str, Option], rules: Rules, given: Mapping[str, Any], case: str) -> None:
    """Check each given option, and that the case accepts it."""
    for name, option in table.items():
        if name not in given:
            continue
        flag, value = "-n" if name == "n" else f"--{name}", given[name]
        if case not in option.cases:
            *others, last = option.cases
            cases = f"{', '.join(others)} and {last}" if others else last
            raise ValueError(f"{flag} is for {cases}, not {case}")
        values = value if isinstance(value, list) else [value]
        if len(values) > option.most:
            raise ValueError(f"{flag} has {len(values)} values, but takes 1 to {option.most}")
        is_right, said = rules.get(name, (None, ""))
        for x in values:
            if isinstance(x, float) and not ("inf" in option.values and math.isinf(x)):
                if not math.isfinite(x):
                    raise ValueError(f"{flag} is {x}, but must be finite")
                in_range(flag, abs(x))
            if "positive" in option.values and not x > 0.0:
                raise ValueError(f"{flag} is {x}, but must be positive")
            if is_right is not None and not is_right(x):
                raise ValueError(f"{flag} is {x}, but must {said}")
        if name == "plot":
            files.check_plotting(value)
    if "dpi" in given and "plot" not in given:
        raise ValueError("--dpi is given, but no --plot, whose picture it is for")


# Linear systems ---------------------------------------------------------------------------------


class Cycle(NamedTuple):
    """A multigrid cycle: its kind, V or W, and the smoothing steps before and after."""

    kind: str
    pre: int
    post: int

    def __str__(self) -> str:
        return f"{self.kind}({self.pre},{self.post})"

    @classmethod
    def of(cls, text: str) -> "Cycle":
        """Read a cycle such as V(0,1); more than 999 steps are refused as a typing error."""
        match = re.fullmatch(r"([VW])\((\d{1,3}),(\d{1,3})\)", text.replace(" ", ""))
        if match is None:
            raise ValueError(
                f"--cycle is {text}, but must be like V(0,1) or W(1,1), of at most 999 steps each"
            )
        return cls(match[1], int(match[2]), int(match[3]))


def complete_linear(given: argparse.Namespace) -> argparse.Namespace:
    """Fill in the defaults for a linear system, and refuse contradictions."""
    is_solve, told = given.command == "solve", vars(given)
    if is_solve and (hasattr(given, "test") or hasattr(given, "n")):
        raise ValueError("--test and -n choose a problem of the paper, which solve does not solve")
    defaults = {name: option.default for name, option in OF_LINEAR.items()}
    options = argparse.Namespace(**({"column": None, "rhs": None} | defaults | told))
    _choose_method(given, options)
    _check(OF_LINEAR, RULES_OF_LINEAR, told, "solve" if is_solve else "paper")
    read = (options.column, options.rhs, options.mask)
    files.check_files((options.output, options.plot), read, overwrite=bool(options.overwrite))
    return options


def _choose_method(given: argparse.Namespace, options: argparse.Namespace) -> None:
    """Choose the solver, the preconditioner and the cycle if they are not given."""
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


# Contact ----------------------------------------------------------------------------------------


def complete_contact(given: argparse.Namespace) -> argparse.Namespace:
    """Fill in the defaults for a contact problem, and refuse contradictions."""
    options = {key: value for key, value in vars(given).items() if value is not None}
    # argparse also accepts options of the main command before the name of the case.
    for name in options.keys() - OF_CONTACT.keys() - {"command", "case", "file"}:
        raise ValueError(f"--{name} is for linear systems, not for contact")
    case = options["case"]
    units = options.get("unit", ())
    if "file" not in options and len(units) > 1 and units[-1] not in UNITS:
        options["file"] = Path(units.pop())  # argparse has read it as another unit.
    _check(OF_CONTACT, RULES_OF_CONTACT, options, case)
    _check_together(case, options)
    written = options.get("output"), options.get("plot")
    files.check_files(written, (options.get("file"),), overwrite="overwrite" in options)
    defaults = {name: option.default for name, option in OF_CONTACT.items()}
    if "approach" not in options and case != "rough":
        defaults["force"] = FORCE
    return argparse.Namespace(**(defaults | options), material=_materials(options))


def _materials(options: dict[str, Any]) -> Material | tuple[Material, Material]:
    """Return the material of both bodies, or one material for each."""
    first = {name: options[name] for name in ("E", "G", "nu") if name in options}
    second = {name: options[f"{name}2"] for name in ("E", "G", "nu") if f"{name}2" in options}
    if not second:
        return _material(**first)
    moduli = {name: first[name] for name in first if name == "nu" or second.keys() == {"nu"}}
    return _material(**first), _material(**(moduli | second))


def _material(
    E: float | None = None,
    G: float = OF_CONTACT["G"].default,
    nu: float = OF_CONTACT["nu"].default,
) -> Material:
    if math.isinf(G if E is None else E):
        return Material.rigid()
    return Material.from_shear(G, nu) if E is None else Material(E=E, nu=nu)


def _check_together(case: str, options: dict[str, Any]) -> None:
    """Check combinations of options."""
    for one, other in EXCLUSIVE:
        if one in options and other in options:
            raise ValueError(f"--{one} and --{other} are both given: leave one out")
    if case == "rough" and "file" not in options:
        raise ValueError("rough needs a FILE of heights")
    if case == "rough" and not {"force", "approach", "pressure"} & options.keys():
        raise ValueError("rough needs --force, --approach or --pressure")
    if len(options.get("radius", ())) == 3:
        raise ValueError("--radius has 3 values, but takes 1, 2, or 4 of both bodies")
    if case != "rough" and "file" in options:
        raise ValueError(f"a file, {options['file']}, is for contact rough, not {case}")
    has_load = "tangential" in options or "shift" in options
    if case == "shift" and math.isinf(options.get("mu", 0.0)) and not has_load:
        raise ValueError("--mu is inf: give --tangential or --shift, as nothing slides")
    if "line" not in options:
        return
    why = {
        "approach": "in plane strain it is only known up to a constant; give --force",
        "spin": "line contact has no spin",
        "moment": "line contact has no spin",
    }
    for name, reason in why.items():
        if name in options:
            raise ValueError(f"--{name} is not for --line: {reason}")
    if "lateral" in options:
        raise ValueError(
            "--lateral is not for --line on the command line: call contact.rolling in Python"
        )
    for name in ("radius", "tangential", "shift"):
        if len(options.get(name, ())) > 1:
            raise ValueError(f"--{name} has several values, but --line takes one")
