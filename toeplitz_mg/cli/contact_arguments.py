"""The options of ``toeplitz-mg contact``, and what cannot be meant by them."""

import argparse
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toeplitz_mg.cli import files
from toeplitz_mg.cli.parsing import DPI, Parser, check_dpi, whole_number
from toeplitz_mg.cli.report import EXIT_STATUS
from toeplitz_mg.contact import Material
from toeplitz_mg.values import in_range

SMOOTH = ("hertz", "shift", "rolling")  # The cases of Hertz's bodies.
CASES = (*SMOOTH, "rough")
FEWEST, MOST = 8, 2**24  # Limits of the elements along a side: a contact needs a few to be one.
FORCE = 100.0  # Normal force, N or N/mm, where neither it nor the approach is given.


@dataclass(frozen=True)
class Option:
    """An option with a number or some, a file or a switch.

    Attributes
    ----------
    help : str
        What the option is, with its unit, and its default where that is no plain value.
    kind : type
        The type of its values: float, int, bool or Path.
    most : int
        How many values it takes at most.
    cases : tuple of str
        The cases that the option is for.
    default : object
        The value where none is given.
    positive : bool
        Whether its numbers must be positive.
    infinite : bool
        Whether its numbers may be infinite.
    """

    help: str
    kind: type = float
    most: int = 1
    cases: tuple[str, ...] = CASES
    default: Any = None
    positive: bool = False
    infinite: bool = False


OPTIONS = {
    "radius": Option(
        "of the sphere, mm; of two values, the radii of curvature along x and y (default: 10)",
        most=2,
        cases=SMOOTH,
        default=(10.0,),
        positive=True,
    ),
    "line": Option(
        "line contact of a cylinder in plane strain: forces are N/mm", bool, cases=SMOOTH
    ),
    "force": Option("normal force, N or N/mm (default: 100, but of rough)", positive=True),
    "approach": Option("of the bodies, mm; in place of the force", positive=True),
    "G": Option(
        "shear modulus of both bodies, N/mm² (default: 82000)", default=82000.0, positive=True
    ),
    "E": Option("Young's modulus of both bodies, N/mm²; in place of G", positive=True),
    "nu": Option("Poisson's ratio of both bodies (default: 0.28)", default=0.28),
    "G2": Option(
        "shear modulus of the second body where it is unlike the first; inf: it is rigid",
        positive=True,
        infinite=True,
    ),
    "E2": Option(
        "Young's modulus of the second body; in place of G2", positive=True, infinite=True
    ),
    "nu2": Option("Poisson's ratio of the second body (default: that of the first)"),
    "n": Option(
        "elements along the longer side of the grid (default: 256)",
        int,
        cases=SMOOTH,
        default=256,
    ),
    "size": Option(
        "longer side of the grid, mm (default: 1.3 times the contact of Hertz's theory)",
        cases=SMOOTH,
        positive=True,
    ),
    "friction": Option(
        "coefficient of friction; inf bonds the bodies (default: 0.3)",
        cases=("shift", "rolling"),
        default=0.3,
        positive=True,
        infinite=True,
    ),
    "tangential": Option(
        "tangential force along x, or x and y, N or N/mm (default of shift: half of what friction "
        "carries); of rolling in the place of the creepages along x and y, where one number leaves "
        "none along y",
        most=2,
        cases=("shift", "rolling"),
    ),
    "shift": Option(
        "rigid shift along x, or x and y, mm; in place of the force", most=2, cases=("shift",)
    ),
    "longitudinal": Option(
        "creepage along x, the direction of rolling: rigid slip over distance "
        "(default: -0.002 without other creepages)",
        cases=("rolling",),
    ),
    "lateral": Option("creepage along y (default: 0)", cases=("rolling",)),
    "spin": Option("creepage by rotation, 1/mm (default: 0)", cases=("rolling",)),
    "moment": Option("about the middle, N mm; in place of the spin", cases=("rolling",)),
    "tolerance": Option(
        "violation of the conditions of contact, relative to the largest displacement "
        "(default: 1e-8)",
        default=1e-8,
        positive=True,
    ),
    "element": Option(
        "size of a pixel along x, or x and y, where the file does not say it",
        most=2,
        cases=("rough",),
        positive=True,
    ),
    "unit": Option(
        "of heights and pixels, as um (default: that of the file; of heights alone mm)",
        str,
        cases=("rough",),
    ),
    "periodic": Option("the surface repeats, whatever the file says", bool, cases=("rough",)),
    "hardness": Option(
        "pressure at which the softer body yields, N/mm² (default: it does not)",
        cases=("rough",),
        positive=True,
    ),
    "output": Option("write the fields, as arrays by name", Path),
    "plot": Option("draw the tractions and the areas of stick and slip", Path),
    "dpi": Option(f"dots an inch of the picture (default: {DPI})", int, default=DPI),
}
# Of two options that both decide one thing only one is given.
EXCLUSIVE = (
    ("force", "approach"),
    ("tangential", "shift"),
    ("tangential", "longitudinal"),
    ("tangential", "lateral"),
    ("moment", "spin"),
    ("E", "G"),
    ("E2", "G2"),
)
SHORT = {"n": ("-n",), "output": ("-o", "--output")}
METAVARS = {"output": "FIELDS.npz", "plot": "FILE"}


