"""The command ``toeplitz-mg contact``: smooth bodies that are pressed, shifted or rolled.

Or a measured surface that is pressed. See `hertzian` and `rough`.
"""

import argparse
import warnings
from collections.abc import Callable, Iterable, Mapping
from time import perf_counter
from typing import Any

import numpy as np

from toeplitz_mg._typing import Progress
from toeplitz_mg.cli import files
from toeplitz_mg.cli.contact_arguments import complete
from toeplitz_mg.cli.hertzian import Hertzian
from toeplitz_mg.cli.report import PRESSURE, TANGENTIAL, Waiting, print_step, step_printer
from toeplitz_mg.cli.rough import Rough
from toeplitz_mg.contact import ContactError, ContactResult, ContactWarning, TangentialResult
from toeplitz_mg.contact.checks import SLIDES


def run(given: argparse.Namespace) -> int:
    """Run the command, and return the exit status."""
    options = complete(given)
    case = Rough.of(options) if options.case == "rough" else Hertzian.of(options)
    print(case.title, flush=True)
    start = perf_counter()
    try:
        results = case.solve(_solve)
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
    """Print what was found, and what theory says, as far as it does."""
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
    """Say why the figures may not be those that were meant, each reason once."""
    for doubt in dict.fromkeys(doubt for result in results for doubt in result.warnings):
        print(f"note: {doubt}")


def _tangential_figures(
    case: Hertzian, pressed: ContactResult, result: ContactResult
) -> list[tuple[str, Any, Any]]:
    assert result.stick is not None
    o, (a, _) = case.options, case.theory.half_axes
    carried = o.friction * pressed.force
    # Free rolling leaves no force, beside which its rounding would look like one.
    is_force = np.abs(result.force) > o.tolerance * min(carried, pressed.force)
    along = np.where(is_force, result.force, 0.0)
    part = float(np.linalg.norm(along)) / carried
    share = float(result.stick.sum()) / max(1.0, float(result.contact.sum()))
    sticks, force = None, None
    if case.is_coupled:  # No theory has all of it.
        pass
    elif o.case == "shift":  # Cattaneo and Mindlin are exact for ν = 0 and line contact.
        left = 1.0 - part
        sticks = (left if left > SLIDES else 0.0) ** (0.5 if o.line else 2.0 / 3.0)
    elif o.line:  # Carter's theory says both.
        sticks = max(0.0, 1.0 - abs(result.rigid) * o.radius[0] / (o.friction * a))
        force = 1.0 - sticks**2
    rigid = "shift [mm]"
    if o.case == "rolling":
        rigid = "creepage" if o.line else "creepages [1, 1, 1/mm]"
    unit = "N/mm" if o.line else "N"
    rows: list[tuple[str, Any, Any]] = [
        (f"tangential force [{unit}]", along, None),
        ("that over friction's", part, force),
        (rigid, result.rigid, None),
        ("part that sticks", share, sticks),
    ]
    if o.case == "rolling":
        rows.append((f"power over speed [{unit}]", result.power, None))
    if result.moment is not None:
        is_moment = abs(result.moment) > o.tolerance * min(carried, pressed.force) * a
        rows.append(("moment [N mm]", result.moment if is_moment else 0.0, None))
    return rows
