"""The case ``rough`` of ``toeplitz-mg contact``: a measured surface, from a file, on a flat."""

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from toeplitz_mg.cli import files
from toeplitz_mg.cli.report import Waiting
from toeplitz_mg.contact import Material, NormalResult, normal_contact

OURS = ".npy"  # Ending of files that are read without the extra `surfaces`.


@dataclass(frozen=True)
class Rough:
    """A surface from a file, that is pressed on a flat.

    Attributes
    ----------
    options : Namespace
        What the user asked for, with the defaults.
    surface : dict
        The arguments of `normal_contact` that say what is pressed.
    """

    options: argparse.Namespace
    surface: dict[str, Any]

    @classmethod
    def of(cls, options: argparse.Namespace) -> "Rough":
        """Read the file, or say why it does not do."""
        o = options
        surface: dict[str, Any] = {"unit": o.unit, "periodic": True if o.periodic else None}
        element = None if o.element is None else tuple(np.broadcast_to(o.element, 2).tolist())
        if o.file.suffix.lower() == OURS:
            if element is None:
                raise ValueError(f"{o.file} has no sizes: give --element, and --unit if not mm")
            return cls(o, surface | {"heights": files.load(o.file), "element": element})
        with Waiting(f"reading {o.file}"):
            return cls(o, surface | {"heights": read_topography(o.file, element)})

    @property
    def title(self) -> str:
        """A line that says what is solved."""
        return f"rough: {self.options.file}"

    def press(self, progress: Callable[[int, float], None]) -> NormalResult:
        """Solve the normal problem."""
        o = self.options
        material = Material.from_shear(o.G, o.nu)
        load: dict[str, Any] = {"force": o.force, "approach": o.approach, "tolerance": o.tolerance}
        return normal_contact(**self.surface, **load, material=material, progress=progress)


def read_topography(path: Path, element: tuple[float, float] | None) -> Any:
    """Read a file by SurfaceTopography; `element` is the size of a pixel where it has none.

    Raises
    ------
    OSError
        Where there is no such file.
    ValueError
        Where SurfaceTopography is not installed, or cannot read it.
    """
    path.open("rb").close()  # So that a file that is not there is an error as of any other.
    try:
        from SurfaceTopography import open_topography  # It is an extra, and slow to import.
    except ImportError as error:
        raise ValueError(
            f"reading {path} needs SurfaceTopography: pip install 'toeplitz-mg[surfaces]'; or "
            f"give heights of NumPy, as a file {OURS}"
        ) from error
    try:
        reader = open_topography(str(path))
        if element is None:
            return reader.topography()
        pixels = reader.default_channel.nb_grid_pts
        return reader.topography(
            physical_sizes=tuple(n * h for n, h in zip(pixels, element, strict=False))
        )
    except OSError:
        raise
    except Exception as error:  # Each of its formats raises errors of its own.
        raise ValueError(f"{path} cannot be read: {error}") from error
