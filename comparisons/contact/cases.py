"""Contact problems with a known answer, rough surfaces, and the peers that solve the same.

Hertz (line, sphere, ellipse), Westergaard's wave, Cattaneo and Mindlin (line, sphere), Carter (by
creepage, by force, by friction that falls), Bufler's unlike rollers, Kalker's coefficients, and
stresses below a line and a sphere that slide: the errors against theory over the number N of
elements across the grid, with the order that is observed; pictures of the tractions and of the
areas of stick and slip beside the analytic curves; products, iterations between two changes of the
areas, CPU time, and the violation of all conditions, recomputed. An error is the root mean square
of four grids of nearly the same N, as it jumps with the place of the edge of an area in its
element. Rough surfaces are drawn at several loads, from 1 to 40 % of contact. Kalker's coefficients
are known to three digits. `comparisons.contact.rolling` has more of rolling.

Against `aspher` and `tamaas`, where they are installed, see `contact.peers`.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import nan
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from tqdm import tqdm

from comparisons.contact import below, peers, rolling_theory, theory
from comparisons.contact.figures import convergence, picture, rough_picture
from comparisons.contact.methods import FRICTION, NORMAL, Method, rough_gap
from comparisons.contact.theory import UNIT, Solved
from comparisons.harness import report
from comparisons.harness.processes import in_a_fresh_process, prepare
from comparisons.harness.report import Row
from toeplitz_mg.contact import ContactResult, normal_contact

LINES, QUICK_LINES = (64, 128, 256, 512, 1024, 2048, 4096), (64, 128, 256)
SURFACES, QUICK_SURFACES = (32, 64, 128, 256, 512), (32, 64)
ROLLING, QUICK_ROLLING = (32, 64, 128, 256), (32, 64)
ROUGH, QUICK_ROUGH = (256, 512, 1024), (64,)
BELOW = ("Largest shear", "Stresses")  # Cases below the surface start with these.
GIVEN = 1e-14  # Relative error of a quantity that is given, and so no error.
SECONDS = 1200.0  # Time after which a case is given up.
LOADS = (0.006, 0.0123, 0.06, 0.2, 0.36)  # Normal forces that give 1 to 40 % of contact.

# The solver, its sizes, and those of a quick run.
Case = tuple[Callable[[int], Solved], Sequence[int], Sequence[int]]

CASES: dict[str, Case] = {
    "Hertz, line": (theory.hertz_line, LINES, QUICK_LINES),
    "Westergaard": (theory.westergaard, LINES, QUICK_LINES),
    "Hertz, sphere": (theory.hertz_sphere, SURFACES, QUICK_SURFACES),
    "Hertz, ellipse": (theory.hertz_ellipse, SURFACES, QUICK_SURFACES),
    "Cattaneo, line": (theory.cattaneo_line, LINES, QUICK_LINES),
    "Cattaneo and Mindlin, ν = 0": (theory.cattaneo_sphere, SURFACES, QUICK_SURFACES),
    "Cattaneo and Mindlin, ν = 0.28": (theory.mindlin_sphere, SURFACES, QUICK_SURFACES),
    "Cattaneo and Mindlin, pressed": (theory.pressed_sphere, SURFACES, QUICK_SURFACES),
    "Carter": (rolling_theory.carter, LINES, QUICK_LINES),
    "Carter, by force": (rolling_theory.carter_by_force, LINES, QUICK_LINES),
    "Carter, falling friction": (rolling_theory.carter_falling, LINES, QUICK_LINES),
    "Bufler, unlike rollers": (rolling_theory.bufler, LINES, QUICK_LINES),
    "Kalker": (rolling_theory.kalker, ROLLING, QUICK_ROLLING),
    "Largest shear, line": (below.shear_line, LINES, QUICK_LINES),
    "Largest shear, sphere": (below.shear_sphere, SURFACES, QUICK_SURFACES),
    "Stresses, line, sliding": (below.sliding_line, LINES, QUICK_LINES),
    "Stresses, sphere, sliding": (below.sliding_sphere, SURFACES, QUICK_SURFACES),
}


def rough(N: int, load: float) -> Solved:
    """Solve a rough surface with wavelengths from 0.5 to 1/32, or to four elements."""
    h = 2.0 / N
    gap = rough_gap(N)
    result = normal_contact(gap, (h, h), material=UNIT, force=load)
    return Solved([result], {"F": result.force / load - 1.0}, gap=gap)


def solve_and_count(case: str, N: int, solve: Callable[[], Solved]) -> tuple[Solved, Row]:
    """Solve, and return what it cost."""
    start = process_time()
    answer = solve()
    seconds = process_time() - start
    results = answer.results
    return answer, {
        "case": case,
        "N": N,
        "products": " + ".join(str(r.products) for r in results),
        "work": " + ".join(f"{r.work:.1f}" for r in results),
        "iterations": "; ".join(" ".join(map(str, r.iterations)) for r in results),
        "violation": answer.violation,
        "cpu_s": seconds,
    }


def grids(N: int) -> list[int]:
    """Return some even sizes from N to less than 1.2 N."""
    return [N + 2 * (k * N // 32) for k in range(4)]


def order(errors: Sequence[float], sizes: Sequence[int]) -> float:
    """Return the power of 1/N by which errors fall, by least squares."""
    known = [k for k, e in enumerate(errors) if e > 0.0]
    if len(known) < 2:
        return nan
    x, y = np.log(np.array(sizes)[known]), np.log(np.array(errors)[known])
    return -float(np.polyfit(x, y, 1)[0])


def study(
    case: str, solve: Callable[[int], Solved], sizes: Sequence[int], folder: Path
) -> tuple[list[Row], list[Row]]:
    """Solve a case on every grid, draw the finest, return costs and errors; in a fresh process."""
    solve(sizes[0])  # What the first call loads is not its time.
    costs: list[Row] = []
    errors: list[Row] = []
    for N in sizes:
        answer, cost = solve_and_count(case, N, partial(solve, N))
        costs.append(cost)
        several = [answer.errors, *(solve(n).errors for n in grids(N)[1:])]
        for quantity in answer.errors:
            error = float(np.sqrt(np.mean([float(e[quantity]) ** 2 for e in several])))
            errors.append({"case": case, "quantity": quantity, "N": N, "error": error})
    picture(answer.results, answer.theory, f"{case}, N = {N}", folder / f"{solve.__name__}.png")
    return costs, errors


def analytic(cases: Mapping[str, Case], quick: bool, folder: Path) -> list[Row]:
    """Solve cases with a known answer, and return what they cost."""
    costs: list[Row] = []
    errors: list[Row] = []
    orders: list[Row] = []
    for case, (solve, full, few) in tqdm(cases.items(), unit="case"):
        sizes = few if quick else full
        cost, error = in_a_fresh_process(partial(study, case, solve, sizes, folder), SECONDS)
        costs += cost
        errors += error
        for quantity, own in report.group(error, "quantity").items():
            values = [row["error"] for row in own]
            row: Row = {"case": case, "quantity": quantity, "order": order(values, sizes)}
            orders.append(row | {f"N = {n}": v for n, v in zip(sizes, values, strict=True)})
    convergence(errors, folder / "convergence.png")
    report.write_csv(folder / "errors.csv", errors)
    report.write_csv(folder / "orders.csv", orders)
    for case, own in report.group(orders, "case").items():
        show(f"{case}: errors against theory", own)
    show("Products, iterations between changes of the areas, CPU time", costs)
    return costs


def study_rough(N: int, folder: Path) -> list[Row]:
    """Solve a rough surface at every load, and draw the pressures; in a fresh process."""
    rough(64, LOADS[0])
    rows: list[Row] = []
    answers: list[ContactResult] = []
    for load in LOADS:
        answer, row = solve_and_count("rough", N, partial(rough, N, load))
        (result,) = answer.results
        assert result.gap is not None
        row |= {"load": load, "contact": f"{result.contact.mean():.2%}"}
        row |= {"force error": abs(answer.errors["F"])}
        row |= {"least pressure": result.traction.min(), "least gap": result.gap.min()}
        rows.append(row)
        answers.append(result)
    rough_picture(answers, N, folder / f"rough_{N}.png")
    return rows


def rough_surfaces(quick: bool, folder: Path) -> list[Row]:
    """Solve rough surfaces at several loads, and return what they cost."""
    rows: list[Row] = []
    for N in QUICK_ROUGH if quick else ROUGH:
        rows += in_a_fresh_process(partial(study_rough, N, folder), SECONDS)
    show("Rough surfaces", rows)
    return rows


def arrange_errors(rows: Sequence[Row]) -> list[Row]:
    """Return the table of errors on the finest grids, with their orders."""
    table: list[Row] = []
    for case, own in report.group(rows, "case").items():
        if case.startswith(BELOW):
            continue
        errors, orders = [], []
        for quantity, several in report.group(own, "quantity").items():
            values, sizes = [row["error"] for row in several], [row["N"] for row in several]
            if values[-1] > GIVEN:
                errors.append(f"{quantity} {values[-1]:.0e}")
                orders.append(f"{order(values, sizes):.1f}")
        line = {"case": case, "N": own[-1]["N"]}
        table.append(line | {"errors": ", ".join(errors), "order": ", ".join(orders)})
    return table


def arrange_stresses(rows: Sequence[Row]) -> list[Row]:
    """Return the table of errors of the stresses, a row for each grid."""
    own = [row for row in rows if row["case"].startswith(BELOW)]
    columns = dict.fromkeys((row["case"] for row in own), "")
    table: list[Row] = []
    for N in sorted({row["N"] for row in own}):
        line: Row = {"N": N} | columns
        for case, several in report.group([r for r in own if r["N"] == N], "case").items():
            line[case] = ", ".join(f"{r['quantity']} {r['error']:.0e}" for r in several)
        table.append(line)
    return table


def arrange_products(rows: Sequence[Row]) -> list[Row]:
    """Return the table of products on the grid itself, a column for each size."""
    sizes = {f"N = {N}": "" for N in sorted({row["N"] for row in rows})}
    shares = {row["load"]: row["contact"] for row in reversed(rows) if "load" in row}
    table: dict[str, Row] = {}
    for row in rows:
        name = row["case"]
        if "load" in row:  # Named by the contact on the coarsest grid.
            name += f", {float(shares[row['load']].rstrip('%')):.0f} %"
        if not name.startswith(BELOW):  # Which is of the same bodies.
            line = table.setdefault(name, {"case": name} | sizes)
            line[f"N = {row['N']}"] = row["products"]
    return list(table.values())


def show(title: str, rows: Sequence[Row]) -> None:
    """Print rows, as they are read."""
    report.show(title, [{k: format_cell(k, v) for k, v in row.items()} for row in rows])


def format_cell(key: str, value: Any) -> Any:
    """Return a cell as it is printed."""
    formats = {"order": ".2f", "cpu_s": ".3f", "load": "g", "contact": "s", "work": "s"}
    return format(value, formats.get(key, ".2e")) if isinstance(value, float) else value


def main(
    cases: Mapping[str, Case] = CASES,
    normal: Mapping[str, Method] = NORMAL,
    friction: Mapping[str, Method] = FRICTION,
) -> None:
    """Run the comparison."""
    prepare("comparisons.contact.peers", "comparisons.contact.figures")
    arguments = report.options("contact.cases", "Contact problems: theory, rough surfaces, peers.")
    costs = analytic(cases, arguments.quick, arguments.output)
    costs += rough_surfaces(arguments.quick, arguments.output)
    report.write_csv(arguments.output / "costs.csv", costs)
    rows = peers.run(peers.problems(64 if arguments.quick else 256), normal, friction)
    report.write_csv(arguments.output / "peers.csv", rows)
    for problem, own in report.group(rows, "problem").items():
        table = [peers.format_row(row) for row in own]
        report.show(f"{problem}: each as accurate as {peers.TARGET:g} takes", table)


if __name__ == "__main__":
    main()
