"""Surfaces are pressed as they are given: by gap or heights, in any unit, with missing pixels.

Profiles are those of their curvatures, and rough surfaces have the spectrum that is asked for.
"""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.optimize
from numpy.testing import assert_allclose

from tests.repeating import sum_of_waves
from toeplitz_mg import halfspace
from toeplitz_mg.contact import Material, load_curve, normal_contact, rolling, surfaces

UNIT = Material.from_shear(0.7, 0.3)  # E* = G/(1-ν) = 1 of two equal bodies.
N, H = 48, 2.0 / 48
GAP = surfaces.rough((N, N), (H, H), rms=0.01, longest=0.5, shortest=4 * H, seed=3)
pytestmark = pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")


def press(gap=None, element=(H, H), force=0.05, **options):
    return normal_contact(gap, element, material=UNIT, force=force, **options)


class Topography(SimpleNamespace):
    """What SurfaceTopography's classes have, as far as it is used."""

    def __init__(self, heights, sizes, unit, is_periodic=False, is_uniform=True):
        super().__init__(
            physical_sizes=sizes,
            pixel_size=np.divide(sizes, np.shape(heights)),
            unit=unit,
            is_periodic=is_periodic,
            is_uniform=is_uniform,
        )
        self.heights = lambda: heights


# Sign and zero ------------------------------------------------------------------------------


def test_heights_are_positive_at_summits_and_the_highest_touches_first():
    h = np.array([[0.0, 3.0], [1.0, -2.0]])
    assert_allclose(press(heights=h, force=0.0).gap, [[3.0, 0.0], [2.0, 5.0]])


@pytest.mark.parametrize("level", [0.0, 7.0, -30.0])
def test_heights_are_a_gap_turned_over(level):
    by_gap, by_heights = press(GAP), press(heights=level - GAP)
    assert_allclose(by_heights.pressure, by_gap.pressure, atol=1e-6 * by_gap.max_pressure)
    # The gap of heights is zero at the highest, as that of `surfaces.rough` is.
    assert_allclose(by_heights.approach, by_gap.approach, rtol=1e-7)


def test_a_sphere_that_is_tilted_touches_elsewhere_with_the_same_pressures():
    # x²/2R + t x is the same parabola about -t R, deeper by t² R/2.
    n, h, moved = 64, 2.0 / 64, 5
    tilt = moved * h
    x, _ = surfaces.centres((n, n), (h, h))
    gap = surfaces.sphere((n, n), (h, h), radius=1.0)
    level = normal_contact(gap, (h, h), material=UNIT, force=0.05)
    tilted = normal_contact(heights=3.0 - gap - tilt * x, element=(h, h), material=UNIT, force=0.05)
    by_gap = normal_contact(gap + tilt * x, (h, h), material=UNIT, force=0.05)
    expected = np.roll(level.pressure, -moved, axis=0)
    for result in (tilted, by_gap):
        assert_allclose(result.pressure, expected, atol=1e-6 * level.max_pressure)
    assert_allclose(by_gap.approach, level.approach - 0.5 * tilt**2, rtol=1e-6)


def test_load_curves_take_heights():
    curve = list(load_curve(heights=-GAP, element=(H, H), material=UNIT, forces=[0.02, 0.05]))
    assert_allclose(curve[1].approach, press(GAP).approach, rtol=1e-7)


# Units --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("unit", "mm"), [("um", 1e-3), ("µm", 1e-3), ("nm", 1e-6), ("m", 1e3)])
def test_units(unit, mm):
    in_mm = press(GAP)
    by_gap = press(GAP / mm, (H / mm, H / mm), unit=unit)
    by_heights = press(heights=-GAP / mm, element=(H / mm, H / mm), unit=unit)
    for result in (by_gap, by_heights):
        assert_allclose(result.element, (H, H))
        assert_allclose(result.approach, in_mm.approach, rtol=1e-6)
        assert_allclose(result.pressure, in_mm.pressure, atol=1e-5 * in_mm.max_pressure)


def in_mm(unit):
    """The width of an element that is 1 in a unit."""
    return press(np.zeros((2, 2)), (1.0, 1.0), force=0.0, unit=unit).element[0]


