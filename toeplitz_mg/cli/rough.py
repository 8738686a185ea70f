"""The case ``rough`` of ``toeplitz-mg contact``: a measured surface on a flat."""

import argparse
import re
from dataclasses import dataclass
from typing import Any

from toeplitz_mg._typing import Progress
from toeplitz_mg.cli.report import PRESSURE, Solve, Waiting
from toeplitz_mg.contact import ContactResult, NormalResult, normal_contact, surfaces
from toeplitz_mg.contact.gaps import Heights

ARGUMENT = re.compile(r"\b(channel|element|level|unit)(?:=|(?= is ))")


@dataclass(frozen=True)
class Rough:
    """A measured surface or profile, which is pressed on a flat.

    Attributes
    ----------
    options : Namespace
        The user's options and defaults.
    surface : Heights
        The content of the file.
    """

    options: argparse.Namespace
    surface: Heights

    @classmethod
    def of(cls, options: argparse.Namespace) -> "Rough":
        """Read the file, or raise an error that names the options."""
        o = options
        try:
            with Waiting(f"reading {o.file}"):
                heights = surfaces.read(
                    o.file,
                    channel=o.channel,
                    level=o.level,
                    element=_one_or_two(o.element),
                    unit=_one_or_two(o.unit),
                )
        except ValueError as error:  # It names arguments of `surfaces.read`.
            raise ValueError(ARGUMENT.sub(r"--\1", str(error))) from error
        if heights.element is None:
            raise ValueError(f"{o.file} has no sizes: give --element, and --unit if not mm")
        case = cls(o, heights)
        if o.approach is not None and case.is_plane and not o.periodic:
            raise ValueError(
                f"--approach is not for {o.file}, a profile: in plane strain it is only known "
                "up to a constant; give --force"
            )
        return case

    @property
    def is_plane(self) -> bool:
        """Whether plane strain is assumed: for a profile without a length."""
        return self.surface.element is not None and len(self.surface.element) == 1

    @property
    def title(self) -> str:
        """One line that describes the problem."""
        plane = " of a profile, in plane strain: forces are N/mm" if self.is_plane else ""
        shape = " x ".join(map(str, self.surface.heights.shape))
        return f"rough: {self.options.file}, {shape} heights{plane}"

    def solve(self, solve: Solve) -> dict[str, ContactResult]:
        """Solve the normal problem."""
        return {PRESSURE: solve("normal contact", self.press)}

    def press(self, progress: Progress) -> NormalResult:
        """Press the surface on the flat."""
        names = "force", "approach", "pressure", "material", "hardness", "tolerance", "periodic"
        given: dict[str, Any] = {name: getattr(self.options, name) for name in names}
        return normal_contact(heights=self.surface, **given, progress=progress)


def _one_or_two(values: Any) -> Any:
    """Return the values of an option as an argument: a number if there is one, else both."""
    return values and (values[0] if len(values) == 1 else tuple(values))
