"""The motion of rolling bodies: given creepages, and those that belong to given forces.

The rigid slip divided by the distance rolled, at x, y from the pole, is

    w = (ξ - φ y, η + φ x) + the given field,

with the creepages ξ, η and the spin φ. Each has a conjugate load: Fx, Fy and the moment about the
pole. For each pair, one is given and the other is found.

The slip of a step belongs to the middle of the step, half an element ahead of its element
(`rolling`). So the spin acts about a point half an element ahead of the pole, and the moment has
the arm x - h/2. With the arm x, Kalker's C₃₃ has an error of 70 % on 128² elements for an ellipse
ten times as long as wide; with this arm, 2 %.
"""

from dataclasses import dataclass
from dataclasses import field as dataclass_field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.checks import check_force, widen
from toeplitz_mg.contact.doubts import examine_creepages, examine_moment
from toeplitz_mg.contact.gaps import in_order
from toeplitz_mg.contact.grid import keep
from toeplitz_mg.contact.results.quantities import CREEPAGES
from toeplitz_mg.contact.tangential.law import size
from toeplitz_mg.values import field, finite, in_range, in_unit, refuse_masked

DEPENDENT = 1e-12  # A slip by unit spin, over the element size, that counts as rounding.
LARGEST = 1e15  # Largest creepage; with larger ones, displacements would be lost in rounding.
LOADS = ("the force along x", "the force along y", "the moment")


class BeyondBound(ValueError):
    """Loads that exceed what a traction bound can carry."""


