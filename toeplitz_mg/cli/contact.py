"""The command ``toeplitz-mg contact``: a Hertzian contact that is pressed, shifted or rolled.

Or a measured surface that is pressed (see `rough`).
"""

import argparse
import math
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import Any, TypeVar

import numpy as np

from toeplitz_mg._typing import Array, Element
from toeplitz_mg.cli import files
from toeplitz_mg.cli.contact_arguments import complete
from toeplitz_mg.cli.report import Waiting, print_step, step_printer
from toeplitz_mg.cli.rough import Rough
from toeplitz_mg.contact import (
    ContactError,
    ContactResult,
    ContactWarning,
    HertzContact,
    Material,
    NormalResult,
    TangentialResult,
    friction,
    hertz,
    normal_contact,
    rolling,
    surfaces,
)
from toeplitz_mg.contact.checks import SLIDES

MARGIN = 1.3  # Side of the grid over the length of the contact by Hertz's theory.
Result = TypeVar("Result", NormalResult, TangentialResult)
Progress = Callable[[int, float], None]  # Is told of the products so far and of the violation.
TANGENTIAL = "tangential traction"  # Name of the second result, where there is one.
CREEPAGE = -0.002  # Longitudinal creepage (slip over distance) where no creepage is given.


@dataclass(frozen=True)
class Case:
    """What is to be solved, on a grid that Hertz's theory says is large enough.

    Attributes
    ----------
    options : Namespace
        What the user asked for, with the defaults.
    theory : HertzContact
        The contact that Hertz's theory expects.
    shape : tuple of int
        Elements of the grid along each axis.
    h : float
        Side of an element, or width of a strip, mm.
    """

    options: argparse.Namespace
    theory: HertzContact
    shape: tuple[int, ...]
    h: float

    @classmethod
    def of(cls, options: argparse.Namespace) -> "Case":
        """Choose the grid, or say why the one asked for does not do."""
        o = options
        radii = o.radius[0], math.inf if o.line else o.radius[-1]
        material = Material.from_shear(o.G, o.nu)
        theory = hertz(radii=radii, material=material, force=o.force, approach=o.approach)
        a, b = theory.half_axes
        longer = 2.0 * (a if o.line else max(a, b))
        size = MARGIN * longer if o.size is None else o.size
        if size < longer:
            raise ValueError(
                f"--size is {size:g}, but the contact is {longer:.4g} mm long by Hertz's theory"
            )
        h = size / o.n
        if o.line:
            return cls(o, theory, (o.n,), h)
        n1, n2 = (max(1, math.ceil(o.n * axis / max(a, b))) for axis in (a, b))
        return cls(o, theory, (n1, n2), h)

    @property
    def element(self) -> Element:
        """The size of an element."""
        return self.h if self.options.line else (self.h, self.h)

    @property
    def title(self) -> str:
        """A line that says what is solved."""
        o = self.options
        radii = " and ".join(f"{r:g}" for r in dict.fromkeys(o.radius))
        body = "cylinder" if o.line else "sphere" if len(set(o.radius)) == 1 else "ellipsoid"
        grid = " x ".join(map(str, self.shape))
        return f"{o.case}: {body} of {radii} mm, {grid} elements of {self.h:.3g} mm"

    @property
    def common(self) -> dict[str, Any]:
        """The arguments that all solvers are given."""
        o = self.options
        material = Material.from_shear(o.G, o.nu)
        return {"material": material, "tolerance": o.tolerance}

    def press(self, progress: Progress) -> NormalResult:
        """Solve the normal problem."""
        o = self.options
        if o.line:
            gap = surfaces.cylinder(self.shape, self.element, radius=o.radius[0])
        else:
            radii = o.radius[0], o.radius[-1]
            n1, n2 = self.shape
            gap = surfaces.ellipsoid((n1, n2), (self.h, self.h), radii=radii)
        load = {"force": o.force, "approach": o.approach}
        return normal_contact(gap, self.element, **load, **self.common, progress=progress)

    def shift(self, pressed: NormalResult, progress: Progress) -> TangentialResult:
        """Solve the tangential problem of the pressures."""
        o = self.options
        half = [0.5 * o.friction * pressed.force]
        load: dict[str, Any] = {"force": self.components(o.tangential or half)}
        if o.shift is not None:
            load = {"shift": self.components(o.shift)}
        bound = self.bound(pressed)
        return friction(bound, self.element, **load, **self.common, progress=progress)

    def roll(self, pressed: NormalResult, progress: Progress) -> TangentialResult:
        """Solve the problem of rolling with the pressures."""
        names = ("longitudinal", "lateral", "spin", "moment")
        given = {name: getattr(self.options, name) for name in names}
        asked = {name: value for name, value in given.items() if value is not None}
        if self.options.tangential is not None:
            asked["force"] = self.components(self.options.tangential)
        asked = asked or {"longitudinal": CREEPAGE}
        bound = self.bound(pressed)
        return rolling(bound, self.element, **asked, **self.common, progress=progress)

    def bound(self, pressed: NormalResult) -> Array:
        """Return the traction bound of the pressures: zero outside the contact, at any friction."""
        g = np.zeros_like(pressed.pressure)
        g[pressed.contact] = self.options.friction * pressed.pressure[pressed.contact]
        return g

    def components(self, values: Sequence[float]) -> Any:
        """Return a load along the surface: a number in line contact, else two."""
        return values[0] if self.options.line else (*values, 0.0)[:2]


