"""Contenders that take turns: each in a process of its own, run by run, timed."""

import math
import os
import resource
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from statistics import median
from time import perf_counter, process_time
from typing import Any

import numpy as np
import scipy.fft

from comparisons.measuring import RUSAGE_BYTES
from comparisons.speed_contenders import SYSTEMS, Contender
from toeplitz_mg._typing import Array

TURN_SECONDS = 1.0  # of one contender's runs of one size
MOST_TURNS = 200


@dataclass(frozen=True)
class Times:
    """Of one contender at one size."""

    cpu: float
    wall: float
    peak_vectors: float  # of n float64, above the process before the set-up
    note: str = ""


def _serve(contender: Contender, c: Array, b: Array, threads: int, pipe: Connection) -> None:
    """Set a contender up, then run it whenever asked, and send the times."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with suppress(OSError), scipy.fft.set_workers(threads):
        _answer(contender, c, b, before, pipe)


def _answer(contender: Contender, c: Array, b: Array, before: int, pipe: Connection) -> None:
    try:
        action = contender(c, b)
        action()
        while pipe.recv():
            wall, cpu = perf_counter(), process_time()
            action()
            cpu, wall = process_time() - cpu, perf_counter() - wall
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
            pipe.send((cpu, wall, peak * RUSAGE_BYTES / (8 * c.size)))
    except Exception as error:
        pipe.send(f"{type(error).__name__}: {error}".partition("\n")[0])


def take_turns(
    contenders: dict[str, Contender], name: str, n: int, threads: int = 1
) -> dict[str, Times]:
    """Time contenders at one size, in processes of their own, run by run in turns."""
    # BLAS reads the number of its threads where it is imported: once, or in each process.
    os.environ["OMP_NUM_THREADS"] = str(threads)
    context: Any = get_context("forkserver" if threads == 1 else "spawn")
    pipes: dict[str, Connection] = {}
    processes: list[Any] = []
    results: dict[str, Times] = {}
    # Sent, not built there: the temporary arrays of building them would be the peak.
    c = SYSTEMS[name](n)
    b = np.random.default_rng(0).standard_normal(c.size)
    runs: dict[str, list[tuple[float, float, float]]] = {key: [] for key in contenders}
    for key, contender in contenders.items():
        ours, theirs = context.Pipe()
        process = context.Process(
            target=_serve, args=(contender, c, b, threads, theirs), daemon=True
        )
        process.start()
        theirs.close()
        processes.append(process)
        pipes[key] = ours
        _run(pipes, key, runs, results)  # it waits for the set-up: one at a time
    for turn in range(MOST_TURNS):
        for key in list(pipes):
            done = runs[key]
            # Seven at least, if they are not slow.
            seconds = sum(wall for _, wall, _ in done)
            if turn and (seconds > 10 * TURN_SECONDS or (turn > 6 and seconds > TURN_SECONDS)):
                continue
            _run(pipes, key, runs, results)
    for process in processes:
        process.kill()
        process.join()
    for key, done in runs.items():
        if done:
            cpu, wall, peak = zip(*done, strict=True)
            results[key] = Times(median(cpu), median(wall), max(peak))
    return results


def _run(
    pipes: dict[str, Connection],
    key: str,
    runs: dict[str, list[tuple[float, float, float]]],
    results: dict[str, Times],
) -> None:
    try:
        pipes[key].send(True)
        answer = pipes[key].recv()
    except (EOFError, OSError):
        answer = "the process died"
    if isinstance(answer, str):
        results[key] = Times(math.nan, math.nan, math.nan, answer)
        del pipes[key]
    else:
        runs[key].append(answer)
