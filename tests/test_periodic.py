"""Surfaces that repeat: displacements are sums of waves, or of images; Westergaard's theory holds.

On any surface gap and pressures are complementary, and tractions obey Coulomb's law.
"""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

from tests.budgets import assert_within_budget
from tests.repeating import sum_of_images, sum_of_waves
from tests.test_friction import assert_areas, assert_slip, doubtful
from toeplitz_mg import halfspace
from toeplitz_mg.contact import Material, friction, normal_contact, surfaces

UNIT = Material.from_shear(0.7, 0.3)  # G and ν of bodies with E* = G/(1-ν) = 1.


def assert_complementary(result, gap, matrix=None, *, hardness=np.inf, tolerance=1e-8):
    """It is w ≥ 0 where p = 0, w = 0 between, and w ≤ 0 where p = H, by a matrix."""
    p, w = result.pressure, result.displacement + gap - result.approach
    if matrix is not None:
        w = (matrix @ p.ravel()).reshape(p.shape) + gap - result.approach
    slack = 1.05 * tolerance * (result.approach - gap.min())
    assert p.min() >= 0.0
    assert p.max() <= hardness
    assert w[p < hardness].min(initial=0.0) >= -slack
    assert w[p > 0.0].max(initial=0.0) <= slack
    if result.plastic is not None:
        dents = np.where(p == hardness, np.maximum(-w, 0.0), 0.0)
        assert_allclose(result.plastic, dents, atol=slack)
        assert_allclose(result.gap, w + dents, atol=2 * slack)


def assert_displaced_by(matrix, result, rounding=1e-13):
    """The displacements of a result are the products of its tractions with a dense matrix."""
    expected = matrix @ result.traction.ravel()
    atol = rounding * np.abs(expected).max()
    assert_allclose(result.displacement.ravel(), expected, rtol=0, atol=atol)


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


# Displacements ------------------------------------------------------------------------------


@doubtful
@pytest.mark.parametrize("shape", [(6,), (7,), (6, 5), (4, 8), (5, 1)])
def test_displacements_are_a_sum_of_waves(shape):
    rng, element = np.random.default_rng(0), (0.3, 0.2)[: len(shape)]
    pressed = normal_contact(
        0.02 * rng.random(shape), element, material=UNIT, force=0.02, periodic=True
    )
    assert_displaced_by(sum_of_waves("z", shape, element), pressed)
    assert_allclose(pressed.displacement.mean(), 0.0, atol=1e-15)  # The mean is free.


@doubtful
@pytest.mark.parametrize("shape", [(5, 7), (6, 5), (4, 6)])
def test_displacements_by_friction_are_a_sum_of_waves(shape):
    bound, force = 0.1 * np.random.default_rng(0).random(shape), 0.002 * np.prod(shape)
    shifted = friction(
        bound=bound, element=(0.3, 0.2), material=UNIT, force=(force, 0.3 * force), periodic=True
    )
    assert shifted.stick.any()
    assert shifted.sliding.any()
    assert_displaced_by(sum_of_waves("xy", shape, (0.3, 0.2)), shifted)


@doubtful
@pytest.mark.parametrize("axis", [0, 1])
def test_where_one_axis_repeats_displacements_are_sums_of_images(axis):
    shape, element = ((8, 4), (0.25, 0.4)) if axis == 0 else ((4, 8), (0.4, 0.25))
    rng = np.random.default_rng(0)
    options = {"material": UNIT, "periodic": (axis == 0, axis == 1), "reference": 5.0}
    pressed = normal_contact(0.02 * rng.random(shape), element, force=0.02, **options)
    assert 0.2 < pressed.contact_fraction < 0.8
    assert_displaced_by(sum_of_images("z", shape, element, axis, 5.0), pressed, 1e-4)
    shifted = friction(bound=0.1 * rng.random(shape), element=element, shift=(0.1, 0.05), **options)
    assert shifted.stick.any()
    assert shifted.sliding.any()
    assert_displaced_by(sum_of_images("xy", shape, element, axis, 5.0), shifted, 1e-4)