@dataclass(frozen=True)
class Motion:
    """The given creepages, loads and pole."""

    # Longitudinal, lateral, spin; None if the load is given.
    creepages: tuple[float | None, ...]
    # The forces along x and y, and the moment; None if the creepage is given.
    loads: tuple[float | None, ...]
    # The point about which the bodies spin, relative to the middle of the grid, mm.
    pole: tuple[float, float] = (0.0, 0.0)
    # (components, ...): additional rigid slip divided by the distance rolled.
    slip: Array | None = dataclass_field(default=None, compare=False)
    # Directions of the tractions: "x" in line contact without lateral motion or load, else "xy".
    directions: str = "xy"

    @classmethod
    def of(
        cls,
        shape: tuple[int, ...],
        creepages: tuple[float, float, float],
        force: Any = None,
        moment: float | None = None,
        slip: ArrayLike | None = None,
        pole: tuple[float, float] = (0.0, 0.0),
        *,
        beside_lateral: bool = False,
    ) -> Self:
        """Return the motion for fields of a shape, or raise an error.

        `beside_lateral` says that other tractions (a guess or previous ones) have two components.
        """
        moment = in_unit("moment", moment, "N*mm")
        creepages = tuple(map(in_unit, CREEPAGES, creepages, ("", "", "1/mm")))
        loads = (*_read_force(len(shape) == 1, force), moment)
        given: list[float | None] = []
        for name, load, value, wanted in zip(CREEPAGES, LOADS, creepages, loads, strict=True):
            in_range(name, abs(finite(name, value)))
            if abs(value) > LARGEST:
                raise ValueError(
                    f"{name} is {value:g}, but must be at most {LARGEST:g} in size: beside a "
                    "larger one elastic displacements are below rounding"
                )
            if wanted is not None:
                in_range(load, abs(finite(load, wanted)))
            if value and wanted is not None:
                raise ValueError(
                    f"{name} is {value:g} and {load} is {wanted:g}, but only one of the two can be "
                    "given: the other is a result"
                )
            given.append(value if wanted is None else None)
        if len(shape) == 1 and given[2] != 0.0:
            name, refused = ("moment", moment) if given[2] is None else ("spin", given[2])
            raise ValueError(
                f"{name} is {refused}, but line contact has longitudinal and lateral creepage only"
            )
        middle = np.atleast_1d(field("pole", pole, "mm"))
        if middle.shape != (2,) or not np.isfinite(middle).all():
            raise ValueError(f"pole is {pole}, but must be (x, y), and finite")
        x, y = middle.tolist()
        more = None if slip is None else _read_slip(shape, slip)
        is_lateral = len(shape) == 2 or given[1] != 0.0 or beside_lateral
        is_lateral = is_lateral or (more is not None and len(more) > 1)
        if more is not None:
            more = widen(more, 2 if is_lateral else 1)
        return cls(tuple(given), loads, (x, y), more, "xy" if is_lateral else "x")

    @property
    def unknown(self) -> tuple[int, ...]:
        """The indices of the creepages to be found."""
        return tuple(k for k, value in enumerate(self.creepages) if value is None)

    @property
    def wanted(self) -> Array:
        """The given loads."""
        return np.array([self.loads[k] for k in self.unknown], dtype=np.float64)

    def find_sliding(self, grid: Any, g: Array) -> Array | None:
        """Return the sum of the tractions if a given force makes all elements slide, or None.

        A force that exceeds the bound g is refused as in friction. With a moment, `check_loads`
        refuses it.
        """
        forces = [F or 0.0 for F in self.loads[: grid.components]]
        if self.loads[2] is not None or not any(forces):
            return None
        force = forces if len(forces) > 1 else forces[0]
        total, all_slides = check_force(force, grid.vectors.sum(g), grid)
        return total if all_slides else None

    def check_loads(self, grid: Any, g: Array, bearer: str = "friction") -> None:
        """Raise an error for loads that the bearer's bound g cannot carry."""
        if not self.unknown:
            return
        forces = [F or 0.0 for F in self.loads[:2]]
        arms = {"tangential force": np.ones(g.shape)}
        wanted = {"tangential force": float(np.linalg.norm(forces))}
        if self.loads[2] is not None:
            arm = _arms(grid, self.pole)[2]
            arms["moment"], wanted["moment"] = np.hypot(*arm), abs(self.loads[2])
        for name, load in wanted.items():
            # Where the arm is zero, an infinite bound carries nothing either.
            carried = np.where(arms[name] > 0.0, g, 0.0) * arms[name]
            most = grid.area * grid.vectors.sum(carried)
            if load and not load < most:
                raise BeyondBound(
                    f"the {name} is of size {load:g}, but must be less than {most:g}, the most "
                    f"that {bearer} carries: there everything slides, at any creepage"
                )
        if self.loads[2] is not None:
            self._check_spin(grid, g)

    def _check_spin(self, grid: Any, g: Array) -> None:
        """Refuse a moment if a spin causes no slip, unless no moment can arise."""
        slips = np.hypot(*unit_slips(grid, self.pole)[2]) > DEPENDENT * max(grid.element)
        lateral = self.loads[1] or self.creepages[1] or self.slip is not None
        if not (self.loads[2] or lateral) or not grid.vectors.count(g):
            return
        if not grid.vectors.count(slips & (g > 0.0)):
            raise ValueError(
                f"the moment is {self.loads[2]:g}, but a spin about the pole, {self.pole}, makes "
                "nothing in the contact slip, so that no spin has this moment: give the spin"
            )

    def doubts(self, grid: Any, found: Any) -> tuple[str, ...]:
        """Return warnings about creepages, and about a moment with a large lateral force."""
        about = examine_creepages(np.ravel(found.creepages).tolist(), found.area)
        moment = self.loads[2]
        if moment is None or not found.area:
            return about
        bound = np.where(np.isfinite(found.bound), found.bound, 0.0)
        most = grid.area * grid.vectors.sum(bound * size(_arms(grid, self.pole)[2]))
        off = 0.5 * grid.element[0] * abs(float(found.force[1]))
        return about + examine_moment(moment, off, most, found.stick_area / found.area)

    def rigid_slip(self, grid: Any) -> Array:
        """Return the rigid slip, divided by the distance rolled, of everything given (Eq. 1)."""
        units = unit_slips(grid, self.pole)
        w = np.zeros_like(units[0])
        for value, unit in zip(self.creepages, units, strict=False):
            if value:
                w += value * unit
        return w if self.slip is None else w + self.slip

    def largest_slip(self, grid: Any, contact: Array) -> float:
        """Return the sum of the largest rigid slips in contact of all given parts.

        It is zero if only creepages are given, since these do not cancel.
        """
        if self.slip is None and not self.unknown:
            return 0.0  # Saves time for small problems.
        given = [
            (abs(value), unit)
            for value, unit in zip(self.creepages, unit_slips(grid, self.pole), strict=False)
            if value
        ]
        if self.slip is not None:
            given.append((1.0, self.slip))
        return sum(
            value * float(grid.vectors.max(np.where(contact, size(unit), 0.0)))
            for value, unit in given
        )

    def units(self, grid: Any) -> Array:
        """Return the rigid slip over the distance rolled, per unit of each unknown creepage."""
        return self._stack(unit_slips(grid, self.pole))

    def arms(self, grid: Any) -> Array:
        """Return the fields whose inner products with the tractions are the given loads."""
        return grid.area * self._stack(_arms(grid, self.pole))

    def work(self, grid: Any, q: Array, creepages: Array) -> tuple[Array, float]:
        """Return the forces and, on a surface, the moment of tractions, and the dissipated power.

        The power is that of the loads with the creepages, divided by the rolling speed. In the
        steady state it equals the dissipation by slip, and is far more accurate than the sum of
        q·s, whose terms at the trailing edge are large and of both signs.
        """
        arms = _arms(grid, self.pole)
        loads = np.array([grid.area * grid.vectors.sum(q * arm) for arm in arms])
        power = -float(loads @ creepages[: len(loads)])
        if self.slip is not None:
            for traction, w in zip(q, self.slip, strict=True):
                behind = _half_behind(grid.lines(w, 0))
                power -= grid.area * grid.vectors.sum(grid.lines(traction, 0) * behind)
        return loads, power

    def complete(self, found: Array) -> Array:
        """Return all creepages, with the found ones inserted."""
        creepages = list(self.creepages)
        for k, value in zip(self.unknown, found.tolist(), strict=True):
            creepages[k] = value
        return np.array(creepages, dtype=np.float64)

    def _stack(self, fields: tuple[Array, ...]) -> Array:
        """Return the fields of the unknown creepages, of shape (m, components, ...)."""
        if not self.unknown:
            return np.zeros((0, *fields[0].shape))
        return np.stack([fields[k] for k in self.unknown])


