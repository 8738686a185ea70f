"""What every comparison shares: its options, its folder, its tables.

Files are written whole or not at all, and in UTF-8, wherever the comparison runs.
"""

import argparse
import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from math import isnan
from operator import itemgetter
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from tabulate import tabulate

from comparisons.harness import machine
from toeplitz_mg.cli import files
from toeplitz_mg.cli.report import print_any_character

Row = dict[str, Any]
MEASURED = "measured.txt"  # Name of the file, among the results, that says when and on what.


def options(
    name: str,
    description: str,
    flags: Mapping[str, str] | None = None,
    **choices: Sequence[Any] | int | str,
) -> argparse.Namespace:
    """Parse ``--quick``, ``--output``, flags and choices, make the output folder and name it.

    What is measured is then of this day, this machine and these versions: a file there says so.

    `name` is that of the module in `comparisons`, like "paper.tables". `flags` are options without
    a value, with what their help says.
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
            many: dict[str, Any] = {"nargs": "+"} if is_list else {}
            kind = str if isinstance(values, str) else int
            name_of = "TEXT" if kind is str else "NUMBER"
            parser.add_argument(
                f"--{choice}",
                type=kind,
                default=values,
                metavar=name_of,
                help="default: %(default)s",
                **many,
            )
            continue
        parser.add_argument(
            f"--{choice}",
            nargs="+",
            type=type(values[0]),
            choices=values,
            metavar=choice.upper().rstrip("S"),
            help="of %(choices)s",
        )
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("results", *name.split(".")),
        metavar="FOLDER",
        help="folder for CSV and PNG (default: %(default)s)",
    )
    print_any_character()
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    files.write(arguments.output / MEASURED, f"{machine.describe()}\n".encode())
    print(f"Writing to {arguments.output.resolve()}")
    return arguments


def group(rows: Iterable[Row], *keys: str) -> dict[Any, list[Row]]:
    """Return rows by what they have under a key, or under several, in the order of the first."""
    groups: dict[Any, list[Row]] = {}
    for row in rows:
        groups.setdefault(itemgetter(*keys)(row), []).append(row)
    return groups


def show(title: str, rows: Sequence[Row]) -> None:
    """Print rows as a table under a title."""
    print(f"\n{title}\n\n{_draw(rows, 'simple')}")


def draw_markdown(rows: Sequence[Row]) -> str:
    """Return rows as a table of a page."""
    return _draw(rows, "github")


def _draw(rows: Sequence[Row], style: str) -> str:
    return tabulate(
        list(rows), headers="keys", missingval="", disable_numparse=True, tablefmt=style
    )


def format_cells(row: Row, formats: Mapping[str, str]) -> Row:
    """Return the cells of a row as they are printed, empty where nothing was measured."""
    return {
        key: "" if row.get(key) is None else format(row[key], spec) for key, spec in formats.items()
    }


def format_seconds(seconds: float | None) -> str:
    """Return a time with two digits in the unit that suits it; nothing where there is none."""
    if seconds is None or isnan(seconds):
        return ""
    scale, unit = next(
        (s for s in ((1e6, "µs"), (1e3, "ms")) if seconds * s[0] < 995.0), (1.0, "s")
    )
    return f"{float(f'{seconds * scale:.2g}'):g} {unit}"


def write_markdown(
    path: Path, title: str, module: str, tables: Mapping[str, Sequence[Row]]
) -> None:
    """Write tables under their headings, with the command of the module that measures them."""
    text = f"# {title}\n\nWritten by `python -m {module}` on {machine.describe()}.\n\n"
    for heading, rows in tables.items():
        text += f"## {heading}\n\n{draw_markdown(rows)}\n\n"
    files.write(path, text.encode())


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
