"""What bodies that are pressed together have for an answer."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.results import files
from toeplitz_mg.contact.results.base import Figure, GridResult, Summary, list_figures
from toeplitz_mg.contact.results.consistency import Rule
from toeplitz_mg.contact.results.quantities import ENERGY, TOGETHER, Quantity, is_whole
from toeplitz_mg.halfspace import CombinedMaterial
from toeplitz_mg.values import positive


class Slope(float):
    """A number that belongs to the pressures of a result, which a copy with others has not."""

    of: tuple[Any, ...]


class OnDemand:
    """A number of a dataclass, or a function that computes it when it is first asked for."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: Any, owner: type) -> float | None:
        if instance is None:
            return None  # The default.
        value = vars(instance)[self._name]
        if value is not None and not isinstance(value, Slope):
            value = Slope(value() if callable(value) else value)
            value.of = find_state(instance)
            vars(instance)[self._name] = value
        return value

    def __set__(self, instance: Any, value: float | Callable[[], float] | None) -> None:
        if isinstance(value, Slope):  # It is of the result that `dataclasses.replace` copies.
            same = map(np.array_equal, value.of, find_state(instance))
            value = value if all(same) else None
        vars(instance)[self._name] = value


def find_state(result: Any) -> tuple[Any, ...]:
    """Return what a stiffness belongs to: where the bodies touch, and which they are."""
    m = result.material
    return result.pressure, result.element, result.periodic, (m.G, m.nu)


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
        of copies with the rows of one rank, and of those with other pressures or bodies.
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
    stiffness: Annotated[OnDemand, Quantity("stiffness", beyond="inf")] = OnDemand()
    products: Annotated[int, Quantity("", kind="i")] = 0
    work: float = 0.0
    iterations: tuple[int, ...] = ()
    residual: Annotated[float, Quantity("")] = 0.0
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

    def conductance(self, k1: float, k2: float) -> float:
        """Return the electrical or thermal conductance of the contact, by its stiffness.

        Parameters
        ----------
        k1, k2 : float
            The conductivities of the two bodies: in S/m, or in W/(m K).

        Returns
        -------
        float
            C = 2 (dF/dδ) / (E* (1/k₁ + 1/k₂)), in S or in W/K: zero without contact. 1/C is the
            resistance between bodies that conduct as half-spaces, through the contact alone and no
            film; where the surface repeats along both axes, what is added to that of bodies that
            touch everywhere (Barber, Proc. R. Soc. Lond. A 459, 2003).

        Raises
        ------
        ValueError
            In line contact, also where the surface repeats along one of two axes; without a
            `stiffness`; and where elements have yielded, as these conduct, but bear no more load.

        Examples
        --------
        One round spot of radius a has Holm's resistance, (1/k₁ + 1/k₂)/(4 a):

        >>> from toeplitz_mg.contact import Material, normal_contact, surfaces
        >>> copper, element = Material(E=120000.0, nu=0.34), (0.01, 0.01)
        >>> gap = surfaces.sphere((64, 64), element, radius=10.0)
        >>> pressed = normal_contact(gap, element, material=copper, force=20.0)
        >>> a = (pressed.area / 3.14159) ** 0.5  # mm
        >>> C = pressed.conductance(58e6, 58e6)  # S
        >>> bool(abs(C * (2 / 58e6) / (4e-3 * a) - 1) < 0.02)
        True
        """
        rho = 1.0 / positive("k1", k1) + 1.0 / positive("k2", k2)
        if len(self.element) == 1 or sum(self.periodic) == 1:
            raise ValueError(
                f"element is {self.element} and periodic {self.periodic}, a line contact, but only "
                "an area has a conductance between points that are far away"
            )
        if self.plastic is not None and self.plastic.any():
            raise ValueError(
                f"plastic is above zero in {self._yields}, but must be zero: elements that yield "
                "conduct, but have no part in the stiffness"
            )
        if self.stiffness is None:
            raise ValueError("stiffness is None, but must be known: use normal_contact")
        return 2e-3 * self.stiffness / (self.material.E_star * rho)  # In mm, of k per metre.

    def _rules(self) -> Iterator[Rule]:
        p, C, k = self.pressure, self.contact, vars(self)["stiffness"]
        yield from super()._rules()
        yield Rule("contact", np.array_equal(C, p > 0.0), "where pressure is positive")
        yield Rule("gap", bool(np.isfinite(self.gap[C]).all()), "finite in contact")
        yield Rule("stiffness", k is None or callable(k) or k >= 0.0, "at least zero")
        most = p.max(initial=0.0)
        yield Rule.of_sum("max_pressure", self.max_pressure, most, most, "the largest of pressure")

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
            self, "force", "approach", *on_demand, "area",
            Figure("share of the grid", share, "%", "contact_fraction"),
            Figure("mean pressure", mean, "N/mm²", "mean_pressure"), "max_pressure",
            Figure("yields", self._yields), "energy",
        )  # fmt: skip
