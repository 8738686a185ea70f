"""Influence coefficients against adaptive quadrature, and against what physics demands."""

import mpmath
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from toeplitz_mg import halfspace

KERNELS = {
    "zz": lambda x, y, r, nu: (1 - nu) / r,
    "xx": lambda x, y, r, nu: (1 - nu) / r + nu * x**2 / r**3,
    "yy": lambda x, y, r, nu: (1 - nu) / r + nu * y**2 / r**3,
    "xy": lambda x, y, r, nu: nu * x * y / r**3,
}
INFLUENCE = {
    "zz": halfspace.influence_zz,
    "xx": halfspace.influence_xx,
    "yy": halfspace.influence_yy,
    "xy": halfspace.influence_xy,
}


def quadrature(kernel, x, y, element, nu):
    """∬ f over the element, f homogeneous of degree -1, as ∮ f (r·n) ds, adaptively."""
    f = KERNELS[kernel]
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


# In element sizes: self, neighbours, off centre inside and out, the border, middling, far.
POINTS = [(0, 0), (1, 0), (0, 1), (1, 1), (0.3, -0.2), (0.5, 0.1), (2, 0.4), (-7, 3), (0.2, 17)]
POINTS += [(1000.5, 0.25), (3e4, 2e4)]


@pytest.mark.parametrize("element", [(1, 1), (1, 30), (3e3, 1), (8e-6, 100), (10, 1e-6)], ids=str)
@pytest.mark.parametrize("kernel", KERNELS)
def test_against_adaptive_quadrature(kernel, element):
    nu = 0.28
    for tx, ty in POINTS:
        x, y = tx * element[0], ty * element[1]
        value = float(INFLUENCE[kernel](x, y, element, G=1.0, nu=nu))
        if kernel == "xy" and 0 in (tx, ty):
            assert value == 0.0  # odd in x and in y
            continue
        expected = quadrature(kernel, x, y, element, nu)
        assert_allclose(value, expected, rtol=1e-12, atol=0, err_msg=f"at {tx, ty} elements")


def test_the_papers_coefficients_at_two_to_the_twenty():
    n = 2**20
    c = tmg.contact.problems.test1(n).A.c
    for k in (0, 1, 2, 3, 15, 16, 1000, n // 2, n - 1):
        expected = quadrature("xx", k * 8 / n, 0, (8 / n, 100), 0.28) / 82000
        assert_allclose(c[k], expected, rtol=1e-12)
    assert (np.diff(c) < 0).all()


@pytest.mark.parametrize("nu", [-0.9, 0.0, 0.28, 0.5])
@pytest.mark.parametrize("element", [(1.0, 1.0), (0.1, 2.5)])
def test_matrices_are_positive_definite_and_symmetric_under_exchange(nu, element):
    x, y = halfspace.lags((6, 5), element)
    matrix = {
        k: tmg.ToeplitzOperator(INFLUENCE[k](x, y, element, G=2.0, nu=nu)).toarray()
        for k in ("xx", "yy", "zz")
    }
    X, Y = halfspace.all_lags((6, 5), element)
    xy = tmg.ToeplitzOperator.from_lags(halfspace.influence_xy(X, Y, element, G=2.0, nu=nu))
    matrix["xy"] = xy.toarray()
    assert_allclose(matrix["xy"], matrix["xy"].T, atol=1e-15)
    coupled = np.block([[matrix["xx"], matrix["xy"]], [matrix["xy"], matrix["yy"]]])
    assert np.linalg.eigvalsh(matrix["zz"]).min() > 0
    if nu >= 0:  # below zero the collocated kernels are hardly used, and not definite
        assert np.linalg.eigvalsh(coupled).min() > 0
    # x and y change places.
    swapped = INFLUENCE["yy"](y, x, element[::-1], G=2.0, nu=nu)
    assert_allclose(INFLUENCE["xx"](x, y, element, G=2.0, nu=nu), swapped, rtol=1e-14)
    # A_xx + A_yy = (2 - ν)/(1 - ν) A_zz
    zz = INFLUENCE["zz"](x, y, element, G=2.0, nu=nu)
    total = INFLUENCE["xx"](x, y, element, G=2.0, nu=nu) + INFLUENCE["yy"](
        x, y, element, G=2.0, nu=nu
    )
    assert_allclose(total, (2 - nu) / (1 - nu) * zz, rtol=1e-14)


@pytest.mark.parametrize("kernel", KERNELS)
def test_elements_add_up(kernel):
    """An element of 4 x 3 is twelve of 1 x 1."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-9, 9, (2, 50))
    parts = sum(
        INFLUENCE[kernel](x - i, y - j, (1.0, 1.0), G=1.0, nu=0.3)
        for i in (-1.5, -0.5, 0.5, 1.5)
        for j in (-1, 0, 1)
    )
    whole = INFLUENCE[kernel](x, y, (4.0, 3.0), G=1.0, nu=0.3)
    assert_allclose(parts, whole, rtol=1e-12, atol=1e-14)


def test_combined_materials():
    steel, rubber = halfspace.Material(82000.0, 0.28), halfspace.Material(0.3, 0.49)
    G, nu = halfspace.combined_material(steel, rubber)
    assert_allclose(1 / G, (1 / 82000 + 1 / 0.3) / 2)
    assert_allclose(nu / G, (0.28 / 82000 + 0.49 / 0.3) / 2)
    assert_allclose(halfspace.combined_material(rubber, rubber), rubber)
    # The displacement difference is the mean of what each pair of equal bodies gives.
    args = (0.3, 1.2, (1.0, 2.0))
    for influence in INFLUENCE.values():
        each = [influence(*args, G=m.G, nu=m.nu) for m in (steel, rubber)]
        assert_allclose(influence(*args, G=G, nu=nu), np.mean(each))


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
        ({"nu": 0.6}, ValueError, "nu is 0.6, but Poisson's ratio"),
        ({"element": (1.0, -1.0)}, ValueError, r"element\[1\] is -1.0"),
        ({"element": (1.0, 1.0, 1.0)}, ValueError, "two sizes"),
        ({"x": np.inf}, ValueError, "x has coordinates that are not finite"),
        ({"x": 1j}, TypeError, "x has dtype complex128"),
    ],
)
@pytest.mark.parametrize("kernel", KERNELS)
def test_refuses_bad_arguments(kernel, change, error, match):
    arguments = {"x": 0.0, "y": 0.0, "element": (1.0, 1.0), "G": 1.0, "nu": 0.3} | change
    with pytest.raises(error, match=match):
        INFLUENCE[kernel](**arguments)


def test_refuses_bad_grids():
    for lags in (halfspace.lags, halfspace.all_lags):
        with pytest.raises(ValueError, match=r"grid_shape\[1\] is 0"):
            lags((4, 0), (1.0, 1.0))
        with pytest.raises(ValueError, match="two axes"):
            lags((4,), (1.0, 1.0))
        with pytest.raises(TypeError):
            lags((4.0, 1), (1.0, 1.0))
    with pytest.raises(ValueError, match="n is 0"):
        halfspace.line_contact_coefficients(0, 1.0, G=1.0, nu=0.3, reference=9.0)
