"""Stresses below a loaded rectangle: they are integrals of point loads, so in equilibrium."""

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from numpy.testing import assert_allclose

from toeplitz_mg import halfspace

H = (1.3, 0.7)
LOADS = {d: getattr(halfspace, f"stresses_{d}") for d in "xyz"}
LINES = {d: getattr(halfspace, f"line_stresses_{d}") for d in "xyz"}
each_load = pytest.mark.parametrize("direction", LOADS)
NEAR = np.random.default_rng(1).uniform([-1, -1, 0.3], [1, 1, 1.5], (20, 3))


def boussinesq(x, y, z, nu):
    """The stresses by a unit force into the body (Johnson, Eq. 3.20)."""
    r, d2, n = np.sqrt(x * x + y * y + z * z), x * x + y * y, 1 - 2 * nu
    first, second = (1 - z / r) / d2, z / r**3
    return np.array([
        n / d2 * (first * (x * x - y * y) + second * y * y) - 3 * z * x * x / r**5,
        n / d2 * (first * (y * y - x * x) + second * x * x) - 3 * z * y * y / r**5,
        -3 * z**3 / r**5,
        -3 * y * z * z / r**5,
        -3 * x * z * z / r**5,
        n / d2 * (2 * first * x * y - second * x * y) - 3 * x * y * z / r**5,
    ]) / (2 * np.pi)  # fmt: skip


def cerruti(x, y, z, nu):
    """The stresses by a unit force along x (Johnson, Eq. 3.76)."""
    r, n = np.sqrt(x * x + y * y + z * z), 1 - 2 * nu
    e, g = 1 / (r * (r + z) ** 2), 1 / (r**3 * (r + z) ** 2) + 2 / (r**2 * (r + z) ** 3)
    return np.array([
        -3 * x**3 / r**5 + n * (x / r**3 - 3 * x * e + x**3 * g),
        -3 * x * y * y / r**5 + n * (x / r**3 - x * e + x * y * y * g),
        -3 * x * z * z / r**5,
        -3 * x * y * z / r**5,
        -3 * x * x * z / r**5,
        -3 * x * x * y / r**5 + n * (-y * e + x * x * y * g),
    ]) / (2 * np.pi)  # fmt: skip


def point_load(direction, x, y, z, nu):
    if direction == "y":
        return cerruti(y, x, z, nu)[[1, 0, 2, 4, 3, 5]]
    return (boussinesq if direction == "z" else cerruti)(x, y, z, nu)


@each_load
@pytest.mark.parametrize("nu", [-0.5, 0.0, 0.3, 0.5])
def test_an_element_is_the_integral_of_point_loads(direction, nu):
    s, w = leggauss(60)
    along, across = np.meshgrid(s * H[0] / 2, s * H[1] / 2, indexing="ij")
    weight = np.outer(w, w) * H[0] * H[1] / 4
    for x, y, z in [(0.0, 0.01, 0.4), (0.65, 0.35, 0.5), (0.3, -9.0, 30.0), *NEAR]:
        of_points = point_load(direction, x - along, y - across, z, nu)
        expected = (of_points * weight).sum(axis=(1, 2))
        assert_allclose(LOADS[direction](x, y, z, H, nu=nu), expected, rtol=0, atol=1e-13)


@each_load
@pytest.mark.parametrize("depth", [0.0, 1e-40, 1e-20])
def test_at_the_surface_is_what_acts_on_it(direction, depth):
    component = {"x": 4, "y": 3, "z": 2}
    for x, y, share in [(0.1, -0.2, 1), (0.65, 0.1, 0.5), (0.65, -0.35, 0.25), (1.0, 0.1, 0)]:
        stress = LOADS[direction](x, y, depth, H, nu=0.3)
        assert not np.isnan(stress).any()
        assert_allclose(stress[component[direction]], -share, atol=1e-12)
        # On an edge the limits of the others depend on the way there.
        if share in (0, 1):
            others = [component[d] for d in "xyz" if d != direction]
            assert_allclose(stress[others], 0.0, atol=1e-12)


def test_stresses_that_are_infinite_on_edges_are_so_there_alone():
    on_edge, in_line = halfspace.stresses_x([0.65, 0.65], [0.1, 0.5], 0.0, H, nu=0.3).T
    assert on_edge[0] == on_edge[1] == -np.inf
    assert np.isfinite(on_edge[2:]).all()
    near = halfspace.stresses_x(0.65 + 1e-9, 0.5, 0.0, H, nu=0.3)
    assert_allclose(in_line, near, atol=1e-7)
    without = halfspace.stresses_x(0.65, 0.1, 0.0, H, nu=0.0)
    assert np.isfinite(without[1])


@pytest.mark.parametrize("direction", LINES)
def test_plane_strain_is_a_long_element(direction):
    rng = np.random.default_rng(2)
    x, z = rng.uniform(-3, 3, 50), rng.uniform(0, 3, 50)
    line = LINES[direction](x, z, 1.3, nu=0.3)
    long = LOADS[direction](x, 0.0, z, (1.3, 1e9), nu=0.3)
    in_plane, antiplane = [0, 2, 4], [3, 5]
    some, none = (antiplane, in_plane) if direction == "y" else (in_plane, antiplane)
    assert_allclose(line[some], long[some], atol=1e-8)
    assert_allclose(line[1], 0.3 * (line[0] + line[2]), atol=1e-14)
    assert not line[none].any()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"z": -1.0}, "z has the value -1, but a depth must be at least zero"),
        ({"x": np.inf}, "x has values that are not finite"),
        ({"x": [1.0, 2.0], "y": [1.0, 2.0, 3.0]}, r"x \(2,\), y \(3,\), .* but must broadcast"),
        ({"nu": 0.6}, "nu is 0.6"),
        ({"element": (1.0, -1.0)}, r"element\[1\] is -1"),
    ],
)
def test_refuses_what_makes_no_sense(change, message):
    arguments = {"x": 0.0, "y": 0.0, "z": 0.0, "element": (1.0, 1.0), "nu": 0.3} | change
    for function in LOADS.values():
        with pytest.raises(ValueError, match=message):
            function(**arguments)
    for function in LINES.values():
        with pytest.raises(ValueError, match="h is 0"):
            function(0.0, 0.0, 0.0, nu=0.3)
