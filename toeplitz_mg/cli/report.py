"""Printing: the report on any terminal, and a line for each step of an iteration."""

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
Solve = Callable[[str, Callable[[Progress], Any]], Any]  # Calls a solver, prints its progress.
PATIENCE = 2.0  # Seconds after which a terminal shows that work is in progress.
EXIT_STATUS = (
    "Exit status: 0 converged; 1 not converged, nothing is written; 2 not possible, one line says "
    "why; 130 interrupted; 141 the reader of the output is gone."
)


def print_any_character() -> None:
    """Escape characters that the terminal's encoding lacks, so that a "²" raises no error."""
    failing = ("strict", "surrogateescape")  # Other handlers were chosen by PYTHONIOENCODING.
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors in failing:
        sys.stdout.reconfigure(errors="backslashreplace")


def print_step(count: int, error: float) -> None:
    """Print the number of a step and the remaining error."""
    print(f"{count:10d}   {format_error(error, 3)}", flush=True)


def format_error(error: float, digits: int) -> str:
    """Return an error with so many digits after the point; zero as a zero."""
    return f"{error:.{digits}e}" if error else "0"


def write_json(figures: Mapping[str, Any]) -> str:
    """Return figures as JSON, by name; infinity and NaN become null."""

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
    """Discard further output: at exit Python would try to flush it, with a traceback."""
    with suppress(OSError):  # The stream may have no file.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class Reader:
    """The standard output, which ignores further text once its reader (like `head`) has stopped."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.is_there = True

    def write(self, text: str) -> int:
        """Print a text."""
        return self._call(self._stream.write, text) or 0

    def flush(self) -> None:
        """Flush the stream."""
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
    """Continue after the reader of the report has stopped, if files remain to be written."""
    reader = Reader(sys.stdout)
    if not goes_on or sys.stdout is None:
        yield reader
        return
    with redirect_stdout(reader):
        yield reader


class Waiting:
    """A progress display on a terminal's standard error, which is erased at the end.

    It appears after two seconds, only on a terminal, and only until lines of the report appear on a
    terminal.
    """

    def __init__(self, what: str, patience: float = PATIENCE) -> None:
        self.what, self.patience = what, patience
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._show, daemon=True)

    def __enter__(self) -> Self:
        if sys.stderr and sys.stderr.isatty():  # It is None if closed, as in a daemon.
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def before_line(self) -> None:
        """Erase the display before a line of the report."""
        if sys.stdout and sys.stdout.isatty():
            self.end()

    def end(self) -> None:
        """Erase the display and stop."""
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
    """Return a function that prints a step of a contact problem when the violation changes.

    It is called after each product; calls with 0 products (on coarser grids) print nothing.
    """
    last = inf

    def tell(products: int, violation: float) -> None:
        nonlocal last
        if products and violation != last:
            waiting.before_line()
            print_step(products, violation)
            last = violation

    return tell
