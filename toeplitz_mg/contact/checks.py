"""Checks of the arguments of contact problems."""

from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.gaps import has_axes, in_order, measure_axes, unit_of_axes
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.results import NormalResult, TangentialResult
from toeplitz_mg.contact.results.quantities import require_whole
from toeplitz_mg.engine.vectors import Vectors
from toeplitz_mg.values import count, field, finite, in_range, positive, real

# Relative distance of a force from the friction limit at which all elements count as sliding. The
# last sticking element is then below the size of any grid, its force below the default tolerance.
SLIDES = 1e-9
ALIKE = 1e-9  # Relative difference of equal material constants, which may have been computed.
ROUNDING = 1e-14  # Relative excess of a force over the largest one that counts as rounding.


def check_load(
    grid: Grid, z: Array, approach: Any, force: Any, pressure: Any = None
) -> tuple[float | None, float | None]:
    """Return the approach and the normal force, one of them None, after checking them and the gap.

    The mean pressure on the grid may be given instead of the force.
    """
    if np.isneginf(z).any():
        raise ValueError("gap has the value -inf: where there is no material, it is inf")
    loads = {"force": force, "approach": approach, "pressure": pressure}
    given = [f"{name} is {value}" for name, value in loads.items() if value is not None]
    if len(given) != 1:
        told = " and ".join(given) or "no load is given"
        raise ValueError(f"{told}, but just one of force, approach and pressure must be given")
    if approach is not None:
        approach = finite("approach", approach, "mm")
        if grid.has_free_mean and approach >= (mean := grid.vectors.sum(z) / z.size):
            raise ValueError(
                f"approach is {approach:g}, but must be below the mean of the gap, {mean:g}: from "
                "there on periodic surfaces touch everywhere, and the approach does not change "
                "with the force: give force= or pressure="
            )
        return approach, None
    name, unit, area = "force", grid.force_unit, 1.0
    if pressure is not None:
        name, force, unit, area = "pressure", pressure, "N/mm**2", grid.area * prod(grid.shape)
    load = finite(name, force, unit)
    if load < 0.0:
        raise ValueError(
            f"{name} is {force}, but must be at least zero: bodies without adhesion cannot pull"
        )
    in_range(name, load * area)
    return None, load * area


def measure_from_contact(
    z: Array, approach: float | None, vectors: Vectors
) -> tuple[Array, float, float | None]:
    """Return gap and approach measured from first contact, and the distance to it.

    A large distance would lose the interference in rounding errors.
    """
    distance = vectors.min(z)
    if distance == np.inf:
        raise ValueError("gap is infinite everywhere, but somewhere there must be material")
    if approach is not None:
        approach = float(approach) - distance
        in_range("the interference", max(0.0, approach))
    return z - distance, distance, approach


def check_hardness(
    grid: Grid,
    hardness: Any,
    force: float | None,
    elements: int | None = None,
    pressure: Any = None,
) -> float:
    """Return the largest pressure (by default infinity) after checking that the force is within it.

    It is carried by all elements, or by `elements` of them. Rounding may exceed it, as a user who
    wants exactly this force computes the product in another order.
    """
    if hardness is None:
        return np.inf
    hardness = positive("hardness", hardness, "N/mm**2")
    in_range("hardness", hardness)
    carried = hardness * grid.area * (prod(grid.shape) if elements is None else elements)
    if force is not None and force > carried * (1.0 + ROUNDING):
        if pressure is not None:
            raise ValueError(
                f"pressure is {pressure}, but must be at most the hardness, {hardness:g}"
            )
        raise ValueError(
            f"force is {force:.15g}, but must be at most {carried:.15g}, which all elements carry "
            f"if they yield at the hardness of {hardness:g} N/mm²"
        )
    return hardness


def check_bound(bound: ArrayLike) -> Array:
    """Return a traction bound as an array, or raise an error."""
    if hasattr(bound, "summary"):
        raise TypeError(
            f"bound is of type {type(bound).__name__}, but must be an array, μ times the pressure: "
            "a result of normal_contact is the first argument, beside mu="
        )
    g = field("bound", in_order("bound", bound), "N/mm**2")
    if (g < 0.0).any():
        raise ValueError(f"bound has the value {g.min():g}, but a traction bound is at least zero")
    return g


def check_friction(mu: Any, shape: tuple[int, ...]) -> Array:
    """Return a coefficient of friction, one number or one per element, after checking it."""
    friction = field("mu", in_order("mu", mu), "")
    if (friction < 0.0).any():
        raise ValueError(
            f"mu is {friction.min():g}, but a coefficient of friction is at least zero"
        )
    if friction.shape not in ((), shape):
        raise ValueError(
            f"mu has shape {friction.shape}, but must be a number, or have that of the grid, "
            f"{shape}"
        )
    return friction


