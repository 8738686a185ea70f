"""What bodies that shift or roll on each other have for an answer."""

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
    """Two bodies that shift or roll on each other: tractions, slip, areas of stick and of slip.

    Fields have the shape of the grid, and cannot be written to; those with a direction have on a
    surface the components x and y first, (2, n1, n2).

    Attributes
    ----------
    material : CombinedMaterial
        Of the two bodies together; `material=` of all functions takes it.
    shape : tuple of int
        The elements of the grid along each axis.
    element : tuple of float
        Size of an element, mm.
    centres : tuple of ndarray
        The centres of the elements along each axis, mm (see `x` and `y`).
    traction : ndarray
        The tangential tractions, N/mm².
    slip : ndarray
        The slip (Eq. 1): along minus the traction where the bodies slide, zero where they stick.
        It is in mm, in rolling over the distance rolled, dimensionless.
    displacement : ndarray
        The displacement of both bodies together along the tractions, mm, in rolling too. It is
        given, as the slip is, in contact only, and zero elsewhere.
    bound : ndarray
        The traction bound g, N/mm².
    contact : ndarray of bool
        Where the bodies touch: the traction bound is positive, and at least 1e-15 of the largest,
        as tractions that are less are rounding.
    stick : ndarray of bool
        Where the bodies stick.
    area : float
        The area of contact, mm²; in plane strain its width, mm.
    stick_area : float
        The part of it where the bodies stick.
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
        In friction, the sum of that shift and those of all results before it; None in rolling.
    creepages : float, ndarray or None
        In rolling, the creepages (longitudinal, lateral, spin), the first two dimensionless, the
        spin in 1/mm, and in line contact that is rolled along x alone the longitudinal one; None in
        friction.
    moment : float or None
        The moment of the tractions, N mm, about the middle of the grid; in rolling about the pole,
        with the arm x - h/2, as the slip by a spin belongs half an element ahead of where it
        stands: the moment of the tractions themselves is ``moment + h / 2 * force[1]``. None in
        line contact.
    power : float
        What slip dissipates. In `rolling` the power over the speed, N, from forces and creepages:
        in the steady state it is more exact than the sum of -q·s over the elements that slide, but
        with spin on an element or two it may even be negative. That sum it is in `rolling_steps`,
        where the bodies store a part of the other. In friction it is the work of the slip since
        the previous tractions, N mm, in plane strain N: that sum too, exact where each element
        slides one way under the bound that it has now.
    products : int
        Products with the matrix of the smallest rectangle around the elements in contact.
    work : float
        All work, that on coarser grids, in preconditioners and in transforms of coefficients
        too, in such products.
    iterations : tuple of int
        Iterations of the Krylov method on this grid, between two changes of the areas; in steady
        rolling all steps, first those with the matrix as an array, where there were such.
    residual : float
        The largest violation of Coulomb's law, at most the tolerance. It is relative, in friction
        to the largest displacement that there would be without slip, or was before, or that by
        the mean traction on one element where a force is given, if that is larger; in steady
        rolling to the largest rigid slip, and in a step of rolling to what would be without slip,
        if that is larger. Zero where a force of μ P lets all slide: tractions along it are those
        after a long way, and not yet at the shift that is returned, unless ν = 0.
    warnings : tuple of str
        Why the answer may not be of the problem that was meant, each of which is a
        `ContactWarning` too.

    See Also
    --------
    NormalResult : of bodies that are pressed together.
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

    # What only normal contact has.
    gap: ClassVar[None] = None

    @property
    def sliding(self) -> Array:
        """Where the bodies slide on each other."""
        return self.contact & ~self.stick

    @property
    def magnitude(self) -> Array:
        """The size of the traction in each element, N/mm²."""
        is_vector = self.traction.ndim > self.contact.ndim
        return np.hypot(*self.traction) if is_vector else np.abs(self.traction)

    @property
    def dissipation(self) -> Array:
        """What slip dissipates in each element over its area, -q·s, as wear is in proportion to.

        In rolling it is over the distance rolled, N/mm², and in friction N/mm.
        """
        lost = np.where(self.sliding, 0.0 - self.traction * self.slip, 0.0)
        density: Array = lost.sum(axis=0) if lost.ndim > self.contact.ndim else lost
        return density

    @property
    def rigid(self) -> Any:
        """The shift, or the creepages, by the name that they share with an approach."""
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
        # A moment that is rounding of its parts is none.
        arm = 0.5 * max(h * n for h, n in zip(self.element, self.shape, strict=False))
        largest = arm * prod(self.element) * float(self.magnitude.sum())
        moment = 0.0 if abs(self.moment or 0.0) <= NOTHING * largest else self.moment
        name, unit = "power over speed" if is_rolling else "work of slip", name_units(self)["power"]
        lost = (
            Figure("moment", None if self.moment is None else moment, "N mm"),
            Figure(name, self.power, unit),
        )
        is_field = np.size(self.shift) > 2 or np.ndim(self.shift) > 1  # It may be of one element.
        return list_figures(
            self, "force", Figure("creepages", creepages), Figure("spin", spin, "1/mm"),
            Figure("shift", "a field" if is_field else self.shift, "mm"),
            *(lost if is_rolling else ()), "area", "stick_area",
            *(() if is_rolling else lost), "energy",
        )  # fmt: skip
