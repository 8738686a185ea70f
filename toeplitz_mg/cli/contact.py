"""The command ``toeplitz-mg contact``: press, shift or roll smooth bodies.

It also presses a measured surface (see `rough`).
"""

import argparse
import math
import re
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array, Element, Progress
from toeplitz_mg.cli import files
from toeplitz_mg.cli.arguments import complete_contact
from toeplitz_mg.cli.report import (
    PRESSURE,
    TANGENTIAL,
    Solve,
    Waiting,
    print_step,
    step_printer,
)
from toeplitz_mg.cli.rough import Rough
from toeplitz_mg.contact import (
    ContactError,
    ContactResult,
    ContactWarning,
    FrictionalResult,
    HertzContact,
    NormalResult,
    TangentialResult,
    friction,
    frictional_contact,
    frictional_rolling,
    hertz,
    normal_contact,
    rolling,
    surfaces,
)
from toeplitz_mg.contact.checks import SLIDES
from toeplitz_mg.contact.doubts import UNCOUPLED
from toeplitz_mg.halfspace import difference_parameter

MARGIN = 1.3  # Side of the grid divided by the length of the contact by Hertz's theory.
CREEPAGE = -0.002  # Default longitudinal creepage.


@dataclass(frozen=True)
class Hertzian:
    """A contact problem of smooth bodies, on a grid of the size that Hertz's theory suggests."""

    options: argparse.Namespace
    theory: HertzContact
    shape: tuple[int, ...]
    h: float  # Size of an element, or width of a strip, mm.

    @classmethod
    def of(cls, options: argparse.Namespace) -> "Hertzian":
        """Choose the grid, or raise an error if the requested grid is too small."""
        o = options
        radii = _radii(o)
        try:
            theory = hertz(radii=radii, material=o.material, force=o.force, approach=o.approach)
        except ValueError as error:  # It names the arguments of `hertz`.
            raise ValueError(re.sub(r"^radii is", "--radius is", str(error))) from error
        a, b = theory.half_axes
        if not o.line and math.isinf(max(a, b)):
            raise ValueError("--radius is straight along an axis: give --line, and one radius")
        longer = 2.0 * (a if o.line else max(a, b))
        size = MARGIN * longer if o.size is None else o.size
        if size < longer:
            raise ValueError(
                f"--size is {size:g}, but the contact is {longer:.4g} mm long by Hertz's theory"
            )
        h = size / o.n
        shape: tuple[int, ...] = (o.n,)
        if not o.line:
            shape = tuple(max(1, math.ceil(o.n * axis / max(a, b))) for axis in (a, b))
        case = cls(o, theory, shape, h)
        case.check_friction()
        return case

    @property
    def element(self) -> Element:
        """The size of an element."""
        return self.h if self.options.line else (self.h, self.h)

    @property
    def title(self) -> str:
        """One line that describes the problem."""
        o = self.options
        radii = " and ".join(f"{r:g}" for r in dict.fromkeys(o.radius))
        body = "cylinder" if o.line else "sphere" if len(set(o.radius)) == 1 else "ellipsoid"
        grid = " x ".join(map(str, self.shape))
        return f"{o.case}: {body} of {radii} mm, {grid} elements of {self.h:.3g} mm"

    @property
    def is_coupled(self) -> bool:
        """Whether pressures displace the bodies along the surface, and tractions across it."""
        material = self.options.material
        return isinstance(material, tuple) and abs(difference_parameter(*material)) > UNCOUPLED

    def solve(self, solve: Solve) -> dict[str, ContactResult]:
        """Solve the normal problem, and the tangential one, or both at once.

        Parameters
        ----------
        solve : callable
            Calls a solver with a progress function, whose output is printed under a name.
        """
        case = self.options.case
        if case == "hertz":
            return {PRESSURE: solve("normal contact", self.press)}
        name = "friction" if case == "shift" else "steady rolling"
        if self.is_coupled:
            both = solve(f"normal contact and {name}", self.press_and_move)
            return {PRESSURE: both.normal, TANGENTIAL: both.tangential}
        pressed = solve("normal contact", self.press)
        return {PRESSURE: pressed, TANGENTIAL: solve(name, partial(self.move, pressed))}

    def press(self, progress: Progress) -> NormalResult:
        """Solve the normal problem."""
        return normal_contact(self.gap, self.element, **self.pressing, progress=progress)

    def move(self, pressed: NormalResult, progress: Progress) -> TangentialResult:
        """Solve the tangential problem for given pressures."""
        o = self.options
        common = {"mu": o.mu, "tolerance": o.tolerance, "progress": progress}
        if o.case == "shift":
            return friction(pressed, **self.shift(pressed.force), **common)
        return rolling(pressed, **self.creepages, **common)

    def press_and_move(self, progress: Progress) -> FrictionalResult:
        """Solve both problems for unlike bodies."""
        common = self.pressing | {"mu": self.options.mu, "progress": progress}
        shifts = self.options.case == "shift"
        motion = self.shift(self.theory.force) if shifts else self.creepages
        if "force" in motion:  # In these functions `force` is the normal force.
            motion["tangential_force"] = motion.pop("force")
        solver = frictional_contact if shifts else frictional_rolling
        return solver(self.gap, self.element, **common, **motion)

    @property
    def gap(self) -> Array:
        """The gap between the bodies before loading."""
        if self.options.line:
            return surfaces.cylinder(self.shape, self.element, radius=self.options.radius[0])
        radii = _radii(self.options)
        n1, n2 = self.shape
        return surfaces.ellipsoid((n1, n2), (self.h, self.h), radii=radii)

    @property
    def pressing(self) -> dict[str, Any]:
        """The arguments of functions for normal contact."""
        names = "force", "approach", "material", "tolerance"
        return {name: getattr(self.options, name) for name in names}

    def shift(self, force: float) -> dict[str, Any]:
        """Return the arguments of a shift; by default half of the force that friction can carry."""
        o = self.options
        if o.shift is not None:
            return {"shift": self.components(o.shift)}
        return {"force": self.components(o.tangential or [0.5 * o.mu * force])}

    @property
    def creepages(self) -> dict[str, Any]:
        """The arguments of functions for rolling."""
        names = "longitudinal", "lateral", "spin", "moment"
        given = {name: getattr(self.options, name) for name in names}
        asked = {name: value for name, value in given.items() if value is not None}
        if self.options.tangential is not None:
            asked["force"] = self.components(self.options.tangential)
        return asked or {"longitudinal": CREEPAGE}

    def components(self, values: Sequence[float]) -> Any:
        """Return a tangential load: a number in line contact, otherwise two."""
        return values[0] if self.options.line else (*values, 0.0)[:2]

    def check_friction(self) -> None:
        """Refuse a tangential force that friction cannot carry, before any work."""
        o = self.options
        if o.tangential is None:
            return
        wanted, most = math.hypot(*o.tangential), o.mu * self.theory.force
        # If the approach is given, the force follows from theory, within the error of the grid.
        if o.case == "rolling" and wanted >= most:
            raise ValueError(
                f"--tangential is {wanted:g}, but must be less than {most:.6g}, the most that "
                "friction carries: there everything slides, at any creepage"
            )
        if wanted > most * (1.0 + SLIDES):
            raise ValueError(f"--tangential is {wanted:g}, but friction carries at most {most:.6g}")


