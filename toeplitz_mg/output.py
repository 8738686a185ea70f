"""Files of the command line: read with a clear error, written whole or not at all."""

import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from toeplitz_mg.contact import ContactResult

Array = NDArray[Any]


def load(path: Path) -> Array:
    """Read an array from a ``.npy`` file.

    Raises
    ------
    OSError
        Where there is no such file.
    ValueError
        Where it is not one of NumPy's, or holds Python objects.
    """
    try:
        with path.open("rb") as file:
            array = np.load(file, allow_pickle=False)
    except (ValueError, EOFError, BadZipFile) as error:
        raise ValueError(f"{path} is not a NumPy file of numbers (.npy): {error}") from None
    if not isinstance(array, np.ndarray):
        raise ValueError(f"{path} holds several arrays (.npz), but one is needed (.npy)")
    return array


def check_writable(path: Path) -> None:
    """Raise OSError where `path` could not be written."""
    if path.is_dir():
        raise IsADirectoryError(f"{path} is a folder, but a file is to be written")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path.parent} is no folder, so {path.name} cannot be written")
    if not os.access(path.parent, os.W_OK):
        raise PermissionError(f"{path.parent} is not writable")


def check_plotting(path: Path) -> None:
    """Raise ValueError where matplotlib is not installed, or cannot draw such a file."""
    if find_spec("matplotlib") is None:
        raise ValueError("--plot needs matplotlib: pip install 'toeplitz-mg[plot]'")
    from matplotlib.backend_bases import FigureCanvasBase  # an extra, and slow to import

    kinds = FigureCanvasBase.get_supported_filetypes()
    if path.suffix.lower().removeprefix(".") not in kinds:
        raise ValueError(f"{path} does not end in one of .{', .'.join(sorted(kinds))}")


def save(path: Path, array: Array) -> None:
    """Write an array to a ``.npy`` file, whole or not at all."""
    _write(path, lambda part: _save_npy(part, array))


def _save_npy(part: Path, array: Array) -> None:
    with part.open("wb") as file:  # np.save would append .npy to a name
        np.save(file, array)


def save_fields(path: Path, fields: Mapping[str, Any]) -> None:
    """Write arrays by their names to a ``.npz`` file, whole or not at all."""
    _write(path, lambda part: _save_npz(part, fields))


def _save_npz(part: Path, fields: Mapping[str, Any]) -> None:
    with part.open("wb") as file:
        np.savez(file, **fields)


def plot_contact(path: Path, title: str, results: Mapping[str, ContactResult]) -> None:
    """Draw the tractions of contact problems beside each other, by their titles."""
    import matplotlib.figure

    figure = matplotlib.figure.Figure(figsize=(5.5 * len(results), 4.5), layout="constrained")
    axes = figure.subplots(1, len(results), squeeze=False)[0]
    figure.suptitle(title)
    for ax, (name, result) in zip(axes, results.items(), strict=True):
        result.plot(ax)
        ax.set_title(name)
    _write(path, figure.savefig)


def plot(
    path: Path,
    title: str,
    solution: Array,
    x: Array | None,
    mask: Array | None,
    residuals: Sequence[float],
) -> None:
    """Draw the solution, and the relative residuals, from that of the first guess."""
    import matplotlib.figure

    figure = matplotlib.figure.Figure(figsize=(10, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    figure.suptitle(title)
    grid = solution
    if mask is not None:
        grid = np.full(mask.shape, np.nan)
        grid[mask] = solution
        if x is not None:
            at = np.full(mask.shape, np.nan)
            at[mask] = x
            x = at
    if grid.ndim == 2 and min(grid.shape) > 1:
        image = left.imshow(grid.T, origin="lower")
        figure.colorbar(image, ax=left)
    else:
        left.plot(np.arange(grid.size) if x is None else x, grid.ravel())
        # The traction is singular at the ends: show its shape, not its largest value.
        low, high = np.nanquantile(grid, [0.002, 0.998])
        left.set_ylim(min(low, 0.0) * 1.1, max(high, 0.0) * 1.1)
        left.set_xlabel("unknown" if x is None else "x (mm)")
        left.set_ylabel("solution" if x is None else "traction (N/mm²)")
    right.semilogy(range(len(residuals)), residuals, "o-")
    right.xaxis.get_major_locator().set_params(integer=True)
    right.set_xlabel("iteration")
    right.set_ylabel("residual / right-hand side")
    right.grid(alpha=0.3)
    _write(path, figure.savefig)


def _write(path: Path, write: Callable[[Path], object]) -> None:
    """Write beside `path` and move there, so that a file is never half-written."""
    path = path.resolve()  # a link stays a link
    handle, name = tempfile.mkstemp(prefix=".", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    part = Path(name)
    try:
        write(part)
        part.chmod(0o666 & ~_umask())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
