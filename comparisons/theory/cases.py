"""Contact problems against theory: errors and their order, products, the violation recomputed.

`CASES` has them. An error is the root mean square of four grids of nearly the same N elements
across, as it jumps with the place of the edge of an area in its element; the order is the power of
1/N by which it falls. Rough surfaces have no theory: their products, and whether all conditions
hold. Last come numbers that others have printed: Kalker's tables, of three digits, the creepages of
aluminium on steel, a soft sphere that is pressed on a rigid plane in 35 steps.
"""

import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from time import process_time

import numpy as np

from comparisons.harness import report
from comparisons.harness.processes import FreshProcess, prepare
from comparisons.harness.report import Row
from comparisons.theory import below, pressed, rolling
from comparisons.theory.solved import Solved, grids, order
from toeplitz_mg.contact import ContactWarning

LINES, QUICK_LINES = (64, 128, 256, 512, 1024, 2048, 4096), (64, 128)
SURFACES, QUICK_SURFACES = (32, 64, 128, 256, 512), (32,)
ROLLING, QUICK_ROLLING = (32, 64, 128, 256), (32,)
ROUGH, QUICK_ROUGH = (256, 512, 1024), (64,)
QUICK_STEPS = 4  # Of the sphere that is pressed in steps.
BELOW = "Stresses"  # Cases below the surface start with this.
REPEATED = "repeated, "  # Rough surfaces that repeat start with this.
GIVEN = 1e-14  # Relative error of a quantity that is given, and so no error.
ROOM = {"case": 56, "here": 36, "known": 36}  # Characters of the columns of what is printed.
SECONDS = 1200.0  # Time after which a grid of a case is given up.
# Normal forces on the rough surface by the share that touches, %: as it ends, and as it repeats.
LOADS = {1: 0.006, 2: 0.0123, 10: 0.06, 28: 0.2, 44: 0.36}
REPEATED_LOADS = {2: 0.0123, 10: 0.06, 31: 0.2, 77: 0.7, 99: 1.6}

# The solver, its sizes, and those of a quick run.
Case = tuple[Callable[[int], Solved], Sequence[int], Sequence[int]]
Study = tuple[Row, list[Row]]  # What a grid costs, and its errors.

mindlin = partial(pressed.cattaneo_sphere, nu=0.28)
CASES: dict[str, Case] = {
    "Hertz, line": (pressed.hertz_line, LINES, QUICK_LINES),
    "Westergaard": (pressed.westergaard, LINES, QUICK_LINES),
    "Hertz, sphere": (pressed.hertz_sphere, SURFACES, QUICK_SURFACES),
    "Hertz, ellipse": (pressed.hertz_ellipse, SURFACES, QUICK_SURFACES),
    "Flat punch": (pressed.flat_punch, SURFACES, QUICK_SURFACES),
    "Bonded punch, ν = 0": (partial(pressed.bonded_punch, nu=0.0), ROLLING, QUICK_ROLLING),
    "Bonded punch, ν = 0.3": (partial(pressed.bonded_punch, nu=0.3), ROLLING, QUICK_ROLLING),
    "Cattaneo, line": (pressed.cattaneo_line, LINES, QUICK_LINES),
    "Cattaneo and Mindlin, ν = 0": (pressed.cattaneo_sphere, SURFACES, QUICK_SURFACES),
    "Cattaneo and Mindlin, ν = 0.28": (mindlin, SURFACES, QUICK_SURFACES),
    "Ciavarella and Jäger, repeated": (pressed.repeated_friction, ROLLING, QUICK_ROLLING),
    "Carter": (rolling.carter, LINES, QUICK_LINES),
    "Carter, by force": (rolling.carter_by_force, LINES, QUICK_LINES),
    "Carter, falling friction": (rolling.carter_falling, LINES, QUICK_LINES),
    "Carter, from rest": (rolling.carter_from_rest, (32, 64, 128), (32,)),
    "Bufler, unlike rollers": (rolling.bufler, LINES, QUICK_LINES),
    "Kalker": (rolling.kalker, ROLLING, QUICK_ROLLING),
    "Stresses, line, sliding": (below.sliding_line, LINES, QUICK_LINES),
    "Stresses, sphere, sliding": (below.sliding_sphere, SURFACES, QUICK_SURFACES),
}
for name, loads, periodic in (("rough, ", LOADS, False), (REPEATED, REPEATED_LOADS, True)):
    for share, load in loads.items():
        solver = partial(pressed.rough, force=load, periodic=periodic)
        CASES[f"{name}{share} %"] = (solver, ROUGH, QUICK_ROUGH)


def study(case: str, sizes: Sequence[int]) -> Iterator[Study]:
    """Solve a case on grid after grid; in a process of its own."""
    solve, *_ = CASES[case]
    warnings.simplefilter("ignore", ContactWarning)  # Coarse grids are a part of it.
    solve(min(sizes[0], 64))  # What the first call loads is not its time.
    for N in sizes:
        start = process_time()
        answer = solve(N)
        seconds = process_time() - start
        cost: Row = {"case": case, "N": N, "violation": answer.violation, "cpu_s": seconds}
        cost["products"] = " + ".join(str(r.products) for r in answer.results)
        several = [answer.errors, *(solve(n).errors for n in grids(N)[1:] if answer.errors)]
        errors: list[Row] = []
        for quantity in answer.errors:
            error = float(np.sqrt(np.mean([float(e[quantity]) ** 2 for e in several])))
            errors.append({"case": case, "quantity": quantity, "N": N, "error": error})
        yield cost, errors


