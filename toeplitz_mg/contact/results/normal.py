"""Results of normal contact."""

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
    """A stiffness that is valid for the pressures of one result only."""

    of: tuple[Any, ...]


class OnDemand:
    """A number of a dataclass, or a function that computes it on first access."""

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
        if isinstance(value, Slope):  # `dataclasses.replace` passes that of another result.
            same = map(np.array_equal, value.of, find_state(instance))
            value = value if all(same) else None
        vars(instance)[self._name] = value


def find_state(result: Any) -> tuple[Any, ...]:
    """Return what a stiffness depends on: the elements in contact and the bodies."""
    return result.pressure, result.element, result.periodic, result.material


@files.loadable
@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class NormalResult(GridResult):
    """Two bodies pressed together: pressures, gap, contact area, force and approach.

    Fields have the shape of the grid, (n,) or (n1, n2), and are read-only.

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
    pressure : ndarray
        The pressures, N/mm²; also named `traction`.
    gap : ndarray
        The gap under load, mm: at least zero, and zero in contact, within `residual` of the
        largest interference.
    displacement : ndarray
        Displacement of both bodies together in the direction of the pressure, mm.
    contact : ndarray of bool
        Elements in contact: where the pressure is positive.
    area : float
        The area of contact, mm²; in plane strain its width, mm.
    force : float
        The normal force, N; in plane strain N per mm of length.
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
        If a hardness was given, the plastic depth of each element, mm; for a `load_curve` after all
        loads so far.
    stiffness : float or None
        dF/dδ, the derivative of the force by the approach, N/mm; in plane strain N/mm². It is
        computed on first access, with a few products. None for unlike bodies with friction, for
        copies that have the rows of one rank, and for copies with other pressures or bodies.
    products : int
        Matrix-vector products on this grid.
    work : float
        Total work in units of such a product, including coarser grids, preconditioners and
        transforms of coefficients.
    iterations : tuple of int
        Iterations of conjugate gradients on this grid, between successive changes of the area.
    residual : float
        The largest violation of the conditions of contact, relative to the largest interference; at
        most the tolerance.
    warnings : tuple of str
        Reasons to doubt that the input is what was meant: the grid is too small or too coarse, a
        unit or a sign is wrong, or pressures and slopes are beyond the theory. Each was also issued
        as a `ContactWarning`.

    See Also
    --------
    TangentialResult : the result of friction and rolling.
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

    # Attributes of tangential contact only.
    slip: ClassVar[None] = None
    stick: ClassVar[None] = None
    sliding: ClassVar[None] = None
    bound: ClassVar[None] = None

    _title: ClassVar[str] = "Normal contact"

    @property
    def traction(self) -> Array:
        """The pressures, N/mm²; the same name as for tangential tractions."""
        return self.pressure

    @property
    def magnitude(self) -> Array:
        """The magnitude of the traction in each element, N/mm²: here the pressures."""
        return self.pressure

    @property
    def rigid(self) -> float:
        """The approach, mm; the same name as for shifts and creepages."""
        return self.approach

    @property
    def mean_pressure(self) -> float:
        """The mean pressure in contact, N/mm²; zero without contact."""
        return self.force / self.area if self.area else 0.0

    def conductance(self, k1: float, k2: float) -> float:
        """Return the electrical or thermal conductance of the contact from its stiffness.

        Parameters
        ----------
        k1, k2 : float
            The conductivities of the two bodies, in S/m or in W/(m K).

        Returns
        -------
        float
            C = 2 (dF/dδ) / (E* (1/k₁ + 1/k₂)), in S or W/K (Barber, Proc. R. Soc. Lond. A 459,
            2003). It is zero without contact. 1/C is the resistance of conducting half-spaces
            joined at the contact only, without a film. If the surface repeats along both axes, 1/C
            is added to the resistance of bodies that touch everywhere.

        Raises
        ------
        ValueError
            In line contact, or if the surface repeats along one of two axes; without a `stiffness`;
            and if elements have yielded, as these conduct but carry no additional load.

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
        return 2e-3 * self.stiffness / (self.material.E_star * rho)  # k is per metre.

    def _rules(self) -> Iterator[Rule]:
        p, C, k = self.pressure, self.contact, vars(self)["stiffness"]
        yield from super()._rules()
        yield Rule("contact", np.array_equal(C, p > 0.0), "where pressure is positive")
        yield Rule("gap", bool(np.isfinite(self.gap[C]).all()), "finite in contact")
        yield Rule("stiffness", k is None or callable(k) or k >= 0.0, "at least zero")
        most = p.max(initial=0.0)
        yield Rule.of_sum("max_pressure", self.max_pressure, most, most, "the largest of pressure")

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to pickle or copy, without values that only all ranks can compute."""
        state = dict(vars(self))
        if callable(state["stiffness"]) and not is_whole(self):
            state["stiffness"] = None
        return state

    def _summary(self) -> Summary:
        # With several ranks, computing the stiffness takes all of them.
        return super()._summary()._replace(figures=self._figures(*("stiffness",) * is_whole(self)))

    @property
    def _yields(self) -> str | None:
        """The number of elements that yield, as text, if a hardness was given."""
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
