"""Whether `default_preconditioner` is ever worse than none, on matrices of every kind.

1,000 matrices of `systems.random_matrices` and 250 of `systems.matrices`, a constant and a random
right-hand side, CG from a zero guess to a relative residual of 1e-8. Worse is what takes more than
1.1 of the iterations of none, where that is more than two iterations: one or two are the rounding
of counts.
"""

import os
from collections.abc import Sequence
from multiprocessing import get_context
from statistics import median
from typing import Any

import numpy as np
from tqdm import tqdm

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import TOLERANCE, iterate
from comparisons.harness.report import Row
from comparisons.systems.matrices import Case, typical
from comparisons.systems.random_matrices import random_ones

TITLE = "default_preconditioner against none"
MAXITER = 500  # Iterations after which CG has not converged.
RANDOM, QUICK_RANDOM = 1000, 30  # Random matrices of a full and of a quick run.
QUICK_EVERY = 12  # A quick run takes every twelfth of the typical matrices.
GOAL = 1.1  # Iterations over those of none, above which a preconditioner is worse than none.
ROUNDING = 2  # Iterations more than those of none that are not called worse.
WORST = 12  # Cases with the largest ratios that are listed.
RIGHT_HAND_SIDES = ("constant", "random")


def iterations(A: Any, M: Any, b: Any) -> int:
    """Return the iterations of CG, one more than `MAXITER` where it has not converged."""
    _, count, info = iterate(A, b, M=M, rtol=TOLERANCE, maxiter=MAXITER)
    return MAXITER + 1 if info else count


def measure(case: Case) -> Row:
    """Return the iterations of one case, or why there is no preconditioner."""
    A = case.operator()
    row: Row = {"family": case.family, "case": case.name, "unknowns": A.shape[0]}
    try:
        M = tmg.default_preconditioner(A)
    except (ArithmeticError, ValueError) as error:
        return row | {"taken": "", "worse": "", "note": f"{type(error).__name__}: {error}"}
    rhs = (np.ones(A.shape[0]), np.random.default_rng(1).standard_normal(A.shape[0]))
    none = [iterations(A, None, b) for b in rhs]
    ours = [iterations(A, M, b) for b in rhs]
    for name, of_none, of_ours in zip(RIGHT_HAND_SIDES, none, ours, strict=True):
        row |= {f"none, {name}": of_none, f"default, {name}": of_ours}
    pairs = list(zip(ours, none, strict=True))
    worse = any(own > max(GOAL * other, other + ROUNDING) for own, other in pairs)
    # One is added, as a matrix of one eigenvalue takes none at all.
    ratio = max((own + 1) / (other + 1) for own, other in pairs)
    return row | {"taken": repr(M), "worse": worse, "ratio": ratio, "note": ""}


def by_family(rows: Sequence[Row]) -> list[Row]:
    """Return what the families have in common, a row each, and all together."""
    groups = report.group(rows, "family") | {"all": list(rows)}
    return [summary(family, own) for family, own in groups.items()]


def summary(family: str, rows: Sequence[Row]) -> Row:
    """Return the counts of some rows."""
    done = [row for row in rows if not row["note"]]
    result: Row = {"family": family, "matrices": len(rows), "refused": len(rows) - len(done)}
    result["worse than none"] = sum(row["worse"] for row in done)
    for method in ("none", "default"):
        counts = [row[f"{method}, {name}"] for row in done for name in RIGHT_HAND_SIDES]
        result[f"{method}, median"] = f"{median(counts):g}" if counts else ""
        result[f"{method}, most"] = format_count(max(counts)) if counts else ""
        result[f"{method}, not converged"] = sum(count > MAXITER for count in counts)
    result["largest ratio"] = f"{max(row['ratio'] for row in done):.2f}" if done else ""
    return result


def format_count(count: int) -> str:
    """Return a number of iterations as it is printed."""
    return f"> {MAXITER}" if count > MAXITER else str(count)


def list_worst(rows: Sequence[Row]) -> list[Row]:
    """Return those with the largest ratios, and all that are worse or refused."""
    listed = sorted((row for row in rows if not row["note"]), key=lambda row: -row["ratio"])
    chosen = [row for k, row in enumerate(listed) if row["worse"] or k < WORST]
    return [
        {key: row[key] for key in ("family", "case", "unknowns", "taken")}
        | {
            name: f"{format_count(row[f'default, {name}'])} / {format_count(row[f'none, {name}'])}"
            for name in RIGHT_HAND_SIDES
        }
        | {"ratio": f"{row['ratio']:.2f}", "worse": "worse" if row["worse"] else ""}
        for row in chosen
    ]


def list_refusals(rows: Sequence[Row]) -> list[Row]:
    """Return what is refused, and why."""
    return [
        {key: row[key] for key in ("family", "case", "unknowns", "note")}
        for row in rows
        if row["note"]
    ]


def tables(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return what is printed, by heading."""
    return {
        f"Iterations to {TOLERANCE:.0e}": by_family(rows),
        "The largest ratios, iterations default / none": list_worst(rows),
        "Refused": list_refusals(rows),
    }


def main(quick_random: int = QUICK_RANDOM, quick_every: int = QUICK_EVERY) -> None:
    """Run the comparison."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = "1"  # It is read where a process imports BLAS.
    families = tuple(dict.fromkeys(case.family for case in (*typical(), *random_ones(RANDOM))))
    arguments = report.options("preconditioners.default_choice", f"{TITLE}.", families=families)
    cases = [*typical(), *random_ones(RANDOM)]
    if arguments.quick:
        cases = [*list(typical())[::quick_every], *random_ones(quick_random)]
    cases = [case for case in cases if case.family in (arguments.families or families)]
    if arguments.quick:
        rows = [measure(case) for case in tqdm(cases, unit="matrix")]
    else:
        # Two at a time; of a fresh interpreter each, that has read the environment above.
        with get_context("spawn").Pool(2) as pool:
            rows = list(tqdm(pool.imap(measure, cases, chunksize=4), total=len(cases)))
    report.write_csv(arguments.output / "default_choice.csv", rows)
    module = "comparisons.preconditioners.default_choice"
    report.write_markdown(arguments.output / "default_choice.md", TITLE, module, tables(rows))
    for heading, table in tables(rows).items():
        report.show(heading, table)


if __name__ == "__main__":
    main()
