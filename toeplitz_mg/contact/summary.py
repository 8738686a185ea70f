"""What a result of a contact problem is in words: figures with their units."""

from collections.abc import Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np

from toeplitz_mg._typing import Array

NOTHING = 1e-8  # Size of a component over the largest that is shown as zero: the usual tolerance.
ENERGY = "elastic energy"
FEW = 3  # Figures in the repr of a result, which is one line.


class Figure(NamedTuple):
    """A number, or some, with a name and a unit."""

    name: str
    value: Any
    unit: str = ""

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
    """What a result is in words: a title, its figures, what they cost, and doubts about them."""

    title: str
    figures: Sequence[Figure]
    cost: str = ""
    warnings: Sequence[str] = ()

    @property
    def rows(self) -> list[tuple[str, str]]:
        """What stands below the title: names and what belongs to them."""
        rows = [(figure.name, figure.text) for figure in self.figures]
        rows += [("solved by", self.cost)] * bool(self.cost)
        return rows + [("warning", warning) for warning in self.warnings]

    def write(self) -> str:
        """Return a line for each row, below the title."""
        lines = (
            f"  {name}: {text}" if name == "warning" else f"  {name:18s}{text}"
            for name, text in self.rows
        )
        return "\n".join((self.title, *lines))

    def tabulate(self) -> str:
        """Return the same as a table of HTML."""
        cells = "".join(
            f"<tr><th>{name}</th><td>{escape(text)}</td></tr>" for name, text in self.rows
        )
        return f"<table><caption>{escape(self.title)}</caption>{cells}</table>"


def describe_grid(shape: Sequence[int], element: Sequence[float]) -> str:
    """Return the elements of a grid in words."""
    count, size = (" x ".join(f"{x:.5g}" for x in sizes) for sizes in (shape, element))
    return f"{count} elements of {size} mm"


def span(name: str, values: Array, unit: str = "") -> Figure:
    """Return what the first and the last of some values are."""
    first, last = (Figure(name, value).text for value in (values[0], values[-1]))
    return Figure(name, f"{first} to {last} {unit}".rstrip())


def describe_cost(products: int, residual: float | None = None) -> str:
    """Return what a solution cost, and how exact it is, in words."""
    violation = "" if residual is None else f", violation {residual:.1e}"
    return f"{products} product{'s' * (products != 1)}{violation}"


# These are methods of results, of all classes.


def shorten(result: Any) -> str:
    """Return the first figures in one line."""
    few = ", ".join(f"{figure.name} {figure.text}" for figure in result._figures()[:FEW])
    grid = " x ".join(map(str, result.shape))
    cost = describe_cost(result.products)
    return f"<{type(result).__name__} {grid}: {few}; {cost}>"


def list_figures(result: Any) -> str:
    """Return the figures of this result with their units, a line each."""
    text: str = result._summary().write()
    return text


def tabulate_figures(result: Any) -> str:
    """Return the same as a table of HTML."""
    table: str = result._summary().tabulate()
    return table
