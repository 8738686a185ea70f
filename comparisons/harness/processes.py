"""Jobs in processes of their own: an answer within a time, or one after the other."""

import os
import resource
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from multiprocessing import get_context, set_forkserver_preload
from multiprocessing.connection import Connection
from typing import Any, Generic, TypeVar

T = TypeVar("T")

MEMORY_LIMIT = 8 << 30  # Bytes of address space, beyond which a method meets a MemoryError.
RUSAGE_BYTES = 1 if sys.platform == "darwin" else 1024  # The unit of ru_maxrss, in bytes.
DIED = "the process died, as it does where memory ends"


def prepare(*modules: str, threads: int = 1) -> None:
    """Give later processes so many threads, and let them start with these modules imported."""
    # BLAS reads it where a process imports it, and so do the packages that are compared.
    os.environ["OMP_NUM_THREADS"] = str(threads)
    # Each of them runs the module of the command again, which it may have imported already.
    os.environ["PYTHONWARNINGS"] = "ignore::RuntimeWarning:runpy"
    set_forkserver_preload(list(modules))


class FreshProcess(Generic[T]):
    """A process of its own, that computes the next item of an iterator whenever it is asked.

    `items` makes the iterator, in the process.
    """

    def __init__(self, items: Callable[[], Iterator[T]]) -> None:
        context: Any = get_context("forkserver")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(items, theirs), daemon=True)
        # Who interrupts waits until it has all that it starts from.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        self._process.start()
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        theirs.close()

    def next(self, seconds: float | None = None) -> T:
        """Return the next item, or raise a TimeoutError where it takes longer than that.

        An error that computing it raises, or the end of the process, is an ArithmeticError.
        """
        try:
            self._pipe.send(None)
            answer = self._pipe.recv() if self._pipe.poll(seconds) else None
        except (EOFError, OSError):
            raise ArithmeticError(DIED) from None
        if answer is None:
            raise TimeoutError
        item, error = answer
        if error is not None:
            raise ArithmeticError(error)
        result: T = item
        return result

    def end(self) -> None:
        """Kill the process."""
        self._process.kill()
        self._process.join()
        self._pipe.close()


def _serve(items: Callable[[], Iterator[Any]], pipe: Connection) -> None:
    """Send an item, or the error that it met, whenever one is asked for."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Who asks is interrupted, and ends this process.
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, resource.RLIM_INFINITY))
    warnings.simplefilter("ignore")  # What matters of warnings is seen in the residual.
    iterator = items()
    answer: tuple[Any, str | None]
    with suppress(EOFError, OSError):  # The process that asks has ended.
        while True:
            pipe.recv()
            try:
                answer = (next(iterator), None)
            except Exception as error:
                reason = str(error).partition("\n")[0]
                answer = (None, f"{type(error).__name__}: {reason}")
            pipe.send(answer)


def in_a_fresh_process(job: Callable[[], T], seconds: float | None = None) -> T:
    """Return what a function returns in a process of its own, which is killed after that time.

    It raises what `FreshProcess.next` does.
    """
    process = FreshProcess(partial(_once, job))
    try:
        return process.next(seconds)
    finally:
        process.end()


def row_or_note(job: Callable[[], dict[str, Any]], seconds: float) -> dict[str, Any]:
    """Return the row that a function makes in a process of its own, or a note why there is none."""
    try:
        return in_a_fresh_process(job, seconds)
    except TimeoutError:
        return {"note": f"over {seconds:.0f} s"}
    except ArithmeticError as error:
        return {"note": str(error)[:80]}


def _once(job: Callable[[], T]) -> Iterator[T]:
    yield job()


def peak_bytes() -> int:
    """Return the largest resident memory that this process had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * RUSAGE_BYTES
