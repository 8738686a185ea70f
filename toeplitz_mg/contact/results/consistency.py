"""Checks that the fields of a result are consistent, whether it comes from a solver or a file.

A class of results lists the sizes of its axes in `_sizes`, and in `_rules` the conditions that its
fields must satisfy.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import lru_cache
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.results.quantities import Quantity, is_whole, quantities

ROUNDING = 1e-6  # Relative error allowed in coordinates and sums.
LONGEST = 50  # Longest text of a value in an error message, characters.
DTYPES = {"f": np.dtype(np.float64), "b": np.dtype(np.bool_), "i": np.dtype(np.int64)}
UNIONS = (Union, UnionType)
CLASSES = {float: Real, int: Integral, bool: (bool, np.bool_), Array: np.ndarray}
NAMES = {Array: "an array", float: "a number", int: "an integer", bool: "true or false"}
NAMES |= {str: "a text"}


class Rule(NamedTuple):
    """A condition on one field that depends on other fields, and whether it holds."""

    field: str
    holds: bool
    text: str

    @classmethod
    def of_sum(cls, field: str, value: Any, exact: Any, size: Any, text: str) -> "Rule":
        """Return the rule that numbers are a sum of terms whose magnitudes sum to `size`."""
        fits = np.shape(value) == np.shape(exact)
        error = np.max(np.abs(np.subtract(value, exact))) if fits else np.inf
        return cls(field, bool(error <= ROUNDING * np.max(size)), f"{text}, {exact}")


def check(result: Any) -> None:
    """Raise an error if fields have a wrong type or shape, or contradict each other."""
    kind, own = type(result), vars(result)
    check_values(kind, own)
    sizes = result._sizes
    whole = "shape" not in own or is_whole(result)
    if not whole:  # The fields have the rows of one rank only.
        (rows, *others), (n, *more) = own["contact"].shape, own["shape"] or (0,)
        if rows > n or others != more:
            raise ValueError(f"contact has shape {(rows, *others)}, but must have {own['shape']}")
    for name, quantity in quantities(kind).items():
        if isinstance(own[name], np.ndarray):
            check_array(name, own[name].shape, own[name].dtype, quantity, sizes)
        if not callable(own[name]) and own[name] is not None:
            check_numbers(name, own[name], quantity)
    for rule in result._rules() if whole else ():
        if not rule.holds:
            value = str(own[rule.field])
            shown = f" is {value}, but" if len(value) <= LONGEST else ""
            raise ValueError(f"{rule.field}{shown} must be {rule.text}")


def check_values(kind: type, values: Mapping[str, Any]) -> None:
    """Raise an error if values do not have the types of the fields of a class of results."""
    types = find_types(kind)
    for name, value in values.items():
        if name not in types:
            raise ValueError(f"{name} is given, but a {kind.__name__} has no such field")
        if not _is_of(value, types[name]):
            shown = repr(value)
            shown = shown if len(shown) <= LONGEST else f"of type {type(value).__name__}"
            raise TypeError(f"{name} is {shown}, but must be {_say(types[name])}")


def check_array(
    name: str,
    shape: tuple[int, ...],
    dtype: np.dtype[Any],
    quantity: Quantity,
    sizes: Mapping[str, tuple[int, ...]],
) -> None:
    """Raise an error if the shape or dtype of an array is not that of its quantity."""
    allowed = quantity.shapes(sizes)
    if shape not in allowed:
        raise ValueError(
            f"{name} has shape {shape}, but must have {' or '.join(map(str, allowed))}"
        )
    if dtype.newbyteorder("=") != DTYPES[quantity.kind]:
        raise ValueError(f"{name} is of type {dtype}, but must be of {DTYPES[quantity.kind]}")


def check_numbers(name: str, value: Any, quantity: Quantity) -> None:
    """Raise an error for infinity or NaN, unless the quantity may have such values."""
    values = np.asarray(value)
    allowed = {"": False, "inf": values == np.inf, "nan": np.isnan(values)}[quantity.beyond]
    bad = ~(np.isfinite(values) | allowed)
    if bad.any():
        raise ValueError(f"{name} has {values[bad].flat[0]}, but must be finite")


def check_centres(centres: Sequence[Array], element: Sequence[float]) -> Iterator[Rule]:
    """Yield the rules: centres are equally spaced about zero, by the element size."""
    for axis, x, h in zip("xy", centres, element, strict=False):
        exact = h * (np.arange(len(x)) - (len(x) - 1) / 2.0)
        holds = bool((np.abs(x - exact) <= ROUNDING * h).all())
        yield Rule("centres", holds, f"about zero, and along {axis} {h} mm apart")


@lru_cache
def find_types(kind: type) -> dict[str, Any]:
    """Return the types of the fields of a class of results."""
    found = {}
    for field in fields(kind):
        bare = get_args(field.type)[0] if get_origin(field.type) is Annotated else field.type
        if bare is Any:  # A plain number in line contact.
            bare = Array | float | None if field.default is None else Array | float
        elif isinstance(bare, type) and hasattr(bare, "__get__"):
            bare = float | Callable | None
        found[field.name] = bare
    return found


def _is_of(value: Any, wanted: Any) -> bool:
    """Whether a value is of a type; an integer counts as a real number, a bool does not."""
    origin, of = get_origin(wanted), get_args(wanted)
    if origin is tuple:
        return type(value) is tuple and all(_is_of(x, of[0]) for x in value)
    if origin in UNIONS:
        return any(_is_of(value, one) for one in of)
    kind: Any = CLASSES.get(wanted, wanted)
    return isinstance(value, kind) and (wanted is bool or not isinstance(value, bool))


def _say(wanted: Any) -> str:
    """Return the name of a type for an error message."""
    origin, of = get_origin(wanted), get_args(wanted)
    if origin is tuple:
        return f"a tuple, each {_say(of[0])}"
    if origin in UNIONS:
        return " or ".join(_say(one) for one in of if one is not Callable)
    return "None" if wanted is NoneType else NAMES.get(wanted) or f"a {wanted.__name__}"
