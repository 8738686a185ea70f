"""A contact problem by this package, `aspher`, `tamaas` and `ContactMechanics`, equally accurate.

Each is asked for the loosest tolerance, in half decades, whose answer violates the conditions of
contact by no more than the target, measured with one matrix for all: by the natural residual
a₀ |p - max(0, p - w/a₀)|, of the gap w under load, the largest over the largest interference, and
likewise in friction, with Coulomb's bound, over the shift. (`tamaas` gets the fewest iterations.)
Times are CPU seconds of set-up and solution, in processes of their own with one thread. Surfaces
that repeat do so at several sizes. A package that is not installed is left out:
``pip install --group peers`` and ``--group compiled-peers`` have them.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from math import nan
from statistics import median
from typing import Any

import numpy as np

from comparisons.harness import report
from comparisons.harness.processes import prepare, row_or_note
from comparisons.harness.report import Row
from comparisons.peers.methods import FRICTION, NORMAL, Answer, Method, Problem, ours, tamaas
from comparisons.theory.solved import MU, A, C

TARGET = 1e-8  # Violation of the conditions of contact that is allowed.
SECONDS = 300.0  # Time after which a method is given up on a problem.
REPEATS = 3  # Solves of which the median time counts.
OURS = "toeplitz-mg"
REPEATED = "rough, repeated, "  # Problems on surfaces that repeat start with this.


def loosest(method: Callable[..., Answer], problem: Problem) -> tuple[float, Answer]:
    """Return the loosest tolerance, in half decades, that is exact enough, and the answer."""
    for k in range(8, 27):
        answer = method(problem, 10.0 ** (-k / 2))
        if problem.violation(answer.traction, answer.bound) <= TARGET:
            return 10.0 ** (-k / 2), answer
    raise ArithmeticError("no tolerance is enough")


def fewest(method: Callable[..., Answer], problem: Problem) -> tuple[float, Answer]:
    """Return the fewest iterations that are exact enough, and the answer."""

    def exact(iterations: int) -> bool:
        answer = method(problem, iterations)
        return problem.violation(answer.traction, answer.bound) <= TARGET

    few, enough = 0, 16
    while not exact(enough):
        few, enough = enough, 2 * enough
    while enough - few > 1:
        middle = (few + enough) // 2
        few, enough = (few, middle) if exact(middle) else (middle, enough)
    return enough, method(problem, enough)


def measure(method: Callable[..., Answer], problem: Problem) -> Row:
    """Find what is asked of a method, and measure it; in a process of its own."""
    asked, answer = (fewest if method is tamaas else loosest)(method, problem)
    argument: Any = int(asked) if method is tamaas else asked
    seconds = [method(problem, argument).seconds for _ in range(REPEATS)]
    reference = ours(problem, 1e-12).traction
    away = np.linalg.norm(answer.traction - reference) / np.linalg.norm(reference)
    return {
        "iterations": answer.iterations,
        "products": answer.products,
        "cpu_s": median(seconds),
        "violation": problem.violation(answer.traction, answer.bound),
        "traction_error": float(away),
        "asked": asked,
        "note": "",
    }


def problems(N: int, larger: Sequence[int] = ()) -> list[Problem]:
    """Return the problems that methods are compared on, those that repeat on larger grids too."""
    shifts = {nu: MU * (A**2 - C**2) * (2.0 - nu) / (2.0 * (1.0 - nu)) for nu in (0.0, 0.28)}
    return [
        Problem("Hertz, sphere", N),
        Problem("rough, 2 %", N, 0.0123, is_rough=True),
        Problem("rough, 10 %", N, 0.06, is_rough=True),
        Problem("rough, 28 %", N, 0.2, is_rough=True),
        *(
            Problem(f"rough, nearly full, F = {force:g}", N // 2, force, is_rough=True)
            for force in (0.5, 1.0, 2.0, 4.0)
        ),
        *(
            Problem(f"{REPEATED}{share} %", n, force, is_rough=True, periodic=True)
            for n in (N, *larger)
            for share, force in ((2, 0.0123), (10, 0.06), (31, 0.2), (77, 0.7), (99, 1.6))
        ),
        *(
            Problem(f"Cattaneo and Mindlin, ν = {nu:g}", N, nu=nu, shift=shift)
            for nu, shift in shifts.items()
        ),
    ]


def run(
    table: report.Table,
    chosen: Sequence[Problem],
    normal: Mapping[str, Method] = NORMAL,
    friction: Mapping[str, Method] = FRICTION,
) -> None:
    """Measure every method that is installed on every problem that it is for."""
    for problem in chosen:
        for name, (package, method) in (friction if problem.shift else normal).items():
            if find_spec(package):
                row: Row = {"problem": problem.name, "N": problem.N, "method": name, "cpu_s": nan}
                table.add(row | row_or_note(partial(measure, method, problem), SECONDS))


def form(row: Row) -> Row:
    """Return a row as it is printed."""
    formats = {"iterations": "d", "products": ".0f", "cpu_s": ".3f", "violation": ".1e"}
    formats |= {"traction_error": ".1e", "asked": ".3g"}
    names = {key: row[key] for key in ("problem", "N", "method")}
    return names | report.format_cells(row, formats) | {"note": row["note"]}


def arrange_repeated(rows: Sequence[Row]) -> list[Row]:
    """Return the table of CPU times over that of the faster way of `aspher`, where both repeat."""
    table: dict[int, Row] = {}
    for (problem, N), own in report.group(rows, "problem", "N").items():
        seconds = {row["method"]: row["cpu_s"] for row in own if row.get("cpu_s", nan) > 0.0}
        theirs = [s for method, s in seconds.items() if method.startswith("aspher")]
        if problem.startswith(REPEATED) and theirs and OURS in seconds:
            line = table.setdefault(N, {"CPU over aspher's": f"{N}²"})
            line[problem.removeprefix(REPEATED)] = f"{seconds[OURS] / min(theirs):.2f}"
    return list(table.values())


@report.interruptible
def main(
    argv: Sequence[str] | None = None,
    normal: Mapping[str, Method] = NORMAL,
    friction: Mapping[str, Method] = FRICTION,
) -> None:
    """Run the comparison."""
    prepare("comparisons.peers.measuring")
    arguments = report.options(
        "peers", "A contact problem by this package and by others.", argv=argv
    )
    chosen = problems(64) if arguments.quick else problems(256, (512, 1024))
    title = f"Each as accurate as {TARGET:g} takes"
    room = {"problem": 34, "method": 22}
    run(report.Table(title, arguments.output / "peers.csv", form, room), chosen, normal, friction)
