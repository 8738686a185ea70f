"""A loop that `scipy.fft.set_workers` shares among threads."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

from scipy import fft

WORTH_THREADS = 2**17  # numbers of a transform that threads make faster


def share(work: Callable[[range], None], count: int, points: int) -> None:
    """Do all parts, by as many threads as ``scipy.fft.set_workers`` says."""
    workers = min(fft.get_workers(), count)
    if workers == 1 or points < WORTH_THREADS:
        work(range(count))
        return
    bounds = [count * k // workers for k in range(workers + 1)]
    parts = list(map(range, bounds[:-1], bounds[1:]))
    others = [_threads(workers - 1, os.getpid()).submit(work, part) for part in parts[1:]]
    work(parts[0])
    for other in others:
        other.result()


@lru_cache(maxsize=4)
def _threads(number: int, process: int) -> ThreadPoolExecutor:
    """Return threads that keep their workspaces; those of a parent process are not ours."""
    return ThreadPoolExecutor(number, thread_name_prefix=f"toeplitz_mg {process}")
