"""Numbers and fields that a user gives: what they are, or what is wrong with them."""

import reprlib
import sys
from operator import index
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array

SMALL = 1e-40  # Least size other than zero, in the user's units: powers of less may underflow.
LARGE = 1e40  # Largest size, in the user's units: powers of more may overflow.


def real(name: str, value: Any, unit: str | None = None) -> float:
    """Return a real number, of a quantity that in this unit."""
    if type(value) is float:  # Sooner than by what follows, which a small system would feel.
        return value
    if unit is not None:
        value = in_unit(name, value, unit)
    if isinstance(value, list | tuple):
        raise TypeError(f"{name} is {value!r}, but must be a real number")
    if np.ndim(value) > 0 or refuse_masked(name, value).dtype.kind not in "buif":
        raise TypeError(f"{name} is {value!r}, but must be a real number")
    return float(value)


def finite(name: str, value: Any, unit: str | None = None) -> float:
    """Return a finite number, of a quantity that in this unit."""
    x = real(name, value, unit)
    if not np.isfinite(x):
        raise ValueError(f"{name} is {value}, but must be finite")
    return x


def positive(name: str, value: Any, unit: str | None = None) -> float:
    """Return a number that is positive and finite, of a quantity that in this unit."""
    x = real(name, value, unit)
    if not 0.0 < x < np.inf:
        raise ValueError(f"{name} is {value}, but must be positive and finite")
    return x


def has_unit(value: Any) -> bool:
    """Whether this is a quantity with a unit, as those of pint, or a sequence with one in it."""
    if isinstance(value, list | tuple):
        return any(map(has_unit, value))
    return hasattr(value, "magnitude") and hasattr(value, "units")


def in_unit(name: str, value: Any, unit: str) -> Any:
    """Return the number of a quantity in this unit; what is no quantity as it is."""
    if not has_unit(value):
        return value
    if isinstance(value, list | tuple):
        return type(value)(in_unit(name, x, unit) for x in value)
    try:
        return value.to(unit).magnitude
    except TypeError:  # Errors of pint about dimensions are such.
        raise TypeError(f"{name} is in {value.units}, but must be in {unit}") from None


def count(name: str, value: Any, least: int = 1) -> int:
    """Return an integer that is not below `least`."""
    refuse_masked(name, value)
    try:
        n = int(index(value))  # True is an index, but no length of an array.
    except TypeError:
        raise TypeError(f"{name} is {value!r}, but must be an integer") from None
    if n < least:
        raise ValueError(f"{name} is {value}, but must be at least {least}")
    return n


def refuse_masked(name: str, values: Any) -> Array:
    """Return NumPy's array of any dtype; refuse those of other libraries, and masked arrays.

    The numbers below a mask mean nothing.
    """
    if type(values) is np.ndarray:  # Sooner than by what follows, which a small system would feel.
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
    """Whether this is an array, and not of NumPy."""
    if type(values) is np.ndarray:  # Sooner than by what follows, as small systems would feel.
        return False
    if isinstance(values, np.ndarray | np.generic | list | tuple | float | int):
        return False
    home = type(values).__module__.partition(".")[0]
    return home in ("cupy", "torch") or hasattr(values, "__array_namespace__")


def is_traced(*arrays: Any) -> bool:
    """Whether one of these has no numbers yet, as JAX follows what is done with it."""
    jax = sys.modules.get("jax")
    return jax is not None and any(isinstance(array, jax.core.Tracer) for array in arrays)


def name_library(values: Any) -> str:
    """Return the name of the library of an array; of all that is no array it is NumPy's."""
    if not is_foreign(values):
        return "numpy"
    if hasattr(values, "__array_namespace__"):
        return str(values.__array_namespace__().__name__)
    return type(values).__module__.partition(".")[0]


def refuse_mixed(name: str, theirs: str, ours: str) -> NoReturn:
    """Raise a TypeError for an array of another library than those it would meet."""
    raise TypeError(
        f"{name} is an array of {theirs}, but the operator has arrays of {ours}: all must be of "
        "one library; iterations for any are toeplitz_mg.cg and richardson"
    )


def _is_masked(values: Any) -> bool:
    """Whether this is a masked array, or a list with one in it."""
    if isinstance(values, list | tuple):
        return any(map(_is_masked, values))
    return np.ma.isMaskedArray(values)


def numbers(name: str, values: ArrayLike) -> Array:
    """Return a copy of an array of real numbers, NaN and infinities too, in double precision."""
    array = refuse_masked(name, values)
    if array.dtype.kind not in "buif":
        what = f"has dtype {array.dtype}" if array.ndim else f"is {values!r}"
        raise TypeError(f"{name} {what}, but must be of real numbers")
    return array.astype(np.float64)


def field(name: str, values: ArrayLike, unit: str | None = None) -> Array:
    """Return a copy of an array of real numbers, infinities too, in double precision.

    Those of a quantity are in this unit.
    """
    array = numbers(name, values if unit is None else in_unit(name, values, unit))
    if np.isnan(array).any():
        raise ValueError(f"{name} is not a number somewhere")
    in_range(name, float(np.max(np.abs(array), where=np.isfinite(array), initial=0.0)))
    return array


def fields(**values: ArrayLike) -> list[Array]:
    """Return what `field` does of each, if their shapes broadcast with each other."""
    return require_broadcast(**{name: field(name, x) for name, x in values.items()})


def require_broadcast(**arrays: Array) -> list[Array]:
    """Return arrays whose shapes broadcast with each other, or say that they do not."""
    try:
        np.broadcast_shapes(*(x.shape for x in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {x.shape}" for name, x in arrays.items())
        raise ValueError(f"the shapes are {shapes}, but must broadcast with each other") from None
    return list(arrays.values())


def generator(name: str, seed: Any) -> Any:
    """Return a generator of random numbers: the one that is given, or a new one with this seed."""
    if hasattr(seed, "standard_normal"):
        return seed
    try:
        return np.random.default_rng(seed)
    except (TypeError, ValueError) as error:
        raise type(error)(
            f"{name} is {seed!r}, but must be an integer of at least zero, or a generator of numpy"
        ) from None


def in_range(name: str, size: float) -> None:
    """Refuse a size whose powers could not be represented."""
    if size != 0.0 and not SMALL <= size <= LARGE:
        raise ValueError(f"{name} is of size {size:g}, but must be zero or {SMALL:g} to {LARGE:g}")
