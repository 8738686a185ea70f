"""Results of friction and rolling."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from typing import Annotated, Any, ClassVar

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.results import files
from toeplitz_mg.contact.results.base import NOTHING, Figure, GridResult, list_figures
from toeplitz_mg.contact.results.consistency import Rule
from toeplitz_mg.contact.results.quantities import ENERGY, TOGETHER, VECTORS, Quantity, name_units
from toeplitz_mg.halfspace import CombinedMaterial


@files.loadable
@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class TangentialResult(GridResult):
    """Two bodies that shift or roll on each other: tractions, slip, areas of stick and slip.

    Fields have the shape of the grid and are read-only. On a surface, vector fields have shape (2,
    n1, n2), with the components x and y first.

    Attributes
    ----------
    material : CombinedMaterial
        Combined constants of the two bodies; other functions take it as ``material=``.
    shape : tuple of int
        Number of elements along each axis.
    element : tuple of float
        Size of an element, mm.
    centres : tuple of ndarray
        The centres of the elements along each axis, mm (see `x` and `y`).
    traction : ndarray
        The tangential tractions, N/mm².
    slip : ndarray
        The slip (Eq. 1): opposite to the traction where the bodies slide, zero where they stick. In
        mm for friction; for rolling divided by the distance rolled, dimensionless.
    displacement : ndarray
        Displacement of both bodies together along x and y, mm, in rolling too. Both slip and
        displacement are zero outside the contact.
    bound : ndarray
        The traction bound g, N/mm².
    contact : ndarray of bool
        Elements in contact: where the traction bound is positive, and at least 1e-15 of its
        maximum.
    stick : ndarray of bool
        Where the bodies stick.
    area : float
        The area of contact, mm²; in plane strain its width, mm.
    stick_area : float
        The part of the area where the bodies stick.
    force : float or ndarray of shape (2,)
        The sum of the tractions, N; in plane strain N per mm of length.
    energy : float
        The elastic energy ½ ∫ q u of both bodies, N mm; in plane strain N.
    touches_edge : bool
        Whether the contact reaches an edge of the grid.
    periodic : tuple of bool
        Along which axes the surface repeats.
    shift : float, ndarray or None
        In friction, the rigid shift of the bodies since the previous tractions, mm; None in
        rolling.
    total_shift : float, ndarray or None
        In friction, the sum of this shift and those of all previous results; None in rolling.
    creepages : float, ndarray or None
        In rolling, the creepages (longitudinal, lateral, spin): the first two are dimensionless,
        the spin is in 1/mm. In line contact rolled along x only, the longitudinal creepage. None in
        friction.
    moment : float or None
        The moment of the tractions about the middle of the grid, N mm. In rolling it is about the
        pole, with the arm x - h/2, since the slip of an element due to spin belongs to the point
        half an element ahead. The moment with the arm x is ``moment + h / 2 * force[1]``. None in
        line contact.
    power : float
        The dissipated power or work. In `rolling`, the power divided by the speed, N, from forces
        and creepages. In the steady state this is more exact than the sum of -q·s over the sliding
        elements, but with spin on one or two elements it may be negative. In `rolling_steps` it is
        that sum, as the bodies also store energy. In friction that sum is the work of the slip
        since the previous tractions, N mm; in plane strain N. It is exact if each element slides in
        one direction under its present bound.
    products : int
        Products with the matrix for the smallest rectangle around the elements in contact.
    work : float
        Total work in units of such a product, including coarser grids, preconditioners and
        transforms of coefficients.
    iterations : tuple of int
        Iterations of the Krylov method on this grid, between successive changes of the areas. In
        steady rolling, all steps; those with the matrix stored as an array come first.
    residual : float
        The largest relative violation of Coulomb's law, at most the tolerance. In friction it is
        relative to the largest displacement without slip, now or before, or, if a force is given,
        to the displacement of one element by the mean traction if that is larger. In steady rolling
        it is relative to the largest rigid slip; in a step of rolling to the displacement without
        slip, if that is larger. It is zero if a force of μ P makes all elements slide: the
        tractions are then those after a long way, which the returned shift reaches only if ν = 0.
    warnings : tuple of str
        Reasons to doubt that the input is what was meant. Each was also issued as a
        `ContactWarning`.

    See Also
    --------
    NormalResult : the result of normal contact.
    """

    material: CombinedMaterial
    shape: tuple[int, ...]
    element: Annotated[tuple[float, ...], Quantity("mm")]
    centres: tuple[Array, ...]
    traction: Annotated[Array, Quantity("N/mm²", VECTORS, shades="Blues Oranges")]
    slip: Annotated[Array, Quantity("slip", VECTORS, beyond="nan", shades="Oranges")]
    displacement: Annotated[Array, Quantity("mm", VECTORS, label=TOGETHER, shades="Greens")]
    bound: Annotated[Array, Quantity("N/mm²", "grid", beyond="inf")]
    contact: Annotated[Array, Quantity("1", "grid", "b")]
    stick: Annotated[Array, Quantity("1", "grid", "b")]
    area: Annotated[float, Quantity("area", label="contact")]
    stick_area: Annotated[float, Quantity("area", label="of which sticks")]
    force: Annotated[Any, Quantity("force", "2")]
    energy: Annotated[float, Quantity("energy", label=ENERGY)]
    touches_edge: bool
    periodic: tuple[bool, ...] = ()
    shift: Annotated[Any, Quantity("mm", f"2 | {VECTORS}")] = None
    total_shift: Annotated[Any, Quantity("mm", f"2 | {VECTORS}")] = None
    creepages: Annotated[Any, Quantity("creepages", "3", beyond="nan")] = None
    moment: Annotated[float | None, Quantity("N mm")] = None
    power: Annotated[float, Quantity("loss", beyond="nan")] = 0.0
    products: Annotated[int, Quantity("", kind="i")] = 0
    work: float = 0.0
    iterations: tuple[int, ...] = ()
    residual: Annotated[float, Quantity("")] = 0.0
    warnings: tuple[str, ...] = ()

    # Attributes of normal contact only.
    gap: ClassVar[None] = None

    @property
    def sliding(self) -> Array:
        """Elements in contact where the bodies slide."""
        return self.contact & ~self.stick

    @property
    def magnitude(self) -> Array:
        """The magnitude of the traction in each element, N/mm²."""
        is_vector = self.traction.ndim > self.contact.ndim
        return np.hypot(*self.traction) if is_vector else np.abs(self.traction)

    @property
    def dissipation(self) -> Array:
        """The energy -q·s dissipated in each element, per area, to which wear is proportional.

        N/mm in friction; in rolling divided by the distance rolled, N/mm².
        """
        lost = np.where(self.sliding, 0.0 - self.traction * self.slip, 0.0)
        density: Array = lost.sum(axis=0) if lost.ndim > self.contact.ndim else lost
        return density

    @property
    def rigid(self) -> Any:
        """The shift or the creepages; the same name as for the approach."""
        return self.shift if self.creepages is None else self.creepages

    @property
    def _title(self) -> str:
        return "Friction" if self.creepages is None else "Rolling"

    def _rules(self) -> Iterator[Rule]:
        C, s, moves = self.contact, self.slip, self.creepages is None
        yield from super()._rules()
        yield Rule("contact", np.array_equal(C, self.bound > 0.0), "where bound is positive")
        yield Rule("bound", not (self.bound < 0.0).any(), "at least zero")
        yield Rule("stick", not (self.stick & ~C).any(), "in contact only")
        area, sticks = prod(self.element), self.stick.sum()
        yield Rule.of_sum("stick_area", self.stick_area, area * sticks, self.area, "that of stick")
        wanted = "given in friction, and None in rolling"
        yield Rule("shift", (self.shift is not None) == moves, wanted)
        yield Rule("total_shift", (self.total_shift is not None) == moves, wanted)
        yield Rule("moment", (self.moment is None) == (len(self.shape) == 1), "that of an area")
        unknown = not moves and bool(np.isnan(self.creepages).any())
        there = bool(np.isnan(s[..., C]).any()) == (unknown and bool(C.any()))
        yield Rule("slip", there, "finite, unless creepages are nan")
        yield Rule("power", unknown or not np.isnan(self.power), "finite, unless creepages are nan")
        if moves:
            terms = area * self.traction * np.where(self.sliding, s, 0.0)
            work, size = 0.0 - terms.sum(), np.abs(terms).sum()
            yield Rule.of_sum("power", self.power, work, size, "the work of slip by traction")
        if moves and self.moment is not None:
            x, y = np.meshgrid(*self.centres, indexing="ij", sparse=True)
            along, across = area * self.traction
            turning = x * across - y * along
            exact, size = turning.sum(), np.abs(turning).sum()
            yield Rule.of_sum("moment", self.moment, exact, size, "that of traction")

    def _figures(self) -> list[Figure]:
        is_rolling = self.creepages is not None
        creepages, spin = self.creepages, None
        if is_rolling and np.size(creepages) == 3:
            *creepages, spin = creepages
        # A moment within rounding of its terms is shown as zero.
        arm = 0.5 * max(h * n for h, n in zip(self.element, self.shape, strict=False))
        largest = arm * prod(self.element) * float(self.magnitude.sum())
        moment = 0.0 if abs(self.moment or 0.0) <= NOTHING * largest else self.moment
        name, unit = "power over speed" if is_rolling else "work of slip", name_units(self)["power"]
        lost = (
            Figure("moment", None if self.moment is None else moment, "N mm"),
            Figure(name, self.power, unit),
        )
        is_field = np.size(self.shift) > 2 or np.ndim(self.shift) > 1  # May have one element.
        return list_figures(
            self, "force", Figure("creepages", creepages), Figure("spin", spin, "1/mm"),
            Figure("shift", "a field" if is_field else self.shift, "mm"),
            *(lost if is_rolling else ()), "area", "stick_area",
            *(() if is_rolling else lost), "energy",
        )  # fmt: skip
