"""What contact problems have for answers, and the error where they have none."""

import os
from collections.abc import Callable
from dataclasses import dataclass, fields
from math import prod
from typing import Any, ClassVar, TypeVar

import numpy as np

from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.contact import plotting, saving
from toeplitz_mg.contact.summary import (
    Figure,
    describe_cost,
    describe_grid,
    list_figures,
    shorten,
    tabulate_figures,
)
from toeplitz_mg.contact.units import units_of
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


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class NormalResult:
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
    displacement : ndarray
        The displacement of both bodies together along the pressure, mm.
    gap : ndarray
        The gap under load, mm: at least zero, and zero in contact, within `residual` of the
        largest interference.
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
        Where a hardness was given, the depth by which elements that bear it have yielded, mm.
    stiffness : float or None
        The change of the force by that of the approach, N/mm; in plane strain N/mm². It is
        computed when it is first asked for, by a few products.
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
    element: tuple[float, ...]
    centres: tuple[Array, ...]
    pressure: Array
    displacement: Array
    gap: Array
    contact: Array
    area: float
    force: float
    approach: float
    max_pressure: float
    energy: float
    touches_edge: bool
    periodic: tuple[bool, ...] = ()
    plastic: Array | None = None
    stiffness: OnDemand = OnDemand()
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

    def __post_init__(self) -> None:
        _protect(self)

    @property
    def x(self) -> Array:
        """The centres of the elements along the first axis, mm."""
        return self.centres[0]

    @property
    def y(self) -> Array | None:
        """The centres of the elements along the second axis, mm; None in line contact."""
        return self.centres[1] if len(self.centres) > 1 else None

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
    def contact_fraction(self) -> float:
        """The area of contact over that of the grid."""
        return self.area / (prod(self.shape) * prod(self.element))

    @property
    def mean_pressure(self) -> float:
        """The mean pressure in contact, N/mm²; zero where nothing touches."""
        return self.force / self.area if self.area else 0.0

    def plot(self, field: str | None = None, ax: Any = None) -> Any:
        """Draw the pressures, or another field.

        Parameters
        ----------
        field : str, optional
            "pressure", "gap" or "displacement"; by default the first.
        ax : matplotlib.axes.Axes, optional
            Where to draw, as beside other results; by default on a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ValueError
            Where there is no such field.
        ImportError
            Where matplotlib is not installed: ``pip install 'toeplitz-mg[plot]'``.
        """
        return plotting.draw(self, field, ax)

    save, to_xarray, to_vtk = saving.save, saving.to_xarray, saving.to_vtk
    summary, __repr__, _repr_html_ = list_figures, shorten, tabulate_figures

    def _summary(self) -> tuple[str, list[Figure], str, tuple[str, ...]]:
        title = f"Normal contact, {describe_grid(self.shape, self.element)}"
        figures = self._figures()
        stiffness = saving.split_fields(self)[1]["stiffness"]
        if stiffness is not None:
            figures.insert(2, Figure("stiffness", stiffness, units_of(self.element).stiffness))
        return title, figures, describe_cost(self.products, self.residual), self.warnings

    def _figures(self) -> list[Figure]:
        units = units_of(self.element)
        figures = [
            Figure("force", self.force, units.force),
            Figure("approach", self.approach, "mm"),
            Figure("contact", self.area, units.area),
            Figure("share of the grid", 100.0 * self.contact_fraction, "%"),
            Figure("mean pressure", self.mean_pressure, "N/mm²"),
            Figure("largest pressure", self.max_pressure, "N/mm²"),
            Figure("elastic energy", self.energy, units.energy),
        ]
        return [figure for figure in figures if figure.value is not None]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class TangentialResult:
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
    displacement : ndarray
        The displacement of both bodies together along the tractions, mm, in rolling too. It is
        given, as the slip is, in contact only, and zero elsewhere.
    slip : ndarray
        The slip (Eq. 1): along minus the traction where the bodies slide, zero where they stick.
        It is in mm, in rolling over the distance rolled, dimensionless.
    bound : ndarray
        The traction bound g, N/mm².
    contact : ndarray of bool
        Where the bodies touch: the traction bound is positive.
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
        In rolling, the moment of the tractions about the pole, N mm, with arms to the middle of a
        step, half an element ahead; None in friction and in line contact.
    power : float or None
        The power that slip dissipates, in rolling over the speed, N, from forces and creepages,
        which is exact in the steady state; in friction the work of this shift, N mm; None where it
        was not asked for.
    products : int
        Products with the matrix of the smallest rectangle around the elements in contact.
    work : float
        All work, that on coarser grids, in preconditioners and in transforms of coefficients
        too, in such products.
    iterations : tuple of int
        Iterations of the Krylov method on this grid, between two changes of the areas.
    residual : float
        The largest violation of Coulomb's law, at most the tolerance. It is relative, in friction
        to the largest displacement that there would be without slip, or was before; in steady
        rolling to the largest rigid slip, and in a step of rolling to what would be without slip,
        if that is larger.
    warnings : tuple of str
        Why the answer may not be of the problem that was meant, each of which is a
        `ContactWarning` too.

    See Also
    --------
    NormalResult : of bodies that are pressed together.
    """

    material: CombinedMaterial
    shape: tuple[int, ...]
    element: tuple[float, ...]
    centres: tuple[Array, ...]
    traction: Array
    displacement: Array
    slip: Array
    bound: Array
    contact: Array
    stick: Array
    area: float
    stick_area: float
    force: Any
    energy: float
    touches_edge: bool
    periodic: tuple[bool, ...] = ()
    shift: Any = None
    total_shift: Any = None
    creepages: Any = None
    moment: float | None = None
    power: float | None = None
    products: int = 0
    work: float = 0.0
    iterations: tuple[int, ...] = ()
    residual: float = 0.0
    warnings: tuple[str, ...] = ()

    # What only normal contact has.
    gap: ClassVar[None] = None

    def __post_init__(self) -> None:
        _protect(self)

    @property
    def x(self) -> Array:
        """The centres of the elements along the first axis, mm."""
        return self.centres[0]

    @property
    def y(self) -> Array | None:
        """The centres of the elements along the second axis, mm; None in line contact."""
        return self.centres[1] if len(self.centres) > 1 else None

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
    def rigid(self) -> Any:
        """The shift, or the creepages, by the name that they share with an approach."""
        return self.shift if self.creepages is None else self.creepages

    @property
    def contact_fraction(self) -> float:
        """The area of contact over that of the grid."""
        return self.area / (prod(self.shape) * prod(self.element))

    def plot(self, field: str | None = None, ax: Any = None) -> Any:
        """Draw the tractions where the bodies stick and where they slip, or another field.

        Parameters
        ----------
        field : str, optional
            "traction", "slip" or "displacement"; by default the first.
        ax : matplotlib.axes.Axes, optional
            Where to draw, as beside other results; by default on a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ValueError
            Where there is no such field.
        ImportError
            Where matplotlib is not installed: ``pip install 'toeplitz-mg[plot]'``.
        """
        return plotting.draw(self, field, ax)

    save, to_xarray, to_vtk = saving.save, saving.to_xarray, saving.to_vtk
    summary, __repr__, _repr_html_ = list_figures, shorten, tabulate_figures

    def _summary(self) -> tuple[str, list[Figure], str, tuple[str, ...]]:
        kind = "Friction" if self.creepages is None else "Rolling"
        title = f"{kind}, {describe_grid(self.shape, self.element)}"
        return title, self._figures(), describe_cost(self.products, self.residual), self.warnings

    def _figures(self) -> list[Figure]:
        units = units_of(self.element)
        is_rolling = self.creepages is not None
        creepages, spin = self.creepages, None
        if is_rolling and np.size(creepages) == 3:
            *creepages, spin = creepages
        figures = [
            Figure("force", self.force, units.force),
            Figure("creepages", creepages),
            Figure("spin", spin, "1/mm"),
            Figure("shift", "a field" if np.size(self.shift) > 2 else self.shift, "mm"),
            Figure("moment", self.moment, "N mm"),
            Figure("power over speed", self.power, units.force)
            if is_rolling
            else Figure("work of slip", self.power, units.energy),
            Figure("contact", self.area, units.area),
            Figure("of which sticks", self.stick_area, units.area),
            Figure("elastic energy", self.energy, units.energy),
        ]
        return [figure for figure in figures if figure.value is not None]


ContactResult = NormalResult | TangentialResult  # Of any contact problem.
KINDS = {kind.__name__: kind for kind in (NormalResult, TangentialResult)}
Result = TypeVar("Result", NormalResult, TangentialResult)


def load(path: str | os.PathLike[str]) -> ContactResult:
    """Read a result that `save` has written.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    NormalResult or TangentialResult

    Raises
    ------
    OSError
        Where there is no such file.
    ValueError
        Where it is another file than of `save`.

    See Also
    --------
    NormalResult.save, TangentialResult.save

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from toeplitz_mg import contact
    >>> steel, element = contact.Material(E=210000.0, nu=0.3), (0.01, 0.01)
    >>> gap = contact.surfaces.sphere((64, 64), element, radius=10.0)
    >>> pressed = contact.normal_contact(gap, element, material=steel, force=100.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "pressed.npz"
    ...     pressed.save(path)
    ...     again = contact.load(path)
    >>> again
    <NormalResult 64 x 64: force 100 N, approach 0.0034825 mm, contact 0.1116 mm²; 10 products>
    """
    return saving.load_result(path, KINDS)


class ContactError(RuntimeError):
    """The areas of contact, stick or slip were not found to the tolerance.

    Attributes
    ----------
    result : NormalResult or TangentialResult
        The last iterate, with its `residual`.

    See Also
    --------
    ContactWarning : doubt of an answer that was found.
    """

    def __init__(self, message: str, result: ContactResult) -> None:
        super().__init__(message)
        self.result = result


def check_converged(result: Result, tolerance: float) -> Result:
    """Return the result, or raise ContactError where it violates the conditions of contact."""
    if result.residual <= tolerance:
        return result
    law, scale = ("Coulomb's law is", "displacement, or rigid slip")
    if isinstance(result, NormalResult):
        law, scale = ("the conditions of contact are", "interference")
    raise ContactError(
        f"after {result.products} products {law} violated by {result.residual:.1e} of the largest "
        f"{scale}, but the tolerance is {tolerance:g}",
        result,
    )


def touches_edge(grid: Any, contact: Mask) -> bool:
    """Whether elements in contact are at an edge of the grid, along an axis of more than one."""
    return any(
        n > 1
        and not grid.periodic[axis]
        and grid.vectors.count(grid.lines(contact, axis)[..., [0, -1]])
        for axis, n in enumerate(grid.shape)
    )


def _protect(result: ContactResult) -> None:
    """Put views that cannot be written to in the place of the arrays."""
    for field in fields(result):
        value = vars(result)[field.name]  # What is computed on demand is not asked for here.
        if isinstance(value, np.ndarray):
            value = _read_only(value)
        elif isinstance(value, tuple):
            value = tuple(_read_only(x) if isinstance(x, np.ndarray) else x for x in value)
        object.__setattr__(result, field.name, value)


def _read_only(x: Array) -> Array:
    view = x.view()
    view.flags.writeable = False
    return view
