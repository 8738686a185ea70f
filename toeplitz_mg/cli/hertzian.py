"""The cases ``hertz``, ``shift`` and ``rolling`` of ``toeplitz-mg contact``: smooth bodies."""

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array, Element, Progress
from toeplitz_mg.cli.report import PRESSURE, TANGENTIAL, Solve
from toeplitz_mg.contact import (
    ContactResult,
    FrictionalResult,
    HertzContact,
    NormalResult,
    TangentialResult,
    friction,
    frictional_contact,
    frictional_rolling,
    hertz,
    normal_contact,
    rolling,
    surfaces,
)
from toeplitz_mg.contact.checks import SLIDES
from toeplitz_mg.contact.doubts import UNCOUPLED
from toeplitz_mg.halfspace import difference_parameter

MARGIN = 1.3  # Side of the grid over the length of the contact by Hertz's theory.
CREEPAGE = -0.002  # Longitudinal creepage (slip over distance) where no creepage is given.


@dataclass(frozen=True)
class Hertzian:
    """What is to be solved, on a grid that Hertz's theory says is large enough.

    Attributes
    ----------
    options : Namespace
        What the user asked for, with the defaults.
    theory : HertzContact
        The contact that Hertz's theory expects.
    shape : tuple of int
        Elements of the grid along each axis.
    h : float
        Side of an element, or width of a strip, mm.
    """

    options: argparse.Namespace
    theory: HertzContact
    shape: tuple[int, ...]
    h: float

    @classmethod
    def of(cls, options: argparse.Namespace) -> "Hertzian":
        """Choose the grid, or say why the one asked for does not do."""
        o = options
        radii = o.radius[0], math.inf if o.line else o.radius[-1]
        theory = hertz(radii=radii, material=o.material, force=o.force, approach=o.approach)
        a, b = theory.half_axes
        longer = 2.0 * (a if o.line else max(a, b))
        size = MARGIN * longer if o.size is None else o.size
        if size < longer:
            raise ValueError(
                f"--size is {size:g}, but the contact is {longer:.4g} mm long by Hertz's theory"
            )
        h = size / o.n
        shape: tuple[int, ...] = (o.n,)
        if not o.line:
            shape = tuple(max(1, math.ceil(o.n * axis / max(a, b))) for axis in (a, b))
        case = cls(o, theory, shape, h)
        case.check_friction()
        return case

    @property
    def element(self) -> Element:
        """The size of an element."""
        return self.h if self.options.line else (self.h, self.h)

    @property
    def title(self) -> str:
        """A line that says what is solved."""
        o = self.options
        radii = " and ".join(f"{r:g}" for r in dict.fromkeys(o.radius))
        body = "cylinder" if o.line else "sphere" if len(set(o.radius)) == 1 else "ellipsoid"
        grid = " x ".join(map(str, self.shape))
        return f"{o.case}: {body} of {radii} mm, {grid} elements of {self.h:.3g} mm"

    @property
    def is_coupled(self) -> bool:
        """Whether pressures move the bodies along the surface, and tractions across it."""
        material = self.options.material
        return isinstance(material, tuple) and abs(difference_parameter(*material)) > UNCOUPLED

    def solve(self, solve: Solve) -> dict[str, ContactResult]:
        """Solve the normal problem, and the tangential one, or both at once.

        Parameters
        ----------
        solve : callable
            It calls a solver, with what is told of its progress, and prints that below a name.
        """
        case = self.options.case
        if case == "hertz":
            return {PRESSURE: solve("normal contact", self.press)}
        name = "friction" if case == "shift" else "steady rolling"
        if self.is_coupled:
            both = solve(f"normal contact and {name}", self.press_and_move)
            return {PRESSURE: both.normal, TANGENTIAL: both.tangential}
        pressed = solve("normal contact", self.press)
        return {PRESSURE: pressed, TANGENTIAL: solve(name, partial(self.move, pressed))}

    def press(self, progress: Progress) -> NormalResult:
        """Solve the normal problem."""
        return normal_contact(self.gap, self.element, **self.pressing, progress=progress)

    def move(self, pressed: NormalResult, progress: Progress) -> TangentialResult:
        """Solve the tangential problem of the pressures."""
        o, bound = self.options, np.zeros_like(pressed.pressure)
        # Zero outside the contact at any friction, also where it is infinite.
        bound[pressed.contact] = o.friction * pressed.pressure[pressed.contact]
        common = {"material": o.material, "tolerance": o.tolerance, "progress": progress}
        if o.case == "shift":
            motion = self.shift(pressed.force)
            return friction(bound, self.element, **motion, **common)
        return rolling(bound, self.element, **self.creepages, **common)

    def press_and_move(self, progress: Progress) -> FrictionalResult:
        """Solve both problems of unlike bodies."""
        common = self.pressing | {"mu": self.options.friction, "progress": progress}
        shifts = self.options.case == "shift"
        motion = self.shift(self.theory.force) if shifts else self.creepages
        if "force" in motion:  # There is one of that name that presses.
            motion["tangential_force"] = motion.pop("force")
        solver = frictional_contact if shifts else frictional_rolling
        return solver(self.gap, self.element, **common, **motion)

    @property
    def gap(self) -> Array:
        """The distance of the bodies before they touch."""
        if self.options.line:
            return surfaces.cylinder(self.shape, self.element, radius=self.options.radius[0])
        radii = self.options.radius[0], self.options.radius[-1]
        n1, n2 = self.shape
        return surfaces.ellipsoid((n1, n2), (self.h, self.h), radii=radii)

    @property
    def pressing(self) -> dict[str, Any]:
        """The arguments of what presses."""
        names = "force", "approach", "material", "tolerance"
        return {name: getattr(self.options, name) for name in names}

    def shift(self, force: float) -> dict[str, Any]:
        """Return the arguments of what shifts, by default half of what friction carries."""
        o = self.options
        if o.shift is not None:
            return {"shift": self.components(o.shift)}
        return {"force": self.components(o.tangential or [0.5 * o.friction * force])}

    @property
    def creepages(self) -> dict[str, Any]:
        """The arguments of what rolls."""
        names = "longitudinal", "lateral", "spin", "moment"
        given = {name: getattr(self.options, name) for name in names}
        asked = {name: value for name, value in given.items() if value is not None}
        if self.options.tangential is not None:
            asked["force"] = self.components(self.options.tangential)
        return asked or {"longitudinal": CREEPAGE}

    def components(self, values: Sequence[float]) -> Any:
        """Return a load along the surface: a number in line contact, else two."""
        return values[0] if self.options.line else (*values, 0.0)[:2]

    def check_friction(self) -> None:
        """Refuse a tangential force that friction cannot carry, before any work."""
        o = self.options
        if o.tangential is None:
            return
        wanted, most = math.hypot(*o.tangential), o.friction * self.theory.force
        # Where the approach is given, theory says the force, within the error of the grid.
        if o.case == "rolling" and wanted >= most:
            raise ValueError(
                f"--tangential is {wanted:g}, but must be less than {most:.6g}, which friction "
                "carries: then all slides, by any creepage"
            )
        if wanted > most * (1.0 + SLIDES):
            raise ValueError(f"--tangential is {wanted:g}, but friction carries {most:.6g} at most")