@keep
def unit_slips(grid: Any, pole: tuple[float, float]) -> tuple[Array, ...]:
    """Return the rigid slip, divided by the distance rolled, per unit of each creepage.

    On a surface the last one is the spin.
    """
    centres = np.meshgrid(*grid.centres(), indexing="ij")
    units = list(np.zeros((grid.components, grid.components, *centres[0].shape)))
    for k, unit in enumerate(units):
        unit[k] = 1.0
    if len(centres) == 2:
        x, y = (r - p for r, p in zip(centres, pole, strict=True))
        units.append(np.stack([-y, x]))
    for unit in units:
        unit.flags.writeable = False
    return tuple(units)


def _arms(grid: Any, pole: tuple[float, float]) -> tuple[Array, ...]:
    """Return the fields whose inner products with the tractions, times the area, are the loads."""
    *units, last = unit_slips(grid, pole)
    if len(units) < 2:
        return *units, last
    return *units, last - 0.5 * grid.element[0] * units[1]


def _half_behind(w: Array) -> Array:
    """Return a field half an element behind along the last axis, for the arm of the moment."""
    before = 2.0 * w[..., :1] - w[..., 1:2] if w.shape[-1] > 1 else w
    return 0.5 * (w + np.concatenate([before, w[..., :-1]], axis=-1))


def _read_force(is_line: bool, force: Any) -> tuple[float | None, float | None]:
    """Return the forces along x and y; None if not given."""
    if force is None:
        return None, None
    if is_line and np.ndim(refuse_masked("force", force)) == 0:
        return force, None
    try:
        x, y = force
    except (TypeError, ValueError):
        wanted = "(Fx, Fy), or in line contact a number" if is_line else "(Fx, Fy)"
        raise ValueError(
            f"the tangential force is {force}, but must be {wanted}, with None for a component "
            "whose creepage is given"
        ) from None
    return x, y


def _read_slip(shape: tuple[int, ...], slip: ArrayLike) -> Array:
    """Return a field of rigid slip with its components first."""
    w = field("slip", in_order("slip", slip), "")
    allowed = [(2, *shape)]
    if len(shape) == 1:
        allowed.append(shape)
    if w.shape not in allowed:
        wanted = " or ".join(map(str, allowed))
        raise ValueError(f"slip has shape {w.shape}, but must have {wanted}")
    if not np.isfinite(w).all():
        raise ValueError("slip has values that are not finite")
    return w if w.shape == allowed[0] else w[None]
