"""The case ``rough`` of ``toeplitz-mg contact``: a measured surface, from a file, on a flat."""

import argparse
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array, Progress
from toeplitz_mg.cli import files
from toeplitz_mg.cli.report import PRESSURE, Solve, Waiting
from toeplitz_mg.contact import ContactResult, NormalResult, normal_contact

TABLES = (".npy", *files.TEXT)  # Endings of files that are read without the extra `surfaces`.
SIZE = re.compile(rb"#.*[:=]\s*[-+.\d]")  # A comment that may say one, as "# Width: 1 mm".
FEWEST = 4  # Fewest columns of a table of heights: of two or three, the first are positions.


@dataclass(frozen=True)
class Rough:
    """A surface from a file, or a profile, that is pressed on a flat.

    Attributes
    ----------
    options : Namespace
        What the user asked for, with the defaults.
    surface : dict
        The arguments of `normal_contact` that say what is pressed.
    shape : tuple of int
        The pixels along each axis.
    """

    options: argparse.Namespace
    surface: dict[str, Any]
    shape: tuple[int, ...]

    @classmethod
    def of(cls, options: argparse.Namespace) -> "Rough":
        """Read the file, or say why it does not do."""
        o = options
        surface: dict[str, Any] = {"unit": o.unit, "periodic": True if o.periodic else None}
        with Waiting(f"reading {o.file}"):
            heights = None if is_table(o.file) else read_topography(o.file, o.element)
        if heights is None:
            heights = read_table(o.file)
            if o.element is None:
                raise ValueError(f"{o.file} has no sizes: give --element, and --unit if not mm")
            shape, size = heights.shape, np.array(o.element)
            surface["element"] = tuple((size if len(shape) == 1 else size + np.zeros(2)).tolist())
        elif heights.unit is None and o.unit is None:
            raise ValueError(f"{o.file} has no unit: give --unit")
        else:
            shape = tuple(heights.nb_grid_pts)
        case = cls(o, surface | {"heights": heights}, shape)
        if o.approach is not None and case.is_plane and not o.periodic:
            raise ValueError(
                f"--approach is not for {o.file}, a profile: plane strain leaves it open by a "
                "constant; give --force"
            )
        return case

    @property
    def is_plane(self) -> bool:
        """Whether it is plane strain: a profile without a length."""
        return len(self.shape) == 1 and len(self.surface.get("element", "1")) == 1

    @property
    def title(self) -> str:
        """A line that says what is solved."""
        plane = " of a profile, in plane strain: forces are N/mm" if self.is_plane else ""
        return f"rough: {self.options.file}, {' x '.join(map(str, self.shape))} heights{plane}"

    def solve(self, solve: Solve) -> dict[str, ContactResult]:
        """Solve the normal problem."""
        return {PRESSURE: solve("normal contact", self.press)}

    def press(self, progress: Progress) -> NormalResult:
        """Press the surface on the flat."""
        names = "force", "approach", "material", "hardness", "tolerance"
        load: dict[str, Any] = {name: getattr(self.options, name) for name in names}
        return normal_contact(**self.surface, **load, progress=progress)


def is_table(path: Path) -> bool:
    """Whether a file is a table of numbers, without comments that may say sizes."""
    if path.suffix.lower() not in files.TEXT:
        return path.suffix.lower() in TABLES
    with path.open("rb") as file:
        return not any(SIZE.match(line) for line in file)


def read_table(path: Path) -> Array:
    """Read heights, of a surface or along a profile, or say why these are none."""
    try:
        heights = files.load(path)
    except ValueError as error:
        raise ValueError(f"{error}; a height that is missing is written nan") from error
    if heights.ndim == 2 and heights.shape[1] < FEWEST <= heights.shape[0]:
        raise ValueError(
            f"{path} has {heights.shape[1]} columns, as positions beside heights, but must be a "
            "table of heights alone, or a file .xyz"
        )
    return heights


def read_topography(path: Path, element: list[float] | None) -> Any:
    """Read a file by SurfaceTopography; `element` is the size of a pixel where it has none.

    Of a text that says no sizes it is None: that is a table, in which rows follow each other along
    x, as SurfaceTopography's along y.

    Raises
    ------
    OSError
        Where there is no such file.
    ValueError
        Where SurfaceTopography is not installed, or cannot read it.
    """
    path.open("rb").close()  # So that a file that is not there is an error as of any other.
    try:
        # It is an extra, and slow to import.
        from SurfaceTopography import open_topography
        from SurfaceTopography.Exceptions import CannotDetectFileFormat
    except ImportError as error:
        raise ValueError(
            f"reading {path} needs SurfaceTopography: pip install 'toeplitz-mg[surfaces]'; or "
            f"give heights alone, as a file {', '.join(TABLES)} without lines that say sizes"
        ) from error
    try:
        channel = open_topography(str(path)).default_channel
        if channel.physical_sizes is None and path.suffix.lower() in files.TEXT:
            return None
        sizes: dict[str, Any] = {}
        if element is not None and channel.physical_sizes is None:
            pixels = np.array(channel.nb_grid_pts)
            sizes["physical_sizes"] = tuple((pixels * element).tolist())
        topography = channel.topography(**sizes)
    except CannotDetectFileFormat:
        if path.suffix.lower() in files.TEXT:
            return None
        raise ValueError(f"{path} cannot be read: SurfaceTopography knows no such format") from None
    except OSError:
        raise
    except Exception as error:  # Each of its formats raises errors of its own.
        raise ValueError(f"{path} cannot be read: {error}") from error
    if element is not None and not sizes:
        raise ValueError(f"{path} has its own sizes: leave --element out")
    if not topography.is_uniform:
        raise ValueError(
            f"{path} is a profile at positions that are not evenly spaced: interpolate it first, "
            "as by the method to_uniform() of SurfaceTopography"
        )
    return topography
