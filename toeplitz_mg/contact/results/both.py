"""What contact with friction of unlike materials has for an answer."""

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
    """Tractions before a step, with the force and the approach that pressed."""

    traction: Annotated[Array, Quantity("N/mm²", "1, grid | 2, grid")]
    force: Annotated[float, Quantity("force")]
    approach: Annotated[float, Quantity("mm")]

    @property
    def _sizes(self) -> dict[str, tuple[int, ...]]:
        return {"grid": self.traction.shape[1:]}


@files.loadable
@dataclass(frozen=True, eq=False, repr=False)
class FrictionalResult(Result):
    """Bodies that are pressed together with friction: what holds across, and what along.

    Attributes
    ----------
    normal : NormalResult
        Pressures, contact, approach; the displacement is that by tractions too. Where the materials
        are unlike, the tractions change with the approach, so that the stiffness is no solution
        with the elements in contact alone: it is None.
    tangential : TangentialResult
        Tractions, slip, stick; the displacement is that by pressures too.
    energy : float
        The elastic energy of both bodies, N mm; in plane strain N. The `energy` of each part is
        the work of its tractions, which may be negative.
    products : int
        The products with a matrix that both parts took.
    residuals : tuple of float
        The largest violation of the conditions of normal contact, over the largest interference,
        in each iteration between the two problems.
    before : Before or None
        The state before this step; None in rolling.

    See Also
    --------
    NormalResult : without friction.
    TangentialResult : of bodies that were pressed before.
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
        """The violation that is left."""
        return self.residuals[-1]

    @property
    def products(self) -> int:
        """The products with a matrix that both parts took."""
        return self.normal.products + self.tangential.products

    @property
    def energy(self) -> float:
        """The elastic energy ½ ∫ (p u + q·u) of both bodies, N mm; in plane strain N."""
        return self.normal.energy + self.tangential.energy

    @property
    def warnings(self) -> tuple[str, ...]:
        """Why the answer may not be of the problem that was meant."""
        return self.normal.warnings + self.tangential.warnings

    to_xarray, to_vtk = files.to_xarray, files.to_vtk

    def plot(self, ax: Any = None) -> Any:
        """Draw the pressures, and beside them where the bodies stick and where they slip.

        `normal` and `tangential` have each a `plot` for their other fields.

        Parameters
        ----------
        ax : pair of matplotlib.axes.Axes, optional
            Where to draw, as ``plt.subplots(1, 2)`` returns them; by default on a new figure.

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
        """Yield those of both parts, and of what they have together only."""
        for part in (self.normal, self.tangential):
            summary = part._summary()
            yield summary._replace(figures=[x for x in summary.figures if x.name != ENERGY])
        energy = Figure(ENERGY, self.energy, name_units(self.normal)["energy"])
        yield Summary("Both together", [energy])
