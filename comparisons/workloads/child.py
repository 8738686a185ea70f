"""A server of fresh processes: it loads a package and the jobs once, and forks for every run.

`comparisons.workloads` loads this file by its path, for the package is that of the tree that is
measured. For each line that it reads, the number of a job, `serve` writes a line, a pickled `dict`
in hexadecimal: the seconds and the answer, or the error.
"""

import os
import pickle
import runpy
import sys
import warnings
from collections.abc import Callable
from math import ceil, inf
from time import process_time
from typing import Any

LEAST = 0.02  # CPU seconds of the calls that are timed at once, so that the clock resolves them.
BLOCKS = 5  # Times that this is repeated; the fastest counts.
ENOUGH = 0.2  # CPU seconds after which it is not repeated again.


def time_calls(runs: dict[str, Callable[[], Any]], is_first: bool) -> dict[str, Any]:
    """Return the CPU seconds of a call of each, and the answer of the first of them.

    Several take turns. A first call is timed alone; of all others one call comes before.
    """
    answers, calls, best = {}, {}, {}
    for key, run in runs.items():
        answers[key], best[key] = time_block(run, 1)
        if not is_first:
            seconds, calls[key], best[key] = time_block(run, 1)[1], 1, inf
            calls[key] = ceil(LEAST / max(seconds, 1e-6))
    spent = inf if is_first else 0.0
    for _ in range(BLOCKS):
        if spent > ENOUGH * len(runs):
            break
        for key, run in runs.items():
            seconds = time_block(run, calls[key])[1]
            best[key], spent = min(best[key], seconds / calls[key]), spent + seconds
    return {"seconds": best, "answer": answers["own"]}


def time_block(run: Callable[[], Any], calls: int) -> tuple[Any, float]:
    """Return the answer of the last of so many calls, and the CPU seconds of all."""
    start = process_time()
    for _ in range(calls):
        answer = run()
    return answer, process_time() - start


def measure(job: Any) -> dict[str, Any]:
    """Prepare a job and time it, with its peer where it has one."""
    try:
        runs = {"own": job.prepare()}
        if job.peer is not None:
            runs["peer"] = job.peer()
        return time_calls(runs, job.is_first)
    except Exception as error:
        return {"error": f"{type(error).__name__}: {error}".partition("\n")[0]}


def serve(tree: str, path: str, threads: str) -> None:
    """Measure the jobs that are asked for, each in a process of its own."""
    sys.path[0] = tree
    warnings.simplefilter("ignore")
    pipe = os.dup(1)
    os.dup2(2, 1)  # What a job prints is no answer.
    import scipy.fft

    import toeplitz_mg

    jobs = runpy.run_path(path)["JOBS"]
    source = os.path.dirname(os.path.dirname(os.path.abspath(toeplitz_mg.__file__)))
    if not os.path.samefile(source, tree):
        raise SystemExit(f"the package is that of {source}, but must be that of {tree}")
    for line in sys.stdin:
        if os.fork() == 0:
            with scipy.fft.set_workers(int(threads)):
                send(pipe, measure(jobs[int(line)]))
            os._exit(0)
        status = os.wait()[1]
        if status:
            send(pipe, {"error": f"the process ended with status {status}"})


def send(pipe: int, answer: dict[str, Any]) -> None:
    """Write an answer as a line."""
    with open(pipe, "wb", closefd=False) as file:
        file.write(pickle.dumps(answer).hex().encode() + b"\n")
