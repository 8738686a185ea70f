"""Influence coefficients are the integrals of their kernels, and obey what physics demands."""

import mpmath
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from numpy.testing import assert_allclose, assert_array_equal

import toeplitz_mg as tmg
from tests.systems import refuses
from toeplitz_mg import halfspace
from toeplitz_mg.halfspace import Material

KERNELS = {
    "zz": lambda x, y, r, nu: (1 - nu) / r,
    "xx": lambda x, y, r, nu: (1 - nu) / r + nu * x**2 / r**3,
    "yy": lambda x, y, r, nu: (1 - nu) / r + nu * y**2 / r**3,
    "xy": lambda x, y, r, nu: nu * x * y / r**3,
}
COUPLINGS = {
    "xz": lambda x, y, r, K: -K * x / r**2,
    "yz": lambda x, y, r, K: -K * y / r**2,
}
INFLUENCE = {k: getattr(halfspace, f"influence_{k}") for k in KERNELS}
COUPLING = {k: getattr(halfspace, f"influence_{k}") for k in COUPLINGS}


def influence(kernel, x, y, element, constant, G=1.0):
    """The influence, with the other constant of the kernel: ν, or K of a coupling."""
    if kernel in COUPLING:
        return COUPLING[kernel](x, y, element, G=G, K=constant)
    return INFLUENCE[kernel](x, y, element, G=G, nu=constant)


def quadrature(kernel, x, y, element, nu):
    """∬ f over the element, f homogeneous of degree -1, as ∮ f (r·n) ds, adaptively."""
    f = (KERNELS | COUPLINGS)[kernel]
    with mpmath.workdps(40):
        x, y, h1, h2, nu = (mpmath.mpf(float(v)) for v in (x, y, *element, nu))

        def edge(a, low, high, along_x):
            """a ∫ f ds over the edge at the distance a of its line from the point."""
            if a == 0:
                return mpmath.mpf(0)
            # The integrand changes on the scale |a|: subdivide there, geometrically.
            steps = [s * abs(a) * mpmath.mpf(8) ** k for s in (1, -1) for k in range(12)]
            cuts = sorted({low, high, *(s for s in [0, *steps] if low < s < high)})
            if along_x:
                return a * mpmath.quad(lambda s: f(s, a, mpmath.hypot(s, a), nu), cuts)
            return a * mpmath.quad(lambda s: f(a, s, mpmath.hypot(s, a), nu), cuts)

        X, Y = (x - h1 / 2, x + h1 / 2), (y - h2 / 2, y + h2 / 2)
        total = (
            edge(X[1], *Y, False) - edge(X[0], *Y, False)
            + edge(Y[1], *X, True) - edge(Y[0], *X, True)
        )  # fmt: skip
        return float(total / mpmath.pi)


# Points in element sizes: self, neighbours, off centre inside and out, border, middling, far.
POINTS = [(0, 0), (1, 0), (0, 1), (1, 1), (0.3, -0.2), (0.5, 0.1), (2, 0.4), (-7, 3), (0.2, 17)]
POINTS += [(1000.5, 0.25), (3e4, 2e4)]
ELEMENTS = [(1, 1), (1, 2.5), (3e3, 1), (8e-6, 100)]  # Others are in test_rectangles.py.


@pytest.mark.slow
@pytest.mark.parametrize("element", ELEMENTS, ids=str)
@pytest.mark.parametrize("kernel", KERNELS | COUPLINGS)
def test_against_adaptive_quadrature(kernel, element):
    nu = 0.28
    for tx, ty in POINTS:
        x, y = tx * element[0], ty * element[1]
        value = float(influence(kernel, x, y, element, nu))
        if (tx == 0 and kernel in ("xy", "xz")) or (ty == 0 and kernel in ("xy", "yz")):
            assert value == 0.0  # It is odd in x and in y.
            continue
        expected = quadrature(kernel, x, y, element, nu)
        assert_allclose(value, expected, rtol=1e-12, atol=0, err_msg=f"at {tx, ty} elements")


