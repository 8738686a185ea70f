"""Input files with clear errors, and output files that are never left incomplete."""

import io
import os
import stat
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact import ContactResult
from toeplitz_mg.tables import TEXT
from toeplitz_mg.whole_files import (
    check_folder,
    find_status,
    find_target,
    new_whole,
)

STANDARD_OUTPUT = 1  # File descriptor of the report.


def check_files(
    written: Sequence[Path | None], read: Sequence[Path | None], *, overwrite: bool
) -> None:
    """Raise an error before any work if files cannot be written or are used twice.

    Parameters
    ----------
    written, read : sequence of Path or None
        The output files and the input files; None stands for no file.
    overwrite : bool
        Whether existing files are replaced.

    Raises
    ------
    FileExistsError
        If an output file exists, and is not to be replaced.
    OSError
        If a file cannot be written.
    ValueError
        If a file is written twice, or is also an input file or the report.
    """
    wanted: list[Path] = []
    for path in filter(None, written):
        _check_writable(path)
        for other in wanted:
            if _is_same(path, other):
                raise ValueError(f"{path} is the same file as {other}, but each needs its own")
        for other in filter(None, read):
            if _is_same(path, other):
                raise ValueError(f"{path} is the same file as {other}, but that one is read")
        wanted.append(path)
        old = find_status(path)
        if old is not None and stat.S_ISREG(old.st_mode) and not overwrite:
            raise FileExistsError(f"{path} is there already: --overwrite replaces it")


def _check_writable(path: Path) -> None:
    """Raise OSError if `path` cannot be written, or is the file that the report goes to."""
    old = find_status(path)
    if old is None or stat.S_ISREG(old.st_mode):
        check_folder(path)
    elif stat.S_ISDIR(old.st_mode):
        raise IsADirectoryError(f"{path} is a folder, but a file is to be written")
    elif not (stat.S_ISFIFO(old.st_mode) or stat.S_ISCHR(old.st_mode)):
        raise OSError(f"{path} is neither a file nor a pipe nor a device of characters")
    elif not os.access(path, os.W_OK):
        raise PermissionError(f"{path} is not writable")
    if old is None:
        return
    with suppress(OSError):  # The standard output may be closed, or not be a file.
        if not stat.S_ISCHR(old.st_mode) and os.path.samestat(old, os.fstat(STANDARD_OUTPUT)):
            raise ValueError(f"{path} is the standard output, but the report is printed there")


def _is_same(one: Path, other: Path) -> bool:
    """Whether two paths are, or would be, the same file, also through links."""
    a, b = find_status(one), find_status(other)
    if a is None or b is None:
        return find_target(one) == find_target(other)
    return os.path.samestat(a, b)


def check_plotting(path: Path) -> None:
    """Raise ValueError if matplotlib is not installed, or does not support the format."""
    if find_spec("matplotlib") is None:
        raise ValueError("drawing needs matplotlib: pip install 'toeplitz-mg[plot]'")
    from matplotlib.backend_bases import FigureCanvasBase  # Optional.

    kinds = FigureCanvasBase.get_supported_filetypes()
    if path.suffix.lower().removeprefix(".") not in kinds:
        raise ValueError(f"{path} does not end in one of .{', .'.join(sorted(kinds))}")


def save(path: Path, array: Array, *, overwrite: bool) -> None:
    """Write an array to a ``.npy`` file, or a table to a text file."""
    data = io.BytesIO()
    if path.suffix.lower() in TEXT:
        np.savetxt(data, array, fmt="%.17g", delimiter=",")
    else:
        np.save(data, array)
    write(path, data.getvalue(), overwrite=overwrite)


def save_fields(path: Path, fields: Mapping[str, Any], *, overwrite: bool) -> None:
    """Write arrays by name to a ``.npz`` file."""
    data = io.BytesIO()
    np.savez(data, **fields)
    write(path, data.getvalue(), overwrite=overwrite)


def save_figure(path: Path, figure: Any, dpi: float, *, overwrite: bool = True) -> None:
    """Write a matplotlib figure in the format of the file's ending; `dpi` is in dots per inch."""
    data = io.BytesIO()
    figure.savefig(data, format=path.suffix.lower().removeprefix("."), dpi=dpi)
    write(path, data.getvalue(), overwrite=overwrite)


