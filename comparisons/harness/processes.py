"""Jobs in processes of their own: one answer within a time, or several jobs that take turns."""

import os
import resource
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
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

    Parameters
    ----------
    items : callable
        Makes the iterator, in the process.
    method : str
        How the process starts, as in `multiprocessing`: "spawn" reads the environment anew.
    """

    def __init__(self, items: Callable[[], Iterator[T]], method: str = "forkserver") -> None:
        context: Any = get_context(method)
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(items, theirs), daemon=True)
        self._process.start()
        theirs.close()

    def next(self, seconds: float | None = None) -> T:
        """Return the next item.

        Raises
        ------
        TimeoutError
            Where it takes longer than that.
        ArithmeticError
            Where computing it raises an error, which is the message, or the process dies.
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
    """Return what a function returns in a process of its own.

    Raises
    ------
    TimeoutError
        Where it takes longer than that, if there is a limit; it is killed.
    ArithmeticError
        Where it raises an error, which is the message, or the process dies.
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


def take_turns(
    jobs: Mapping[str, Callable[[], Iterator[T]]],
    done: Callable[[list[T]], bool],
    method: str = "forkserver",
) -> dict[str, list[T] | str]:
    """Let jobs take turns, so that what disturbs the machine disturbs all of them alike.

    Parameters
    ----------
    jobs : mapping of str to callable
        Each makes an iterator in a process of its own; all set-ups come first, one at a time.
    done : callable
        Tells whether a job has returned enough, from its items so far.
    method : str
        How the processes are started, as `FreshProcess` takes it.

    Returns
    -------
    dict
        The items of each job by its name; or the reason why it met an error.
    """
    processes: dict[str, FreshProcess[T]] = {}
    results: dict[str, list[T]] = {}
    errors: dict[str, str] = {}
    left = list(jobs)
    try:
        while left:
            for name in left:
                if name not in processes:
                    processes[name] = FreshProcess(jobs[name], method)
                try:
                    results.setdefault(name, []).append(processes[name].next())
                except ArithmeticError as error:
                    errors[name] = str(error)
            left = [name for name in left if name not in errors and not done(results[name])]
    finally:
        for process in processes.values():
            process.end()
    return {name: errors.get(name, results[name]) for name in jobs}


def peak_bytes() -> int:
    """Return the largest resident memory that this process had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * RUSAGE_BYTES