@pytest.mark.slow  # The import of the library is.
def test_units_of_the_library_are_known():
    units = pytest.importorskip("SurfaceTopography.Support.UnitConversion").length_units
    for name, metres in units.items():
        assert_allclose(in_mm(name), 1e3 * metres)


def test_units_are_powers_of_ten_of_a_millimetre():
    known = {"m": 1e3, "mm": 1.0, "um": 1e-3, "nm": 1e-6, "Å": 1e-7}
    known |= {"µm": 1e-3, "μm": 1e-3}  # Micro sign, and Greek letter.
    for name, size in known.items():
        assert_allclose(in_mm(name), size, rtol=1e-15)


def test_heights_in_nanometres_on_pixels_in_micrometres():
    pair = press(heights=-1e6 * GAP, element=(1e3 * H, 1e3 * H), unit=("nm", "um"))
    assert_allclose(pair.pressure, press(GAP).pressure, atol=1e-9)


@pytest.mark.parametrize("hardness", [None, 1.0])
def test_a_mean_pressure_is_the_force_of_a_period(hardness):
    case = {"force": None, "hardness": hardness, "periodic": True}
    mean = press(GAP, **case, pressure=0.02)
    assert_allclose(mean.pressure.mean(), 0.02)
    assert_allclose(mean.pressure, press(GAP, **case | {"force": 0.02 * 4.0}).pressure)


class Quantity:
    """A number with a unit, as those of pint."""

    def __init__(self, magnitude, units):
        self.magnitude, self.units = magnitude, units
        self.shape, self.ndim = np.shape(magnitude), np.ndim(magnitude)

    def to(self, unit):
        known = {"um": 1e-3, "mm": 1.0, "kN": 1e3, "N": 1.0, "GPa": 1e3, "N/mm**2": 1.0}
        if ("m" in self.units) != ("m" in unit) and self.units != "GPa":
            raise TypeError("dimensions")
        return Quantity(np.multiply(self.magnitude, known[self.units] / known[unit])[()], unit)


def test_quantities_are_read_in_their_units():
    um = H * 1e3
    for element in ((Quantity(um, "um"), Quantity(um, "um")), Quantity([um, um], "um")):
        for name, gap in (("gap", GAP), ("heights", -GAP)):
            given = {name: Quantity(1e3 * gap, "um")}
            result = press(**given, element=element, force=Quantity(5e-5, "kN"))
            assert_allclose(result.pressure, press(GAP).pressure, atol=1e-9)
    assert Material(E=Quantity(210.0, "GPa"), nu=0.3) == Material(E=210e3, nu=0.3)
    for given, message in (
        ({"force": Quantity(1.0, "um")}, "force is in um, but must be in N"),
        ({"gap": Quantity(GAP, "um"), "unit": "nm"}, "unit is 'nm', but gap or element has its"),
        ({"max_products": Quantity(3, "um")}, "max_products is a quantity in um, but must be a"),
    ):
        with pytest.raises((TypeError, ValueError), match=message):
            press(**{"gap": GAP} | given)


# Axes with names ----------------------------------------------------------------------------


def labelled(values, dims=("y", "x"), sign=1.0, **attrs):
    """A field on elements of 0.02 by 0.03 mm as an array of xarray, transposed."""
    xarray = pytest.importorskip("xarray")
    x, y = 0.02 * np.arange(values.shape[0]), 0.03 * np.arange(values.shape[1])[:: int(sign)]
    values = values.T[:: int(sign)]
    axes = {dims[1]: (dims[1], x, attrs), dims[0]: (dims[0], y, attrs)}
    return xarray.DataArray(values, dims=dims, coords=axes, attrs=attrs)


