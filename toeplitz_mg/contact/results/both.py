"""Results of frictional contact of unlike materials."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.results import files, pictures
from toeplitz_mg.contact.results.base import Figure, Protected, Result, Summary
from toeplitz_mg.contact.results.consistency import Rule
from toeplitz_mg.contact.results.normal import NormalResult
from toeplitz_mg.contact.results.quantities import ENERGY, Quantity, name_units
from toeplitz_mg.contact.results.tangential import TangentialResult


@files.loadable
@dataclass(frozen=True, eq=False)
class Before(Protected):
    """Tractions before a step, with the force and the approach at that time."""

    traction: Annotated[Array, Quantity("N/mm²", "1, grid | 2, grid")]
    force: Annotated[float, Quantity("force")]
    approach: Annotated[float, Quantity("mm")]

    @property
    def _sizes(self) -> dict[str, tuple[int, ...]]:
        return {"grid": self.traction.shape[1:]}


@files.loadable
@dataclass(frozen=True, eq=False, repr=False)
class FrictionalResult(Result):
    """Normal and tangential contact solved together, for bodies of unlike materials.

    Attributes
    ----------
    normal : NormalResult
        Pressures, contact and approach. Its displacement includes the effect of the tractions. If
        the materials are unlike, its stiffness is None: the tractions change with the approach, so
        the stiffness does not follow from the elements in contact.
    tangential : TangentialResult
        Tractions, slip and stick. Its displacement includes the effect of the pressures.
    energy : float
        The elastic energy of both bodies, N mm; in plane strain N. The `energy` of `normal` or
        `tangential` is the work of its own tractions, which may be negative.
    products : int
        Matrix-vector products of both problems together.
    residuals : tuple of float
        The largest violation of the conditions of normal contact, relative to the largest
        interference, for each iteration between the two problems.
    before : Before or None
        The state before this step; None in rolling.

    See Also
    --------
    NormalResult : the result of normal contact without friction.
    TangentialResult : the result of friction and rolling with given pressures.
    """

    normal: NormalResult
    tangential: TangentialResult
    residuals: tuple[float, ...]
    before: Before | None = None

    _sizes: ClassVar[dict[str, tuple[int, ...]]] = {}

    def _rules(self) -> Iterator[Rule]:
        one, other, grid = self.normal, self.tangential, self.normal.contact.shape
        for name in ("shape", "element", "material", "periodic"):
            same = getattr(one, name) == getattr(other, name)
            yield Rule("tangential", same, f"of the same {name} as normal")
        inside = other.contact.shape == grid and not (other.contact & ~one.contact).any()
        yield Rule("tangential", inside, "in contact where normal is only")
        before = self.before is None or self.before.traction.shape[1:] == grid
        yield Rule("before", before, f"on the grid of normal, {grid}")
        yield Rule("residuals", len(self.residuals) > 0, "one at least")

    @property
    def residual(self) -> float:
        """The last entry of `residuals`."""
        return self.residuals[-1]

    @property
    def products(self) -> int:
        """Matrix-vector products of both problems together."""
        return self.normal.products + self.tangential.products

    @property
    def energy(self) -> float:
        """The elastic energy ½ ∫ (p u + q·u) of both bodies, N mm; in plane strain N."""
        return self.normal.energy + self.tangential.energy

    @property
    def warnings(self) -> tuple[str, ...]:
        """Reasons to doubt that the input is what was meant."""
        return self.normal.warnings + self.tangential.warnings

    to_xarray, to_vtk = files.to_xarray, files.to_vtk

    def plot(self, ax: Any = None) -> Any:
        """Plot the pressures, and beside them the areas of stick and slip.

        `normal.plot` and `tangential.plot` draw the other fields.

        Parameters
        ----------
        ax : pair of matplotlib.axes.Axes, optional
            Axes to draw in, as returned by ``plt.subplots(1, 2)``; by default those of a new
            figure.

        Returns
        -------
        pair of matplotlib.axes.Axes
        """
        left, right = pictures.find_axes(ax, 2)
        return self.normal.plot(ax=left), self.tangential.plot(ax=right)

    def __repr__(self) -> str:
        """Return the first figures of both results."""
        return f"<FrictionalResult: {self.normal!r}, {self.tangential!r}>"

    def _summaries(self) -> Iterator[Summary]:
        """Yield the summaries of both results, and one of what they share."""
        for part in (self.normal, self.tangential):
            summary = part._summary()
            yield summary._replace(figures=[x for x in summary.figures if x.name != ENERGY])
        energy = Figure(ENERGY, self.energy, name_units(self.normal)["energy"])
        yield Summary("Both together", [energy])