def plot_contact(
    path: Path,
    dpi: int,
    title: str,
    results: Mapping[str, ContactResult],
    *,
    overwrite: bool,
) -> None:
    """Draw the tractions of contact problems side by side, with their titles."""
    import matplotlib.figure

    figure = matplotlib.figure.Figure(figsize=(5.5 * len(results), 4.5), layout="compressed")
    axes = figure.subplots(1, len(results), squeeze=False)[0]
    figure.suptitle(title)
    for ax, (name, result) in zip(axes, results.items(), strict=True):
        result.plot(ax=ax)
        ax.set_title(name)
    save_figure(path, figure, dpi, overwrite=overwrite)


def plot(
    path: Path,
    dpi: int,
    title: str,
    solution: Array,
    x: Array | None,
    residuals: Sequence[float],
    *,
    overwrite: bool,
) -> None:
    """Plot the solution on its grid, and the relative residuals from the initial guess on."""
    import matplotlib.figure

    figure = matplotlib.figure.Figure(figsize=(10, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    # The title contains a file name, in which $ or undecodable bytes may occur.
    figure.suptitle(title.encode(errors="backslashreplace").decode(), parse_math=False)
    if solution.ndim == 2 and min(solution.shape) > 1:
        _draw_grid(left, solution)
    else:
        left.plot(np.arange(solution.size) if x is None else x, solution.ravel())
        # The traction is singular at the ends: choose limits that show its shape.
        low, high = np.nanquantile(solution, [0.002, 0.998])
        if low or high:  # Otherwise all values are zero.
            left.set_ylim(min(low, 0.0) * 1.1, max(high, 0.0) * 1.1)
        left.set_xlabel("unknown" if x is None else "x [mm]")
        left.set_ylabel("solution" if x is None else "traction [N/mm²]")
    right.semilogy(range(len(residuals)), residuals, "o-")
    right.xaxis.get_major_locator().set_params(integer=True)
    right.set_xlabel("iteration")
    right.set_ylabel("residual / right-hand side")
    right.grid(alpha=0.3)
    save_figure(path, figure, dpi, overwrite=overwrite)


def _draw_grid(ax: Any, grid: Array) -> None:
    """Draw values on a grid with two axes, and a colour bar as high as the axes.

    Elements outside of the mask are white. Small values are light; two signs have two colours.
    """
    # As on a line: a few values at singular edges would use up the range of colours.
    largest = float(np.nanquantile(np.abs(grid), 0.998)) or 1.0
    has_signs = bool((grid < 0.0).any())
    image = ax.imshow(
        grid.T,
        origin="lower",
        cmap="PuOr" if has_signs else "YlOrRd",
        vmin=-largest if has_signs else 0.0,
        vmax=largest,
    )
    bar = ax.inset_axes((1.03, 0.0, 0.05, 1.0))
    beyond = "both" if has_signs else "max"
    ax.figure.colorbar(image, cax=bar, extend=beyond, label="solution")
    ax.set(xlabel="first axis", ylabel="second axis")


def spread(values: Array, mask: Array | None, outside: float) -> Array:
    """Return values on the grid of a mask, with the value `outside` elsewhere."""
    if mask is None:
        return values
    grid = np.full(mask.shape, outside, values.dtype)
    grid[mask] = values
    return grid


def write(path: Path, data: bytes, *, overwrite: bool = True) -> None:
    """Write a regular file completely or not at all; or write into a pipe or device.

    If it cannot be written, an OSError is raised, and an existing file is unchanged.
    """
    try:
        old = find_status(path)
        if old is None or stat.S_ISREG(old.st_mode):
            with new_whole(path, replaces=overwrite) as file:
                file.write(data)
        else:
            with path.open("wb") as file:
                file.write(data)
    except FileExistsError:  # Created since the command started.
        raise FileExistsError(f"{path} is there already: --overwrite replaces it") from None
    except OSError as error:
        raise OSError(f"{path} cannot be written: {error.strerror or error}") from error