def _radii(o: argparse.Namespace) -> Any:
    """Return the radii of curvature in the form of `surfaces.ellipsoid`."""
    if len(o.radius) == 4:
        return tuple(o.radius[:2]), tuple(o.radius[2:])
    return o.radius[0], math.inf if o.line else o.radius[-1]


def run(given: argparse.Namespace) -> tuple[int, dict[str, Any]]:
    """Run the command, and return the exit status and the figures by name."""
    options = complete_contact(given)
    case = Rough.of(options) if options.case == "rough" else Hertzian.of(options)
    print(case.title, flush=True)
    start = perf_counter()
    try:
        results = case.solve(_solve)
    except ContactError as error:
        print(f"\nNOT CONVERGED: {error}")
        _print_doubts([error.result])
        return 1, {"converged": False, "message": str(error)}
    seconds = perf_counter() - start
    if options.output is not None:  # First, so that a failure to print does not prevent it.
        files.save_fields(options.output, fields(results), overwrite=bool(options.overwrite))
    _print_report(case, results, seconds)
    if options.output is not None:
        print(f"written to {options.output}")
    if options.plot is not None:
        over = bool(options.overwrite)
        files.plot_contact(options.plot, options.dpi, case.title, results, overwrite=over)
        print(f"drawn in {options.plot}")
    return 0, {"converged": True, "seconds": seconds} | _figures(case, results)