@pytest.mark.parametrize("nu", [-0.9, 0.0, 0.28, 0.5])
@pytest.mark.parametrize("element", [(1.0, 1.0), (0.1, 2.5)])
def test_matrices_are_positive_definite_and_symmetric_under_exchange(nu, element):
    body = Material.from_shear(2.0, nu)
    zz, xy = (halfspace.influence_matrix(d, (6, 5), element, body).toarray() for d in ("z", "xy"))
    assert_allclose(xy, xy.T, atol=1e-15)
    assert np.linalg.eigvalsh(zz).min() > 0
    if nu >= 0:  # Below zero the collocated kernels are hardly used, and not definite.
        assert np.linalg.eigvalsh(xy).min() > 0
    x, y = halfspace.offsets((6, 5), element)
    xx, yy, zz = (influence(k, x, y, element, nu, G=2.0) for k in ("xx", "yy", "zz"))
    # x and y change places.
    assert_allclose(xx, influence("yy", y, x, element[::-1], nu, G=2.0), rtol=1e-14)
    # A_xx + A_yy = (2 - ν)/(1 - ν) A_zz
    assert_allclose(xx + yy, (2 - nu) / (1 - nu) * zz, rtol=1e-14)


@pytest.mark.parametrize("element", [(1.0, 1.0), (1.0, 2.5), (100.0, 1.0)])
def test_the_coupling_is_towards_the_load_and_the_same_along_both_axes(element):
    points = halfspace.all_offsets((40, 30), element)
    xz, yz = (influence(k, *points, element, 0.1) for k in ("xz", "yz"))
    assert (xz[:39] > 0).all()
    assert (xz[39] == 0.0).all()
    assert (xz[40:] < 0).all()
    assert_array_equal(yz, influence("xz", *points[::-1], element[::-1], 0.1))
    assert_array_equal(influence("xz", *points, element, 0.0), 0.0)


STEEL, RUBBER = Material.from_shear(82000.0, 0.28), Material.from_shear(0.3, 0.49)
ALUMINIUM = Material(E=70000.0, nu=0.33)
PAIRS = [
    (STEEL, RUBBER),
    (ALUMINIUM, STEEL),
    (Material.from_shear(1.0, -0.2), Material.from_shear(3.0, 0.5)),
]


def test_combined_materials():
    both = halfspace.combined_material(STEEL, RUBBER)
    assert_allclose(1 / both.G, (1 / 82000 + 1 / 0.3) / 2)
    assert_allclose(both.nu / both.G, (0.28 / 82000 + 0.49 / 0.3) / 2)
    assert_allclose(1 / both.E_star, 1 / STEEL.E_star + 1 / RUBBER.E_star)
    assert halfspace.combined_material(RUBBER, RUBBER) == halfspace.CombinedMaterial(0.3, 0.49)


@pytest.mark.parametrize(("first", "second"), PAIRS, ids=str)
def test_displacement_differences_of_unequal_materials(first, second):
    """They are those of each body by itself: Johnson, §3.2 and §3.6, with z into that body."""
    element = (1, 2.5)
    both = halfspace.combined_material(first, second)
    K = halfspace.difference_parameter(first, second)
    for tx, ty in ((0.5, 0.25), (1e4, -2e4)):
        x, y = tx * element[0], ty * element[1]
        for kernel in KERNELS | COUPLINGS:
            is_coupling = kernel in COUPLINGS
            one, other = (
                quadrature(kernel, x, y, element, 1 - 2 * m.nu if is_coupling else m.nu) / m.G
                for m in (first, second)
            )
            # The second body is loaded the other way; its z axis points away from the first.
            expected = (one - other) / 4 if is_coupling else (one + other) / 2
            value = influence(kernel, x, y, element, K if is_coupling else both.nu, G=both.G)
            assert_allclose(value, expected, rtol=1e-12, atol=0)


