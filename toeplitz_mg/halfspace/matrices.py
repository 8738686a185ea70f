"""The influence matrix of a grid of elements, from its shape, element size and materials."""

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.halfspace.influence import (
    KERNELS,
    influence,
    line_contact_coefficients,
    offsets,
)
from toeplitz_mg.halfspace.materials import Bodies, CombinedMaterial, combine
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator
from toeplitz_mg.operators.coefficients import Coefficients
from toeplitz_mg.values import count, positive, refuse_masked

NEGLIGIBLE = 1e-17  # Smaller ν and K do not change any digit of a displacement in float64.


def influence_matrix(
    directions: str,
    grid_shape: tuple[int, ...],
    element: tuple[float, ...],
    material: Bodies,
    *,
    reference: float | None = None,
    ahead: int = 0,
) -> ToeplitzOperator | CoupledOperator:
    """Return the matrix that maps tractions on a surface to its displacements.

    Parameters
    ----------
    directions : str
        Directions of the displacements and tractions: one or several of x, y and z, in this order.
        "z" is normal contact, "xy" the tangential problem, "xyz" both, coupled if the bodies
        differ.
    grid_shape : (int, int) or (int,)
        n₁ × n₂ elements, or n₁ strips side by side along x.
    element : (float, float) or (float,)
        Size h₁ × h₂ of an element, mm. For strips, width and length, or the width only for strips
        of infinite length (plane strain).
    material : Material or (Material, Material)
        The material of both bodies, or those of the first and the second.
    reference : float, optional
        In plane strain, the distance at which a line load causes no displacement, mm; by default
        the length of the grid.
    ahead : int, optional
        Return the displacements at points that lie this number of elements further along x.

    Returns
    -------
    ToeplitzOperator
        For one direction. Vectors are fields flattened in C order; entries are mm per N/mm².
    CoupledOperator
        For several directions. Vectors have one component after the other.

    Raises
    ------
    ValueError
        If the directions, the grid, the element or the material are not valid, or if z is combined
        with other directions in plane strain.
    TypeError
        If an argument is not a number, or not a `Material`.

    See Also
    --------
    influence_zz, influence_xx, influence_xy, influence_xz, line_contact_coefficients

    Notes
    -----
    Each kernel is even or odd in x and in y, so it is evaluated in one quadrant only.

    Examples
    --------
    >>> from toeplitz_mg import contact, halfspace
    >>> steel = contact.Material(E=210000.0, nu=0.28)  # N/mm²
    >>> halfspace.influence_matrix("z", (32, 16), (0.25, 0.5), steel)
    <ToeplitzOperator 32 x 16, symmetric, float64>
    >>> halfspace.influence_matrix("xy", (32, 16), (0.25, 0.5), steel)
    <CoupledOperator of 2 components, 32 x 16, symmetric, float64>
    """
    is_text = isinstance(directions, str) and directions
    if not is_text or directions != "".join(d for d in "xyz" if d in directions):
        raise ValueError(
            f"directions is {directions!r}, but must be one or several of x, y and z, such as 'xy'"
        )
    for name, value, wanted in (
        ("grid_shape", grid_shape, "(n1, n2), or (n,) for strips"),
        ("element", element, "(h1, h2), or (h,) for strips of infinite length"),
    ):
        if refuse_masked(name, value).shape not in ((1,), (2,)):
            raise ValueError(f"{name} is {value!r}, but must be {wanted}")
    ahead, bodies = count("ahead", ahead, least=0), combine(material)
    shape = (grid_shape[0] + ahead, *grid_shape[1:])
    if len(element) == 1 and (directions not in ("x", "y", "xy", "z") or len(shape) != 1):
        raise ValueError(
            f"directions is {directions!r} on a grid of shape {grid_shape}, but plane strain "
            "(an element of one size) must have one axis, and x, y, xy or z as directions"
        )
    if reference is None:
        reference = element[0] * grid_shape[0]
    else:
        reference = positive("reference", reference)
    return assemble(directions, evaluate_all(directions, shape, element, bodies, reference), ahead)


def evaluate_all(
    directions: str,
    shape: tuple[int, ...],
    element: tuple[float, ...],
    material: CombinedMaterial,
    reference: float,
) -> dict[str, Array]:
    """Return the coefficients for all pairs of directions, at nonnegative offsets."""
    names = [name for name in KERNELS if set(name) <= set(directions)]
    return {name: quadrant(name, shape, element, material, reference) for name in names}