def test_axes_are_taken_by_their_names():
    gap = surfaces.ellipsoid((30, 20), (0.02, 0.03), radii=(1.0, 3.0))
    expected = press(gap, (0.02, 0.03))
    for given in (labelled(gap), labelled(gap, sign=-1.0)):
        result = press(given, element=None)
        assert_allclose(result.element, (0.02, 0.03))
        assert_allclose(result.pressure, expected.pressure, atol=1e-6 * expected.max_pressure)
    um = press(heights=labelled(-gap, units="um"), element=None).element
    assert_allclose(um, (2e-5, 3e-5))
    motion = {"longitudinal": 0.01, "spin": 0.1}
    rolled = rolling(expected, mu=0.3, **motion)
    bound = {"bound": labelled(0.3 * expected.pressure), "material": UNIT}
    assert_allclose(rolling(**bound, **motion).traction, rolled.traction, atol=1e-6)
    mu = labelled(np.full(gap.shape, 0.3))
    assert_allclose(rolling(expected, mu=mu, **motion).traction, rolled.traction, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"element": (0.03, 0.02)}, r"element is \(0.03, 0.02\), but the coordinates x of gap are"),
        ({"dims": ("y", "lon")}, r"axes \('y', 'lon'\), but must have x and y"),
        ({"half": "um"}, "gap has units 'um', but its coordinates has none"),
        ({"units": "um", "unit": "nm"}, "unit is 'nm', but gap is in 'um'"),
        ({"units": "yard"}, "unit is 'yard', but must be one of"),
    ],
)
def test_what_contradicts_an_array_with_names_is_refused(change, message):
    own = {name: change.pop(name) for name in ("dims", "units") if name in change}
    given, half = labelled(np.zeros((4, 6)), **own), change.pop("half", own.get("units"))
    with pytest.raises(ValueError, match=message):
        press(given.assign_attrs(units=half) if half else given, **{"element": None} | change)


# Missing pixels -----------------------------------------------------------------------------


def punctured(seed=5, share=0.2):
    return np.random.default_rng(seed).random((N, N)) < share


@pytest.mark.parametrize(
    ("force", "periodic"),
    [(0.05, False), (1e-4, False), (3.0, False), (0.05, True), (0.05, (True, False))],
)
def test_missing_pixels_are_never_in_contact(force, periodic):
    missing = punctured()
    gap = np.where(missing, np.inf, GAP)
    holes = press(gap, force=force, periodic=periodic)
    assert not holes.contact[missing].any()
    assert not holes.pressure[missing].any()
    assert np.isinf(holes.gap[missing]).all()
    assert np.isfinite(holes.gap[~missing]).all()
    assert_allclose(holes.force, force)
    again = press(gap, force=None, approach=holes.approach, periodic=periodic)
    assert_allclose(again.force, holes.force, rtol=1e-5)


@pytest.mark.parametrize("share", [0.2, 0.9])
def test_a_punctured_surface_is_that_of_the_elements_with_material(share):
    n, h = 16, 2.0 / 16
    gap = surfaces.rough((n, n), (h, h), rms=0.01, longest=0.5, shortest=4 * h, seed=3)
    missing = np.random.default_rng(7).random((n, n)) < share
    approach = gap[~missing].min() + 0.01
    result = normal_contact(
        np.where(missing, np.inf, gap), (h, h), material=UNIT, approach=approach
    )
    there = ~missing.ravel()
    A = halfspace.influence_matrix("z", (n, n), (h, h), UNIT).toarray()[np.ix_(there, there)]
    root = np.linalg.cholesky(A)
    p, _ = scipy.optimize.nnls(root.T, np.linalg.solve(root, approach - gap.ravel()[there]))
    assert_allclose(result.pressure.ravel()[there], p, atol=1e-6 * p.max())


def test_nan_masked_and_minus_infinity_are_missing_heights():
    missing = punctured()
    expected = press(np.where(missing, np.inf, GAP))
    for heights in (
        np.where(missing, np.nan, -GAP),
        np.where(missing, -np.inf, -GAP),
        np.ma.masked_array(-GAP, mask=missing),
    ):
        result = press(heights=heights)
        assert_allclose(result.pressure, expected.pressure, atol=1e-6 * expected.max_pressure)


