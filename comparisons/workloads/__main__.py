"""Jobs as users have them: their CPU time in this tree beside that in another revision.

``python -m comparisons.workloads --against REV`` checks the revision out in a worktree of its own
and runs every job of `jobs` in both trees: the same file, by public names alone; without it times
are of this tree alone. ``--jobs`` runs those that have one of some texts in their name or family.

Every run of a job is a new process, forked from one that has imported the package and done nothing
else. The trees take turns, as often as ``--runs`` says, each turn forked from another process, and
the least CPU time of each tree counts. It is that of the call alone, on one thread unless
``--threads`` says otherwise. Short calls are repeated until the clock resolves them, and one call
comes before those that are timed, unless the job is to time the first one.

A job may take 1.3 of the time of the other tree, or its own limit. A solve of up to 256 unknowns is
judged beside SciPy's function instead, of whose time it may take 1.1; or 1.1 of that of the other
tree, where this takes longer than SciPy's. A job that takes more is measured again, and fails where
two of three ratios are too large; their median is printed. The geometric mean of the ratios to the
other tree, without those small solves, may be 1.1, and answers must agree to the tolerance of the
job. Where anything fails, the exit status is 1.
"""

import argparse
import runpy
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.harness import report
from comparisons.workloads.judging import MEASUREMENTS, Measurement, Result, differ, summarise
from comparisons.workloads.trees import Tree, worktree

ROOT = Path(__file__).resolve().parents[2]
JOBS = Path(__file__).with_name("jobs.py")


def run(
    jobs: Sequence[Any], chosen: Sequence[int], trees: dict[str, Tree], runs: int
) -> Iterator[Result]:
    """Yield what is found of each job, once it is settled."""
    for job in chosen:
        result = Result(jobs[job], [])
        for k in range(MEASUREMENTS):
            result.measurements.append(measure(job, trees, range(k * runs, (k + 1) * runs)))
            if result.is_settled:
                break
        yield result


def measure(job: int, trees: dict[str, Tree], turns: Sequence[int]) -> Measurement:
    """Run a job in all trees, which take turns; each of them is the first in every other turn."""
    found, answers = Measurement(), []
    for turn in turns:
        for name in list(trees)[:: -1 if turn % 2 else 1]:
            one = trees[name].run(job, turn)
            if "error" in one:
                found.errors[name] = one["error"]
                continue
            answers.append(np.asarray(one["answer"]))
            setattr(found, name, min(getattr(found, name), one["seconds"]["own"]))
            if name == "here":
                found.peer = min(found.peer, one["seconds"].get("peer", found.peer))
        if "here" in found.errors:
            break
    found.difference = max((differ(answers[0], other) for other in answers[1:]), default=0.0)
    return found


def main(arguments: Sequence[str] | None = None, *, root: Path = ROOT, path: Path = JOBS) -> int:
    """Run the jobs of a file in a tree, and return the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m comparisons.workloads",
        description="Time jobs as users have them, beside another revision.",
    )
    parser.add_argument("--against", metavar="REV", help="the other revision")
    parser.add_argument("--jobs", nargs="+", default=[""], metavar="TEXT", help="in their names")
    parser.add_argument("--quick", action="store_true", help="one turn, within a minute")
    parser.add_argument("--runs", type=int, default=5, metavar="NUMBER", help="turns (default: 5)")
    parser.add_argument("--threads", type=int, default=1, metavar="NUMBER", help="(default: 1)")
    options = parser.parse_args(arguments)
    runs = 1 if options.quick else options.runs
    jobs = runpy.run_path(str(path))["JOBS"]
    names = [f"{job.family}: {job.name}" for job in jobs]
    chosen = [k for k, name in enumerate(names) if any(text in name for text in options.jobs)]
    if not chosen:
        parser.error(f"no job has {' or '.join(options.jobs)} in its name or family")
    results: list[Result] = []
    with ExitStack() as stack:
        folders = {"here": root}
        if options.against:
            folders["there"] = stack.enter_context(worktree(root, options.against))
        trees = {
            name: stack.enter_context(Tree(folder, path, options.threads, runs))
            for name, folder in folders.items()
        }
        table = report.Table("CPU time of a call", room={"job": 50, "here": 7, "there": 7})
        try:
            for result in run(jobs, chosen, trees, runs):
                results.append(result)
                table.add(result.row)
        except KeyboardInterrupt:
            print("interrupted")
    return 0 if summarise(results) and len(results) == len(chosen) else 1


if __name__ == "__main__":
    sys.exit(main())