def assemble(
    directions: str, coefficients: dict[str, Array], ahead: int
) -> ToeplitzOperator | CoupledOperator:
    """Return the matrix for these coefficients, with displacements `ahead` elements along x."""
    blocks: dict[str, ToeplitzOperator | None] = {}
    for name, c in coefficients.items():
        parity = KERNELS[name].parity
        blocks[name] = block = operator_of(c, parity, ahead) if c.any() else None
        # By reciprocity, a block that is odd in only one of x and y changes its sign if transposed.
        is_odd = parity[0] != parity[1]
        blocks[name[::-1]] = operator_of(-c, parity, ahead) if block and is_odd else block
    if len(directions) == 1 and (only := blocks[2 * directions]):
        return only
    return CoupledOperator([[blocks[i + j] for j in directions] for i in directions])


def coupling_matrices(
    directions: str,
    grid_shape: tuple[int, ...],
    element: tuple[float, ...],
    material: Bodies,
    *,
    ahead: int = 0,
) -> tuple[ToeplitzOperator | None, ...]:
    """Return the matrices of the tangential displacements of a surface by pressures.

    Parameters
    ----------
    directions : str
        Directions of the displacements: "x" or "xy".
    grid_shape, element, material, ahead
        The arguments of `influence_matrix`.

    Returns
    -------
    tuple of ToeplitzOperator or None
        One for each direction; None if there is no coupling. By reciprocity their transposes give
        the normal displacements by tangential tractions.
    """
    bodies = combine(material)
    shape = (grid_shape[0] + ahead, *grid_shape[1:])
    matrices: list[ToeplitzOperator | None] = []
    for name in (direction + "z" for direction in directions):
        c = quadrant(name, shape, element, bodies, 1.0)
        matrices.append(operator_of(c, KERNELS[name].parity, ahead) if c.any() else None)
    return tuple(matrices)


def quadrant(
    name: str,
    shape: tuple[int, ...],
    element: tuple[float, ...],
    material: CombinedMaterial,
    reference: float,
) -> Array:
    """Return the coefficients of two directions, for example "zz", at nonnegative offsets."""
    if len(element) == 1:
        if name == "xz":  # A line load causes no strain beside it: each side moves as a whole.
            step = np.sign(np.arange(shape[0], dtype=np.float64))
            coupling: Array = -material.difference / material.G * element[0] * step
            return coupling
        if name in ("xy", "yz"):  # Displacements along the strips do not couple to others.
            return np.zeros(shape)
        # Along the strips it is antiplane shear, which does not depend on Poisson's ratio.
        G, nu = material.G, 0.0 if name == "yy" else material.nu
        return line_contact_coefficients(shape[0], element[0], G=G, nu=nu, reference=reference)
    x, y = offsets((shape[0], shape[1] if len(shape) == 2 else 1), (element[0], element[1]))
    return evaluate(name, x, y, element, material).reshape(shape)


def evaluate(
    name: str, x: Array, y: Array, element: tuple[float, ...], material: CombinedMaterial
) -> Array:
    """Return the coefficients of two directions, for example "zz", at any offsets on a surface."""
    constant = KERNELS[name].constant
    value = material.difference if constant == "K" else material.nu
    # The coupling of two directions may be so small that products underflow.
    value = 0.0 if abs(value) < NEGLIGIBLE else value
    return influence(name, x, y, (element[0], element[1]), G=material.G, **{constant: value})


def operator_of(c: Array, parity: tuple[int, ...], ahead: int) -> ToeplitzOperator:
    """Return the matrix with coefficients that are even or odd in each axis."""
    if ahead == 0 and set(parity[: c.ndim]) == {1}:
        return ToeplitzOperator(Coefficients.of_column(c))  # Without the check for a dense matrix.
    lags = np.empty([2 * n - 1 for n in c.shape])
    lags[tuple(slice(n - 1, None) for n in c.shape)] = c
    for axis, n in enumerate(c.shape):
        # The axes before this one are already complete.
        behind = [slice(m - 1, None) for m in c.shape[axis + 1 :]]
        before = [slice(None)] * axis
        at = (*before, slice(n, None), *behind)
        lags[(*before, slice(n - 1), *behind)] = parity[axis] * np.flip(lags[at], axis)
    # The coefficient at the offset d is the kernel at d + ahead.
    return ToeplitzOperator.from_lags(lags[2 * ahead :])