def _figures(case: Hertzian | Rough, results: Mapping[str, ContactResult]) -> dict[str, Any]:
    """Return the printed figures, and those of summaries, by the field names of results."""
    pressed, whole = results[PRESSURE], fields(results)
    numbers = "force", "approach", "tangential_force", "rigid", "moment", "power"
    found = {
        "products": [result.products for result in results.values()],
        "residual": [result.residual for result in results.values()],
        "warnings": [*dict.fromkeys(doubt for r in results.values() for doubt in r.warnings)],
    } | {name: whole[name] for name in numbers if name in whole}
    for name, value, _, of in pressed._summary().figures:
        found[of or name] = getattr(pressed, of) if of else value
    if isinstance(tangential := results.get(TANGENTIAL), TangentialResult):
        found["stick_area"] = tangential.stick_area
    if isinstance(case, Hertzian):
        names = "force", "approach", "max_pressure", "area"
        found["theory"] = {name: getattr(case.theory, name) for name in names}
    return found


def fields(results: Mapping[str, ContactResult]) -> dict[str, Any]:
    """Return the output arrays by name."""
    pressed, tangential = results[PRESSURE], results.get(TANGENTIAL)
    assert isinstance(tangential, TangentialResult | None)
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
        of_rolling = {"moment": tangential.moment, "power": tangential.power}
        found |= {name: value for name, value in of_rolling.items() if value is not None}
    return found


def _solve(name: str, solve: Callable[[Progress], Any]) -> Any:
    print(f"\n{name}\n  products   violation", flush=True)
    with Waiting(name) as waiting, warnings.catch_warnings():
        warnings.simplefilter("ignore", ContactWarning)  # They are printed below the figures.
        result = solve(step_printer(waiting))
    print_step(result.products, result.residual)
    return result


def _print_report(
    case: Hertzian | Rough, results: Mapping[str, ContactResult], seconds: float
) -> None:
    """Print the results, and the values of theory where available."""
    products = " + ".join(str(result.products) for result in results.values())
    print(f"\nconverged: {products} product{'s' * (products != '1')}, {seconds:.2f} seconds")
    if isinstance(case, Rough):
        print(results[PRESSURE].summary())
        return
    pressed, tangential = results[PRESSURE], results.get(TANGENTIAL)
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
    """Print the warnings of the results, each of them once."""
    for doubt in dict.fromkeys(doubt for result in results for doubt in result.warnings):
        print(f"note: {doubt}")


def _tangential_figures(
    case: Hertzian, pressed: ContactResult, result: ContactResult
) -> list[tuple[str, Any, Any]]:
    assert result.stick is not None
    o, (a, _) = case.options, case.theory.half_axes
    carried = o.mu * pressed.force
    # In free rolling the force is zero up to rounding; print it as zero.
    is_force = np.abs(result.force) > o.tolerance * min(carried, pressed.force)
    along = np.where(is_force, result.force, 0.0)
    part = float(np.linalg.norm(along)) / carried
    share = float(result.stick.sum()) / max(1.0, float(result.contact.sum()))
    sticks, force = None, None
    if case.is_coupled:  # No theory covers the coupling.
        pass
    elif o.case == "shift":  # Cattaneo and Mindlin are exact for ν = 0 and line contact.
        left = 1.0 - part
        sticks = (left if left > SLIDES else 0.0) ** (0.5 if o.line else 2.0 / 3.0)
    elif o.line:  # Carter's theory gives both.
        sticks = max(0.0, 1.0 - abs(result.rigid) * o.radius[0] / (o.mu * a))
        force = 1.0 - sticks**2
    rigid = "shift [mm]"
    if o.case == "rolling":
        rigid = "creepage" if o.line else "creepages [1, 1, 1/mm]"
    unit = "N/mm" if o.line else "N"
    rows: list[tuple[str, Any, Any]] = [
        (f"tangential force [{unit}]", along, None),
        ("force / (mu P)", part, force),
        (rigid, result.rigid, None),
        ("share that sticks", share, sticks),
    ]
    if o.case == "rolling":
        rows.append((f"power over speed [{unit}]", result.power, None))
    if result.moment is not None:
        is_moment = abs(result.moment) > o.tolerance * min(carried, pressed.force) * a
        rows.append(("moment [N mm]", result.moment if is_moment else 0.0, None))
    return rows