@pytest.mark.parametrize("shape", [(24,), (12, 10)])
def test_a_periodic_surface_with_missing_pixels_under_any_approach(shape):
    """Where all that is there touches, the rest takes up the mean: p solves A p = δ - z."""
    element = (0.1,) * len(shape)
    gap = surfaces.rough(shape, element, rms=1e-3, shortest=0.2, seed=3)
    missing = np.random.default_rng(4).random(shape) < 0.05
    missing.flat[7] = True
    there = ~missing.ravel()
    A = sum_of_waves("z", shape, element)[np.ix_(there, there)]
    for approach in (gap[~missing].max() + 0.01, 1.0):
        result = normal_contact(
            np.where(missing, np.inf, gap), element, material=UNIT, approach=approach, periodic=True
        )
        p = np.linalg.solve(A, approach - gap.ravel()[there])
        assert p.min() > 0.0
        assert_allclose(result.pressure.ravel()[there], p, atol=1e-6 * p.max())


def test_only_elements_with_material_carry_at_the_hardness():
    missing = punctured(share=0.5)
    gap, most = np.where(missing, np.inf, GAP), 0.1 * H * H * (~missing).sum()
    result = press(gap, force=0.9 * most, hardness=0.1)
    assert not result.contact[missing].any()
    with pytest.raises(ValueError, match="which all elements carry if they yield"):
        press(gap, force=1.01 * most, hardness=0.1)


def test_warnings_do_not_take_missing_pixels_for_slopes():
    n, h = 64, 2.0 / 64
    gap = surfaces.sphere((n, n), (h, h), radius=1.0)
    gap[5, 5] = np.inf
    assert normal_contact(gap, (h, h), material=UNIT, force=0.05).warnings == ()


# Topographies -------------------------------------------------------------------------------


def test_a_topography_brings_sizes_and_units():
    heights = -1e3 * GAP[:, :32]
    topography = Topography(heights, (N * H * 1e3, 32 * H * 1e3), "µm")
    expected = press(GAP[:, :32], (H, H))
    result = normal_contact(heights=topography, material=UNIT, force=0.05)
    assert_allclose(result.element, (H, H))
    assert_allclose(result.pressure, expected.pressure, atol=1e-6 * expected.max_pressure)


@pytest.mark.parametrize("is_periodic", [True, False])
def test_a_topography_says_whether_it_is_periodic(is_periodic):
    topography = Topography(-GAP, (N * H, N * H), "mm", is_periodic)
    result = normal_contact(heights=topography, material=UNIT, force=0.05)
    expected = press(GAP, periodic=is_periodic)
    assert_allclose(result.approach, expected.approach, rtol=1e-6)
    other = normal_contact(heights=topography, material=UNIT, force=0.05, periodic=not is_periodic)
    assert abs(other.approach / result.approach - 1.0) > 1e-3


@pytest.mark.slow
def test_topographies_of_the_library(tmp_path):
    library = pytest.importorskip("SurfaceTopography")
    missing = punctured()
    masked = np.ma.masked_array(-1e3 * GAP, mask=missing)
    topography = library.Topography(masked, (N * H * 1e3, N * H * 1e3), unit="um")
    expected = press(np.where(missing, np.inf, GAP))
    result = normal_contact(heights=topography, material=UNIT, force=0.05)
    assert_allclose(result.pressure, expected.pressure, atol=1e-6 * expected.max_pressure)
    # A file that it reads.
    x, y = np.meshgrid(np.arange(N) * H * 1e3, np.arange(N) * H * 1e3, indexing="ij")
    path = tmp_path / "surface.xyz"
    np.savetxt(path, np.stack([x.ravel(), y.ravel(), -1e3 * GAP.ravel()], axis=1))
    read = library.read_topography(path)
    result = normal_contact(heights=read, unit="um", material=UNIT, force=0.05)
    expected = press(GAP)
    assert_allclose(result.pressure, expected.pressure, atol=1e-6 * expected.max_pressure)
    line = library.UniformLineScan(-GAP[0], N * H, unit="mm")
    result = normal_contact(heights=line, material=UNIT, force=0.001)
    expected = press(GAP[0], H, 0.001)
    assert_allclose(result.pressure, expected.pressure, atol=1e-6 * expected.max_pressure)
    scan = library.NonuniformLineScan(np.array([0.0, 1.0, 3.0]), np.zeros(3))
    for several in (scan, library.open_topography(path)):
        with pytest.raises(TypeError, match="must be one topography on a uniform grid"):
            normal_contact(heights=several, material=UNIT, force=0.001)


