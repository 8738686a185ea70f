"""The unit, the axes and the label of each quantity in a result.

Each field of a result declares them in its annotation. Summaries, files, datasets, VTK and pictures
use these declarations.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array

TOGETHER, ENERGY = "displacement of both bodies", "elastic energy"  # Labels used more than once.
CREEPAGES = ("longitudinal", "lateral", "spin")
VECTORS = "grid | 2, grid"  # Axes of a vector field: with the x component only, or with x and y.


@dataclass(frozen=True)
class Quantity:
    """A quantity of a result, declared in the annotation of its field.

    Parameters
    ----------
    unit : str
        The unit, "1" for a plain number, or the name of a unit in `units_of`.
    axes : str
        The axes of an array, as in "2, grid"; alternatives are separated by "|". Empty for a
        number.
    kind : str
        The `kind` of its dtype: "f" for real numbers, "b" for booleans, "i" for integers.
    beyond : str
        Special values it may have: "inf" for infinity, "nan" for NaN.
    label : str
        Its label in summaries and pictures; by default the name of the field.
    shades : str
        The matplotlib colour maps of its picture, two if stick and slip differ. Without, it has no
        picture.
    """

    unit: str
    axes: str = ""
    kind: str = "f"
    beyond: str = ""
    label: str = ""
    shades: str = ""

    def shapes(self, sizes: Mapping[str, tuple[int, ...]]) -> list[tuple[int, ...]]:
        """Return the shapes that an array may have for these sizes of the axes."""
        alternatives = [[axis.strip() for axis in one.split(",")] for one in self.axes.split("|")]
        return [
            sum((sizes[axis] if axis in sizes else (int(axis),) for axis in axes), ())
            for axes in alternatives
        ]


def quantities(kind: type) -> dict[str, Quantity]:
    """Return the quantities that a class of results declares, by field name."""
    declared = {field.name: getattr(field.type, "__metadata__", ()) for field in fields(kind)}
    return {name: found[0] for name, found in declared.items() if found}


def units_of(element: Sequence[float], *, rolls: bool = False) -> dict[str, str]:
    """Return the units that depend on the problem, by the names that `Quantity.unit` uses.

    In plane strain, where elements have one size, they are per mm of length. In rolling they are
    per distance rolled.
    """
    force, area, energy, stiffness = "N", "mm²", "N mm", "N/mm"
    if len(element) == 1:
        force, area, energy, stiffness = "N/mm", "mm", "N", "N/mm²"
    units = {"force": force, "area": area, "energy": energy, "stiffness": stiffness}
    return units | ({"slip": "1", "loss": force} if rolls else {"slip": "mm", "loss": energy})


def name_units(result: Any) -> dict[str, str]:
    """Return the units of the attributes of a result by name: "1" for plain numbers."""
    own, declared = vars(result), quantities(type(result))
    creepages = own.get("creepages")  # Values computed on demand are not computed here.
    units = units_of(own.get("element", ()), rolls=creepages is not None)
    if creepages is not None:
        of_points = declared["creepages"].axes.startswith("points")
        units["creepages"] = "1, 1, 1/mm" if np.ndim(creepages) > of_points else "1"
    there = {name: q.unit for name, q in declared.items() if own[name] is not None}
    named = {name: units.get(unit, unit) for name, unit in there.items() if unit}
    axes = "xy"[: len(own.get("centres", ()))]
    return named | dict.fromkeys((*axes, "centres") if axes else (), "mm")


def fields_on_grid(result: Any) -> dict[str, Array]:
    """Return the arrays with a value in each element by name; components come first."""
    require_whole(result)
    own, shape = vars(result), result.contact.shape
    declared = {name for name, quantity in quantities(type(result)).items() if quantity.axes}
    return {k: x for k, x in own.items() if k in declared and np.shape(x)[-len(shape) :] == shape}


def is_whole(result: Any) -> bool:
    """Whether the fields cover the whole grid; with several ranks they have the rows of one."""
    whole: bool = result.contact.shape == result.shape
    return whole


def require_whole(result: Any, name: str = "the result") -> None:
    """Raise an error if a result has only the rows of one rank."""
    if not is_whole(result):
        raise ValueError(
            f"{name} has the rows of one rank, {result.contact.shape} of the {result.shape} "
            "elements, but must have all: all ranks together write a field to a file by "
            "slab.save(path, field), and numpy.load reads it"
        )
