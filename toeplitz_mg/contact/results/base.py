"""Base classes of all results: read-only arrays, and summaries of figures with their units."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import MISSING, fields
from html import escape
from math import prod
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.contact.results import consistency, files, pictures
from toeplitz_mg.contact.results.consistency import Rule
from toeplitz_mg.contact.results.quantities import name_units, quantities

NOTHING = 1e-8  # A component is shown as zero if it is this much smaller than the largest one.
FEW = 3  # Number of figures in the one-line repr of a result.


class Figure(NamedTuple):
    """One or more numbers with a name, a unit, and the field or property they belong to."""

    name: str
    value: Any
    unit: str = ""
    of: str = ""

    @property
    def text(self) -> str:
        """The value and its unit."""
        if isinstance(self.value, str):
            return self.value
        values = np.atleast_1d(self.value)
        sizes = np.abs(values)
        least = NOTHING * float(np.max(sizes, where=np.isfinite(sizes), initial=0.0))
        numbers = ", ".join(f"{0.0 if abs(x) <= least else x:.5g}" for x in values)
        return f"{numbers if len(values) == 1 else f'({numbers})'} {self.unit}".rstrip()


class Summary(NamedTuple):
    """A text summary of a result: a title, its figures, its cost, and its warnings."""

    title: str
    figures: Sequence[Figure]
    cost: str = ""
    warnings: Sequence[str] = ()

    @property
    def rows(self) -> list[tuple[str, str]]:
        """The rows below the title: names and values."""
        rows = [(figure.name, figure.text) for figure in self.figures]
        rows += [("solved by", self.cost)] * bool(self.cost)
        return rows + [("warning", warning) for warning in self.warnings]

    def write(self) -> str:
        """Return one line for each row below the title."""
        lines = (
            f"  {name}: {text}" if name == "warning" else f"  {name:18s}{text}"
            for name, text in self.rows
        )
        return "\n".join((self.title, *lines))

    def tabulate(self) -> str:
        """Return the same as an HTML table."""
        cells = "".join(
            f"<tr><th>{name}</th><td>{escape(text)}</td></tr>" for name, text in self.rows
        )
        return f"<table><caption>{escape(self.title)}</caption>{cells}</table>"


def list_figures(result: Any, *names: str | Figure) -> list[Figure]:
    """Return the figures that a result has; a string names a field of the result."""
    units, declared = name_units(result), quantities(type(result))
    figures = [
        Figure(declared[name].label or name, getattr(result, name), units.get(name, ""), name)
        if isinstance(name, str)
        else name
        for name in names
    ]
    return [figure for figure in figures if figure.value is not None]


def span(figure: Figure) -> Figure:
    """Return a figure with the first and the last value."""
    name, values, unit, _ = figure
    first, last = (Figure(name, value).text for value in (values[0], values[-1]))
    return Figure(name, f"{first} to {last} {unit}".rstrip())


def describe_cost(products: int, residual: float | None = None) -> str:
    """Return the cost of a solution and its residual as text."""
    violation = "" if residual is None else f", violation {residual:.1e}"
    return f"{products} product{'s' * (products != 1)}{violation}"


def touches_edge(grid: Any, contact: Mask) -> bool:
    """Whether elements in contact lie at an edge of the grid, along axes of several elements."""
    return any(
        n > 1
        and not grid.periodic[axis]
        and grid.vectors.count(grid.lines(contact, axis)[..., :: n - 1])
        for axis, n in enumerate(grid.shape)
    )


class Described:
    """A class with a `_summary`, printed as lines of text and, in notebooks, as a table."""

    def _summaries(self: Any) -> Iterable[Summary]:
        return (self._summary(),)

    def summary(self) -> str:
        """Return the figures with their units, one per line."""
        return "\n\n".join(summary.write() for summary in self._summaries())

    def _repr_html_(self) -> str:
        return "".join(summary.tabulate() for summary in self._summaries())


class Protected:
    """A dataclass with read-only arrays, in its copies too."""

    def __post_init__(self) -> None:
        """Check the fields, and replace the arrays by read-only views."""
        consistency.check(self)
        self._protect()

    def _protect(self) -> None:
        own = vars(self)  # Values computed on demand are not computed here.
        for name, value in own.items():
            own[name] = tuple(map(_protect, value)) if type(value) is tuple else _protect(value)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a pickled or copied object; its arrays are writable until they are protected."""
        vars(self).update(state)
        self._protect()

    def _rules(self) -> Iterable[Rule]:
        """Return the rules that the fields must satisfy."""
        return ()


Made = TypeVar("Made", bound=Protected)