@doubtful
def test_where_one_axis_repeats_the_mean_is_a_line_contact():
    """Along the axis antiplane shear, of which ν is no part; across it plane strain."""
    G, nu, reference, element = 0.7, 0.3, 5.0, (0.25, 0.4)
    options = {"material": UNIT, "reference": reference, "periodic": (True, False)}
    c, antiplane = (
        halfspace.line_contact_coefficients(4, 0.4, G=G, nu=ratio, reference=reference)
        for ratio in (nu, 0.0)
    )
    gap = np.tile([0.0, 0.01, 0.0, 0.02], (6, 1))
    pressed = normal_contact(gap, element, approach=0.5, **options)
    across = friction(bound=np.full((6, 4), 1.0), element=element, shift=(0.0, 0.1), **options)
    along = friction(bound=np.full((6, 4), 1.0), element=element, shift=(0.1, 0.0), **options)
    for u, traction, column in (
        (pressed.displacement, pressed.pressure, c),
        (across.displacement[1], across.traction[1], c),
        (along.displacement[0], along.traction[0], antiplane),
    ):
        assert_allclose(u, traction @ scipy.linalg.toeplitz(column), rtol=1e-12)
    for other in (along.displacement[1], across.displacement[0]):
        assert_allclose(other, 0.0, atol=1e-14)
    # It is the sum of many images but for a constant, that is the same for all rows.
    x = 0.25 * np.arange(-40_000, 40_001)
    rows = [
        halfspace.influence_zz(x, np.full_like(x, 0.4 * k), element, G=G, nu=nu).sum()
        for k in range(4)
    ]
    assert_allclose(np.diff(c), np.diff(rows), rtol=1e-6)


@doubtful
def test_strips_of_finite_length_that_repeat_are_rows_of_one_element():
    rng = np.random.default_rng(6)
    options = {"material": UNIT, "reference": 3.0, "tolerance": 1e-11}
    gap, bound = 0.02 * rng.random(6), rng.random(12)
    strips = normal_contact(gap, (0.3, 0.2), periodic=True, force=0.01, **options)
    row = normal_contact(gap[:, None], (0.3, 0.2), periodic=(True, False), force=0.01, **options)
    assert_allclose(row.pressure[:, 0], strips.pressure, atol=1e-9 * strips.max_pressure)
    assert_allclose(row.approach, strips.approach, rtol=1e-9)
    strips = friction(bound=bound, element=(0.3, 0.2), periodic=True, force=0.1, **options)
    options |= {"bound": bound[:, None], "element": (0.3, 0.2), "periodic": (True, False)}
    row = friction(force=(0.1, 0.0), **options)
    assert strips.sliding.any()
    assert strips.stick.any()
    assert_allclose(row.traction[0, :, 0], strips.traction, atol=1e-9)
    assert_allclose(row.shift[0], strips.shift, rtol=1e-9)


# Westergaard --------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.1, 0.3, 0.6, 0.9])
def test_westergaards_wave(share):
    result, theory, half = westergaard(512, share)
    assert abs(result.area - 2.0 * half) <= 2.0 / 512  # An element at each edge.
    assert abs(result.max_pressure / theory.max() - 1.0) < 1e-3
    assert np.linalg.norm(result.pressure - theory) < 1e-2 * np.linalg.norm(theory)
    assert_within_budget("Westergaard's wave, n = 512", products=result.products)
    assert_allclose(result.force, share * np.pi * 0.01)


def test_the_order_of_westergaards_pressure():
    errors = []
    for n in (128, 512, 2048):
        # The error jumps with the place of the edge in its element.
        pairs = [westergaard(n, share)[:2] for share in (0.3, 0.35, 0.4, 0.45, 0.5, 0.55)]
        errors.append(np.hypot.reduce([np.linalg.norm(p.pressure - t) for p, t in pairs]))
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