def solve(case: Case | Rough) -> dict[str, ContactResult]:
    """Solve the normal problem, and the tangential one of its pressures, where there is one."""
    pressed = _solve("normal contact", case.press)
    results: dict[str, ContactResult] = {"pressure": pressed}
    if isinstance(case, Case) and case.options.case == "shift":
        results[TANGENTIAL] = _solve("friction", partial(case.shift, pressed))
    elif isinstance(case, Case) and case.options.case == "rolling":
        results[TANGENTIAL] = _solve("steady rolling", partial(case.roll, pressed))
    return results


def run(given: argparse.Namespace) -> int:
    """Run the command, and return the exit status."""
    options = complete(given)
    case = Rough.of(options) if options.case == "rough" else Case.of(options)
    if isinstance(case, Case):
        _check_slides_not(case)
    print(case.title, flush=True)
    start = perf_counter()
    try:
        results = solve(case)
    except ContactError as error:
        print(f"\nNOT CONVERGED: {error}")
        _print_doubts([error.result])
        return 1
    seconds = perf_counter() - start
    if options.output is not None:  # First, so that it does not depend on what can be printed.
        files.save_fields(options.output, fields(results))
    _print_report(case, results, seconds)
    if options.output is not None:
        print(f"written to {options.output}")
    if options.plot is not None:
        files.plot_contact(options.plot, options.dpi, case.title, results)
        print(f"drawn in {options.plot}")
    return 0


def fields(results: Mapping[str, ContactResult]) -> dict[str, Any]:
    """Return what is written, by name."""
    pressed, tangential = results["pressure"], results.get(TANGENTIAL)
    centres = np.meshgrid(*pressed.centres, indexing="ij")
    found: dict[str, Any] = dict(zip("xy", centres, strict=False))
    found |= {"element": pressed.element, "contact": pressed.contact}
    found |= {"pressure": pressed.traction, "displacement": pressed.displacement}
    found |= {"gap": pressed.gap, "force": pressed.force, "approach": pressed.rigid}
    if tangential is not None:
        found |= {"traction": tangential.traction, "slip": tangential.slip}
        found |= {"stick": tangential.stick, "bound": tangential.bound}
        found |= {"tangential_displacement": tangential.displacement}
        found |= {"tangential_force": tangential.force, "rigid": tangential.rigid}
    return found


