"""Read tables of numbers from text files or NumPy's, with errors that say what is wrong."""

import gzip
import io
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array

TEXT = (".txt", ".csv", ".dat")  # Extensions of text files.
UTF_16 = (b"\xff\xfe", b"\xfe\xff")  # First bytes of UTF-16 texts.


def load_table(path: Path, is_text: bool | None = None) -> Array:
    """Return an array from a ``.npy`` file, or a table of numbers from a text file.

    By default the extension decides.

    Raises
    ------
    OSError
        If there is no such file.
    ValueError
        If the content does not fit the extension, holds Python objects, or has no numbers.
    """
    stem = path.with_suffix("") if path.suffix.lower() == ".gz" else path
    is_text = stem.suffix.lower() in TEXT if is_text is None else is_text
    with open_file(path) as file:
        try:
            array: Any = _read_text(file.read()) if is_text else np.load(file, allow_pickle=False)
        except MemoryError:  # The array or its header is too large.
            raise ValueError(f"{path} needs more memory than there is") from None
        except Exception as error:  # NumPy parses the header as Python: any exception may occur.
            raise ValueError(f"{path} {_describe(is_text, error)}") from None
    if not isinstance(array, np.ndarray):
        raise ValueError(f"{path} holds several arrays (.npz), but one is needed (.npy)")
    if array.size == 0:
        raise ValueError(f"{path} holds no numbers: its array has shape {array.shape}")
    return array


def open_file(path: Path) -> Any:
    """Open a file for reading, decompressed if it is compressed."""
    file = path.open("rb")
    if path.suffix.lower() != ".gz":
        return file
    with file:
        if file.read(2) != b"\x1f\x8b":
            raise ValueError(f"{path} is not compressed by gzip, as its name says")
    return gzip.open(path)


def decode(data: bytes) -> str:
    """Return a text in UTF-8 (with or without a byte order mark, as from Excel) or in UTF-16."""
    return data.decode("utf-16" if data[:2] in UTF_16 else "utf-8-sig")


def _read_text(data: bytes) -> Array:
    """Return a table of numbers separated by semicolons, else by commas, else by blanks."""
    text = decode(data)
    rows = [line.partition("#")[0] for line in text.splitlines()]
    separator = next((mark for mark in ";," if any(mark in row for row in rows)), None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # A table without numbers is refused later.
        try:
            return np.loadtxt(io.StringIO(text), delimiter=separator, ndmin=1)
        except ValueError:
            _refuse_row(rows, separator)
            raise


def _refuse_row(rows: Sequence[str], separator: str | None) -> None:
    """Raise a ValueError for the first row that does not belong to a table, counted from 1."""
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
            raise ValueError(f"line {number} has {len(cells)} numbers, but above are {columns}")


def _describe(is_text: bool, error: Exception) -> str:
    """Say what is wrong with a file, without NumPy's advice to unpickle an unknown file."""
    if is_text:
        return f"is not a table of numbers with points for decimals: {error}"
    said = "" if "pickle" in str(error) else f": {error}"
    return f"is not a NumPy file of numbers (.npy); text is read from {', '.join(TEXT)}{said}"
