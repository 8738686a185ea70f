"""Contact on arrays of other libraries: the search is that on NumPy's, and so is what it finds."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from tests.array_libraries import LIBRARIES, load_library, record_numbers
from toeplitz_mg import contact

strict = pytest.importorskip("array_api_strict")
STEEL, H = contact.Material(E=210000.0, nu=0.28), 0.01
pytestmark = pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")


def press(gap, element=(H, H), **load):
    return contact.normal_contact(gap, element, material=STEEL, **load)


def rough(n, seed=0):
    """A self-affine surface of n x n elements, pressed on a flat."""
    k = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n))
    spectrum = np.fft.rfft2(np.random.default_rng(seed).standard_normal((n, n)))
    z = np.fft.irfft2(spectrum * np.maximum(k, 4 / n) ** -1.8, s=(n, n))
    return 1e-3 * (z.max() - z) / z.std()


SPHERE = contact.surfaces.sphere((47, 40), (H, H), radius=10.0)
HOLES = np.where(np.random.default_rng(1).random(SPHERE.shape) < 0.1, np.inf, SPHERE)
CASES = {
    "force": lambda a: press(a(SPHERE), force=60.0),
    "approach": lambda a: press(a(SPHERE), approach=0.0025),
    "no guess": lambda a: press(a(SPHERE), force=60.0, nested=False),
    "little contact": lambda a: press(a(SPHERE), force=1.0),
    "rough": lambda a: press(a(rough(64)), force=800.0),
    "rough by approach": lambda a: press(a(rough(64)), approach=0.002),
    "punch": lambda a: press(a(np.zeros((20, 33))), force=60.0),
    "hardness": lambda a: press(a(SPHERE), force=60.0, hardness=1500.0),
    "all yields": lambda a: press(a(np.zeros((3, 4))), force=120 * H * H, hardness=10.0),
    "holes": lambda a: press(a(HOLES), force=60.0),
    "heights": lambda a: press(None, heights=a(-SPHERE), force=60.0),
    "micrometres": lambda a: press(a(1e3 * SPHERE), (10.0, 10.0), unit="um", force=60.0),
    "another load": lambda a: press(a(SPHERE), force=60.0, previous=press(SPHERE, force=50.0)),
    "line": lambda a: press(a(SPHERE[:, 20]), H, force=60.0),
    "no load": lambda a: press(a(SPHERE), force=0.0),
    "single precision": lambda a: press(a(SPHERE.astype(np.float32)), force=60.0),
}


def assert_same(actual, expected):
    """The same area, products but for a step; pressures to the tolerance of the search."""
    assert np.array_equal(actual.contact, expected.contact)
    assert abs(actual.products - expected.products) <= 2  # Rounding may decide on a step more.
    assert abs(sum(actual.iterations) - sum(expected.iterations)) <= 2
    assert actual.warnings == expected.warnings
    scale = expected.max_pressure or 1.0
    assert_allclose(actual.pressure, expected.pressure, rtol=0.0, atol=1e-6 * scale)
    assert_allclose(actual.approach, expected.approach, rtol=1e-8)
    for name in ("force", "energy", "stiffness"):
        assert_allclose(getattr(actual, name), getattr(expected, name), rtol=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_normal_contact_is_that_on_numpy(name):
    expected, actual = CASES[name](np.asarray), CASES[name](strict.asarray)
    assert_same(actual, expected)
    for field in (actual.pressure, actual.displacement, actual.gap, actual.contact):
        assert type(field) is np.ndarray  # So that it is drawn, written and given to friction.


@pytest.mark.parametrize("library", LIBRARIES[1:])
def test_normal_contact_on_jax_and_gpus_is_that_on_numpy(library):
    """A few loads of one size: JAX compiles all anew for another."""
    xp = load_library(library)
    for name in ("force", "approach", "hardness"):
        assert_same(CASES[name](xp.asarray), CASES[name](np.asarray))


def test_a_large_fragmented_contact_is_that_on_numpy():
    """So large that it takes another preconditioner than small ones."""
    z = rough(256)
    assert_same(*(press(a(z), force=3300.0) for a in (strict.asarray, np.asarray)))


@pytest.mark.parametrize("load", [{"approach": 0.002}, {"force": 800.0}], ids=str)
def test_an_iteration_takes_a_few_numbers_to_the_host(monkeypatch, load):
    """Products of vectors, extremes and means, some fifteen a product with the matrix; no field."""
    copied, array = [], type(strict.ones(1))
    looked = record_numbers(monkeypatch, array)
    export = array.__dlpack__

    def record_copy(x, **options):
        copied.append(x.shape)
        return export(x, **options)

    monkeypatch.setattr(array, "__dlpack__", record_copy)
    found = press(strict.asarray(rough(64)), nested=False, **load)
    assert 0 < len(looked) <= 15 * found.products
    assert set(looked) == {()}
    # What is given goes there once, and what is found.
    assert copied.count((64, 64)) == 3


def test_surfaces_that_repeat_and_curves_need_numpys_arrays():
    gap = strict.asarray(SPHERE)
    for wrong in (
        lambda: press(gap, force=1.0, periodic=True),
        lambda: press(None, heights=gap, force=1.0, periodic=(True, False)),
        lambda: contact.load_curve(gap, (H, H), material=STEEL, forces=[1.0]),
    ):
        with pytest.raises(TypeError, match=r"is an array of array_api_strict, but .* numpy"):
            wrong()
    with pytest.raises(ValueError, match="gap is nan somewhere"):
        press(strict.asarray(SPHERE * np.nan), force=1.0)


@pytest.mark.slow
def test_a_library_without_double_precision_is_refused():
    jnp, jax = load_library("jax.numpy"), pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(TypeError, match=r"no double precision here.*jax_enable_x64"):
            press(jnp.asarray(SPHERE), force=1.0)
        A = tmg.ToeplitzOperator(jnp.asarray([2.0, 1.0, 0.5]))
        for make in (A.astype, lambda dtype: tmg.cosine_preconditioner(A, dtype=dtype)):
            with pytest.raises(
                TypeError, match=r"dtype needs float64, but jax.numpy has no double precision"
            ):
                make(np.float64)
        assert tmg.cosine_preconditioner(A).dtype == np.float32
    finally:
        jax.config.update("jax_enable_x64", True)
