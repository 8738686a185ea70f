"""Stresses below the surface of two bodies in contact, from the tractions that were found."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.fields import require_finite, require_whole
from toeplitz_mg.contact.result import ContactResult, NormalResult, TangentialResult
from toeplitz_mg.contact.stresses import Stresses
from toeplitz_mg.contact.unlike.result import FrictionalResult
from toeplitz_mg.halfspace import CombinedMaterial
from toeplitz_mg.halfspace.stresses import stress_matrices
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.values import field

BODIES = ("first", "second")


def subsurface_stresses(
    *results: ContactResult | FrictionalResult, depths: ArrayLike, body: str = "first"
) -> Stresses:
    """Return the stresses in a body below the contact, by pressures and tangential tractions.

    Parameters
    ----------
    results : NormalResult, TangentialResult or FrictionalResult
        One of either of the first two kinds, or both, of the same bodies on the same grid: their
        stresses add up. The third has both.
    depths : array_like of shape (d,), or float
        At least zero, mm.
    body : str
        "first", which a positive shift or force drags along x and y, or "second", on which the
        tangential tractions act the other way round. Each has its own Poisson's ratio; of a rigid
        body the stresses are not determined.

    Returns
    -------
    Stresses
        The six components below the centre of each element, at each depth, with `von_mises` and
        `max_shear`.

    Warns
    -----
    ContactWarning
        Where there are tangential tractions without a pressure: the two results do not belong
        together.

    Raises
    ------
    ValueError
        For results on different grids or of different materials, two of one kind, or of materials
        whose bodies are not known; of surfaces that are periodic; for depths that are negative or
        not finite; for a rigid body.
    TypeError
        For what is no result.

    See Also
    --------
    toeplitz_mg.halfspace.stresses_z, toeplitz_mg.halfspace.stresses_x : of one element.

    Notes
    -----
    The tractions are constant in each element, and half-spaces end nowhere. Each depth takes one
    product with a Toeplitz matrix for each component of the stresses, and of the tractions. Depths
    come one after the other: beyond the result, of 6 d n1 n2 numbers, the memory is that of one
    depth, some 40 n1 n2 numbers. One call for each depth saves the rest.

    References
    ----------
    A. E. H. Love, The stress produced in a semi-infinite solid by pressure on part of the boundary,
    Phil. Trans. R. Soc. A 228 (1929); K. L. Johnson, Contact Mechanics, chapters 3, 4 and 7.

    Examples
    --------
    Below a sphere, ν = 0.3, the largest shear stress is 0.31 p₀, at a depth of 0.48 a.

    >>> import numpy as np
    >>> from toeplitz_mg import contact
    >>> steel, element = contact.Material(E=210000.0, nu=0.3), (0.01, 0.01)
    >>> gap = contact.surfaces.sphere((65, 65), element, radius=10.0)
    >>> pressed = contact.normal_contact(gap, element, material=steel, force=100.0)
    >>> a, p0 = np.sqrt(pressed.approach * 10.0), pressed.pressure.max()
    >>> stresses = contact.subsurface_stresses(pressed, depths=np.linspace(0.3, 0.7, 41) * a)
    >>> below = stresses.max_shear[:, 32, 32]
    >>> f"{below.max() / p0:.2f} p0 at {stresses.depths[below.argmax()] / a:.2f} a"
    '0.31 p0 at 0.48 a'
    """
    parts = tuple(part for result in results for part in _parts(result))
    grid = _check_results(parts)
    z = np.atleast_1d(field("depths", depths))
    if z.ndim != 1 or z.size == 0 or not np.isfinite(z).all():
        raise ValueError(f"depths is {depths!r}, but must be a number, or a list of finite ones")
    if (z < 0.0).any():
        raise ValueError(f"depths has the value {z.min():g}, but a depth is at least zero")
    nu = _find_ratio(grid.material, body)
    _doubt(parts)
    tractions = list(_tractions(parts, -1.0 if body == BODIES[1] else 1.0))
    components = np.zeros((6, len(z), *grid.shape))
    for k, depth in enumerate(z.tolist()):
        for direction, traction in tractions:
            matrices = stress_matrices(direction, grid.shape, grid.element, depth, nu=nu)
            for total, A in zip(components[:, k], matrices, strict=True):
                if A is not None:
                    total += apply_to_rows(A, traction.reshape(-1)).reshape(grid.shape)
    return Stresses(body, z, grid.centres, components)


def _parts(result: Any) -> tuple[Any, ...]:
    """Return the normal and the tangential result of bodies pressed together with friction."""
    if isinstance(result, FrictionalResult):
        return result.normal, result.tangential
    return (result,)


def _check_results(results: tuple[ContactResult, ...]) -> ContactResult:
    """Return one of the results, whose grid and material are those of all."""
    for result in results:
        if not isinstance(result, NormalResult | TangentialResult):
            raise TypeError(
                f"a result is {result!r}, but must be a NormalResult, a TangentialResult, or a "
                "FrictionalResult, which has both"
            )
        require_whole(result, "a result")
        require_finite(result, "a result")
        if any(result.periodic):
            raise ValueError(
                f"periodic is {result.periodic} in a result, but stresses are those below bodies "
                "of which nothing repeats"
            )
    kinds = [type(result) for result in results]
    if len(kinds) not in (1, 2) or len(set(kinds)) < len(kinds):
        raise ValueError(
            f"there are {len(kinds)} results, but must be a normal one, a tangential one, or both"
        )
    first, last = results[0], results[-1]
    for name in ("shape", "element", "material"):
        values = getattr(first, name), getattr(last, name)
        if values[0] != values[1]:
            raise ValueError(
                f"{name} is {values[0]} in one result and {values[1]} in the other, but both must "
                "be of the same bodies on the same grid"
            )
    return first


def _doubt(results: tuple[ContactResult, ...]) -> None:
    """Warn of tangential tractions where another result has no pressure."""
    pressed = [r.pressure > 0.0 for r in results if isinstance(r, NormalResult)]
    shifted = [r.traction for r in results if isinstance(r, TangentialResult)]
    for contact, traction in zip(pressed, shifted, strict=False):
        count = np.count_nonzero(traction.reshape(-1, *contact.shape).any(axis=0) & ~contact)
        if count:
            doubts.warn(
                (
                    f"{count} elements have tangential tractions, but no pressure: the results may "
                    "be of two contacts",
                ),
                within=1,
            )


def _find_ratio(material: CombinedMaterial, body: str) -> float:
    """Return Poisson's ratio of one of the bodies."""
    if body not in BODIES:
        raise ValueError(f"body is {body!r}, but must be 'first' or 'second'")
    if material.bodies is None:
        raise ValueError(
            f"material is {material}, of which the bodies are not known: use contact.Material, or "
            "two of them"
        )
    of_body = material.bodies[BODIES.index(body)]
    if np.isinf(of_body.G):
        raise ValueError(f"the {body} body is rigid, so that its stresses are not determined")
    return of_body.nu


def _tractions(results: tuple[ContactResult, ...], sign: float) -> Iterator[tuple[str, Array]]:
    """Yield the directions of the tractions on a body, and these; a pressure is one along z."""
    for result in results:
        if isinstance(result, NormalResult):
            yield "z", result.pressure
        else:
            components = result.traction.reshape(-1, *result.shape)
            for direction, traction in zip("xy", components, strict=False):
                if traction.any():
                    yield direction, sign * traction
