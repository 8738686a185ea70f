"""The units of what results of contact problems have, in N and mm."""

from collections.abc import Sequence
from typing import Any, NamedTuple


class Units(NamedTuple):
    """The units of what is summed over the contact."""

    force: str
    area: str
    energy: str
    stiffness: str


def units_of(element: Sequence[float]) -> Units:
    """Return the units on elements of this size: in plane strain, of one, per mm of length."""
    if len(element) == 1:
        return Units("N/mm", "mm", "N", "N/mm²")
    return Units("N", "mm²", "N mm", "N/mm")


def name_units(result: Any) -> dict[str, str]:
    """Return the units of the attributes of a result, by their names: "1" of plain numbers."""
    units = units_of(result.element)
    is_rolling = result.stick is not None and result.creepages is not None
    names = (
        ("N/mm²", "pressure traction bound max_pressure"),
        ("mm", "element centres x y displacement gap plastic approach shift total_shift"),
        (units.area, "area stick_area"),
        (units.force, "force"),
        (units.energy, "energy"),
        (units.stiffness, "stiffness"),
        ("N mm", "moment"),
        ("1", "contact stick"),
    )
    found = {name: unit for unit, several in names for name in several.split()}
    # Of rolling they are over the distance rolled; the third of the creepages is in 1/mm.
    found["slip"] = "1" if is_rolling else "mm"
    found["power"] = units.force if is_rolling else units.energy
    found["creepages"] = "1" if len(result.shape) == 1 else "1, 1, 1/mm"
    # What is computed on demand is not asked for here.
    there = {name for name, value in vars(result).items() if value is not None}
    there |= {*"xy"[: len(result.shape)]}
    return {name: unit for name, unit in found.items() if name in there}
