"""The matrix of a grid of elements is that of the influence coefficients at all offsets."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from toeplitz_mg import halfspace
from toeplitz_mg.contact import Material

STEEL, RUBBER = Material.from_shear(82000.0, 0.28), Material.from_shear(0.3, 0.49)
DIRECTIONS = ["x", "y", "z", "xy", "xz", "yz", "xyz"]


def influence(i, j, x, y, element, material):
    """By a traction along j, along i, from the kernels that are documented."""
    G, nu = material.G, material.nu
    if i == "z" and j != "z":  # By reciprocity.
        return -influence(j, i, x, y, element, material)
    kernel = getattr(halfspace, "influence_" + "".join(sorted(i + j)))
    constant = {"K": material.difference} if "z" in (i + j) and i != j else {"nu": nu}
    return kernel(x, y, element, G=G, **constant)


@pytest.mark.parametrize("ahead", [0, 1, 2])
@pytest.mark.parametrize("element", [(0.5, 0.5), (0.5, 2.0)], ids=str)
@pytest.mark.parametrize("directions", DIRECTIONS)
def test_entries_are_the_kernels_at_all_differences_of_points(directions, element, ahead):
    material, (n1, n2) = halfspace.combined_material(STEEL, RUBBER), (5, 4)
    A = halfspace.influence_matrix(directions, (n1, n2), element, material, ahead=ahead)
    i, j = (index.ravel() for index in np.indices((n1, n2)))
    x = element[0] * (np.subtract.outer(i, i) + ahead)
    y = element[1] * np.subtract.outer(j, j)
    dense = np.block(
        [[influence(a, b, x, y, element, material) for b in directions] for a in directions]
    )
    assert_allclose(A @ np.eye(len(dense)), dense, rtol=0, atol=1e-14 * abs(dense).max())
    assert A.is_symmetric == (ahead == 0)


def test_what_is_not_coupled_has_no_blocks():
    shape, element = (6, 5), (1.0, 1.0)
    three = halfspace.influence_matrix("xyz", shape, element, Material.from_shear(1.0, 0.3))
    assert three.blocks[0][2] is three.blocks[1][2] is three.blocks[2][0] is None
    assert three.blocks[0][1] is three.blocks[1][0]
    two = halfspace.influence_matrix("xy", shape, element, Material.from_shear(1.0, 0.0))
    assert two.blocks[0][1] is two.blocks[1][0] is None
    tiny = Material.from_shear(1.0, 1e-310)  # Too small to change a digit.
    assert halfspace.influence_matrix("xy", shape, element, tiny).blocks[0][1] is None


@pytest.mark.parametrize("direction", ["x", "z"])
def test_strips_are_a_column_of_elements_or_plane_strain(direction):
    material, element = halfspace.combined_material(STEEL, RUBBER), (0.5, 8.0)
    strips = halfspace.influence_matrix(direction, (7,), element, material)
    column = halfspace.influence_matrix(direction, (7, 1), element, material)
    assert_array_equal(strips.c, column.c[:, 0])
    plane = halfspace.influence_matrix(direction, (7,), (0.5,), material, reference=9.0)
    constants = {"G": material.G, "nu": material.nu, "reference": 9.0}
    assert_array_equal(plane.c, halfspace.line_contact_coefficients(7, 0.5, **constants))
    moved = halfspace.influence_matrix(direction, (7,), (0.5,), material, reference=9.0, ahead=1)
    assert_array_equal(moved.lags[:-1], plane.lags[1:])
    default = halfspace.influence_matrix(direction, (7,), (0.5,), material)
    same = halfspace.influence_matrix(direction, (7,), (0.5,), material, reference=3.5)
    assert_array_equal(default.c, same.c)


def test_coupled_strips():
    material = halfspace.combined_material(STEEL, RUBBER)
    A = halfspace.influence_matrix("xyz", (6,), (0.5, 8.0), material)
    B = halfspace.influence_matrix("xyz", (6, 1), (0.5, 8.0), material)
    assert_allclose(A @ np.eye(18), B @ np.eye(18), rtol=0, atol=1e-15 * abs(B.toarray()).max())
    assert A.blocks[0][1] is None  # x and y, and y and z, are not coupled on their axis.
    assert A.blocks[0][2] is not None


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"directions": ""}, "directions is '', but must be one or several of x, y and z"),
        ({"directions": "yx"}, "directions is 'yx'"),
        ({"directions": "xx"}, "directions is 'xx'"),
        ({"directions": "xyzn"}, "directions is 'xyzn'"),
        ({"element": (1.0,)}, "directions is 'xy' on a grid of shape .*, but plane strain"),
        ({"element": (1.0,), "directions": "z"}, "plane strain .* must have one axis"),
        ({"element": (1.0,), "directions": "yz", "grid_shape": (4,)}, "x, y, xy or z as dir"),
        ({"element": (1.0, 0.0)}, r"element\[1\] is 0.0"),
        ({"grid_shape": (4, 0)}, r"grid_shape\[1\] is 0"),
        ({"grid_shape": 4}, r"grid_shape is 4, but must be \(n1, n2\), or \(n,\) for strips"),
        ({"grid_shape": (4, 4, 4)}, r"grid_shape is \(4, 4, 4\)"),
        ({"element": 1.0}, r"element is 1.0, but must be \(h1, h2\), or \(h,\) for strips of inf"),
        ({"element": (1.0, 1.0, 1.0)}, r"element is \(1.0, 1.0, 1.0\)"),
        ({"directions": 3}, "directions is 3"),
        ({"ahead": -1}, "ahead is -1, but must be at least 0"),
        ({"reference": -1.0}, "reference is -1.0, but must be positive"),
    ],
)
def test_refuses_bad_arguments(change, match):
    given = {"directions": "xy", "grid_shape": (4, 4), "element": (1.0, 1.0)} | change
    with pytest.raises(ValueError, match=match):
        halfspace.influence_matrix(**given, material=STEEL)
