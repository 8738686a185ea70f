"""Heights from files: tables of numbers, and instrument formats by SurfaceTopography."""

import io
import re
import zlib
from collections.abc import Callable
from contextlib import suppress
from itertools import product
from math import prod
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from toeplitz_mg._typing import Array, Element, Unit
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.gaps import UNITS, Heights, agree_on_unit, read_unit
from toeplitz_mg.contact.grid import read_sizes
from toeplitz_mg.tables import TEXT, UTF_16, decode, load_table, open_file
from toeplitz_mg.values import numbers, positive

TABLES = (".npy", *TEXT)  # Endings of files that are read without the extra `surfaces`.
SIZE = re.compile(r"#.*[:=]\s*[-+.\d]")  # A comment that may give a size, as "# Width: 1 mm".
# The unit in a comment, as in "in um", "unit: nm" or "[mm]", and the quantity beside it.
UNIT = re.compile(rf"(?:\bin\s+|\bunits?\W+|[\[(]\s*)({'|'.join(map(re.escape, UNITS))})(?!\w)")
OF_HEIGHTS = re.compile(r"\b(heights?|z|units?)\b", re.IGNORECASE)
FEWEST = 4  # Tables with fewer columns are not heights: the first columns are positions.
LEVELS = ("mean", "plane", "quadratic")  # Polynomials of degree 0, 1 and 2.


def read(
    path: str | PathLike[str],
    *,
    channel: int | str | None = None,
    level: str | None = None,
    element: Element | None = None,
    unit: Unit | None = None,
) -> Heights:
    """Read the heights of a surface or a profile from a file.

    Parameters
    ----------
    path : str or path
        A table of heights, ``.npy`` or text, with rows in the order of x; or any file that
        SurfaceTopography reads (``pip install 'toeplitz-mg[surfaces]'``), whatever its ending:
        instrument formats, positions with heights, containers. It may be compressed (``.gz``).
    channel : int or str, optional
        Number (from 0) or name of the channel, if the file has several; by default the one that
        SurfaceTopography chooses.
    level : {"mean", "plane", "quadratic"}, optional
        The polynomial to subtract, of degree 0, 1 or 2: the least squares fit to the heights that
        are not missing.
    element : float or (float, float), optional
        Size of a pixel, if the file does not contain it. For a profile at unevenly spaced
        positions, the spacing to which it is interpolated linearly.
    unit : str or (str, str), optional
        Unit of heights and pixels, or one each, as ("nm", "um"), if the file does not contain it.
        For tables the default is mm, or for heights the unit in a comment such as "# heights in
        um".

    Returns
    -------
    Heights
        The heights in mm, NaN where missing, for ``heights=`` of `normal_contact`.

    Warns
    -----
    ContactWarning
        If a comment names units, but it is unclear for what.

    Raises
    ------
    OSError
        If there is no such file.
    ValueError, TypeError
        If it cannot be read, or an argument is missing or contradicts the file.

    See Also
    --------
    toeplitz_mg.contact.normal_contact : presses the surface on a flat.

    Examples
    --------
    >>> import numpy as np
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from toeplitz_mg.contact import surfaces
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "heights.csv"
    ...     np.savetxt(path, [[0, 1, 2, 3], [1, 2, 3, np.nan]], delimiter=",")
    ...     surface = surfaces.read(path, level="plane", element=2.0, unit=("nm", "um"))
    >>> surface.element, np.abs(np.nan_to_num(surface.heights)).max() < 1e-20
    ((0.002, 0.002), np.True_)
    """
    path = Path(path)
    if level not in (None, *LEVELS):
        raise ValueError(f"level is {level!r}, but must be one of {', '.join(LEVELS)}")
    scale = read_unit(unit)
    ending = path.with_suffix("").suffix if path.suffix.lower() == ".gz" else path.suffix
    heights, refused = None, None
    if ending.lower() in TABLES and not (ending.lower() in TEXT and _says_sizes(path)):
        try:
            heights = _read_heights(path)
        except ValueError as error:
            hint = "; write nan for a missing height" if ending.lower() in TEXT else ""
            refused = ValueError(f"{error}{hint}")
    periodic, is_table = False, True
    if heights is None:
        found = _ask_library(path, channel, refused)
        if found is not None and found.sizes is None and ending.lower() not in TEXT:
            with suppress(ValueError):  # A table with another ending, with rows in the order of x.
                heights = _read_heights(path, is_text=True)
        if heights is not None:
            pass
        elif found is None or (found.sizes is None and ending.lower() in TEXT):
            # The rows of such a text would be read in the order of y.
            if refused is not None or ending.lower() not in TEXT:
                raise refused or ValueError(
                    f"{path} cannot be read: SurfaceTopography knows no such format"
                )
            heights = _read_heights(path)
        else:
            heights, element = _sample(path, found, element)
            scale = read_unit(agree_on_unit(str(path), found.unit, unit))
            periodic, is_table = found.periodic, False
    elif channel is not None:
        raise ValueError(f"channel is {channel!r}, but {path} contains heights only")
    if is_table and unit is None and ending.lower() in TEXT:
        said, doubt = _find_unit(path)
        scale = read_unit(said)[0], 1.0
        doubts.warn(doubt)
    if level is not None:
        heights = subtract(heights, LEVELS.index(level))
    pixel = None
    if element is not None:
        is_square = np.size(element) == 1 and heights.ndim == 2
        sizes = read_sizes(heights.shape[:1] if is_square else heights.shape, element)
        pixel = tuple(scale[1] * h for h in sizes * (1 + is_square))
    return Heights(scale[0] * heights, pixel, periodic)


