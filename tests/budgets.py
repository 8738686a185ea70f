"""Budgets of products, iterations and work units: what was measured, and what a test may take.

A test calls `assert_within_budget` with a case and what it has counted. A budget is 1.3 times what
was measured when the table was written, and at least 3 more, so that rounding on another processor
does not fail a test, but a method that has become worse does.

``python -m tests.budgets`` runs the tests that have budgets, writes them anew, in budgets.txt, and
prints what has grown; with names of test files it does so for their cases alone.
"""

import functools
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

RECORD = "TOEPLITZ_MG_BUDGETS"  # Names the folder into which tests write what they measure.
TESTS = Path(__file__).parent
TABLE = TESTS / "budgets.txt"  # A line has a case, a measure, what was measured, the budget.


def budget_of(measured):
    """Return what a test may take where this was measured."""
    return round(max(1.3 * measured, measured + 3), 2)


@functools.cache
def read_table():
    """Return what was measured and the budget, by case and measure."""
    lines = (line.split("\t") for line in TABLE.read_text(encoding="utf-8").splitlines())
    return {(case, name): (float(value), float(budget)) for case, name, value, budget in lines}


def assert_within_budget(case, **measures):
    """Check that each measure (products, iterations, work units, …) is within its budget.

    A case may be measured several times, as by several examples: the largest counts.
    """
    if folder := os.environ.get(RECORD):
        lines = [json.dumps([case, name, float(value)]) for name, value in measures.items()]
        with (Path(folder) / str(os.getpid())).open("a") as file:
            file.writelines(f"{line}\n" for line in lines)
        return
    for measure, value in measures.items():
        assert (case, measure) in read_table(), f"{case}, {measure}: run python -m tests.budgets"
        _, budget = read_table()[case, measure]
        assert value <= budget, f"{case}: {value} {measure}, but at most {budget} are budgeted"


def measure(paths):
    """Run tests, the slow ones too, and return the largest of each measure of each case."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-n", "auto", *map(str, paths)],
            env={**os.environ, RECORD: folder},
            cwd=TESTS.parent,
            check=True,
        )
        found = {}
        for path in sorted(Path(folder).iterdir()):
            for case, name, value in map(json.loads, path.read_text().splitlines()):
                found[case, name] = max(value, found.get((case, name), value))
    return found


def main(names):
    """Measure and rewrite the table, all of it or that of the files that are named."""
    users = [p for p in sorted(TESTS.rglob("*.py")) if "assert_within_budget(" in p.read_text()]
    users = [p for p in users if p != Path(__file__)]
    found = measure(map(Path, names) if names else users)
    before = read_table()
    kept = before if names else {}
    rows = kept | {key: (value, budget_of(value)) for key, value in found.items()}
    lines = (f"{case}\t{name}\t{v:g}\t{b:g}\n" for (case, name), (v, b) in sorted(rows.items()))
    TABLE.write_text("".join(lines), encoding="utf-8")
    for key in sorted(found):
        if key not in before:
            print(f"new: {', '.join(key)}: {rows[key][1]:g}")
        elif rows[key][1] > before[key][1]:
            print(f"GROWN: {', '.join(key)}: {before[key][1]:g} -> {rows[key][1]:g}")
    print(f"{len(found)} measured, {len(rows)} budgets in the table")


if __name__ == "__main__":
    main(sys.argv[1:])
