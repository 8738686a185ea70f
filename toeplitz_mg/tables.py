"""Tables of numbers from files, NumPy's or text: read with an error that says what is wrong."""

import gzip
import io
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array

TEXT = (".txt", ".csv", ".dat")  # Endings of the names of files that are text.
UTF_16 = (b"\xff\xfe", b"\xfe\xff")  # How texts in UTF-16 begin.


def load_table(path: Path, is_text: bool | None = None) -> Array:
    """Read an array from a ``.npy`` file, or a table of numbers from a text file.

    By default its ending says which.

    Raises
    ------
    OSError
        Where there is no such file.
    ValueError
        Where it is not what its name says, holds Python objects, or no numbers at all.
    """
    stem = path.with_suffix("") if path.suffix.lower() == ".gz" else path
    is_text = stem.suffix.lower() in TEXT if is_text is None else is_text
    with open_file(path) as file:
        try:
            array: Any = _read_text(file.read()) if is_text else np.load(file, allow_pickle=False)
        except MemoryError:  # The array is too large, or its header.
            raise ValueError(f"{path} needs more memory than there is") from None
        except Exception as error:  # NumPy parses the header as Python, so it may be any of many.
            raise ValueError(f"{path} {_describe(is_text, error)}") from None
    if not isinstance(array, np.ndarray):
        raise ValueError(f"{path} holds several arrays (.npz), but one is needed (.npy)")
    if array.size == 0:
        raise ValueError(f"{path} holds no numbers: its array has shape {array.shape}")
    return array


def open_file(path: Path) -> Any:
    """Return a file to read from, decompressed."""
    file = path.open("rb")
    if path.suffix.lower() != ".gz":
        return file
    with file:
        if file.read(2) != b"\x1f\x8b":
            raise ValueError(f"{path} is not compressed by gzip, as its name says")
    return gzip.open(path)


def decode(data: bytes) -> str:
    """Return a text in UTF-8, as Excel writes it too, or in UTF-16."""
    return data.decode("utf-16" if data[:2] in UTF_16 else "utf-8-sig")


def _read_text(data: bytes) -> Array:
    """Read a table of numbers, separated by semicolons, or else by commas, or else by blanks."""
    text = decode(data)
    rows = [line.partition("#")[0] for line in text.splitlines()]
    separator = next((mark for mark in ";," if any(mark in row for row in rows)), None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # Of no numbers, which is refused anyway.
        try:
            return np.loadtxt(io.StringIO(text), delimiter=separator, ndmin=1)
        except ValueError:
            _refuse_row(rows, separator)
            raise


def _refuse_row(rows: Sequence[str], separator: str | None) -> None:
    """Raise ValueError for the first row that is none of a table, counted from 1."""
    columns = 0
    for number, row in enumerate(rows, 1):
        cells = row.split(separator) if row.strip() else []
        for place, cell in enumerate(cells, 1):
            try:
                float(cell)
            except ValueError:
                wrong = repr(cell.strip()) if cell.strip() else "nothing"
                raise ValueError(f"line {number} has {wrong} in column {place}") from None
        if len(cells) != (columns := columns or len(cells)) and cells:
            raise ValueError(f"line {number} has {len(cells)} numbers, and those above {columns}")


def _describe(is_text: bool, error: Exception) -> str:
    """Say what a file is not, without NumPy's advice to unpickle what nobody knows."""
    if is_text:
        return f"is not a table of numbers with points for decimals: {error}"
    said = "" if "pickle" in str(error) else f": {error}"
    return f"is not a NumPy file of numbers (.npy); text is read from {', '.join(TEXT)}{said}"
