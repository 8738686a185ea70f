"""That a result does not contradict itself, whoever made it: a solver, a file or `replace`.

A class of results says by `_sizes` how many numbers its axes have, and by `_rules` what follows
from its fields.
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

ROUNDING = 1e-6  # Relative error of the places and of the sums in a result.
LONGEST = 50  # Characters of a value in an error.
DTYPES = {"f": np.dtype(np.float64), "b": np.dtype(np.bool_), "i": np.dtype(np.int64)}
UNIONS = (Union, UnionType)
CLASSES = {float: Real, int: Integral, bool: (bool, np.bool_), Array: np.ndarray}
NAMES = {Array: "an array", float: "a number", int: "an integer", bool: "true or false"}
NAMES |= {str: "a text"}


class Rule(NamedTuple):
    """What a field must be, as the other fields of a result say, and whether it is."""

    field: str
    holds: bool
    text: str

    @classmethod
    def of_sum(cls, field: str, value: Any, exact: Any, size: Any, text: str) -> "Rule":
        """Return that a number, or some, are a sum of terms whose sizes add up to `size`."""
        fits = np.shape(value) == np.shape(exact)
        error = np.max(np.abs(np.subtract(value, exact))) if fits else np.inf
        return cls(field, bool(error <= ROUNDING * np.max(size)), f"{text}, {exact}")


def check(result: Any) -> None:
    """Refuse fields of another type or shape, and what does not follow from the fields."""
    kind, own = type(result), vars(result)
    check_values(kind, own)
    sizes = result._sizes
    whole = "shape" not in own or is_whole(result)
    if not whole:  # They are the rows that one rank has.
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
    """Refuse values that are not of the types that the fields of a class of results have."""
    types = find_types(kind)
    for name, value in values.items():
        if name not in types:
            raise ValueError(f"{name} is given, but a {kind.__name__} has no such field")
        if not _is_of(value, types[name]):
            shown = repr(value)
            shown = shown if len(shown) <= LONGEST else f"a {type(value).__name__}"
            raise TypeError(f"{name} is {shown}, but must be {_say(types[name])}")


def check_array(
    name: str,
    shape: tuple[int, ...],
    dtype: np.dtype[Any],
    quantity: Quantity,
    sizes: Mapping[str, tuple[int, ...]],
) -> None:
    """Refuse the shape or the type of an array that are not those of a quantity."""
    allowed = quantity.shapes(sizes)
    if shape not in allowed:
        raise ValueError(
            f"{name} has shape {shape}, but must have {' or '.join(map(str, allowed))}"
        )
    if dtype.newbyteorder("=") != DTYPES[quantity.kind]:
        raise ValueError(f"{name} is of type {dtype}, but must be of {DTYPES[quantity.kind]}")


def check_numbers(name: str, value: Any, quantity: Quantity) -> None:
    """Refuse infinity and what is no number, where they are none of the values of a quantity."""
    values = np.asarray(value)
    bad = {"": ~np.isfinite(values), "nan": np.isinf(values)}.get(quantity.beyond)
    if bad is None:
        bad = np.isnan(values) | np.isneginf(values)
    if bad.any():
        raise ValueError(f"{name} has {values[bad].flat[0]}, but must be finite")


def check_centres(centres: Sequence[Array], element: Sequence[float]) -> Iterator[Rule]:
    """Yield that elements have a positive size, and lie about zero, that far apart."""
    yield Rule("element", all(h > 0.0 for h in element), "positive")
    for axis, x, h in zip("xy", centres, element, strict=False):
        exact = h * (np.arange(len(x)) - (len(x) - 1) / 2.0)
        holds = bool((np.abs(x - exact) <= ROUNDING * h).all())
        yield Rule("centres", holds, f"about zero, and along {axis} {h} mm apart")


@lru_cache
def find_types(kind: type) -> dict[str, Any]:
    """Return the types that the values of fields of a class of results have."""
    found = {}
    for field in fields(kind):
        bare = get_args(field.type)[0] if get_origin(field.type) is Annotated else field.type
        if bare is Any:  # In line contact it is a number.
            bare = Array | float | None if field.default is None else Array | float
        elif isinstance(bare, type) and hasattr(bare, "__get__"):
            bare = float | Callable | None
        found[field.name] = bare
    return found


def _is_of(value: Any, wanted: Any) -> bool:
    """Whether a value is of a type; an integer is a real number, but no truth value is."""
    origin, of = get_origin(wanted), get_args(wanted)
    if origin is tuple:
        return type(value) is tuple and all(_is_of(x, of[0]) for x in value)
    if origin in UNIONS:
        return any(_is_of(value, one) for one in of)
    kind: Any = CLASSES.get(wanted, wanted)
    return isinstance(value, kind) and (wanted is bool or not isinstance(value, bool))


def _say(wanted: Any) -> str:
    """Return in words what a type is."""
    origin, of = get_origin(wanted), get_args(wanted)
    if origin is tuple:
        return f"a tuple, each {_say(of[0])}"
    if origin in UNIONS:
        return " or ".join(_say(one) for one in of if one is not Callable)
    return "None" if wanted is NoneType else NAMES.get(wanted) or f"a {wanted.__name__}"
