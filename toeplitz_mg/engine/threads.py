"""A loop that `scipy.fft.set_workers` shares among threads."""

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import lru_cache

from scipy import fft

Work = Callable[[range], None]  # Does the parts that have these numbers.

WORTH_THREADS = 2**17  # Numbers of a transform from which on threads make it faster.


def share(work: Work, count: int, points: int) -> None:
    """Do all parts, by as many threads as ``scipy.fft.set_workers`` says.

    Where a part raises, or this thread is interrupted, the others are ended first: they write to
    arrays of the caller.
    """
    workers = min(fft.get_workers(), count)
    if workers == 1 or points < WORTH_THREADS:
        work(range(count))
        return
    bounds = [count * k // workers for k in range(workers + 1)]
    parts = list(map(range, bounds[:-1], bounds[1:]))
    threads = _threads(workers - 1, os.getpid())
    others: list[Future[None]] = []
    try:
        for part in parts[1:]:
            others.append(threads.submit(do_part, [work], part))
        work(parts[0])
    finally:
        wait_for_all(others)
    for other in others:
        other.result()


def do_part(work: list[Work], part: range) -> None:
    """Do a part of the work, and let go of the work.

    A thread keeps its arguments a moment longer than its caller waits. It must not keep a
    workspace, which the next product would have to do without.
    """
    work.pop()(part)


def wait_for_all(others: list[Future[None]]) -> None:
    """Wait for all, and only then pass on an interrupt."""
    interrupt: BaseException | None = None
    while not all(other.done() for other in others):
        try:
            wait(others)
        except BaseException as error:
            interrupt = error
    if interrupt is not None:
        raise interrupt


@lru_cache(maxsize=4)
def _threads(number: int, process: int) -> ThreadPoolExecutor:
    """Return threads that keep their workspaces; those of a parent process are not ours."""
    return ThreadPoolExecutor(number, thread_name_prefix=f"toeplitz_mg {process}")