# Refusals -----------------------------------------------------------------------------------

FLAT = Topography(np.zeros((4, 4)), (4.0, 4.0), None)
IN_UM = Topography(np.zeros((4, 4)), (4.0, 4.0), "um")
UNEVEN = Topography(np.zeros((4, 4)), (4.0, 4.0), "um", is_uniform=False)


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({}, ValueError, "either gap or heights must be given: neither"),
        ({"gap": GAP, "heights": GAP}, ValueError, "either gap or heights must be given: both"),
        ({"gap": GAP}, TypeError, "element is missing"),
        ({"gap": IN_UM}, TypeError, "gap is of type Topography, but must be an array"),
        ({"heights": IN_UM, "element": 1.0}, ValueError, r"has its own: \(1.0, 1.0\) um"),
        ({"heights": FLAT}, ValueError, "has no unit: give unit=, for"),
        ({"heights": IN_UM, "unit": "nm"}, ValueError, "unit is 'nm', but the topography is in"),
        ({"heights": UNEVEN}, TypeError, "must be one topography on a uniform grid"),
        ({"gap": GAP, "element": (H, H), "unit": "yard"}, ValueError, "unit is 'yard', but must"),
        ({"heights": np.full((2, 2), np.nan), "element": 1.0}, ValueError, "has no value in any"),
        ({"heights": [np.inf, 0.0], "element": 1.0}, ValueError, "heights has the value inf"),
        ({"heights": ["a"], "element": 1.0}, TypeError, "heights has dtype"),
        ({"gap": np.full((4, 4), np.inf), "element": (H, H)}, ValueError, "infinite everywhere"),
        ({"gap": np.full((4, 4), -np.inf), "element": (H, H)}, ValueError, "the value -inf"),
        ({"gap": GAP, "element": (-1.0, H), "unit": "um"}, ValueError, r"element is \(-1.0, "),
        ({"gap": GAP, "unit": ("um",), "element": H}, ValueError, "must be one name, or"),
        ({"gap": [[np.nan]], "element": (H, H)}, ValueError, "use inf where there is no material"),
        ({"heights": "a.nc"}, TypeError, "contact.surfaces.read"),
    ],
)
def test_refuses_what_makes_no_sense(given, error, message):
    with pytest.raises(error, match=message):
        normal_contact(**given, material=UNIT, force=0.05)


# Profiles and spectra -----------------------------------------------------------------------


def test_a_body_that_is_straight_along_an_axis_is_a_cylinder():
    shape, element = (8, 6), (1.0, 2.0)
    gap = surfaces.ellipsoid(shape, element, radii=(460.0, np.inf))
    assert_allclose(gap, surfaces.cylinder(shape, element, radius=460.0))
    assert_allclose(surfaces.ellipsoid(shape, element, radii=(np.inf, np.inf)), 0.0)


def test_curvatures_of_both_bodies_add_up():
    shape, element = (9, 9), (1.0, 1.0)
    wheel = surfaces.ellipsoid(shape, element, radii=(460.0, -330.0))
    rail = surfaces.ellipsoid(shape, element, radii=(np.inf, 300.0))
    both = surfaces.ellipsoid(shape, element, radii=((460.0, -330.0), (np.inf, 300.0)))
    assert_allclose(both, wheel + rail, atol=1e-15)
    x, y = surfaces.centres(shape, element)
    assert_allclose(both, x**2 / 920.0 + 0.5 * (1 / 300.0 - 1 / 330.0) * y**2)


def test_a_concave_body_touches_a_convex_one_as_one_of_their_difference():
    n, h = 64, 1.2 / 64
    conformal = surfaces.ellipsoid((n, n), (h, h), radii=((0.5, 0.5), (-1.0, -1.0)))
    sphere = surfaces.sphere((n, n), (h, h), radius=1.0)
    assert_allclose(conformal, sphere)
    result = normal_contact(conformal, (h, h), material=UNIT, force=4 / 3 * 0.4**3)
    assert_allclose(result.approach, 0.4**2, rtol=1e-3)