def add_parser(commands: Any) -> Parser:
    """Add the command `contact` to the others, and return its parser."""
    parser: Parser = commands.add_parser(
        "contact",
        help="contact of two elastic bodies",
        description="Press a sphere, an ellipsoid or a cylinder on a flat "
        "(hertz), shift it then with Coulomb friction (shift), or roll it steadily (rolling); or "
        "press a measured surface, from a FILE of heights, on a flat (rough). Units are N and mm.",
        epilog="Files are written whole or not at all, and only where the solver has converged. "
        + EXIT_STATUS,
    )
    parser.add_argument("case", choices=CASES, help="what to do")
    parser.add_argument(
        "file",
        nargs="?",
        type=Path,
        default=None,
        metavar="FILE",
        help="rough: heights, positive at summits; .npy, a table of text, or what "
        "SurfaceTopography reads; a single column is a profile",
    )
    for name, option in OPTIONS.items():
        special: dict[str, Any] = {"type": whole_number if option.kind is int else option.kind}
        if option.kind is bool:
            special = {"action": "store_true"}
        elif name in METAVARS:
            special["metavar"] = METAVARS[name]
        elif option.most > 1:
            special |= {"nargs": "+", "metavar": name.upper()}
        only = f"{' and '.join(option.cases)}: " if option.cases not in (CASES, SMOOTH) else ""
        parser.add_argument(*SHORT.get(name, (f"--{name}",)), help=only + option.help, **special)
    return parser


def complete(given: argparse.Namespace) -> argparse.Namespace:
    """Fill in the defaults, and refuse what cannot be meant."""
    options = {key: value for key, value in vars(given).items() if value is not None}
    # argparse also takes options of the main command, where they stand before this one.
    for name in options.keys() - OPTIONS.keys() - {"command", "case", "file"}:
        raise ValueError(f"--{name} is for linear systems, not for contact")
    case = options["case"]
    for name, option in OPTIONS.items():
        if name in options:
            if case not in option.cases:
                raise ValueError(f"{_flag(name)} is for {' and '.join(option.cases)}, not {case}")
            _check(name, option, options[name])
    _check_together(case, options)
    files.check_files((options.get("output"), options.get("plot")), (options.get("file"),))
    defaults = {name: option.default for name, option in OPTIONS.items()}
    if "approach" not in options and case != "rough":
        defaults["force"] = FORCE
    return argparse.Namespace(**(defaults | options), material=_materials(options))


def _materials(options: dict[str, Any]) -> Material | tuple[Material, Material]:
    """Return the material of both bodies, or that of each."""
    first = {name: options[name] for name in ("E", "G", "nu") if name in options}
    second = {name: options[f"{name}2"] for name in ("E", "G", "nu") if f"{name}2" in options}
    if not second:
        return _material(**first)
    moduli = {name: first[name] for name in first if name == "nu" or second.keys() == {"nu"}}
    return _material(**first), _material(**(moduli | second))


def _material(
    E: float | None = None, G: float = OPTIONS["G"].default, nu: float = OPTIONS["nu"].default
) -> Material:
    if math.isinf(G if E is None else E):
        return Material.rigid()
    return Material.from_shear(G, nu) if E is None else Material(E=E, nu=nu)


def _check(name: str, option: Option, value: Any) -> None:
    """Check one option by itself."""
    values = value if isinstance(value, list) else [value]
    if len(values) > option.most:
        raise ValueError(f"{_flag(name)} has {len(values)} values, but takes 1 to {option.most}")
    for x in values:
        if isinstance(x, float) and not (option.infinite and math.isinf(x)):
            if not math.isfinite(x):
                raise ValueError(f"{_flag(name)} is {x}, but must be finite")
            in_range(_flag(name), abs(x))
        if option.positive and not x > 0.0:
            raise ValueError(f"{_flag(name)} is {x}, but must be positive")
    if name in ("nu", "nu2") and not -1.0 < value <= 0.5:
        raise ValueError(f"--{name} is {value}, but must be above -1 and at most 0.5")
    if name == "tolerance" and value >= 1.0:
        raise ValueError(f"--tolerance is {value}, but must be below 1")
    if name == "n" and not FEWEST <= value <= MOST:
        raise ValueError(f"-n is {value}, but must be {FEWEST} to {MOST}")
    if name == "output" and value.suffix != ".npz":
        raise ValueError(f"--output is {value}, but must end in .npz")
    if name == "plot":
        files.check_plotting(value)


def _check_together(case: str, options: dict[str, Any]) -> None:
    """Check what options mean for each other."""
    check_dpi(options)
    for one, other in EXCLUSIVE:
        if one in options and other in options:
            raise ValueError(f"--{one} and --{other} are both given, but one decides the other")
    if case == "rough" and "file" not in options:
        raise ValueError("rough needs a FILE of heights")
    if case == "rough" and not {"force", "approach"} & options.keys():
        raise ValueError("rough needs --force or --approach")
    if case != "rough" and "file" in options:
        raise ValueError(f"a file, {options['file']}, is for rough, not {case}")
    has_load = "tangential" in options or "shift" in options
    if case == "shift" and math.isinf(options.get("friction", 0.0)) and not has_load:
        raise ValueError("--friction is inf: give --tangential or --shift, as nothing slides")
    if "line" not in options:
        return
    if "approach" in options:
        raise ValueError(
            "--approach is not for --line: plane strain leaves it open by a constant; give --force"
        )
    for name in ("spin", "moment"):
        if name in options:
            raise ValueError(f"--{name} is not for --line: line contact has no spin")
    if "lateral" in options:
        raise ValueError(
            "--lateral is not for --line, which rolls along x here; contact.rolling takes it"
        )
    for name in ("radius", "tangential", "shift"):
        if len(options.get(name, ())) > 1:
            raise ValueError(f"--{name} has two values, but --line takes one")


def _flag(name: str) -> str:
    return "-n" if name == "n" else f"--{name}"
