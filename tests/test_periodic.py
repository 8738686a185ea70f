"""Surfaces that repeat: their waves, Westergaard's theory, complementarity, few products."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from toeplitz_mg import halfspace
from toeplitz_mg.contact import (
    Material,
    friction,
    normal_contact,
    subsurface_stresses,
    surfaces,
)
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.normal.active_set import Search
from toeplitz_mg.contact.normal.exchange import vary_by
from toeplitz_mg.halfspace.periodic import strip_eigenvalues, strip_length

UNIT = Material.from_shear(0.7, 0.3)  # G and ν of bodies with E* = G/(1-ν) = 1.
ANY = pytest.mark.parametrize(
    ("shape", "element"),
    [((6,), 0.3), ((7,), 0.3), ((6, 5), (0.3, 0.2)), ((4, 8), (0.3, 0.2)), ((5, 1), (0.3, 0.2))],
)

# Tests of what is solved, on grids that are meant to be small.
doubtful = pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")


def dense_waves(shape, element):
    """The matrix of 2/(E*|q|), E* = 1, as a sum of plane waves: no transform, no half spectrum."""
    sizes = np.atleast_1d(element)
    places = np.indices(shape).reshape(len(shape), -1).T
    matrix = np.zeros((len(places),) * 2)
    for k in places[1:]:
        # The frequency n - k is that of -k.
        signed = [j if j <= n // 2 else j - n for j, n in zip(k, shape, strict=True)]
        q = 2 * np.pi * np.array(signed) / (np.array(shape) * sizes[: len(shape)])
        phase = places * sizes[: len(shape)] @ q
        wave = np.cos(phase[:, None] - phase)
        matrix += 2.0 / np.linalg.norm(q) * wave / len(places)
    return matrix


def assert_complementary(result, matrix, gap, tolerance=1e-8):
    """With the products of a dense matrix: p ≥ 0, w ≥ 0, w = 0 where p > 0."""
    p = result.traction
    w = (matrix @ p.ravel()).reshape(p.shape) + gap - result.rigid
    slack = 1.05 * tolerance * (result.rigid - gap.min())
    assert p.min() >= 0.0
    assert w.min() >= -slack
    assert np.abs(w[p > 0.0]).max() <= slack


def westergaard(n, share, amplitude=0.01):
    """A wave of length 1 under a share of the pressure of full contact: result and theory."""
    h, full = 1.0 / n, np.pi * amplitude  # E* = 1 (Johnson, Contact Mechanics, §13.2).
    (x,) = surfaces.centres(n, h)
    x = x + 0.3 * h  # So that the crest is at no element's centre, and at no edge.
    gap = amplitude * (1.0 - np.cos(2 * np.pi * x))
    result = normal_contact(gap, h, material=UNIT, force=share * full, periodic=True)
    half = np.arcsin(np.sqrt(share)) / np.pi
    inside = np.maximum(share - np.sin(np.pi * x) ** 2, 0.0)
    return result, 2.0 * full * np.cos(np.pi * x) * np.sqrt(inside), half


# Matrices -----------------------------------------------------------------------------------


@ANY
def test_the_matrix_is_that_of_its_waves(shape, element):
    grid = Grid.of(shape, element, UNIT, None, True)
    expected = dense_waves(shape, element)
    if shape == (5, 1):  # Along an axis of one element all is constant.
        assert_allclose(grid.normal().toarray(), dense_waves((5,), 0.3), atol=1e-15)
        return
    A, unit = grid.scaled_normal()
    x = np.random.default_rng(0).random(expected.shape[0])
    assert_allclose(grid.normal().toarray(), expected, atol=1e-15)
    assert_allclose(grid.normal() @ x, expected @ x, atol=1e-15)
    assert_allclose(unit * (A @ x), expected @ x, atol=1e-15)
    assert_allclose(grid.normal().norm_bound, np.linalg.eigvalsh(expected).max())
    assert_allclose(grid.normal() @ np.ones(len(x)), 0.0, atol=1e-15)  # The mean is free.


@ANY
def test_the_inverse_is_exact_but_for_the_mean(shape, element):
    grid = Grid.of(shape, element, UNIT, None, True)
    A, _ = grid.scaled_normal()
    M = grid.invert_by_transform(A)
    x = np.random.default_rng(0).random(A.shape[0])
    assert_allclose(M @ (A @ x), x - x.mean(), atol=1e-13)
    assert np.linalg.eigvalsh(M @ np.eye(len(x))).min() > 0.0


@ANY
def test_the_pressures_by_the_displacements_are_the_pseudoinverse(shape, element):
    grid = Grid.of(shape, element, UNIT, None, True)
    if shape == (5, 1):
        expected = np.linalg.pinv(dense_waves((5,), 0.3), rcond=1e-9)
    else:
        expected = np.linalg.pinv(dense_waves(shape, element), rcond=1e-9)
    K, diagonal = grid.scaled_inverse()
    assert_allclose(np.diag(K.toarray()), 1.0)
    assert_allclose(diagonal * K.toarray(), expected, atol=1e-11)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("wave", [1, 3])
def test_where_one_axis_repeats_it_is_a_sum_of_images(axis, wave):
    """Waves along x, constant in a row of elements: as fine elements, and many images of them."""
    n, rows, h, b, fine, images = 8, 4, 0.25, 0.4, 64, 60
    shape, element = ((n, rows), (h, b)) if axis == 0 else ((rows, n), (b, h))
    periodic = (axis == 0, axis == 1)
    A = Grid.of(shape, element, UNIT, None, periodic).normal()
    p = np.zeros((n, rows))
    centres = h * np.arange(n)
    p[:, 0] = np.cos(2 * np.pi * wave * centres / (n * h))
    u = A @ (p if axis == 0 else p.T).ravel()
    u = u.reshape(shape) if axis == 0 else u.reshape(shape).T
    # The fine elements lie around the centre where the displacement is wanted.
    reach = images * n * fine
    x = h / fine * np.arange(-reach, reach + 1)
    pressures = np.cos(2 * np.pi * wave * x / (n * h))
    pressures[[0, -1]] *= 0.5  # Whole periods: what is further away has the mean zero.
    for row in range(rows):
        y = np.full_like(x, row * b)
        kernel = halfspace.influence_zz(x, y, (h / fine, b), G=UNIT.G, nu=UNIT.nu)
        # A wave is displaced as one, by the same factor everywhere.
        assert_allclose(u[:, row], (kernel @ pressures) * p[:, 0], atol=2e-4 * np.abs(u).max())


def test_where_one_axis_repeats_the_mean_is_a_line_contact():
    G, nu, reference = 0.7, 0.3, 5.0
    A = Grid.of((6, 4), (0.25, 0.4), UNIT, reference, (True, False)).normal()
    c = halfspace.line_contact_coefficients(4, 0.4, G=G, nu=nu, reference=reference)
    u = (A @ np.kron(np.ones(6), [1.0, 0.0, 0.0, 0.0])).reshape(6, 4)
    assert_allclose(u, np.tile(c, (6, 1)), rtol=1e-13)
    # It is the sum of many images but for a constant, that is the same for all rows.
    x = 0.25 * np.arange(-40_000, 40_001)
    rows = [
        halfspace.influence_zz(x, np.full_like(x, 0.4 * k), (0.25, 0.4), G=G, nu=nu).sum()
        for k in range(4)
    ]
    assert_allclose(np.diff(c), np.diff(rows), rtol=1e-6)


@pytest.mark.parametrize("directions", ["xx", "xy", "yy"])
@pytest.mark.parametrize("axis", [0, 1])
def test_where_one_axis_repeats_tractions_are_sums_of_images(axis, directions):
    """As above: the tractions of a wave along one axis, and the displacements in all rows."""
    n, rows, h, b, fine, images = 8, 3, 0.25, 0.4, 64, 60
    shape, element = ((n, rows), (h, b)) if axis == 0 else ((rows, n), (b, h))
    A = Grid.of(shape, element, UNIT, None, (axis == 0, axis == 1)).tangential()
    to, of = ("xy".index(direction) for direction in directions)
    q, places = 2 * np.pi / (n * h), h * np.arange(n)
    t = np.zeros((n, rows))
    t[:, 0] = np.cos(q * places + 0.4)
    field = np.zeros((2, *shape))
    field[of] = t if axis == 0 else t.T
    u = (A @ field.ravel()).reshape(field.shape)[to]
    u = u if axis == 0 else u.T
    reach = images * n * fine
    along = h / fine * np.arange(-reach, reach + 1)
    kernel = getattr(halfspace, f"influence_{directions}")
    weights = np.ones_like(along)
    weights[[0, -1]] = 0.5  # Whole periods.
    for row in range(rows):
        across = np.full_like(along, row * b)
        x, y = (along, across) if axis == 0 else (across, along)
        size = (h / fine, b) if axis == 0 else (b, h / fine)
        k = weights * kernel(x, y, size, G=UNIT.G, nu=UNIT.nu)
        # What is at the distance d ahead is moved by the wave's phase there, less q d.
        even, odd = (k * np.cos(q * along)).sum(), (k * np.sin(q * along)).sum()
        expected = even * np.cos(q * places + 0.4) + odd * np.sin(q * places + 0.4)
        assert_allclose(u[:, row], expected, atol=2e-4 / UNIT.G)


def test_where_one_axis_repeats_the_mean_traction_is_a_line_contact():
    """Along the axis antiplane shear, of which ν is no part; across it plane strain."""
    A = Grid.of((6, 4), (0.25, 0.4), UNIT, 5.0, (True, False)).tangential()
    row = np.kron(np.ones(6), [1.0, 0.0, 0.0, 0.0])
    for component, nu in ((0, 0.0), (1, 0.3)):
        c = halfspace.line_contact_coefficients(4, 0.4, G=0.7, nu=nu, reference=5.0)
        u = (A @ np.kron(np.eye(2)[component], row)).reshape(2, 6, 4)
        assert_allclose(u[component], np.tile(c, (6, 1)), rtol=1e-13)
        assert_allclose(u[1 - component], 0.0, atol=1e-15)


@pytest.mark.parametrize("periodic", [(True, True), (True, False), (False, True)])
def test_products_are_those_of_the_blocks(periodic):
    """The one product, in which nothing is padded where it repeats, has the dense entries."""
    A = Grid.of((6, 5), (0.3, 0.2), UNIT, None, periodic).tangential()
    X = np.random.default_rng(2).random((A.shape[0], 2))
    assert_allclose(A @ X, A.toarray() @ X, atol=1e-14)
    assert np.linalg.norm(A.toarray(), 2) <= A.norm_bound * (1 + 1e-12)
    assert A.work <= (0.25 if all(periodic) else 0.6)


@pytest.mark.parametrize("periodic", [(True, True), (True, False), (False, True)])
def test_the_tangential_matrix_is_symmetric_to_the_last_bit(periodic):
    assert Grid.of((48, 54), (0.3, 0.2), UNIT, None, periodic).tangential().is_symmetric


@pytest.mark.parametrize("matrix", ["normal", "tangential"])
@pytest.mark.parametrize("shape", [(8, 5), (7, 1), (6, 3)])
def test_where_one_axis_repeats_the_matrix_is_positive_definite(shape, matrix):
    element = (0.3, 0.2)
    grids = [
        Grid.of(shape, element, UNIT, None, (True, False)),
        Grid.of(shape[::-1], element[::-1], UNIT, None, (False, True)),
    ]
    first, second = (getattr(grid, matrix)() for grid in grids)
    components = first.shape[0] // np.prod(shape)
    x = np.random.default_rng(1).random((components, *shape))
    dense = first.toarray()
    assert np.linalg.eigvalsh(dense).min() > 0.0
    assert_allclose(first @ x.ravel(), dense @ x.ravel(), rtol=1e-12)
    # With x and y exchanged so are the components.
    turned = second @ x[::-1].swapaxes(1, 2).ravel()
    turned = turned.reshape(components, *shape[::-1])[::-1].swapaxes(1, 2)
    assert_allclose(turned.ravel(), first @ x.ravel(), rtol=1e-12)
    for grid, A in zip(grids, (first, second), strict=True):
        M = grid.invert_by_transform(A)
        assert np.linalg.eigvalsh(M @ np.eye(A.shape[0])).min() > 0.0


def test_strips_of_finite_length_that_repeat():
    strips = Grid.of((6,), (0.3, 0.2), UNIT, 3.0, True).normal()
    column = Grid.of((6, 1), (0.3, 0.2), UNIT, 3.0, (True, False)).normal()
    assert_allclose(strips.toarray(), column.toarray(), rtol=1e-14)


@pytest.mark.parametrize("directions", ["zz", "xx", "xy", "yy"])
@pytest.mark.parametrize("axis", [0, 1])
def test_the_eigenvalues_along_an_axis_that_ends(directions, axis):
    """They are those of a circulant of what a wave displaces, by the Bessel functions."""
    from scipy.integrate import quad
    from scipy.special import k0, k1

    nu, G, n, h = 0.3, 1.7, 3, (0.5, 0.4)
    along, across = h[axis], h[1 - axis]
    shape = (5, n) if axis == 0 else (n, 5)
    arguments = {"G": G, "nu": nu, "reference": 20.0}
    found = strip_eigenvalues(shape, h, axis, directions, **arguments)
    is_odd, is_along = directions == "xy", directions == 2 * "xy"[axis]

    def displacement(t, q):
        x = abs(q * t)
        if directions == "zz":
            return (1.0 - nu) * k0(x)
        if is_odd:
            return -nu * q * t * k0(x)
        return k0(x) - nu * x * k1(x) if is_along else (1.0 - nu) * k0(x) + nu * x * k1(x)

    length = strip_length(n)
    for k in range(1, 5):
        q = 2.0 * np.pi * np.fft.fftfreq(5, along)[k]
        column = np.zeros(length)
        for j in range(1 - n, n):
            edges = (j - 0.5) * across, (j + 0.5) * across
            exact, _ = quad(displacement, *edges, args=(q,), points=[0.0] * (j == 0), epsabs=1e-13)
            column[j] = 2.0 / (np.pi * G) * exact
        hat = np.fft.fft(column)
        expected = -hat.imag if is_odd else hat.real
        line = found[k] if axis == 0 else found[:, k] if k < 3 else found[:, 5 - k]
        if axis == 1 and k >= 3 and is_odd:
            line = -line
        assert_allclose(line, expected[: len(line)], rtol=0, atol=1e-11 * abs(expected).max())


# Grids --------------------------------------------------------------------------------------


def test_coarser_grids_halve_even_axes_only():
    grid = Grid.of((48, 45), (0.1, 0.2), UNIT, None, True)
    assert grid.coarser().shape == (24, 45)
    assert grid.coarser().element == (0.2, 0.2)
    assert grid.coarser().coarser().shape == (12, 45)
    assert Grid.of((45, 45), (0.1, 0.2), UNIT, None, True).coarser() is None
    assert Grid.of((45, 45), (0.1, 0.2), UNIT, None, (True, False)).coarser().shape == (45, 23)


@pytest.mark.parametrize("shape", [(8,), (8, 6), (8, 5)])
def test_transfers_go_around(shape):
    grid = Grid.of(shape, (0.1,) * len(shape), UNIT, None, True)
    x = np.random.default_rng(0).random(shape)
    coarse = grid.coarsen(x)
    assert_allclose(coarse.mean(), x.mean())
    assert_allclose(grid.coarsen(np.roll(x, 2, axis=0)), np.roll(coarse, 1, axis=0))
    fine = grid.refine(coarse)
    assert fine.shape == shape
    assert_allclose(fine.mean(), coarse.mean())
    assert_allclose(grid.refine(np.roll(coarse, 1, axis=0)), np.roll(fine, 2, axis=0))


# Westergaard --------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.1, 0.3, 0.6, 0.9])
def test_westergaards_wave(share):
    result, theory, half = westergaard(512, share)
    assert abs(result.area - 2.0 * half) <= 2.0 / 512  # An element at each edge.
    assert abs(result.traction.max() / theory.max() - 1.0) < 1e-3
    assert np.linalg.norm(result.traction - theory) < 1e-2 * np.linalg.norm(theory)
    assert result.products <= 16
    assert_allclose(result.force, share * np.pi * 0.01)


def test_the_order_of_westergaards_pressure():
    errors = []
    for n in (128, 512, 2048):
        # The error jumps with the place of the edge in its element.
        pairs = [westergaard(n, share)[:2] for share in (0.3, 0.35, 0.4, 0.45, 0.5, 0.55)]
        errors.append(np.hypot.reduce([np.linalg.norm(p.traction - t) for p, t in pairs]))
        errors[-1] /= np.hypot.reduce([np.linalg.norm(t) for _, t in pairs])
    assert np.log(errors[0] / errors[-1]) / np.log(16.0) > 0.9


@pytest.mark.parametrize("periodic", [True, (True, False)])
def test_a_wave_in_full_contact(periodic):
    """p = p̄ + E*|q|/2 times the wave of the heights; of a surface the wave is along x."""
    n, amplitude, length = 32, 0.01, 3.2
    (x,) = surfaces.centres(n, 0.1)
    wave = amplitude * np.cos(2 * np.pi * x / length)
    mean = 3.0 * np.pi * amplitude / length
    shape, element = ((n,), 0.1) if periodic is True else ((n, 20), (0.1, 4.0))
    gap = -wave if periodic is True else np.repeat(-wave[:, None], 20, axis=1)
    force = mean * length * (1.0 if periodic is True else 80.0)
    result = normal_contact(gap, element, material=UNIT, force=force, periodic=periodic)
    assert result.contact.all()
    p = result.traction if periodic is True else result.traction[:, 10]
    expected = np.pi * amplitude / length * np.cos(2 * np.pi * x / length)
    assert_allclose(p - p.mean(), expected, atol=1e-3 * expected.max())
    assert result.warnings == ()
    assert result.traction.shape == shape


# Any problem --------------------------------------------------------------------------------


@doubtful
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.one_of(
        st.tuples(st.integers(2, 60)), st.tuples(st.integers(2, 20), st.integers(2, 20))
    ),
    load=st.floats(1e-4, 3.0),
    is_force=st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_any_surface_and_load(seed, shape, load, is_force):
    rng = np.random.default_rng(seed)
    element = tuple(rng.uniform(0.1, 1.0, len(shape)))
    gap = 0.01 * rng.standard_normal(shape)
    if is_force:
        arguments = {"force": 0.01 * load * np.prod(shape) * np.prod(element)}
    else:
        arguments = {"approach": gap.min() + (gap.mean() - gap.min()) * min(load / 3.0, 0.99)}
    result = normal_contact(gap, element, material=UNIT, periodic=True, **arguments)
    assert_complementary(result, dense_waves(shape, element), gap)
    assert_allclose(result.displacement.mean(), 0.0, atol=1e-15)
    assert_allclose(result.gap.mean(), gap.mean() - result.rigid, atol=1e-15)
    if is_force:
        assert_allclose(result.force, arguments["force"], rtol=1e-8)


@doubtful
@pytest.mark.parametrize("share", [0.0, 0.02, 0.08])
def test_nearly_full_contact(share):
    """Forces that would pull a share of the elements, if all were held in contact."""
    shape, element = (16, 12), (0.3, 0.2)
    gap = surfaces.rough(shape, element, rms=0.01, longest=2.0, shortest=0.8, seed=4)
    A = dense_waves(shape, element)
    held = -(np.linalg.pinv(A, rcond=1e-9) @ gap.ravel()).reshape(shape)
    mean = -np.quantile(held, share) + (1e-3 if share == 0.0 else 0.0)
    force = mean * gap.size * np.prod(element)
    result = normal_contact(
        gap, element, material=UNIT, force=force, periodic=True, tolerance=1e-11
    )
    assert_complementary(result, A, gap, tolerance=1e-11)
    assert_allclose(result.force, force)
    apart = np.count_nonzero(result.pressure == 0.0)
    if share == 0.0:
        assert_allclose(result.pressure, held + mean, rtol=1e-9)
    assert share * gap.size <= apart < 3.0 * share * gap.size + 1.0


def test_the_slopes_tell_how_much_full_contact_varies():
    """The root mean square of its pressures is E*/2 times that of the slopes."""
    shape, element, force = (24, 36), (0.3, 0.2), 0.4
    gap = surfaces.rough(shape, element, rms=0.01, longest=7.0, shortest=3.0, seed=4)
    grid = Grid.of(shape, element, UNIT, None, True)
    K, unit = grid.scaled_inverse()
    deviation = np.std(K @ gap.ravel()) * unit * gap.size * grid.area
    assert_allclose(vary_by(Search(grid, gap, None, force, 1e-8)), deviation, rtol=0.1)


@doubtful
@pytest.mark.parametrize("load", [{"force": 0.3}, {"approach": 0.01}])
def test_where_one_axis_repeats_the_pressures_are_complementary(load):
    gap = 0.02 * np.random.default_rng(4).random((12, 9))
    for periodic in ((True, False), (False, True)):
        grid = Grid.of(gap.shape, (0.3, 0.2), UNIT, None, periodic)
        result = normal_contact(gap, (0.3, 0.2), material=UNIT, periodic=periodic, **load)
        assert_complementary(result, grid.normal().toarray(), gap)


@doubtful
def test_moving_the_surface_moves_the_pressures():
    gap = 0.01 * np.random.default_rng(5).random((40, 36))
    here, there = (
        normal_contact(z, (0.1, 0.1), material=UNIT, force=0.2, periodic=True, tolerance=1e-11)
        for z in (gap, np.roll(gap, (7, 13), (0, 1)))
    )
    assert_allclose(np.roll(here.traction, (7, 13), (0, 1)), there.traction, atol=1e-9)
    assert_allclose(here.rigid, there.rigid, rtol=1e-9)


def test_far_apart_spheres_are_as_one():
    gap = surfaces.sphere((128, 128), (0.02, 0.02), radius=1.0)
    one = normal_contact(gap, (0.02, 0.02), material=UNIT, force=0.001)
    many = normal_contact(gap, (0.02, 0.02), material=UNIT, force=0.001, periodic=True)
    assert_allclose(many.traction.max(), one.traction.max(), rtol=0.01)
    assert_allclose(many.area, one.area, rtol=0.03)


@pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")
@pytest.mark.parametrize("shape", [(1, 7), (7, 1), (5, 27), (7, 7), (33, 57)])
@pytest.mark.parametrize("height", [0.0, 1e-16])
def test_flat_surfaces_have_uniform_pressures(shape, height):
    gap = 1.0 + height * np.random.default_rng(3).random(shape)
    for element in ((0.05, 0.05), (0.0117, 0.05)):
        for force in (0.01, 1.0, 2481.31):
            pressed = normal_contact(gap, element, material=UNIT, force=force, periodic=True)
            mean = force / (np.prod(element) * gap.size)
            assert_allclose(pressed.pressure, mean, rtol=1e-6)


def test_units():
    """Lengths in other units, and pressures in others: the same contact."""
    gap = surfaces.rough((64, 64), (0.1, 0.1), rms=0.01, seed=3)
    exact = {"periodic": True, "tolerance": 1e-11}
    one = normal_contact(gap, (0.1, 0.1), material=UNIT, force=0.5, **exact)
    stiff = Material.from_shear(0.7e9, 0.3)
    other = normal_contact(1e3 * gap, (100.0, 100.0), material=stiff, force=0.5e15, **exact)
    # Beside an area that is found to 1e-11 small pressures have fewer digits than large ones.
    atol = 1e-8 * other.traction.max()
    assert_allclose(other.traction, 1e9 * one.traction, rtol=0, atol=atol)
    assert_allclose(other.rigid, 1e3 * one.rigid)


# Rough surfaces -----------------------------------------------------------------------------


def rough(n, mean):
    h = 2.0 / n
    gap = surfaces.rough((n, n), (h, h), rms=0.002, longest=0.5, shortest=2.0 / 64, seed=1)
    return normal_contact(gap, (h, h), material=UNIT, force=0.8 * mean, periodic=True)


LOADS = pytest.mark.parametrize(
    ("mean", "share"), [(0.003, 0.02), (0.015, 0.1), (0.05, 0.3), (0.18, 0.75), (0.4, 0.99)]
)


@LOADS
def test_products_for_a_rough_surface(mean, share):
    result = rough(256, mean)
    assert abs(result.contact.mean() - share) < 0.04
    assert result.products <= 45
    assert result.residual <= 1e-8


def test_few_elements_that_are_apart_are_solved_for_by_fsai(monkeypatch):
    """On a grid that is wide enough: with the same pressures as by transforms of the whole grid."""
    built = []
    invert = Grid.invert_by_fsai

    def count(grid, A, C, dtype=None):
        built.append(np.count_nonzero(C))
        return invert(grid, A, C, dtype)

    monkeypatch.setattr(Grid, "invert_by_fsai", count)
    by_transforms = rough(128, 0.4)
    assert not built
    monkeypatch.setattr("toeplitz_mg.contact.inverse.WIDE", 0)
    result = rough(128, 0.4)
    assert built
    assert max(built) < 0.1 * 128**2
    assert result.residual <= 1e-8
    atol = 1e-6 * by_transforms.pressure.max()
    assert_allclose(result.pressure, by_transforms.pressure, rtol=0, atol=atol)


@pytest.mark.slow
@LOADS
def test_large_rough_surfaces(mean, share):
    result = rough(1024, mean)
    assert abs(result.contact.mean() - share) < 0.04
    assert result.products <= 50
    assert result.residual <= 1e-8


def test_the_area_is_in_proportion_to_the_force():
    """κ = A E* g'/F of light loads, with g' the root mean square of the slopes.

    It lies between √(8/π) of Persson's theory and √(2π) of that of asperities. The elements at the
    edges of spots are in contact in part: the area is corrected by what that makes of the length of
    the edges (Yastrebov, Anciaux, Molinari, Tribol. Int. 114 (2017)).
    """
    n = 512
    h, found = 1.0 / n, []
    for seed in range(3):
        gap = surfaces.rough((n, n), (h, h), rms=5e-4, longest=0.25, shortest=16 * h, seed=seed)
        q = 2 * np.pi * np.fft.fftfreq(n, h)
        power = np.abs(np.fft.fft2(gap) / gap.size) ** 2
        slope = np.sqrt(((q[:, None] ** 2 + q**2) * power).sum())
        force = 0.01 * slope
        result = normal_contact(gap, (h, h), material=UNIT, force=force, periodic=True)
        C = result.contact
        edges = h * sum(np.count_nonzero(C ^ np.roll(C, 1, axis)) for axis in (0, 1))
        area = result.area - (np.pi - 1.0 + np.log(2.0)) / 24.0 * edges * h
        found.append(area * slope / force)
    assert np.sqrt(8.0 / np.pi) < np.mean(found) < np.sqrt(2.0 * np.pi)


def test_the_doubts_know_that_the_grid_goes_on():
    gap = np.roll(surfaces.sphere((64, 64), (0.02, 0.02), radius=1.0), (32, 32), (0, 1))
    result = normal_contact(gap, (0.02, 0.02), material=UNIT, force=0.01, periodic=True)
    assert result.contact[0, 0]
    assert result.warnings == ()


# Friction -----------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(5, 7), (6, 5), (4, 6)])
def test_the_tangential_matrix_is_that_of_its_waves(shape):
    """2/(G|q|) (δ - ν q q/|q|²), G = 0.7 and ν = 0.3, as a sum of plane waves."""
    grid = Grid.of(shape, (0.3, 0.2), UNIT, None, True)
    places = np.indices(shape).reshape(2, -1).T * [0.3, 0.2]
    size = len(places)
    expected = np.zeros((2, size, 2, size))
    for k in np.ndindex(*shape):
        if k == (0, 0):
            continue
        signed = [j if j <= n // 2 else j - n for j, n in zip(k, shape, strict=True)]
        q = 2 * np.pi * np.array(signed) / (np.array(shape) * [0.3, 0.2])
        phase = places @ q
        wave = np.cos(phase[:, None] - phase) / size
        is_highest = any(2 * j == n for j, n in zip(k, shape, strict=True))
        factor = 2.0 / (0.7 * np.linalg.norm(q)) * (np.eye(2) - 0.3 * np.outer(q, q) / (q @ q))
        if is_highest:  # A wave of two elements has no sign along that axis.
            factor[0, 1] = factor[1, 0] = 0.0
        expected += factor[:, None, :, None] * wave[:, None, :]
    A = grid.tangential()
    x = np.random.default_rng(0).random(2 * size)
    assert_allclose(A @ x, expected.reshape(2 * size, -1) @ x, atol=1e-14)
    M = grid.invert_by_transform(A)
    assert np.linalg.eigvalsh(M @ np.eye(2 * size)).min() > 0.0
    mean = x.reshape(2, -1).mean(axis=1)
    assert_allclose(M @ (A @ x), x - np.repeat(mean, size), atol=1e-13)


@doubtful
@pytest.mark.parametrize(("shape", "element"), [((128,), 0.1), ((32, 32), (0.1, 0.1))])
def test_the_tractions_are_a_difference_of_pressures(shape, element):
    """q = μ (p under F - p under F - Q/μ), where both matrices are the same (Ciavarella, Jäger)."""
    smooth = Material.from_shear(1.0, 0.0 if len(shape) == 2 else 0.3)
    gap = surfaces.rough(shape, element, rms=0.005, shortest=0.8, seed=2)
    options = {"material": smooth, "periodic": True, "tolerance": 1e-11}
    pressed = normal_contact(gap, element, force=0.3, **options)
    before = normal_contact(gap, element, force=0.3 - 0.05 / 0.4, **options)
    force = (0.05, 0.0) if len(shape) == 2 else 0.05
    result = friction(pressed, mu=0.4, force=force, tolerance=1e-10)
    q = result.traction[0] if len(shape) == 2 else result.traction
    expected = 0.4 * (pressed.pressure - before.pressure)
    assert_allclose(q, expected, atol=1e-7 * expected.max())
    assert 0.1 < pressed.contact_fraction < 0.95
    assert result.periodic == (True,) * len(shape)


@doubtful
@pytest.mark.parametrize("load", [{"force": (0.02, 0.01)}, {"shift": (1e-3, 5e-4)}])
@pytest.mark.parametrize("periodic", [True, (True, False), (False, True)])
def test_coulombs_law_holds(load, periodic):
    """With the dense products of the matrix: no slip in stick, slip against the traction else."""
    gap = surfaces.rough((24, 20), (0.1, 0.1), rms=0.005, shortest=0.5, seed=3)
    pressed = normal_contact(gap, (0.1, 0.1), material=UNIT, force=0.1, periodic=periodic)
    result = friction(pressed, mu=0.4, **load)
    A = Grid.of(gap.shape, (0.1, 0.1), UNIT, None, periodic).tangential().toarray()
    q = result.traction
    slip = (A @ q.ravel()).reshape(q.shape) - np.reshape(result.shift, (2, 1, 1))
    slack = 2e-8 * np.abs(slip).max()
    assert (np.hypot(*q) <= 0.4 * pressed.pressure * (1 + 1e-12)).all()
    assert np.abs(slip[:, result.stick]).max(initial=0.0) <= slack
    n = q[:, result.sliding] / np.hypot(*q[:, result.sliding])
    s = slip[:, result.sliding]
    assert result.stick.any()
    assert result.sliding.any()
    assert (s * n).sum(axis=0).max() <= slack
    assert np.abs(s - (s * n).sum(axis=0) * n).max() <= slack
    if "force" in load:
        assert_allclose(result.force, load["force"], rtol=1e-8)


def test_friction_takes_the_period_of_a_result():
    gap = surfaces.sphere((64, 64), (0.02, 0.02), radius=1.0)
    pressed = normal_contact(gap, (0.02, 0.02), material=UNIT, force=0.01, periodic=True)
    centred = friction(pressed, mu=0.3, force=(0.001, 0.0))
    moved = normal_contact(
        np.roll(gap, (32, 32), (0, 1)), (0.02, 0.02), material=UNIT, force=0.01, periodic=True
    )
    around = friction(moved, mu=0.3, force=(0.001, 0.0))
    rolled = np.roll(around.traction, (-32, -32), (1, 2))
    assert_allclose(rolled, centred.traction, atol=1e-5 * centred.traction.max())
    same = friction(
        0.3 * pressed.pressure, (0.02, 0.02), material=UNIT, force=(0.001, 0.0), periodic=True
    )
    assert_allclose(same.traction, centred.traction, atol=1e-12)
    with pytest.raises(TypeError, match="periodic is given, but a normal result has its own"):
        friction(pressed, mu=0.3, force=(0.001, 0.0), periodic=True)
    with pytest.raises(ValueError, match="stresses are those below bodies of which nothing repe"):
        subsurface_stresses(pressed, depths=[0.1])


@pytest.mark.parametrize("shape", [(32,), (16, 16)])
def test_in_full_contact_without_slip_tractions_are_uniform(shape):
    """A uniform traction displaces nothing, so that there is no displacement to compare with."""
    element, m = (0.1,) * len(shape), len(shape)
    gap = surfaces.rough(shape, element, rms=1e-5, seed=2)
    pressed = normal_contact(gap, element, material=UNIT, force=0.5, periodic=True)
    assert pressed.contact.all()
    before = None
    for part in (0.1, 0.0, -0.05):
        force = part * pressed.force * np.eye(m)[0]
        before = friction(pressed, mu=0.4, force=force if m == 2 else force[0], previous=before)
        assert before.stick.all()
        mean = force.reshape(-1, *(1,) * m) / (gap.size * np.prod(element))
        atol = 1e-12 * pressed.max_pressure
        assert_allclose(before.traction.reshape(m, *shape), mean + np.zeros((m, *shape)), atol=atol)
        assert before.products <= 10


@doubtful
def test_strips_and_rows_that_repeat_are_one():
    """Strips of finite length are rows of one element; their tractions point along x."""
    bound = np.random.default_rng(6).random(12)
    options = {"material": UNIT, "reference": 3.0, "tolerance": 1e-11}
    strips = friction(bound, (0.3, 0.2), periodic=True, force=0.1, **options)
    row = friction(bound[:, None], (0.3, 0.2), periodic=(True, False), force=(0.1, 0.0), **options)
    assert strips.sliding.any()
    assert strips.stick.any()
    assert_allclose(row.traction[0, :, 0], strips.traction, atol=1e-9)
    assert_allclose(row.shift[0], strips.shift, rtol=1e-9)


def test_friction_refuses_what_it_has_not():
    bound = np.ones((8, 8))
    options = {"material": UNIT, "shift": (0.1, 0.0)}
    with pytest.raises(ValueError, match="shift is given, but surfaces that repeat and touch"):
        friction(bound, (1.0, 1.0), periodic=True, **options)


# Refusals -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"periodic": (True,)}, r"periodic is \(True,\), but must be True or False, or one"),
        ({"periodic": 1}, "periodic is 1, but must be True or False"),
        ({"periodic": "x"}, "periodic is 'x', but must be"),
        ({"reference": 1.0}, "a surface that repeats along one of two axes"),
        ({"force": None, "approach": 0.5}, "approach is 0.5, but must be below the mean of the ga"),
    ],
)
def test_refuses_what_makes_no_sense(change, message):
    arguments = {"material": UNIT, "force": 1.0, "periodic": True} | change
    gap = np.outer([0.0, 1.0], [1.0, 1.0])
    with pytest.raises(ValueError, match=message):
        normal_contact(gap, (1.0, 1.0), **arguments)


def test_refuses_a_single_element_that_repeats():
    with pytest.raises(ValueError, match=r"the grid has shape \(1, 1\), but where it repeats"):
        normal_contact([[0.0]], (1.0, 1.0), material=UNIT, force=1.0, periodic=True)


@doubtful
@pytest.mark.parametrize("aspect", [1.0, 100.0, 1e4])
@pytest.mark.parametrize("pressure", [0.01, 0.5])
def test_long_elements_obey_the_conditions_of_contact(aspect, pressure):
    """Their displacements differ so much that sets that are wrong look as if nothing touched."""
    shape, element, rng = (8, 9), (0.1, 0.1 * aspect), np.random.default_rng(0)
    material = Material.from_shear(1e3, 0.3)
    A = Grid.of(shape, element, material, None, True).normal().toarray()
    for _ in range(4):
        gap = 1e-4 * rng.standard_normal(shape)
        force = pressure * element[0] * element[1] * gap.size
        result = normal_contact(gap, element, material=material, force=force, periodic=True)
        p = result.pressure
        assert_allclose(p.sum() * element[0] * element[1], force)
        open_ = gap + (A @ p.ravel()).reshape(shape)
        touching = open_[p > 0.0].mean()
        slack = 1e-7 * max(np.ptp(open_), np.ptp(gap))
        assert np.abs(open_[p > 0.0] - touching).max() <= slack
        assert open_.min() >= touching - slack