def compare(table: report.Table, errors: list[Row], case: str, quick: bool, folder: Path) -> None:
    """Add the costs of a case to a table, and its errors to those of all."""
    _, full, few = CASES[case]
    sizes = few if quick else full
    process = FreshProcess(partial(study, case, sizes))
    try:
        for _ in sizes:
            cost, own = process.next(SECONDS)
            errors += own
            report.write_csv(folder / "errors.csv", errors)
            table.add(cost | {"errors": list_errors(own)})
    except (TimeoutError, ArithmeticError) as error:
        note = str(error) or f"over {SECONDS:.0f} s"
        table.add({"case": case, "N": "", "errors": note})
        return
    finally:
        process.end()
    if len(sizes) > 1 and own:
        orders = orders_of([row for row in errors if row["case"] == case])
        powers = ", ".join(f"{quantity} {power:.1f}" for quantity, power in orders.items())
        table.add({"case": case, "N": "order", "errors": powers})


def list_errors(rows: Sequence[Row]) -> str:
    """Return the errors of a grid in a line, without those of what is given."""
    return ", ".join(f"{r['quantity']} {r['error']:.0e}" for r in rows if r["error"] > GIVEN)


def orders_of(rows: Sequence[Row]) -> dict[str, float]:
    """Return the order of the error of each quantity that is not given."""
    return {
        quantity: order([row["error"] for row in own], [row["N"] for row in own])
        for quantity, own in report.group(rows, "quantity").items()
        if own[-1]["error"] > GIVEN
    }


def arrange_errors(rows: Sequence[Row]) -> list[Row]:
    """Return the table of errors on the finest grids, with their orders."""
    table: list[Row] = []
    for case, own in report.group(rows, "case").items():
        if case.startswith(BELOW):
            continue
        finest = [row for row in own if row["N"] == own[-1]["N"]]
        orders = ", ".join(f"{power:.1f}" for power in orders_of(own).values())
        table.append({"case": case, "N": own[-1]["N"], "errors": list_errors(finest)})
        table[-1]["order"] = orders
    return table


def arrange_stresses(rows: Sequence[Row]) -> list[Row]:
    """Return the table of errors below the surface, a row for each size, a column for a case."""
    below = [row for row in rows if row["case"].startswith(BELOW)]
    cases = report.group(below, "case")
    return [
        {"N": N} | {case: list_errors([r for r in cases[case] if r["N"] == N]) for case in cases}
        for N in sorted({row["N"] for row in below})
    ]


def arrange_products(rows: Sequence[Row]) -> list[Row]:
    """Return the table of products on the grid itself, a column for each size."""
    # Those below the surface are of the same bodies.
    own = [r for r in rows if "products" in r and not r["case"].startswith((BELOW, REPEATED))]
    sizes = {f"N = {N}": "" for N in sorted({row["N"] for row in own})}
    return report.pivot(
        own,
        lambda row: {"case": row["case"]} | sizes,
        lambda row: (f"N = {row['N']}", row["products"]),
    )


def arrange_repeated(rows: Sequence[Row]) -> list[Row]:
    """Return the table of products on rough surfaces that repeat, a row for each grid."""
    own = (row for row in rows if row["case"].startswith(REPEATED))
    return report.pivot(
        own,
        lambda row: {"products": f"{row['N']}²"},
        lambda row: (row["case"].removeprefix(REPEATED), row["products"]),
    )


def arrange_printed(rows: Sequence[Row]) -> list[Row]:
    """Return the table of what others have printed, without Kalker's tables."""
    return [row for row in rows if not row["case"].startswith(rolling.KALKERS)]


def arrange_kalker(rows: Sequence[Row]) -> list[Row]:
    """Return the table of Kalker's coefficients."""
    named = [row for row in rows if row["case"].startswith(rolling.KALKERS)]
    return [row | {"case": row["case"].removeprefix(rolling.KALKERS)} for row in named]


def form(row: Row) -> Row:
    """Return the cells of a row as they are printed."""
    cells = report.format_cells(row, {"violation": ".0e", "cpu_s": ".2f"})
    several = row.get("products", "")
    products = several if len(several) < 16 else f"{several[:12]} …"
    return {
        "case": row["case"],
        "N": row["N"],
        "products": products,
        **cells,
        "errors": row["errors"],
    }


@report.interruptible
def main(argv: Sequence[str] | None = None) -> None:
    """Run the comparison."""
    prepare("comparisons.theory.cases")
    arguments = report.options(
        "theory", "Contact problems against theory.", argv=argv, cases=(*CASES, "printed")
    )
    folder, quick = arguments.output, arguments.quick
    table = report.Table(
        "Errors against theory", folder / "costs.csv", form, {"case": 30, "products": 16}
    )
    errors: list[Row] = []
    for case in arguments.cases or CASES:
        if case in CASES:
            compare(table, errors, case, quick, folder)
    if "printed" in (arguments.cases or ["printed"]):
        warnings.simplefilter("ignore", ContactWarning)
        known = report.Table("Numbers that others have printed", folder / "printed.csv", room=ROOM)
        sphere = rolling.printed_sphere(QUICK_STEPS) if quick else rolling.printed_sphere()
        known.extend(chain(rolling.printed_creepages(), rolling.printed_tables(), sphere))


if __name__ == "__main__":
    main()
