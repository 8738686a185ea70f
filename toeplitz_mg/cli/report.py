"""What is printed: by any terminal, and a line for each step of an iteration."""

import io
import json
import os
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout, suppress
from math import inf, isfinite
from pathlib import Path
from time import perf_counter
from typing import Any, Self

import numpy as np

from toeplitz_mg._typing import Progress

PRESSURE, TANGENTIAL = "pressure", "tangential traction"  # Names of the results of a contact.
Solve = Callable[[str, Callable[[Progress], Any]], Any]  # Calls a solver, and prints its progress.
PATIENCE = 2.0  # Seconds after which a terminal shows that something is being done.
EXIT_STATUS = (
    "Exit status: 0 converged, 1 not converged, 2 not possible, 130 interrupted, 141 nobody reads "
    "the report any more."
)


def print_any_character() -> None:
    """Print what the terminal does not have as its number, so that no result is lost at a "²"."""
    failing = ("strict", "surrogateescape")  # Any other was asked for, as by PYTHONIOENCODING.
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors in failing:
        sys.stdout.reconfigure(errors="backslashreplace")


def print_step(count: int, error: float) -> None:
    """Print how far an iteration is, and how far from its end."""
    print(f"{count:10d}   {format_error(error, 3)}", flush=True)


def format_error(error: float, digits: int) -> str:
    """Return an error with this many digits after the point; zero as a zero."""
    return f"{error:.{digits}e}" if error else "0"


def write_json(figures: Mapping[str, Any]) -> str:
    """Return figures as JSON, by name; what is no number there, as an infinity, is null."""

    def plain(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {name: plain(x) for name, x in value.items()}
        if isinstance(value, list | tuple):
            return [plain(x) for x in value]
        if isinstance(value, np.ndarray | np.generic):
            return plain(value.tolist())
        if isinstance(value, float) and not isfinite(value):
            return None
        return str(value) if isinstance(value, Path) else value

    return json.dumps(plain(figures), indent=2, ensure_ascii=False)


def drop_output() -> None:
    """Print no more: at exit Python would try once more, with a traceback."""
    with suppress(OSError):  # The stream may have no file.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class Reader:
    """The standard output, whose reader may leave, as `head` does: then nothing more is printed."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.is_there = True

    def write(self, text: str) -> int:
        """Print a text."""
        return self._call(self._stream.write, text) or 0

    def flush(self) -> None:
        """Print what is not printed yet."""
        self._call(self._stream.flush)

    def _call(self, method: Callable[..., Any], *arguments: str) -> Any:
        try:
            return method(*arguments)
        except BrokenPipeError:
            self.is_there = False
            drop_output()
            return None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def outlasting_its_reader(goes_on: bool) -> Iterator[Reader]:
    """Go on where nobody reads the report any more, if that is wanted, as for files to write."""
    reader = Reader(sys.stdout)
    if not goes_on or sys.stdout is None:
        yield reader
        return
    with redirect_stdout(reader):
        yield reader


class Waiting:
    """What a terminal shows on the standard error while something takes long, and then erases.

    Nothing is shown in the first two seconds, nor where the standard error is no terminal, nor
    once lines of the report come on a terminal, which show enough.
    """

    def __init__(self, what: str, patience: float = PATIENCE) -> None:
        self.what, self.patience = what, patience
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._show, daemon=True)

    def __enter__(self) -> Self:
        if sys.stderr and sys.stderr.isatty():  # It is None where a daemon has closed it.
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def before_line(self) -> None:
        """Make room for a line of the report."""
        if sys.stdout and sys.stdout.isatty():
            self.end()

    def end(self) -> None:
        """Show no more, and erase what is shown."""
        self._over.set()
        if self._thread.ident is not None:
            self._thread.join()

    def _show(self) -> None:
        start, text = perf_counter(), ""
        pause = self.patience
        while not self._over.wait(pause):
            text, pause = f"{self.what}: {perf_counter() - start:.0f} s", 1.0
            print(f"\r{text}", end="", file=sys.stderr, flush=True)
        if text:
            print(f"\r{' ' * len(text)}\r", end="", file=sys.stderr, flush=True)


def step_printer(waiting: Waiting) -> Callable[[int, float], None]:
    """Return what prints a step of a contact problem where it is told of another violation.

    It is told after each product, and with none on coarser grids, which are not printed.
    """
    last = inf

    def tell(products: int, violation: float) -> None:
        nonlocal last
        if products and violation != last:
            waiting.before_line()
            print_step(products, violation)
            last = violation

    return tell