def _check_slides_not(case: Case) -> None:
    """Refuse a tangential force that friction cannot carry, before any work."""
    o = case.options
    if o.tangential is None:
        return
    wanted, most = math.hypot(*o.tangential), o.friction * case.theory.force
    # Where the approach is given, theory says the force, within the error of the grid.
    if wanted > most * (1.0 + SLIDES) or (o.case == "rolling" and wanted >= most):
        raise ValueError(f"--tangential is {wanted:g}, but friction carries {most:.6g} at most")


def _solve(name: str, solve: Callable[[Progress], Result]) -> Result:
    print(f"\n{name}\n  products   violation", flush=True)
    with Waiting(name) as waiting, warnings.catch_warnings():
        warnings.simplefilter("ignore", ContactWarning)  # They are printed below the figures.
        result = solve(step_printer(waiting))
    print_step(result.products, result.residual)
    return result


def _print_report(case: Case | Rough, results: Mapping[str, ContactResult], seconds: float) -> None:
    """Print what was found, and what theory says, as far as it does."""
    products = " + ".join(str(result.products) for result in results.values())
    print(f"\nconverged: {products} product{'s' * (products != '1')}, {seconds:.2f} seconds")
    if isinstance(case, Rough):
        print(results["pressure"].summary())
        return
    pressed, tangential = results["pressure"], results.get(TANGENTIAL)
    theory, unit = case.theory, "N/mm" if case.options.line else "N"
    rows: list[tuple[str, Any, Any]] = [
        (f"force [{unit}]", pressed.force, theory.force),
        ("approach [mm]", pressed.rigid, theory.approach),
        ("largest pressure [N/mm²]", pressed.magnitude.max(), theory.max_pressure),
        (
            "width of contact [mm]" if case.options.line else "area of contact [mm²]",
            pressed.area,
            theory.area,
        ),
    ]
    if tangential is not None:
        rows += _tangential_figures(case, pressed, tangential)
    print(f"{'':26s}{'this run':>28s}{'theory':>14s}")
    for name, ours, exact in rows:
        numbers = np.atleast_1d(ours)
        nothing = case.options.tolerance * float(np.abs(numbers).max())
        values = " ".join(f"{x if abs(x) > nothing else 0.0:.6g}" for x in numbers)
        print(f"{name:26s}{values:>28s}{'' if exact is None else f'{exact:.6g}':>14s}")
    _print_doubts(results.values())


def _print_doubts(results: Iterable[ContactResult]) -> None:
    """Say why the figures may not be those that were meant, each reason once."""
    for doubt in dict.fromkeys(doubt for result in results for doubt in result.warnings):
        print(f"note: {doubt}")


def _tangential_figures(
    case: Case, pressed: ContactResult, result: ContactResult
) -> list[tuple[str, Any, Any]]:
    assert result.stick is not None
    o, (a, _) = case.options, case.theory.half_axes
    carried = o.friction * pressed.force
    part = float(np.linalg.norm(result.force)) / carried
    share = float(result.stick.sum()) / max(1.0, float(result.contact.sum()))
    sticks, force = None, None
    if o.case == "shift":  # Cattaneo and Mindlin are exact for ν = 0 and line contact.
        sticks = (1.0 - min(part, 1.0)) ** (0.5 if o.line else 2.0 / 3.0)
    elif o.line:  # Carter's theory says both.
        sticks = max(0.0, 1.0 - abs(result.rigid) * o.radius[0] / (o.friction * a))
        force = 1.0 - sticks**2
    rigid = "shift [mm]"
    if o.case == "rolling":
        rigid = "creepage" if o.line else "creepages [1, 1, 1/mm]"
    return [
        (f"tangential force [{'N/mm' if o.line else 'N'}]", result.force, None),
        ("that over friction's", part, force),
        (rigid, result.rigid, None),
        ("part that sticks", share, sticks),
    ]