def _says_sizes(path: Path) -> bool:
    """Whether a text has comments that may contain sizes."""
    with open_file(path) as file:
        try:
            return any(SIZE.match(line) for line in decode(file.read()).splitlines())
        except (UnicodeDecodeError, EOFError, zlib.error):
            return False


def _find_unit(path: Path) -> tuple[str | None, tuple[str, ...]]:
    """Return the unit of heights in the comments of a table, or a warning if it is unclear."""
    with open_file(path) as file:
        lines = [line for line in decode(file.read()).splitlines() if line.lstrip().startswith("#")]
    said = {unit: line for line in lines for unit in UNIT.findall(line)}
    of_heights = [unit for unit, line in said.items() if OF_HEIGHTS.search(line)]
    if len(said) == len(of_heights) == 1:
        return of_heights[0], ()
    told = "; ".join(dict.fromkeys(said.values()))
    doubt = f"{path} has the comment {told!r:.80}, but is read in mm: give unit="
    return None, (doubt,) if said else ()


def _read_heights(path: Path, is_text: bool | None = None) -> Array:
    """Read a table of heights of a surface or along a profile, or raise an error."""
    heights = load_table(path, is_text)
    if heights.ndim not in (1, 2):
        raise ValueError(
            f"{path} has shape {heights.shape}, but must be heights of a surface, or of a profile"
        )
    if heights.ndim == 2 and heights.shape[1] < FEWEST <= heights.shape[0]:
        raise ValueError(
            f"{path} has {heights.shape[1]} columns, like positions beside heights, but must be a "
            "table that contains heights only"
        )
    return numbers(str(path), heights)


class _Found(NamedTuple):
    """What SurfaceTopography finds in a file; sizes and unit are None if it has none."""

    read: Callable[..., Any]
    pixels: tuple[int, ...]
    sizes: Any
    unit: str | None
    periodic: bool


