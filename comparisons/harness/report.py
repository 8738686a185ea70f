"""What every comparison shares: its options, its folder, its tables.

Tables are printed while they grow. Files are written whole or not at all, and in UTF-8, wherever
the comparison runs: who interrupts it keeps the rows that are there.
"""

import argparse
import csv
import functools
import io
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from math import isnan
from operator import itemgetter
from pathlib import Path
from typing import Any, ParamSpec

from matplotlib.figure import Figure
from tabulate import tabulate

from comparisons.harness import machine
from comparisons.harness.inside import files, print_any_character

Row = dict[str, Any]
P = ParamSpec("P")
MEASURED = "measured.txt"  # Name of the file, among the results, that says when and on what.
INTERRUPTED = 130  # The status of a command that was interrupted, as a shell has it.
NARROWEST = 6  # Characters of the narrowest column of a table that is printed while it grows.


def options(
    name: str,
    description: str,
    flags: Mapping[str, str] | None = None,
    *,
    argv: Sequence[str] | None = None,
    **choices: Sequence[Any] | int | str,
) -> argparse.Namespace:
    """Parse ``--quick``, ``--output``, flags and choices, make the output folder and name it.

    What is measured is then of this day, this machine and these versions: a file there says so.

    `name` is that of the command, like "paper". `flags` are options without a value, with what
    their help says. `argv` are the arguments, those of the command line if None.
    Each of `choices` is an option that takes one or more of its values; None without it. One that
    is an integer or a string takes another one, and one that is a list of integers takes any; they
    are as given here without it.
    """
    parser = argparse.ArgumentParser(prog=f"python -m comparisons.{name}", description=description)
    parser.add_argument("--quick", action="store_true", help="small sizes only, within a minute")
    for flag, text in (flags or {}).items():
        parser.add_argument(f"--{flag}", action="store_true", help=text)
    for choice, values in choices.items():
        is_list = isinstance(values, list) and all(isinstance(v, int) for v in values)
        if isinstance(values, int | str) or is_list:
            kind = str if isinstance(values, str) else int
            more: dict[str, Any] = {"default": values, "help": "default: %(default)s"}
            more |= {"metavar": "TEXT" if kind is str else "NUMBER"}
            more |= {"nargs": "+"} if is_list else {}
        else:
            kind = type(values[0])
            more = {"nargs": "+", "choices": values, "help": "of %(choices)s"}
            more["metavar"] = choice.upper().rstrip("S")
        parser.add_argument(f"--{choice}", type=kind, **more)
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("results", name),
        metavar="FOLDER",
        help="folder of the files (default: %(default)s)",
    )
    print_any_character()
    arguments = parser.parse_args(argv)
    arguments.output.mkdir(parents=True, exist_ok=True)
    files.write(arguments.output / MEASURED, f"{machine.describe()}\n".encode())
    print(f"Writing to {arguments.output.resolve()}", flush=True)
    return arguments


def interruptible(main: Callable[P, None]) -> Callable[P, None]:
    """Let a command end with what it has where it is interrupted, by Ctrl-C."""

    @functools.wraps(main)
    def run(*arguments: P.args, **options: P.kwargs) -> None:
        try:
            main(*arguments, **options)
        except KeyboardInterrupt:
            print("\nInterrupted: the rows so far are above, and in the files.", flush=True)
            sys.exit(INTERRUPTED)

    return run


