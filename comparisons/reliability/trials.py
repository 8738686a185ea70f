"""What a trial of the campaign is, and how many of them run side by side."""

import faulthandler
import os
import signal
import traceback
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context
from types import FrameType
from typing import Any, NamedTuple

import numpy as np

from toeplitz_mg.contact import ContactError, ContactWarning

# An answer that is less than was asked for, of which the user is told; an error that is due; what
# is silently wrong, an error of another kind, or a problem refused that has a good answer.
RIGHT, TOLD, REFUSED, FAILED = "right", "told", "refused", "failed"
CHUNK = 10  # Trials that a process takes at a time: enough to make sending them cheap.
SECONDS = 120  # Time of one trial, s, above which it counts as failed: all are small problems.


class Outcome(NamedTuple):
    """What became of a trial."""

    family: str  # The kind of problem.
    verdict: str  # One of those above.
    note: str = ""  # What went wrong.


class Result(NamedTuple):
    """An outcome, and the seed that gives it again."""

    seed: int
    outcome: Outcome


Trial = Callable[[np.random.Generator], Outcome]


def judge(family: str, where: Any, solve: Callable[[], str]) -> Outcome:
    """Return what becomes of a contact problem that says what is wrong with its answer."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        warnings.simplefilter("ignore", ContactWarning)  # Of random units and grids, as they are.
        try:
            wrong = solve()
        except ContactError as error:
            wrong = str(error)
    return Outcome(family, FAILED if wrong else TOLD if told else RIGHT, f"{where}: {wrong}")


def run(trial: Trial, seeds: range, processes: int) -> Iterator[Result]:
    """Yield the results of a trial for all seeds, from several processes with one thread each."""
    chunks = [seeds[k : k + CHUNK] for k in range(0, len(seeds), CHUNK)]
    context = get_context("forkserver")
    with ProcessPoolExecutor(processes, context, initializer=_start) as pool:
        futures = [pool.submit(_run_chunk, trial, chunk) for chunk in chunks]
        try:
            for future in as_completed(futures):
                yield from future.result()
        finally:  # It may be interrupted: what has not begun never does.
            pool.shutdown(cancel_futures=True)


def _start() -> None:
    faulthandler.enable()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Who collects the results is interrupted.
    os.environ["OMP_NUM_THREADS"] = "1"


def _run_chunk(trial: Trial, seeds: range) -> list[Result]:
    return [Result(seed, run_one(trial, seed)) for seed in seeds]


def run_one(trial: Trial, seed: int) -> Outcome:
    """Run one trial; an error that it does not expect is a failure."""
    signal.signal(signal.SIGALRM, partial(_too_long, seed))
    signal.alarm(SECONDS)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # A trial that looks for warnings records them itself.
            return trial(np.random.default_rng(seed))
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{os.path.basename(where.filename)}:{where.lineno}"
        return Outcome("unexpected error", FAILED, f"{type(error).__name__} at {place}: {error}")
    finally:
        signal.alarm(0)


def _too_long(seed: int, signum: int, frame: FrameType | None) -> None:
    raise TimeoutError(f"seed {seed} took over {SECONDS} s")