@doubtful
@pytest.mark.parametrize("share", [0.0, 0.02, 0.08])
def test_nearly_full_contact(share):
    """Forces that would pull a share of the elements, if all were held in contact."""
    shape, element = (16, 12), (0.3, 0.2)
    gap = surfaces.rough(shape, element, rms=0.01, longest=2.0, shortest=0.8, seed=4)
    A = sum_of_waves("z", shape, element)
    held = -(np.linalg.pinv(A, rcond=1e-9) @ gap.ravel()).reshape(shape)
    mean = -np.quantile(held, share) + (1e-3 if share == 0.0 else 0.0)
    force = mean * gap.size * np.prod(element)
    result = normal_contact(
        gap, element, material=UNIT, force=force, periodic=True, tolerance=1e-11
    )
    assert_complementary(result, gap, A, tolerance=1e-11)
    assert_allclose(result.force, force)
    apart = np.count_nonzero(result.pressure == 0.0)
    if share == 0.0:
        assert_allclose(result.pressure, held + mean, rtol=1e-9)
    assert share * gap.size <= apart < 3.0 * share * gap.size + 1.0


@doubtful
@pytest.mark.parametrize("load", [{"force": 0.3}, {"approach": 0.01}])
def test_where_one_axis_repeats_the_pressures_are_complementary(load):
    gap = 0.02 * np.random.default_rng(4).random((12, 9))
    for periodic in ((True, False), (False, True)):
        result = normal_contact(gap, (0.3, 0.2), material=UNIT, periodic=periodic, **load)
        assert_complementary(result, gap)


@doubtful
@pytest.mark.parametrize("shape", [(1, 7), (7, 1), (5, 27), (7, 7), (33, 57)])
@pytest.mark.parametrize("height", [0.0, 1e-16])
def test_flat_surfaces_have_uniform_pressures(shape, height):
    gap = 1.0 + height * np.random.default_rng(3).random(shape)
    for element in ((0.05, 0.05), (0.0117, 0.05)):
        for force in (0.01, 1.0, 2481.31):
            pressed = normal_contact(gap, element, material=UNIT, force=force, periodic=True)
            mean = force / (np.prod(element) * gap.size)
            assert_allclose(pressed.pressure, mean, rtol=1e-6)


# Rough surfaces -----------------------------------------------------------------------------


def rough(n, mean):
    h = 2.0 / n
    gap = surfaces.rough((n, n), (h, h), rms=0.002, longest=0.5, shortest=2.0 / 64, seed=1)
    return normal_contact(gap, (h, h), material=UNIT, force=0.8 * mean, periodic=True)


@pytest.mark.parametrize("n", [256, pytest.param(1024, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("mean", "share"), [(0.003, 0.02), (0.015, 0.1), (0.05, 0.3), (0.18, 0.75), (0.4, 0.99)]
)
def test_products_for_a_rough_surface(n, mean, share):
    result = rough(n, mean)
    assert abs(result.contact.mean() - share) < 0.04
    assert_within_budget(
        f"rough surface that repeats, n = {n}", products=result.products, work_units=result.work
    )
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


# Friction -----------------------------------------------------------------------------------


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
    """No slip in stick, slip against the traction else."""
    gap = surfaces.rough((24, 20), (0.1, 0.1), rms=0.005, shortest=0.5, seed=3)
    pressed = normal_contact(gap, (0.1, 0.1), material=UNIT, force=0.1, periodic=periodic)
    result = friction(pressed, mu=0.4, **load)
    slip = result.displacement - np.reshape(result.shift, (2, 1, 1))
    assert_areas(result)
    assert_slip(result, result.displacement, slip, 2e-8 * np.abs(slip).max())
    assert_allclose(result.bound, 0.4 * pressed.pressure, rtol=1e-12)
    assert result.stick.any()
    assert result.sliding.any()
    if "force" in load:
        assert_allclose(result.force, load["force"], rtol=1e-8)


def test_friction_takes_the_period_of_a_result():
    gap = surfaces.sphere((64, 64), (0.02, 0.02), radius=1.0)
    pressed = normal_contact(gap, (0.02, 0.02), material=UNIT, force=0.01, periodic=True)
    centred = friction(pressed, mu=0.3, force=(0.001, 0.0))
    moved = normal_contact(
        np.roll(gap, (32, 32), (0, 1)), (0.02, 0.02), material=UNIT, force=0.01, periodic=True
    )
    assert moved.contact[0, 0]
    assert moved.warnings == ()
    around = friction(moved, mu=0.3, force=(0.001, 0.0))
    rolled = np.roll(around.traction, (-32, -32), (1, 2))
    assert_allclose(rolled, centred.traction, atol=1e-5 * centred.traction.max())
    same = friction(
        bound=0.3 * pressed.pressure,
        element=(0.02, 0.02),
        material=UNIT,
        force=(0.001, 0.0),
        periodic=True,
    )
    assert_allclose(same.traction, centred.traction, atol=1e-12)
    with pytest.raises(TypeError, match="periodic is given, but the normal result has it"):
        friction(pressed, mu=0.3, force=(0.001, 0.0), periodic=True)


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
        assert_within_budget("friction in full contact that repeats", products=before.products)


# Refusals -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"periodic": (True,)}, r"periodic is \(True,\), but must be True or False, or one"),
        ({"periodic": 1}, "periodic is 1, but must be True or False"),
        ({"periodic": "x"}, "periodic is 'x', but must be"),
        ({"gap": [[0.0]]}, r"the grid has shape \(1, 1\), but must have more"),
        ({"reference": 1.0}, "periodic along one of two axes"),
        ({"force": None, "approach": 0.5}, "approach is 0.5, but must be below the mean of the ga"),
    ],
)
def test_refuses_what_makes_no_sense(change, message):
    gap = np.outer([0.0, 1.0], [1.0, 1.0])
    arguments = {"gap": gap, "material": UNIT, "force": 1.0, "periodic": True} | change
    with pytest.raises(ValueError, match=message):
        normal_contact(element=(1.0, 1.0), **arguments)