def check_pressed(
    pressed: Any, bound: Any, element: Any, material: Any, periodic: Any, mu: Any
) -> tuple[Array, Any, Any, Any]:
    """Return the traction bound, element, material and periodicity.

    They come from a normal result, or from the arguments for a given bound.
    """
    if (pressed is None) == (bound is None):
        raise TypeError(
            "either a result of normal_contact (the first argument) or a traction bound (bound=) "
            "must be given: " + ("neither is" if bound is None else "both are")
        )
    if bound is not None:
        if has_axes(bound):
            if (unit := unit_of_axes("bound", bound)) not in (None, "mm"):
                raise ValueError(f"the coordinates of bound are in {unit}, but must be in mm")
            bound, element = measure_axes("bound", bound, element)
        g = check_bound(bound)
        if mu is not None:
            raise TypeError("mu is given, but bound is μ p already: leave mu out")
        for name, value in (("element", element), ("material", material)):
            if value is None:
                raise TypeError(f"{name} is not given, but must be beside bound=")
        return g, element, material, False if periodic is None else periodic
    require_pressed(pressed)
    for name, value in (("element", element), ("material", material), ("periodic", periodic)):
        if value is not None:
            raise TypeError(f"{name} is given, but the normal result has it: leave it out")
    require_whole(pressed, "the normal result")
    return read_bound(pressed, mu), pressed.element, pressed.material, pressed.periodic or False


def require_pressed(pressed: Any) -> None:
    """Raise an error unless the first argument of `friction` or `rolling` is a normal result."""
    if isinstance(pressed, NormalResult):
        return
    kind, hint = f"of type {type(pressed).__name__}", ""
    if hasattr(pressed, "normal"):
        hint = ", as its `normal`"
    elif not hasattr(pressed, "summary"):
        kind = f"an array of shape {np.shape(pressed)}" if np.ndim(pressed) else repr(pressed)
        hint = ": give a traction bound as bound="
    raise TypeError(f"the first argument is {kind}, but must be a result of normal_contact{hint}")


def read_bound(pressed: NormalResult, mu: Any) -> Array:
    """Return the traction bound of a normal result; with several ranks, of the rows of one."""
    if mu is None:
        raise TypeError("mu is not given, but must be: the coefficient of friction")
    friction = check_friction(mu, pressed.contact.shape)
    return check_bound(bound_of(friction, pressed.pressure))


def bound_of(mu: Array, p: Array) -> Array:
    """Return the traction bound of pressures: zero without pressure, for any coefficient."""
    return np.multiply(mu, p, out=np.zeros_like(p), where=p != 0.0)


def check_rolled(
    pressed: Any, bound: Any, element: Any, material: Any, mu: Any
) -> tuple[Array, Any, Any]:
    """Return the bound, element and material for rolling, as `check_pressed` does.

    Periodic surfaces are refused.
    """
    g, element, material, periodic = check_pressed(pressed, bound, element, material, None, mu)
    if np.any(periodic):
        raise ValueError(
            f"the normal result has periodic={periodic}, but surfaces that roll do not repeat: "
            "press them with periodic=False"
        )
    return g, element, material


