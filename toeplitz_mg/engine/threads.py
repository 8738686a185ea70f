"""A loop that `scipy.fft.set_workers` shares among threads.

What the threads do must not depend on how many there are: the parts of a sum are cut by their size,
and a part that a thread does is what any other would make of it. So results have the same bits.
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

# What hands on the backends of `scipy.fft` is no public name of SciPy's: no other file knows of it.
uarray: Any = getattr(getattr(fft, "_backend", None), "ua", None)

DOMAIN = "numpy.scipy.fft"  # Its name of the functions of `scipy.fft`.

Work = Callable[[range], None]  # Does the parts that have these numbers.

# Numbers of a loop from which on two threads make it faster, not slower. Each thread more needs as
# many more, or it waits for the interpreter's lock: on 16 cores the products of 1024² unknowns gain
# 3.3 with 8 threads, and with 16 only 1.7.
WORTH_THREADS = 2**19
TRANSFORM = 4  # What a number counts that is transformed: threads gain on 370² elements, not 256².
TOGETHER = 16  # Lines that transforms in single precision take together at most.
PIECE = 2**16  # Numbers that a thread does at once: what comes in between stays in the cache.
# Pieces for each thread: one that has the core to itself takes those of another that has not.
PIECES = 4


def share(work: Work, count: int, points: int) -> None:
    """Do all parts, by as many threads as ``scipy.fft.set_workers`` says.

    Within the work each thread is one: neither transforms nor a loop within are shared again. Where
    there is one part only, what it does may be. All transform by the backend of `scipy.fft` that is
    set in this thread. Where a part raises, or this thread is interrupted, the others are ended
    first: they write to arrays of the caller.

    Parameters
    ----------
    work : callable
        It is called with a range of some parts.
    count : int
        The number of parts.
    points : int
        The numbers of all parts, which say whether threads are worth it.
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
        # Each thread takes the next piece that nobody has.
        while rest:
            try:
                part = rest.pop()
            except IndexError:  # Another thread was quicker.
                return
            work(part)

    others: list[Future[None]] = []
    task = [do]
    try:
        for _ in range(workers - 1):
            other: Future[None] = Future()
            others.append(other)
            # The context has what NumPy does about overflow.
            help_out: Any = partial(copy_context().run, do_task, task, backends, other)
            # Where Python ends, or the system has no more, no thread can be started. The task may
            # be queued all the same, and another thread take it: so its future is our own.
            with suppress(RuntimeError):
                _threads(threads - 1, os.getpid()).submit(help_out)
        with fft.set_workers(1):
            do()
    finally:
        rest.clear()
        # A thread that has not woken up yet has nothing left to do.
        others = [other for other in others if not other.cancel()]
        wait_for_all(others)
        task.clear()
    for other in others:
        other.result()


def chosen_backends() -> Callable[[], AbstractContextManager[None]] | None:
    """Return what makes a context in which any thread has the backends of `scipy.fft` of this one.

    ``scipy.fft.set_backend`` sets one in the thread that calls it. It is None where this SciPy
    hands them on by other names: then no thread may do what another was asked for.
    """
    try:
        return partial(uarray.set_state, uarray.get_state())
    except AttributeError:
        return None


def is_backend_set() -> bool:
    """Whether a backend of `scipy.fft` is chosen, in this thread or for all, or may be."""
    try:
        of_all, of_thread, _ = uarray.get_state()._pickle()
        default = of_all[DOMAIN][0][0]
    except (AttributeError, KeyError):
        return True
    is_set = bool(of_thread) and any(of_thread.get(DOMAIN, ()))
    return is_set or not default.__module__.startswith("scipy.")


def keep_bits(dtype: DTypeLike, lines: int = 1) -> AbstractContextManager[None]:
    """Return what SciPy's transforms of so many lines are made in, so that they have the same bits.

    In single precision lines that are transformed together, up to `TOGETHER`, have other bits than
    those that are left over, and each of SciPy's threads has some that are: there is one then.
    """
    if np.dtype(dtype).char in "dD" or (workers := fft.get_workers()) == 1:
        return nullcontext()
    if lines % (TOGETHER * workers) == 0:
        return nullcontext()
    return fft.set_workers(1)


def share_slices(work: Callable[[slice], None], length: int, size: int, points: int) -> None:
    """Do the slices of a size, of which the last may be shorter, as `share` does parts."""

    def do(blocks: range) -> None:
        for block in blocks:
            work(slice(block * size, min(length, (block + 1) * size)))

    if 0 < length <= size and fft.get_workers() == 1:
        work(slice(0, length))  # In a small system each call more is a part of the time.
        return
    share(do, -(-length // size), points)


def share_rows(work: Callable[[slice], None], field: Array) -> None:
    """Do slices of the first axis of a field, of a `PIECE` each; of a small field all at once."""
    if field.size < WORTH_THREADS:
        work(slice(0, len(field)))
    else:
        share_slices(work, len(field), max(1, PIECE * len(field) // field.size), field.size)


def elementwise(function: Callable[..., Array], *fields: Array, out: Array | None = None) -> Array:
    """Return what a function of each element makes of fields, in `out` or in a new array.

    Threads share the pieces that it is called with, for which the fields are cut along the first
    axis. So all fields have the same shape. One thread calls it once, as each call costs.
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
    """Do a task by the backends of who waits for it, and let go of it; nothing if nobody waits.

    A thread keeps its arguments a moment longer than its caller waits. It must not keep a
    workspace, which the next product would have to do without.
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