@doubtful
def test_friction_refuses_a_shift_that_has_no_meaning():
    """Of a mean there is no displacement, so that no shift says what the force is."""
    case = {"element": (1.0, 1.0), "material": UNIT, "periodic": True}
    pressed = normal_contact(np.zeros((8, 8)), force=0.1, **case)
    assert pressed.contact.all()
    for bodies in ({"bound": np.ones((8, 8)), **case}, {"pressed": pressed, "mu": 0.3}):
        with pytest.raises(ValueError, match="periodic surfaces touch and stick everywhere"):
            friction(**bodies, shift=(0.1, 0.0))


@doubtful
@pytest.mark.parametrize("aspect", [1.0, 100.0, 1e4])
@pytest.mark.parametrize("pressure", [0.01, 0.5])
def test_long_elements_obey_the_conditions_of_contact(aspect, pressure):
    """Their displacements differ so much that sets that are wrong look as if nothing touched."""
    shape, element, rng = (8, 9), (0.1, 0.1 * aspect), np.random.default_rng(0)
    material = Material.from_shear(1e3, 0.3)
    A = sum_of_waves("z", shape, element, G=1e3)
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


@doubtful
@pytest.mark.parametrize("n", [40, 700])  # Few elements are solved directly.
@pytest.mark.parametrize("is_plane", [True, False])
def test_tractions_of_two_components_on_strips_are_those_of_rows_of_a_surface(n, is_plane):
    g, force = np.where(np.arange(n) % 40 < 30, 1.0, 0.0), n * np.array([0.1, 0.15])
    shape, element = ((n, 2), 0.5) if is_plane else ((n, 1), (0.5, 3.0))
    periodic, width = (True, is_plane), 1.0 if is_plane else 3.0  # Of the rows of the strips.
    line = friction(bound=g, element=element, material=UNIT, force=width * force, periodic=True)
    bound, force = np.broadcast_to(g[:, None], shape), 3.0 * shape[1] * force
    surface = friction(
        bound=bound, element=(0.5, 3.0), material=UNIT, force=force, periodic=periodic
    )
    assert line.slip.any()
    assert_allclose(line.traction, surface.traction[:, :, 0], rtol=0, atol=1e-6)
    scale = np.abs(line.displacement).max()
    assert_allclose(line.displacement, surface.displacement[:, :, 0], rtol=0, atol=1e-6 * scale)