def check_shift(shift: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return a shift as an array that broadcasts to a field of shape (components, ...)."""
    array = field("shift", in_order("shift", shift), "mm")
    if not np.isfinite(array).all():
        raise ValueError("shift has values that are not finite")
    m, *grid = shape
    if array.shape == (m,):
        return array.reshape(-1, *(1,) * len(grid))
    if len(grid) == 1 and array.shape in ((), tuple(grid)):
        return widen(array.reshape(1, -1), m)
    if array.shape == shape:
        return array
    allowed = f"(2,) or {shape}" if len(grid) == 2 else f"() or {tuple(grid)}"
    raise ValueError(f"shift has shape {array.shape}, but must have {allowed}")


def check_force(force: Any, most: float, grid: Grid, *, name: str = "force") -> tuple[Array, bool]:
    """Return the sum of the tractions, by components, for a force, and whether all elements slide.

    They do if the force equals the friction limit `most`, to within `SLIDES`.
    """
    m, area = grid.components, grid.area
    wanted = "(Fx, Fy)" if m == 2 else "a number"
    if isinstance(force, list | tuple) and any(F is None for F in force):
        raise ValueError(
            f"{name} is {force}, but must be {wanted}: only rolling takes None for a component"
        )
    force = field(name, force, grid.force_unit)
    total, force = np.atleast_1d(force) / area, force.tolist()
    if len(grid.shape) == 1 and total.shape == (1,):
        total = widen(total, m)
    if total.shape != (m,) or not np.isfinite(total).all():
        raise ValueError(f"{name} is {force}, but must be {wanted}, and finite")
    size = float(np.linalg.norm(total))
    if size > most * (1.0 + SLIDES):
        raise ValueError(
            f"{name} is {force}, of size {size * area:.12g}, but friction carries at most "
            f"{most * area:.12g}, the sum of μ p: the bodies would slide off"
        )
    return total, size >= most * (1.0 - SLIDES)


def show(given: Any) -> str:
    """Return an argument for an error message: for an array that is no vector, its shape."""
    return repr(given) if np.ndim(given) < 2 and np.size(given) < 4 else str(np.shape(given))


def is_lateral(previous: Any) -> bool:
    """Whether a tangential result has two components, which it may have in line contact too."""
    return isinstance(previous, TangentialResult) and previous.traction.ndim > len(previous.shape)


def has_two_components(shape: tuple[int, ...], shift: Any, force: Any) -> bool:
    """Whether a shift or a force in line contact has two components.

    A shift with two numbers may also be a field on two strips.
    """
    if len(shape) > 1:
        return False  # On a surface they always have two.
    is_field = np.shape(shift) == shape
    return np.shape(force) == (2,) or (np.shape(shift)[:1] == (2,) and not is_field)


def widen(x: Array, components: int) -> Array:
    """Return a field, (components, ...), with additional components, which are zero."""
    return np.concatenate([x, np.zeros((components - len(x), *x.shape[1:]))])


def check_previous(
    previous: TangentialResult, grid: Grid, shape: tuple[int, ...], *, is_guess: bool = False
) -> Array:
    """Return the tractions of a tangential result on the same grid, in the given shape.

    In line contact a missing lateral component is set to zero. Previous tractions must be of the
    same bodies, a guess may be of others.
    """
    name = "guess" if is_guess else "previous"
    if isinstance(previous, NormalResult):
        raise ValueError(f"{name} is a normal contact, but must be one with friction")
    if not isinstance(previous, TangentialResult):
        kind = type(previous).__name__
        raise TypeError(f"{name} is of type {kind}, but must be a TangentialResult")
    if previous.contact.shape != shape[1:] or not _is_same(previous.element, grid.element):
        raise ValueError(
            f"{name} has {previous.contact.shape} elements of {previous.element}, but the grid "
            f"has {shape[1:]} of {grid.element}"
        )
    if not is_guess:
        _check_same_bodies(previous, grid)
    return widen(previous.traction.reshape(-1, *shape[1:]), shape[0])


def _check_same_bodies(previous: TangentialResult, grid: Grid) -> None:
    """Raise an error for tractions of other bodies, or of another periodicity."""
    if tuple(previous.periodic) != tuple(grid.periodic):
        raise ValueError(
            f"previous repeats along the axes {previous.periodic}, but the surface along "
            f"{grid.periodic}: a history is of one surface"
        )
    was, now = ((m.G, m.nu, m.difference) for m in (previous.material, grid.material))
    if not np.allclose(was, now, rtol=ALIKE, atol=0.0):
        raise ValueError(
            f"previous is of {previous.material}, but the bodies are of {grid.material}: a history "
            "is of the same bodies"
        )


def check_same_grid(previous: Any, grid: Grid) -> None:
    """Raise an error unless this is a normal result on the same grid."""
    if not isinstance(previous, NormalResult):
        kind = type(previous).__name__
        raise TypeError(f"previous is of type {kind}, but must be a NormalResult")
    require_whole(previous, "previous")
    if previous.shape != grid.shape or not _is_same(previous.element, grid.element):
        raise ValueError(
            f"previous has {previous.shape} elements of {previous.element}, but the grid has "
            f"{grid.shape} of {grid.element}"
        )


def _is_same(element: tuple[float, ...], other: tuple[float, ...]) -> bool:
    """Whether two element sizes are equal up to rounding."""
    return len(element) == len(other) and np.allclose(element, other, rtol=ALIKE, atol=0.0)


def check_iteration(tolerance: float, max_products: int, progress: Any = None) -> None:
    """Check the tolerance, the limit of products and the progress function."""
    if not 0.0 < real("tolerance", tolerance) < 1.0:
        raise ValueError(f"tolerance is {tolerance}, but must be in (0, 1)")
    count("max_products", max_products)
    if progress is not None and not callable(progress):
        raise TypeError(f"progress is {progress!r}, but must be a function, or None")
