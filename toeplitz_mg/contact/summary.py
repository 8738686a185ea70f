"""What a result of a contact problem is in words: figures with their units."""

from collections.abc import Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np

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
        least = NOTHING * float(np.abs(values).max())
        numbers = ", ".join(f"{x if abs(x) > least else 0.0:.5g}" for x in values)
        return f"{numbers if len(values) == 1 else f'({numbers})'} {self.unit}".rstrip()

    @property
    def line(self) -> str:
        """The name and the value of the figure as a line of a list."""
        return f"  {self.name:18s}{self.text}"


def describe_grid(shape: Sequence[int], element: Sequence[float]) -> str:
    """Return the elements of a grid in words."""
    count, size = (" x ".join(f"{x:.5g}" for x in sizes) for sizes in (shape, element))
    return f"{count} elements of {size} mm"


def describe_cost(products: int, residual: float) -> str:
    """Return what a solution cost, and how exact it is, in words."""
    return f"{products} product{'s' * (products != 1)}, violation {residual:.1e}"


# These are methods of results, of both classes.


def shorten(result: Any) -> str:
    """Return the first figures in one line."""
    few = ", ".join(f"{figure.name} {figure.text}" for figure in result._figures()[:FEW])
    grid = " x ".join(map(str, result.shape))
    cost = f"{result.products} product{'s' * (result.products != 1)}"
    return f"<{type(result).__name__} {grid}: {few}; {cost}>"


def list_figures(result: Any) -> str:
    """Return the figures of this result with their units, a line each."""
    return write_lines(*result._summary())


def tabulate_figures(result: Any) -> str:
    """Return the same as a table of HTML."""
    title, figures, cost, warnings = result._summary()
    rows = [*((figure.name, figure.text) for figure in figures), ("solved by", cost)]
    rows += [("warning", warning) for warning in warnings]
    cells = "".join(f"<tr><th>{name}</th><td>{escape(text)}</td></tr>" for name, text in rows)
    return f"<table><caption>{escape(title)}</caption>{cells}</table>"


def write_lines(title: str, figures: Sequence[Figure], cost: str, warnings: Sequence[str]) -> str:
    """Return what `_summary` of a result has, a line each."""
    lines = [title, *(figure.line for figure in figures)]
    lines += [f"  {'solved by':18s}{cost}", *(f"  warning: {warning}" for warning in warnings)]
    return "\n".join(lines)