def test_the_difference_parameter():
    for first, second in PAIRS:
        K = halfspace.difference_parameter(first, second)
        assert K == -halfspace.difference_parameter(second, first) != 0.0
        assert halfspace.difference_parameter(first, first) == 0.0
    # On a rigid body; of an incompressible and a rigid one.
    rigid = Material.rigid()
    assert_allclose(
        halfspace.difference_parameter(Material.from_shear(1.0, 0.3), rigid), (1 - 2 * 0.3) / 2
    )
    assert halfspace.difference_parameter(Material.from_shear(1.0, 0.5), rigid) == 0.0
    for material in (1.0, (1.0, 0.3), (1.0, 0.3, 0.3)):
        with pytest.raises(TypeError, match=r"material is .*, but must be a contact\.Material"):
            halfspace.difference_parameter(material, STEEL)


@pytest.mark.parametrize(("first", "second"), PAIRS[:2], ids=str)
def test_three_directions_are_symmetric_and_positive_definite(first, second):
    """They are symmetric by reciprocity, and positive definite as the energy is positive."""
    matrix = halfspace.influence_matrix("xyz", (6, 5), (0.5, 1.0), (first, second)).toarray()
    assert np.abs(matrix[:60, 60:]).max() > 0.0
    assert_allclose(matrix, matrix.T, atol=1e-15 * abs(matrix).max())
    assert np.linalg.eigvalsh(matrix).min() > 0


@pytest.mark.parametrize("n", [1, 2, 7, 40])
def test_line_contact_is_the_integral_of_the_logarithm(n):
    c = halfspace.line_contact_coefficients(n, 0.3, G=2.0, nu=0.25, reference=5.0)
    for k in range(n):
        with mpmath.workdps(30):
            edges = {(k - 0.5) * 0.3, (k + 0.5) * 0.3, 0.0} if k == 0 else {
                (k - 0.5) * 0.3, (k + 0.5) * 0.3
            }  # fmt: skip
            value = mpmath.quad(lambda s: mpmath.log(5.0 / abs(s)), sorted(edges))
        assert_allclose(c[k], 2 * 0.75 / (np.pi * 2.0) * float(value), rtol=1e-12)


@pytest.mark.parametrize("n", [16, 64, 300])
def test_line_contact_is_definite_above_the_capacity_and_refused_below(n):
    h = 8.0 / n
    args = {"G": 1.0, "nu": 0.3}
    c = halfspace.line_contact_coefficients(n, h, **args, reference=2.0 * (1 + 1e-9))
    assert np.linalg.eigvalsh(scipy.linalg.toeplitz(c)).min() > 0
    with pytest.raises(ValueError, match="logarithmic capacity"):
        halfspace.line_contact_coefficients(n, h, **args, reference=2.0 * (1.0 - 2.0 / n))
    # A little below the refusal is right: the matrix is indefinite.
    shift = 2 * 0.7 / np.pi * h * np.log(1.0 - 2.0 / n)
    assert np.linalg.eigvalsh(scipy.linalg.toeplitz(c + shift)).min() < 0


@pytest.mark.parametrize("n", [1, 2, 3, 10])
def test_few_strips_are_refused_where_they_are_indefinite(n):
    """Their threshold lies below the capacity, n / 4 strips: it is met to 1e-6."""

    def smallest(reference):
        def log(s):
            return mpmath.log(reference / abs(s))

        c = [2 * mpmath.quad(log, [0, 0.5])] + [
            mpmath.quad(log, [k - 0.5, k + 0.5]) for k in range(1, n)
        ]
        c = [float(value) for value in c]
        return np.linalg.eigvalsh(scipy.linalg.toeplitz(c)).min()

    threshold = scipy.optimize.brentq(smallest, 0.1 * n / 4, n, xtol=1e-9)
    assert threshold < n / 4
    args = {"G": 1.0, "nu": 0.3}
    halfspace.line_contact_coefficients(n, 1.0, **args, reference=threshold * (1 + 1e-6))
    with pytest.raises(ValueError, match="positive definite"):
        halfspace.line_contact_coefficients(n, 1.0, **args, reference=threshold * (1 - 1e-6))


