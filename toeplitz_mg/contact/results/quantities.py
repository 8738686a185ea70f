"""What results of contact problems consist of: the unit, the axes and the name of each quantity.

Each field of a result declares them in its annotation. Summaries, files, datasets, VTK and pictures
read what they need there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array

TOGETHER, ENERGY = "displacement of both bodies", "elastic energy"  # Names of two quantities.
CREEPAGES = ("longitudinal", "lateral", "spin")
VECTORS = "grid | 2, grid"  # The axes of what has a direction, along x alone or along both axes.


@dataclass(frozen=True)
class Quantity:
    """A quantity of a result, as the annotation of its field declares it.

    Parameters
    ----------
    unit : str
        The unit, "1" of plain numbers, or the name of one that depends on the result (`units_of`).
    axes : str
        The axes of an array, as in "2, grid", or more than one such list with "|" between them; a
        number without.
    kind : str
        "f" of real numbers, "b" of truth values, "i" of integers, as in the `kind` of a dtype.
    beyond : str
        What it may be beside a number: "inf" where infinity is a value, "nan" where NaN is too.
    label : str
        Its name in summaries and pictures; by default that of the field.
    shades : str
        The colours of its picture, by matplotlib's name, two of what has them for stick and for
        slip; it has no picture without.
    """

    unit: str
    axes: str = ""
    kind: str = "f"
    beyond: str = ""
    label: str = ""
    shades: str = ""

    def shapes(self, sizes: Mapping[str, tuple[int, ...]]) -> list[tuple[int, ...]]:
        """Return the shapes that an array may have, where axes have these sizes."""
        alternatives = [[axis.strip() for axis in one.split(",")] for one in self.axes.split("|")]
        return [
            sum((sizes[axis] if axis in sizes else (int(axis),) for axis in axes), ())
            for axes in alternatives
        ]


def quantities(kind: type) -> dict[str, Quantity]:
    """Return what a class of results declares, by the names of the fields."""
    declared = {field.name: getattr(field.type, "__metadata__", ()) for field in fields(kind)}
    return {name: found[0] for name, found in declared.items() if found}


def units_of(element: Sequence[float], *, rolls: bool = False) -> dict[str, str]:
    """Return the units that depend on the problem, by the names that quantities have for them.

    In plane strain, on elements of one size, they are per mm of length; in rolling they are over
    the distance rolled.
    """
    force, area, energy, stiffness = "N", "mm²", "N mm", "N/mm"
    if len(element) == 1:
        force, area, energy, stiffness = "N/mm", "mm", "N", "N/mm²"
    units = {"force": force, "area": area, "energy": energy, "stiffness": stiffness}
    return units | ({"slip": "1", "loss": force} if rolls else {"slip": "mm", "loss": energy})


def name_units(result: Any) -> dict[str, str]:
    """Return the units of the attributes of a result, by their names: "1" of plain numbers."""
    own, declared = vars(result), quantities(type(result))
    creepages = own.get("creepages")  # What is computed on demand is not asked for here.
    units = units_of(own.get("element", ()), rolls=creepages is not None)
    if creepages is not None:
        of_points = declared["creepages"].axes.startswith("points")
        units["creepages"] = "1, 1, 1/mm" if np.ndim(creepages) > of_points else "1"
    there = {name: q.unit for name, q in declared.items() if own[name] is not None}
    named = {name: units.get(unit, unit) for name, unit in there.items() if unit}
    axes = "xy"[: len(own.get("centres", ()))]
    return named | dict.fromkeys((*axes, "centres") if axes else (), "mm")


def fields_on_grid(result: Any) -> dict[str, Array]:
    """Return the arrays that have a value in each element, by their names, components first."""
    require_whole(result)
    own, shape = vars(result), result.contact.shape
    declared = {name for name, quantity in quantities(type(result)).items() if quantity.axes}
    return {k: x for k, x in own.items() if k in declared and np.shape(x)[-len(shape) :] == shape}


def is_whole(result: Any) -> bool:
    """Whether the fields are of the whole grid: on several ranks they have the rows of one."""
    whole: bool = result.contact.shape == result.shape
    return whole


def require_whole(result: Any, name: str = "the result") -> None:
    """Refuse a result that has the rows of one rank, where the whole grid is needed."""
    if not is_whole(result):
        raise ValueError(
            f"{name} has the rows of one rank, {result.contact.shape} of the {result.shape} "
            "elements, but must have all: all ranks together write a field to a file by "
            "slab.save(path, field), and numpy.load reads it"
        )
