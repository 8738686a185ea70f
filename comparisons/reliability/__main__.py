"""Random problems by the thousand: no answer is silently wrong, no easy problem refused.

Systems, approximate inverses and contact problems, each from a seed of its own and checked against
a dense definition, or against the conditions that the answer is to obey. What is tried and what
fails is printed and written as a table; a failure is given with its seed, and ``--parts PART
--first SEED --trials 1`` repeats it. The command ends with status 1 where anything has failed.
"""

import os
import sys
from collections import Counter
from collections.abc import Mapping, Sequence

from comparisons.harness import report
from comparisons.reliability.approximate_inverses import preconditioner
from comparisons.reliability.bodies import contact_problem, repeated_problem
from comparisons.reliability.kinds import every_kind
from comparisons.reliability.rolling import rolling_problem
from comparisons.reliability.systems import drop_in, iteration, large
from comparisons.reliability.trials import FAILED, REFUSED, RIGHT, TOLD, Result, Trial, run
from comparisons.reliability.unlike import unlike_problem

# What is tried, and how often: quickly, and in full.
PARTS: dict[str, tuple[Trial, int, int]] = {
    "solve_toeplitz": (drop_in, 600, 12000),
    "kinds": (every_kind, 400, 20000),
    "large": (large, 20, 400),
    "iterations": (iteration, 300, 6000),
    "preconditioners": (preconditioner, 700, 16000),
    "contact": (contact_problem, 250, 5000),
    "repeated": (repeated_problem, 250, 5000),
    "rolling": (rolling_problem, 150, 3000),
    "unlike": (unlike_problem, 60, 1000),
}
ROOM = {"part": 15, "family": 34}  # Characters of the columns.


@report.interruptible
def main(
    argv: Sequence[str] | None = None, tried: Mapping[str, tuple[Trial, int, int]] = PARTS
) -> None:
    """Run the campaign."""
    arguments = report.options(
        "reliability",
        "Random problems by the thousand: what fails, and how often.",
        argv=argv,
        parts=tuple(tried),
        first=0,
        trials=0,
        processes=0,
    )
    os.environ["OMP_NUM_THREADS"] = "1"  # It is read where a process imports BLAS.
    folder = arguments.output
    table = report.Table("What was tried", folder / "reliability.csv", room=ROOM)
    failures: list[report.Row] = []
    for part in arguments.parts or tried:
        trial, quick, full = tried[part]
        count = arguments.trials or (quick if arguments.quick else full)
        seeds = range(arguments.first, arguments.first + count)
        processes = arguments.processes or os.cpu_count() or 1
        results: list[Result] = []
        try:
            for result in run(trial, seeds, processes):
                results.append(result)
                if result.outcome.verdict == FAILED:
                    outcome, row = result.outcome, {"part": part, "seed": result.seed}
                    failures.append(row | {"family": outcome.family, "note": outcome.note})
                    print(f"{part}, seed {result.seed}: {result.outcome.note}", flush=True)
        finally:  # Where it is interrupted, of what there is.
            table.extend(_summary(part, results))
            report.write_csv(folder / "failures.csv", failures)
    print(f"\n{sum(row['tried'] for row in table.rows)} tried, {len(failures)} failures")
    sys.exit(bool(failures))


def _summary(part: str, results: Sequence[Result]) -> list[report.Row]:
    """Return how often each verdict was given, by family."""
    families = sorted({r.outcome.family for r in results})
    rows = []
    for family in families:
        counts = Counter(r.outcome.verdict for r in results if r.outcome.family == family)
        verdicts = {verdict: counts[verdict] for verdict in (RIGHT, TOLD, REFUSED, FAILED)}
        rows.append({"part": part, "family": family, "tried": counts.total(), **verdicts})
    return rows


if __name__ == "__main__":
    main()
