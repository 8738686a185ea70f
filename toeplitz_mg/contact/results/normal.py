"""What bodies that are pressed together have for an answer."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.results import files
from toeplitz_mg.contact.results.base import Figure, GridResult, Summary, list_figures
from toeplitz_mg.contact.results.quantities import ENERGY, TOGETHER, Quantity, is_whole
from toeplitz_mg.halfspace import CombinedMaterial


class OnDemand:
    """A number of a dataclass, or a function that computes it when it is first asked for."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: Any, owner: type) -> float | None:
        if instance is None:
            return None  # The default.
        value = vars(instance)[self._name]
        if callable(value):
            value = vars(instance)[self._name] = value()
        return value

    def __set__(self, instance: Any, value: float | Callable[[], float] | None) -> None:
        vars(instance)[self._name] = value


@files.loadable
@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class NormalResult(GridResult):
    """Two bodies that are pressed together: pressures, gap, area, force, and what they cost.

    Fields have the shape of the grid, (n,) or (n1, n2), and cannot be written to.

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
    pressure : ndarray
        The pressures, N/mm²; also named `traction`.
    gap : ndarray
        The gap under load, mm: at least zero, and zero in contact, within `residual` of the
        largest interference.
    displacement : ndarray
        The displacement of both bodies together along the pressure, mm.
    contact : ndarray of bool
        Where the bodies touch: the pressure is positive.
    area : float
        The area of contact, mm²; in plane strain its width, mm.
    force : float
        The force that presses, N; in plane strain N per mm of length.
    approach : float
        The approach of the bodies, mm; also named `rigid`.
    max_pressure : float
        The largest pressure, N/mm².
    energy : float
        The elastic energy ½ ∫ p u of both bodies, N mm; in plane strain N.
    touches_edge : bool
        Whether the contact reaches an edge of the grid.
    periodic : tuple of bool
        Along which axes the surface repeats.
    plastic : ndarray or None
        Where a hardness was given, the depth by which elements have yielded, mm; of a
        `load_curve` under all loads so far.
    stiffness : float or None
        The change of the force by that of the approach, N/mm; in plane strain N/mm². It is
        computed when it is first asked for, by a few products. None of unlike bodies with friction,
        and of copies with the rows of one rank.
    products : int
        Products with the matrix of this grid.
    work : float
        All work, that on coarser grids, in preconditioners and in transforms of coefficients
        too, in such products.
    iterations : tuple of int
        Iterations of conjugate gradients on this grid, between two changes of the area.
    residual : float
        The largest violation of the conditions of contact, over the largest interference: at most
        the tolerance.
    warnings : tuple of str
        Why the answer may not be of the problem that was meant, each of which is a
        `ContactWarning` too: the grid too small or too coarse, a unit or a sign mistaken, or
        pressures and slopes beyond the theory.

    See Also
    --------
    TangentialResult : of friction and rolling.
    """

    material: CombinedMaterial
    shape: tuple[int, ...]
    element: Annotated[tuple[float, ...], Quantity("mm")]
    centres: tuple[Array, ...]
    pressure: Annotated[Array, Quantity("N/mm²", "grid", shades="YlOrRd")]
    gap: Annotated[Array, Quantity("mm", "grid", beyond="inf", shades="Blues")]
    displacement: Annotated[Array, Quantity("mm", "grid", label=TOGETHER, shades="Greens")]
    contact: Annotated[Array, Quantity("1", "grid", "b")]
    area: Annotated[float, Quantity("area", label="contact")]
    force: Annotated[float, Quantity("force")]
    approach: Annotated[float, Quantity("mm")]
    max_pressure: Annotated[float, Quantity("N/mm²", label="largest pressure")]
    energy: Annotated[float, Quantity("energy", label=ENERGY)]
    touches_edge: bool
    periodic: tuple[bool, ...] = ()
    plastic: Annotated[Array | None, Quantity("mm", "grid", shades="Purples")] = None
    stiffness: Annotated[OnDemand, Quantity("stiffness")] = OnDemand()
    products: int = 0
    work: float = 0.0
    iterations: tuple[int, ...] = ()
    residual: float = 0.0
    warnings: tuple[str, ...] = ()

    # What only tangential contact has.
    slip: ClassVar[None] = None
    stick: ClassVar[None] = None
    sliding: ClassVar[None] = None
    bound: ClassVar[None] = None

    _title: ClassVar[str] = "Normal contact"

    @property
    def traction(self) -> Array:
        """The pressures, N/mm², by the name that they share with tangential tractions."""
        return self.pressure

    @property
    def magnitude(self) -> Array:
        """The size of the traction in each element, N/mm²: here the pressures."""
        return self.pressure

    @property
    def rigid(self) -> float:
        """The approach, mm, by the name that it shares with a shift and creepages."""
        return self.approach

    @property
    def mean_pressure(self) -> float:
        """The mean pressure in contact, N/mm²; zero where nothing touches."""
        return self.force / self.area if self.area else 0.0

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled, or copied: without what only all ranks compute, together."""
        state = dict(vars(self))
        if callable(state["stiffness"]) and not is_whole(self):
            state["stiffness"] = None
        return state

    def _summary(self) -> Summary:
        # On several ranks all have to ask for the stiffness.
        return super()._summary()._replace(figures=self._figures(*("stiffness",) * is_whole(self)))

    @property
    def _yields(self) -> str | None:
        """How many elements yield, in words, where a hardness was given."""
        if self.plastic is None:
            return None
        count = int((self.plastic > 0.0).sum())
        return f"{count} element{'s' * (count != 1)}, by {self.plastic.max():.5g} mm at most"

    def _figures(self, *on_demand: str) -> list[Figure]:
        share, mean = 100.0 * self.contact_fraction, self.mean_pressure
        return list_figures(
            self, "force", "approach", *on_demand, "area", Figure("share of the grid", share, "%"),
            Figure("mean pressure", mean, "N/mm²"), "max_pressure",
            Figure("yields", self._yields), "energy",
        )  # fmt: skip