def _ask_library(path: Path, channel: int | str | None, refused: Exception | None) -> _Found | None:
    """Return what SurfaceTopography finds in a file, or None for an unknown format."""
    path.open("rb").close()  # So that a missing file raises the same error as for other formats.
    try:
        # Optional, and slow to import.
        from SurfaceTopography import open_topography
        from SurfaceTopography.Container.IO import read_container
        from SurfaceTopography.Exceptions import CannotDetectFileFormat
    except ImportError as error:
        raise refused or ValueError(
            f"reading {path} needs SurfaceTopography: pip install 'toeplitz-mg[surfaces]'; or "
            f"give heights only, as a file {', '.join(TABLES)} without lines that specify sizes"
        ) from error
    try:
        with open_file(path) as file:
            data = file.read()
        source = io.BytesIO(decode(data).encode() if data[:2] in UTF_16 else data)
        try:
            reader = open_topography(source)
            if reader.format() == "hgt" and ".hgt" not in path.name.lower():
                return None  # This format accepts any file of 2 n² bytes, even an empty one.
            names = [str(info.name) for info in reader.channels]
            chosen = reader.default_channel
            if channel is not None:
                chosen = reader.channels[_choose(channel, names)]
            if not chosen.is_height_channel:
                raise ValueError(f"channel {chosen.name!r} has no heights; channels are {names}")
            return _Found(chosen.topography, *_facts(chosen))
        except CannotDetectFileFormat:
            surfaces = read_container(source)
        several = [(surface, k) for surface in surfaces for k in range(len(surface))]
        if channel is None and len(several) > 1:
            raise ValueError(f"it has {len(several)} surfaces: give channel=, from 0")
        number = _choose(channel or 0, [str(k) for k in range(len(several))])
        surface, k = several[number]
        found = surface[k]
        return _Found(lambda: found, *_facts(found))
    except CannotDetectFileFormat:
        return None
    except OSError:
        raise
    except Exception as error:  # Each format raises its own errors.
        raise ValueError(f"{path} cannot be read: {error}") from error


def _facts(x: Any) -> tuple[Any, ...]:
    return tuple(x.nb_grid_pts), x.physical_sizes, x.unit, bool(x.is_periodic)


def _choose(channel: int | str, names: list[str]) -> int:
    """Return the number of a channel given by its number or its name."""
    if isinstance(channel, str) and channel in names:
        return names.index(channel)
    try:
        number = int(channel)
    except ValueError:
        number = -1
    if not 0 <= number < len(names):
        raise ValueError(f"channel is {channel!r}, but the file has {', '.join(names)}")
    return number


def _sample(path: Path, found: _Found, element: Any) -> tuple[Array, Any]:
    """Return the heights from SurfaceTopography, NaN where missing, and the pixel size."""
    sizes: dict[str, Any] = {}
    if found.sizes is None:
        if element is None:
            raise ValueError(f"{path} has no sizes: give element=")
        sizes["physical_sizes"] = tuple((np.array(found.pixels) * element).tolist())
    try:
        topography = found.read(**sizes)
    except OSError:
        raise
    except Exception as error:
        raise ValueError(f"{path} cannot be read: {error}") from error
    heights = topography.heights()
    if topography.is_uniform:
        if element is not None and not sizes:
            raise ValueError(f"{path} has its own sizes: leave element= out")
        pixel = tuple(np.atleast_1d(topography.pixel_size).tolist())
        return np.ma.filled(np.ma.asarray(heights, np.float64), np.nan), pixel
    if element is None:
        raise ValueError(
            f"{path} is a profile at positions that are not evenly spaced: give element=, the "
            "distance at which to resample it"
        )
    x, h = np.asarray(topography.positions()), positive("element", element)
    if not h < x[-1] - x[0]:
        raise ValueError(
            f"element is {h:g}, but must be less than the length of the profile {path}, "
            f"{x[-1] - x[0]:g}: both are in the same unit"
        )
    at = x[0] + h * np.arange(int((x[-1] - x[0]) / h * (1.0 + 1e-12)) + 1)
    return np.interp(at, x, heights), h


def subtract(heights: Array, degree: int) -> Array:
    """Return heights minus the polynomial of this degree that fits the existing heights best."""
    axes = [np.linspace(-1.0, 1.0, n) for n in heights.shape]
    grid = np.meshgrid(*axes, indexing="ij", sparse=True)
    there = np.isfinite(heights)
    if not there.any():
        return heights
    level = heights - heights[there].mean()
    known = np.where(there, level, 0.0)
    terms = [
        prod(x**k for x, k in zip(grid, powers, strict=True)) * there
        for powers in product(range(degree + 1), repeat=heights.ndim)
        if sum(powers) <= degree
    ]
    gram = [[np.vdot(a, b) for a in terms] for b in terms]
    found, *_ = np.linalg.lstsq(np.array(gram), np.array([np.vdot(a, known) for a in terms]))
    return level - sum(c * term for c, term in zip(found, terms, strict=True))