def test_the_spectrum_is_flat_before_the_roll_off_and_falls_after_it():
    n, hurst, roll_off = 512, 0.7, 64.0
    waves = {"hurst": hurst, "roll_off": roll_off, "longest": 256.0, "shortest": 8.0}
    density = np.zeros((n, n))
    for seed in range(8):
        gap = surfaces.rough((n, n), (1.0, 1.0), rms=1.0, seed=seed, **waves)
        assert_allclose(gap.std(), 1.0)
        assert gap.min() == 0.0
        gap -= gap.mean()
        density += np.abs(np.fft.fft2(gap)) ** 2
    f = np.fft.fftfreq(n)
    k = np.hypot(f[:, None], f)
    # Mean density in rings, an octave each: two before the roll-off, two after it.
    edges = np.array([1 / 257, 1 / 128, 1 / 70, 1 / 32, 1 / 16, 1 / 8.01])
    rings = [density[(k > a) & (k <= b)].mean() for a, b in pairwise(edges)]
    assert_allclose(rings[0], rings[1], rtol=0.15)
    # In a ring after it the density is as k^(-2(1 + H)): compare with the mean of that.
    for j in (3, 4):
        inside = (k > edges[j]) & (k <= edges[j + 1])
        law = (k[inside] * roll_off) ** (-2.0 * (1.0 + hurst))
        assert_allclose(rings[j] / rings[1], law.mean(), rtol=0.2)
    assert density[(k < 1 / 257) | (k > 1 / 8 + 1e-9)].max() < 1e-15 * density.max()


def test_without_a_roll_off_the_longest_wave_is_where_the_fall_begins():
    options = {"rms": 1.0, "longest": 32.0, "shortest": 4.0, "seed": 1}
    plain = surfaces.rough((64, 64), (1.0, 1.0), **options)
    rolled = surfaces.rough((64, 64), (1.0, 1.0), roll_off=32.0, **options)
    assert np.array_equal(plain, rolled)
    with pytest.raises(ValueError, match="roll_off is 64, but must be between"):
        surfaces.rough((64, 64), (1.0, 1.0), roll_off=64.0, **options)


MAKE = {  # Surfaces of some shape, with what may be changed.
    "ellipsoid": {"radii": (1.0, 2.0)},
    "cylinder": {"radius": 1.0},
    "sphere": {"radius": 1.0},
    "wavy": {"amplitude": 1.0, "wavelength": 2.0},
    "rough": {"rms": 1.0},
}
SIZED = [("cylinder", "radius"), ("sphere", "radius"), ("wavy", "amplitude"), ("rough", "rms")]


@pytest.mark.parametrize(
    ("name", "change", "error", "message"),
    [
        *(("ellipsoid", {"radii": radii}, ValueError, "radii is")
          for radii in ((0.0, 1.0), (np.nan, 1.0), (1.0, 2.0, 3.0), 1.0, ((1.0, 2.0), (1.0, 0.0)))),
        *((name, {of: size}, ValueError, rf"{of} is of size 1e.300, but must be zero or")
          for name, of in SIZED for size in (1e-300, 1e300)),
        *(("rough", {"seed": seed}, error, f"seed is {seed!r}, but must be an integer of at")
          for seed, error in ((-1, ValueError), (1.5, TypeError), ("a", TypeError))),
        ("rough", {"hurst": 0.0}, ValueError, "hurst is"),
        ("rough", {"longest": 1.0, "shortest": 0.9}, ValueError, "no wavelength"),
        ("rough", {"rms": 0.0}, ValueError, "rms is"),
        ("sphere", {"radius": -1.0}, ValueError, "radius is"),
        ("sphere", {"shape": 4}, ValueError, r"shape is 4, but must be \(n1, n2\)"),
        ("sphere", {"shape": (-4, 4)}, ValueError, "shape is -4, but must be at least 1"),
        ("sphere", {"shape": (4.0, 4)}, TypeError, "shape is 4.0, but must be an integer"),
    ],
)  # fmt: skip
def test_surfaces_refuse_what_makes_no_sense(name, change, error, message):
    given = {"shape": (16, 16), "element": (1.0, 1.0)} | MAKE[name] | change
    with pytest.raises(error, match=message):
        getattr(surfaces, name)(**given)