def make(kind: type[Made], **values: Any) -> Made:
    """Return a result without checking its fields, which a solver has computed consistently.

    The class itself checks them, for `dataclasses.replace` and for files.
    """
    result = object.__new__(kind)
    declared = fields(cast("Any", kind))
    defaults = {field.name: field.default for field in declared if field.default is not MISSING}
    vars(result).update(defaults | values)
    result._protect()
    return result


def remake(result: Made, **values: Any) -> Made:
    """Return a modified copy of a solver's result, without computing values on demand."""
    return make(type(result), **(vars(result) | values))


class Result(Described, Protected):
    """A result that can be saved and summarised."""

    save = files.save

    def _complete(self, needs_fields: str = "") -> None:
        """Compute the remaining points of a curve, for a method that may need their fields."""


class GridResult(Result):
    """A result with fields on a grid, a `_title` and `_figures`."""

    @property
    def _sizes(self: Any) -> dict[str, tuple[int, ...]]:
        """The shape of the grid; with several ranks, the shape of the rows of one rank."""
        return {"grid": self.contact.shape}

    def _rules(self: Any) -> Iterator[Rule]:
        """Yield the rules for the fields of any contact."""
        C, h, axes = self.contact, self.element, len(self.shape)
        few = len(self.centres) == axes <= len(h)  # Strips of finite length have one axis.
        yield Rule("shape", few, "of as many axes as centres, and no more than element")
        lengths = tuple(map(len, self.centres))
        yield Rule("centres", lengths == self.shape, f"those of {self.shape} elements")
        yield Rule("element", all(size > 0.0 for size in h), "positive")
        yield from consistency.check_centres(self.centres, h)
        for name in ("products", "work", "residual"):
            yield Rule(name, getattr(self, name) >= 0.0, "at least zero")
        area = prod(h)
        yield Rule.of_sum("area", self.area, area * C.sum(), self.area, "that of contact")
        ends = (C.take((0, -1), axis) for axis in range(axes))
        repeats = self.periodic or (False,) * axes
        edge = any(
            x.any() and n > 1 and not again
            for x, n, again in zip(ends, self.shape, repeats, strict=False)
        )
        yield Rule("touches_edge", self.touches_edge == edge, f"{edge}, as contact is")
        q, u = self.traction, self.displacement
        terms = q.reshape(-1, *self.shape)
        total, size = (area * x.reshape(len(terms), -1).sum(axis=1) for x in (terms, np.abs(terms)))
        exact = total if q.ndim > axes else total[0]
        name = "pressure" if self.slip is None else "traction"
        yield Rule.of_sum("force", self.force, exact, size, f"the sum of {name} over the elements")
        work, size = (0.5 * area * np.vdot(a, b) for a, b in ((q, u), (np.abs(q), np.abs(u))))
        yield Rule.of_sum("energy", self.energy, work, size, f"half of {name} times displacement")

    @property
    def x(self: Any) -> Array:
        """The x coordinates of the element centres, mm."""
        centres: Array = self.centres[0]
        return centres

    @property
    def y(self: Any) -> Array | None:
        """The y coordinates of the element centres, mm; None in line contact."""
        return self.centres[1] if len(self.centres) > 1 else None

    @property
    def contact_fraction(self: Any) -> float:
        """The area of contact divided by the area of the grid."""
        share: float = self.area / (prod(self.shape) * prod(self.element))
        return share

    to_xarray, to_vtk = files.to_xarray, files.to_vtk

    def plot(self, field: str | None = None, ax: Any = None) -> Any:
        """Plot the pressures, the areas of stick and slip with the tractions, or another field.

        Parameters
        ----------
        field : str, optional
            "pressure", "gap" or "displacement", and with a hardness "plastic". For friction and
            rolling: "traction", "slip" or "displacement". By default the first.
        ax : matplotlib.axes.Axes, optional
            Axes to draw in; by default those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ValueError
            If the result has no such field.
        """
        return pictures.draw(self, field, ax)

    def __repr__(self: Any) -> str:
        """Return the first figures in one line."""
        few = ", ".join(f"{figure.name} {figure.text}" for figure in self._figures()[:FEW])
        grid = " x ".join(map(str, self.shape))
        return f"<{type(self).__name__} {grid}: {few}; {describe_cost(self.products)}>"

    def _summary(self: Any) -> Summary:
        count, size = (" x ".join(f"{x:.5g}" for x in n) for n in (self.shape, self.element))
        title = f"{self._title}, {count} elements of {size} mm"
        cost = describe_cost(self.products, self.residual)
        return Summary(title, self._figures(), cost, self.warnings)


def _protect(x: Any) -> Any:
    """Return a read-only view of an array; return any other value unchanged."""
    if isinstance(x, np.ndarray):
        x = x.view()
        x.flags.writeable = False
    return x
