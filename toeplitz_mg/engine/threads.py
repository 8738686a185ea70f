"""Loops whose parts run on as many threads as `scipy.fft.set_workers` specifies.

Results have the same bits for any number of threads: the size of a part does not depend on that
number, and neither does the result of a part on its thread.
"""

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, nullcontext, suppress
from contextvars import copy_context
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy import fft

from toeplitz_mg._typing import Array

# The backends of `scipy.fft` are a private module of SciPy; only this file uses it.
uarray: Any = getattr(getattr(fft, "_backend", None), "ua", None)

DOMAIN = "numpy.scipy.fft"  # Name of the functions of `scipy.fft` in uarray.

Work = Callable[[range], None]  # Processes the parts with these indices.

# Fewest numbers in a loop for which two threads are faster than one. Each further thread needs as
# many again, otherwise threads wait for the interpreter's lock: on 16 cores, products with 1024²
# unknowns are 3.3 times faster with 8 threads, but only 1.7 times with 16.
WORTH_THREADS = 2**19
TRANSFORM = 4  # Weight of a transformed number: threads are worth it for 370² elements, not 256².
TOGETHER = 16  # Most lines that SciPy transforms together in single precision (SIMD).
PIECE = 2**16  # Numbers in a piece of work: intermediate results stay in the cache.
# Pieces for each thread. With several, a fast thread takes over pieces of one that shares its core.
PIECES = 4


def share(work: Work, count: int, points: int) -> None:
    """Process all parts, on as many threads as ``scipy.fft.set_workers`` specifies.

    Within the work, transforms and nested loops use one thread, unless there is only one part. All
    threads use the backend of `scipy.fft` that is set in this thread. If a part raises an error or
    this thread is interrupted, the other threads stop before the error is passed on, because they
    write to arrays of the caller.

    Parameters
    ----------
    work : callable
        Called with a range of part indices.
    count : int
        The number of parts.
    points : int
        The numbers in all parts together, which decide whether threads are worth it.
    """
    threads = fft.get_workers()
    is_large = points >= WORTH_THREADS
    if threads == 1 or (count <= 1 and is_large):
        work(range(count))
        return
    backends = chosen_backends() if is_large else None
    workers = min(threads, count, 1 + points // WORTH_THREADS) if backends else 1
    pieces = min(count, PIECES * workers) if workers > 1 else 1
    bounds = [count * k // pieces for k in range(pieces + 1)]
    rest = list(map(range, bounds[:-1], bounds[1:]))[::-1]

    def do() -> None:
        # Each thread takes the next piece that is left.
        while rest:
            try:
                part = rest.pop()
            except IndexError:  # Another thread has taken the last piece.
                return
            work(part)

    others: list[Future[None]] = []
    task = [do]
    try:
        for _ in range(workers - 1):
            other: Future[None] = Future()
            others.append(other)
            # The context contains NumPy's error state (`numpy.errstate`).
            help_out: Any = partial(copy_context().run, do_task, task, backends, other)
            # No thread can be started if Python is shutting down or the system has none left. The
            # task may be queued nevertheless, so that another thread runs it: keep its future.
            with suppress(RuntimeError):
                _threads(threads - 1, os.getpid()).submit(help_out)
        with fft.set_workers(1):
            do()
    finally:
        rest.clear()
        # Threads that have not started yet have nothing left to do.
        others = [other for other in others if not other.cancel()]
        wait_for_all(others)
        task.clear()
    for other in others:
        other.result()


def chosen_backends() -> Callable[[], AbstractContextManager[None]] | None:
    """Return a factory of contexts that give any thread this thread's backends of `scipy.fft`.

    ``scipy.fft.set_backend`` applies to the thread that calls it. The result is None if this
    version of SciPy has other private names; work must then stay on the calling thread.
    """
    try:
        return partial(uarray.set_state, uarray.get_state())
    except AttributeError:
        return None


def is_backend_set() -> bool:
    """Whether a backend of `scipy.fft` is set, for this thread or globally; True if unknown."""
    try:
        of_all, of_thread, _ = uarray.get_state()._pickle()
        default = of_all[DOMAIN][0][0]
    except (AttributeError, KeyError):
        return True
    is_set = bool(of_thread) and any(of_thread.get(DOMAIN, ()))
    return is_set or not default.__module__.startswith("scipy.")


def keep_bits(dtype: DTypeLike, lines: int = 1) -> AbstractContextManager[None]:
    """Return a context in which SciPy's transforms do not depend on the number of threads.

    In single precision, lines that are transformed together, up to `TOGETHER`, round differently
    from the remaining lines of a thread. The context sets one thread if any would remain.
    """
    if np.dtype(dtype).char in "dD" or (workers := fft.get_workers()) == 1:
        return nullcontext()
    if lines % (TOGETHER * workers) == 0:
        return nullcontext()
    return fft.set_workers(1)


def share_slices(work: Callable[[slice], None], length: int, size: int, points: int) -> None:
    """Process slices of a given size (the last may be shorter) as the parts of `share`."""

    def do(blocks: range) -> None:
        for block in blocks:
            work(slice(block * size, min(length, (block + 1) * size)))

    if 0 < length <= size and fft.get_workers() == 1:
        work(slice(0, length))  # Avoid the overhead of calls, which matters in small systems.
        return
    share(do, -(-length // size), points)


def share_rows(work: Callable[[slice], None], field: Array) -> None:
    """Process a field in slices of its first axis, of `PIECE` numbers each; a small one at once."""
    if field.size < WORTH_THREADS:
        work(slice(0, len(field)))
    else:
        share_slices(work, len(field), max(1, PIECE * len(field) // field.size), field.size)


def elementwise(function: Callable[..., Array], *fields: Array, out: Array | None = None) -> Array:
    """Return an elementwise function of fields, in `out` or in a new array.

    The fields have the same shape. Threads call the function with slices of the first axis of the
    fields; a single thread calls it once, because each call has overhead.
    """
    if out is None and (fields[0].size < WORTH_THREADS or fft.get_workers() == 1):
        return function(*fields)
    if out is None:
        out = np.empty(fields[0].shape, function(*(x[:0] for x in fields)).dtype)
    to = out

    def work(part: slice) -> None:
        to[part] = function(*(x[part] for x in fields))

    share_rows(work, out)
    return out


def do_task(task: list[Callable[[], None]], backends: Any, done: Future[None]) -> None:
    """Run a task with the backends of the thread that waits for it, unless it was cancelled.

    A thread holds references to its arguments a moment after its caller has gone on. The task is in
    a list that the caller clears, so that no workspace stays in use.
    """
    if not done.set_running_or_notify_cancel():
        return
    try:
        with backends():
            task[0]()
    except BaseException as error:
        done.set_exception(error)
    else:
        done.set_result(None)


def wait_for_all(others: list[Future[None]]) -> None:
    """Wait for all futures, and only then raise an interrupt."""
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
    """Return a pool of threads, which keep their workspaces; a forked process has its own pool."""
    return ThreadPoolExecutor(number, thread_name_prefix=f"toeplitz_mg {process}")