class Table:
    """A table that is printed while it grows, a row when it is measured, and kept in a CSV file.

    `form` makes the cells that are printed of a row, or is their formats; `room` has the characters
    of columns whose first cell is shorter than those that are to come. `rows` is what was measured.
    """

    def __init__(
        self,
        title: str,
        path: Path | None = None,
        form: Callable[[Row], Row] | Mapping[str, str] = dict,
        room: Mapping[str, int] | None = None,
    ) -> None:
        self.title, self.path, self.room = title, path, room or {}
        self.form = form if callable(form) else functools.partial(format_cells, formats=form)
        self.rows: list[Row] = []
        self._widths: dict[str, int] = {}

    def add(self, row: Row) -> None:
        """Print a row, and write all rows so far."""
        self.rows.append(row)
        if self.path is not None:
            write_csv(self.path, self.rows)
        cells = {key: "" if cell is None else str(cell) for key, cell in self.form(row).items()}
        if not self._widths:
            print(f"\n{self.title}\n")
        if not cells.keys() <= self._widths.keys():
            for key, cell in cells.items():
                width = max(len(key), len(cell), NARROWEST, self.room.get(key, 0))
                self._widths.setdefault(key, width)
            print("  ".join(key.ljust(width) for key, width in self._widths.items()).rstrip())
            print("  ".join("-" * width for width in self._widths.values()))
        line = (cells.get(key, "").ljust(width) for key, width in self._widths.items())
        print("  ".join(line).rstrip(), flush=True)

    def extend(self, rows: Iterable[Row]) -> None:
        """Print rows as they come."""
        for row in rows:
            self.add(row)


def group(rows: Iterable[Row], *keys: str) -> dict[Any, list[Row]]:
    """Return rows by what they have under a key, or under several, in the order of the first."""
    groups: dict[Any, list[Row]] = {}
    for row in rows:
        groups.setdefault(itemgetter(*keys)(row), []).append(row)
    return groups


def pivot(
    rows: Iterable[Row], name: Callable[[Row], Row], cell: Callable[[Row], tuple[str, Any]]
) -> list[Row]:
    """Return a table with a line for each name of rows, whose cells have these headings."""
    table: dict[str, Row] = {}
    for row in rows:
        heading, text = cell(row)
        table.setdefault(str(name(row)), name(row))[heading] = text
    return list(table.values())


def show(title: str, rows: Sequence[Row]) -> None:
    """Print rows that are all there as a table under a title."""
    print(f"\n{title}\n\n{draw(rows, 'simple')}", flush=True)


def draw(rows: Sequence[Row], style: str = "github") -> str:
    """Return rows as a table, of a page unless it has another style."""
    options: Any = {"headers": "keys", "missingval": "", "disable_numparse": True}
    return tabulate(list(rows), tablefmt=style, **options)


def format_cells(row: Row, formats: Mapping[str, str]) -> Row:
    """Return the cells of a row as they are printed, empty where nothing was measured.

    The format "time" is that of `format_seconds`.
    """

    def cell(value: Any, spec: str) -> str:
        return format_seconds(value) if spec == "time" else format(value, spec)

    return {
        key: "" if row.get(key) is None else cell(row[key], spec) for key, spec in formats.items()
    }


def format_rows(formats: Mapping[str, str], rows: Sequence[Row]) -> list[Row]:
    """Return the cells of rows."""
    return [format_cells(row, formats) for row in rows]


def format_seconds(seconds: float | None) -> str:
    """Return a time with two digits in the unit that suits it; nothing where there is none."""
    if seconds is None or isnan(seconds):
        return ""
    scale, unit = next(
        (s for s in ((1e6, "µs"), (1e3, "ms")) if seconds * s[0] < 995.0), (1.0, "s")
    )
    return f"{float(f'{seconds * scale:.2g}'):g} {unit}"


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write rows with their keys as the header."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, columns)
    writer.writeheader()
    writer.writerows(rows)
    files.write(path, text.getvalue().encode())


def read_csv(path: Path) -> list[Row]:
    """Return the rows that `write_csv` has written: numbers as such, without empty cells."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return [{key: _read_cell(text) for key, text in row.items() if text} for row in rows]


def _read_cell(text: str) -> Any:
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return text == "True" if text in ("True", "False") else text


def write_figure(path: Path, figure: Figure, dpi: int) -> None:
    """Write a figure in the format that the name ends in."""
    files.save_figure(path, figure, dpi=dpi)