def test_the_bonded_flat_punch_converges_at_first_order():
    """Test 1 in plane strain: p = Q/(π√(a² - x²)), with Q given by the constant."""
    G, nu, a, d, u = 82000.0, 0.28, 4.0, 200.0, 0.0008
    Q = u * np.pi * G / (2 * (1 - nu) * np.log(2 * d / a))
    errors = []
    for n in (128, 512, 2048, 8192):
        h = 2 * a / n
        A = tmg.ToeplitzOperator(halfspace.line_contact_coefficients(n, h, G=G, nu=nu, reference=d))
        p, info = tmg.richardson(A, np.full(n, u), M=tmg.multigrid(A, pre=0), rtol=1e-12)
        assert info == 0
        x = -a + h * (np.arange(n) + 0.5)
        exact = Q / (np.pi * np.sqrt(a**2 - x**2))
        inside = abs(x) < 0.9 * a
        errors.append(abs(p / exact - 1)[inside].max())
        assert_allclose(p.sum() * h, Q, rtol=2 / n)
    order = np.log(np.array(errors[:-1]) / errors[1:]) / np.log(4)
    assert (order > 0.9).all()
    assert errors[-1] < 1e-3


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        ({"G": 0.0}, ValueError, "G is 0.0, but must be positive"),
        ({"G": np.nan}, ValueError, "G is nan"),
        ({"element": (1.0, -1.0)}, ValueError, r"element\[1\] is -1.0"),
        ({"element": (1.0, 1.0, 1.0)}, ValueError, "two sizes"),
        ({"x": np.inf}, ValueError, "x has coordinates that are not finite"),
        ({"x": np.ones(2), "y": np.ones(3)}, ValueError, r"x \(2,\), y \(3,\), but must"),
        ({"element": 1.0}, ValueError, "element is 1.0, but must have the two sizes"),
        ({"element": (1.0, "a")}, TypeError, r"element\[1\] is 'a', but must be a real number"),
        ({"G": "x"}, TypeError, "G is 'x', but must be a real number"),
        ({"G": np.ones(2)}, TypeError, r"G is array\(\[1., 1.\]\), but must be a real number"),
        ({"x": 1j}, TypeError, "x has dtype complex128"),
        ({"nu": 0.6}, ValueError, "nu is 0.6, but Poisson's ratio"),
        ({"nu": None}, TypeError, "nu is None, but must be a real number"),
        ({"K": 1.5}, ValueError, r"K is 1.5, but a difference parameter must lie in \(-1.5, 1.5\)"),
        ({"K": np.nan}, ValueError, "K is nan"),
    ],
)
def test_refuses_bad_arguments(change, error, match):
    arguments = {"x": 0.0, "y": 0.0, "element": (1.0, 1.0), "G": 1.0} | change
    for functions, constant in ((INFLUENCE, "nu"), (COUPLING, "K")):
        if {"nu": "K", "K": "nu"}[constant] not in change:
            for function in functions.values():
                refuses(error, match, function, **{constant: 0.3} | arguments)


def test_refuses_bad_grids():
    for lags in (halfspace.offsets, halfspace.all_offsets):
        refuses(ValueError, r"grid_shape\[1\] is 0", lags, (4, 0), (1.0, 1.0))
        for grid_shape in ((4,), 4, (4, 4, 4)):
            refuses(ValueError, "two axes", lags, grid_shape, (1.0, 1.0))
        refuses(ValueError, r"element is 1\.0, but must have the two", lags, (4, 4), 1.0)
        with pytest.raises(TypeError):
            lags((4.0, 1), (1.0, 1.0))
    with pytest.raises(ValueError, match="n is 0"):
        halfspace.line_contact_coefficients(0, 1.0, G=1.0, nu=0.3, reference=9.0)
