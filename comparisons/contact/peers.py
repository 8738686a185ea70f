"""A contact problem by this package, `aspher`, `tamaas` and `ContactMechanics`, equally accurate.

Each is asked for the loosest tolerance, in half decades, whose answer violates the conditions of
contact by no more than the target, measured with one matrix for all: by the natural residual
a₀ |p - max(0, p - w/a₀)|, of the gap w under load, the largest over the largest interference, and
likewise in friction, with Coulomb's bound, over the shift. (`tamaas` gets the fewest iterations.)
Times are CPU seconds of set-up and solution, in processes of their own with one thread.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from math import nan
from statistics import median
from typing import Any

import numpy as np
from tqdm import tqdm

from comparisons.contact.methods import FRICTION, NORMAL, Answer, Method, Problem, ours, tamaas
from comparisons.contact.theory import MU, A, C
from comparisons.harness import report
from comparisons.harness.processes import row_or_note
from comparisons.harness.report import Row

TARGET = 1e-8  # Violation of the conditions of contact that is allowed.
SECONDS = 300.0  # Time after which a method is given up on a problem.
REPEATS = 3  # Solves of which the median time counts.


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


def problems(N: int) -> list[Problem]:
    """Return the problems that the methods are compared on."""
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
            Problem(f"rough, repeated, {share} %", N, force, is_rough=True, periodic=True)
            for share, force in ((2, 0.0123), (10, 0.06), (31, 0.2), (77, 0.7), (99, 1.6))
        ),
        *(
            Problem(f"Cattaneo and Mindlin, ν = {nu:g}", N, nu=nu, shift=shift)
            for nu, shift in shifts.items()
        ),
    ]


def run(
    chosen: Sequence[Problem],
    normal: Mapping[str, Method] = NORMAL,
    friction: Mapping[str, Method] = FRICTION,
) -> list[Row]:
    """Measure every method that is installed on every problem that it is for."""
    jobs = [
        (problem, name, method)
        for problem in chosen
        for name, (package, method) in (friction if problem.shift else normal).items()
        if find_spec(package)
    ]
    rows: list[Row] = []
    for problem, name, method in tqdm(jobs, unit="run"):
        row: Row = {"problem": f"{problem.name}, {problem.N}²", "method": name, "cpu_s": nan}
        rows.append(row | row_or_note(partial(measure, method, problem), SECONDS))
    return rows


def format_row(row: Row) -> Row:
    """Return a row as it is printed."""
    formats = {"iterations": "d", "products": ".0f", "cpu_s": ".3f", "violation": ".1e"}
    formats |= {"traction_error": ".1e", "asked": ".3g"}
    cells = report.format_cells(row, formats)
    return {"method": row["method"], **cells, "note": row["note"]}
