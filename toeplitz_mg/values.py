"""Checks of the numbers and arrays that a user gives; each returns them or raises an error."""

import reprlib
import sys
from operator import index
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array

SMALL = 1e-40  # Smallest nonzero size, in the user's units; powers of smaller ones may underflow.
LARGE = 1e40  # Largest size, in the user's units; powers of larger ones may overflow.


def real(name: str, value: Any, unit: str | None = None) -> float:
    """Return a real number; a quantity is converted to `unit`."""
    if type(value) is float:  # A short cut, because the checks below slow small systems down.
        return value
    if unit is not None:
        value = in_unit(name, value, unit)
    if isinstance(value, list | tuple):
        raise TypeError(f"{name} is {value!r}, but must be a real number")
    if np.ndim(value) > 0 or refuse_masked(name, value).dtype.kind not in "buif":
        raise TypeError(f"{name} is {value!r}, but must be a real number")
    return float(value)


def finite(name: str, value: Any, unit: str | None = None) -> float:
    """Return a finite number; a quantity is converted to `unit`."""
    x = real(name, value, unit)
    if not np.isfinite(x):
        raise ValueError(f"{name} is {value}, but must be finite")
    return x


def positive(name: str, value: Any, unit: str | None = None) -> float:
    """Return a positive and finite number; a quantity is converted to `unit`."""
    x = real(name, value, unit)
    if not 0.0 < x < np.inf:
        raise ValueError(f"{name} is {value}, but must be positive and finite")
    return x


def has_unit(value: Any) -> bool:
    """Whether this is a quantity with a unit, such as pint's, or a sequence that contains one."""
    if isinstance(value, list | tuple):
        return any(map(has_unit, value))
    return hasattr(value, "magnitude") and hasattr(value, "units")


def in_unit(name: str, value: Any, unit: str) -> Any:
    """Return the magnitude of a quantity in this unit; other values unchanged."""
    if not has_unit(value):
        return value
    if isinstance(value, list | tuple):
        return type(value)(in_unit(name, x, unit) for x in value)
    try:
        return value.to(unit).magnitude
    except TypeError:  # The base class of pint's DimensionalityError.
        raise TypeError(f"{name} is in {value.units}, but must be in {unit}") from None


def count(name: str, value: Any, least: int = 1) -> int:
    """Return an integer that is at least `least`."""
    refuse_masked(name, value)
    try:
        n = int(index(value))  # int, because True is an index but not a length.
    except TypeError:
        raise TypeError(f"{name} is {value!r}, but must be an integer") from None
    if n < least:
        raise ValueError(f"{name} is {value}, but must be at least {least}")
    return n


def refuse_masked(name: str, values: Any) -> Array:
    """Return a NumPy array of any dtype; refuse masked arrays and arrays of other libraries.

    The values under a mask have no meaning.
    """
    if type(values) is np.ndarray:  # A short cut for small systems.
        return values
    if has_unit(values):
        raise TypeError(f"{name} is a quantity in {values.units}, but must be a plain number here")
    if is_foreign(values):
        raise TypeError(
            f"{name} is an array of {name_library(values)}, but must be one of numpy here: copy it "
            "to the memory of the processor by x.get() of cupy, x.cpu() of torch, or np.asarray(x)"
        )
    if _is_masked(values):
        raise TypeError(f"{name} is a masked array, but must have a value in each element")
    try:
        return np.asarray(values)
    except ValueError as error:
        if not isinstance(values, list | tuple):
            raise
        shown = reprlib.repr(values)
        raise ValueError(f"{name} is {shown}, but its rows must be of the same length") from error


def is_foreign(values: Any) -> bool:
    """Whether this is an array of a library other than NumPy."""
    if type(values) is np.ndarray:  # A short cut for small systems.
        return False
    if isinstance(values, np.ndarray | np.generic | list | tuple | float | int):
        return False
    home = type(values).__module__.partition(".")[0]
    return home in ("cupy", "torch") or hasattr(values, "__array_namespace__")


def is_traced(*arrays: Any) -> bool:
    """Whether one of these is a JAX tracer, which has no values yet."""
    jax = sys.modules.get("jax")
    return jax is not None and any(isinstance(array, jax.core.Tracer) for array in arrays)


def name_library(values: Any) -> str:
    """Return the name of an array's library; "numpy" for all other objects."""
    if not is_foreign(values):
        return "numpy"
    if hasattr(values, "__array_namespace__"):
        return str(values.__array_namespace__().__name__)
    return type(values).__module__.partition(".")[0]


def refuse_mixed(name: str, theirs: str, ours: str) -> NoReturn:
    """Raise a TypeError for an array whose library differs from that of the operator."""
    raise TypeError(
        f"{name} is an array of {theirs}, but must be one of {ours}, as the others are: convert "
        "it; SciPy's iterations take arrays of numpy, toeplitz_mg.cg, gmres and richardson all"
    )


def _is_masked(values: Any) -> bool:
    """Whether this is a masked array, or a list that contains one."""
    if isinstance(values, list | tuple):
        return any(map(_is_masked, values))
    return np.ma.isMaskedArray(values)


def numbers(name: str, values: ArrayLike) -> Array:
    """Return a copy in double precision of an array of real numbers, possibly NaN or infinite."""
    array = refuse_masked(name, values)
    if array.dtype.kind not in "buif":
        what = f"has dtype {array.dtype}" if array.ndim else f"is {values!r}"
        raise TypeError(f"{name} {what}, but must be of real numbers")
    return array.astype(np.float64)


def field(name: str, values: ArrayLike, unit: str | None = None) -> Array:
    """Return a copy in double precision of an array of real numbers, possibly infinite.

    A quantity is converted to `unit`.
    """
    array = numbers(name, values if unit is None else in_unit(name, values, unit))
    if np.isnan(array).any():
        raise ValueError(f"{name} is not a number somewhere")
    in_range(name, float(np.max(np.abs(array), where=np.isfinite(array), initial=0.0)))
    return array


def fields(**values: ArrayLike) -> list[Array]:
    """Return `field` of each array, if their shapes broadcast with each other."""
    return require_broadcast(**{name: field(name, x) for name, x in values.items()})


def require_broadcast(**arrays: Array) -> list[Array]:
    """Return the arrays; raise an error unless their shapes broadcast with each other."""
    try:
        np.broadcast_shapes(*(x.shape for x in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {x.shape}" for name, x in arrays.items())
        raise ValueError(f"the shapes are {shapes}, but must broadcast with each other") from None
    return list(arrays.values())


def generator(name: str, seed: Any) -> Any:
    """Return a given random generator, or a new one with this seed."""
    if hasattr(seed, "standard_normal"):
        return seed
    try:
        return np.random.default_rng(seed)
    except (TypeError, ValueError) as error:
        raise type(error)(
            f"{name} is {seed!r}, but must be an integer of at least zero, or a generator of numpy"
        ) from None


def in_range(name: str, size: float) -> None:
    """Raise an error for a size whose powers could not be represented."""
    if size != 0.0 and not SMALL <= size <= LARGE:
        raise ValueError(f"{name} is of size {size:g}, but must be zero or {SMALL:g} to {LARGE:g}")
