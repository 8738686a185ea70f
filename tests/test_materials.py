"""A body is the same by both of its moduli, rigid where it has none; a bare pair is refused."""

import copy
import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose

from toeplitz_mg import halfspace
from toeplitz_mg.contact import Material, friction, normal_contact, rolling


def test_both_spellings_are_of_the_same_body_which_cannot_be_changed():
    steel = Material(E=210000.0, nu=0.3)
    assert_allclose(steel.G, 210000.0 / 2.6, rtol=1e-15)
    assert_allclose(steel.E, 210000.0, rtol=1e-15)
    assert_allclose(steel.E_star, 210000.0 / (1 - 0.3**2), rtol=1e-15)
    again = Material.from_shear(steel.G, 0.3)
    assert again == steel
    assert hash(again) == hash(steel)
    assert repr(steel) == "Material(E=210000, nu=0.3)"
    for twin in (pickle.loads(pickle.dumps(steel)), copy.deepcopy(steel), eval(repr(steel))):
        assert twin == steel
    with pytest.raises(AttributeError):
        Material(E=1.0, nu=0.3).G = 2.0


def test_a_rigid_body():
    rigid, rubber = Material.rigid(), Material(E=3.0, nu=0.49)
    assert np.isinf([rigid.G, rigid.E, rigid.E_star]).all()
    assert repr(rigid) == "Material.rigid()"
    both = halfspace.combined_material(rubber, rigid)
    assert_allclose(both.E_star, rubber.E_star, rtol=1e-15)
    assert_allclose(both.nu, rubber.nu, rtol=1e-15)
    # It is what a body is on that is far stiffer than it.
    stiff = halfspace.combined_material(rubber, Material(E=3e20, nu=0.2))
    assert_allclose([both.G, both.nu, both.difference], [stiff.G, stiff.nu, stiff.difference])
    with pytest.raises(ValueError, match="both bodies are rigid, but one must be elastic"):
        halfspace.combined_material(rigid, rigid)


def test_a_pair_of_equal_bodies_is_the_body():
    one, two = Material(E=3.0, nu=0.4), (Material(E=3.0, nu=0.4), Material(E=3.0, nu=0.4))
    g = np.full((12, 12), 0.1)
    for solve in (
        lambda m: friction(bound=g, element=(0.1, 0.1), material=m, shift=(1e-3, 0.0)),
        lambda m: rolling(bound=g, element=(0.1, 0.1), material=m, lateral=1e-3),
    ):
        assert np.array_equal(solve(one).traction, solve(two).traction)


@pytest.mark.parametrize(
    ("make", "error", "match"),
    [
        (lambda: Material(E=0.0, nu=0.3), ValueError, "E is 0.0, but must be positive"),
        (lambda: Material(E=np.inf, nu=0.3), ValueError, "E is inf"),
        (lambda: Material(E=1.0, nu=0.6), ValueError, "nu is 0.6, but Poisson's ratio"),
        (lambda: Material(E=1.0, nu=-1.0), ValueError, "nu is -1.0"),
        (lambda: Material(E="a", nu=0.3), TypeError, "E is 'a', but must be a real number"),
        (lambda: Material.from_shear(-1.0, 0.3), ValueError, "G is -1.0"),
        (lambda: Material.from_shear(1.0, np.nan), ValueError, "nu is nan"),
        (lambda: halfspace.CombinedMaterial(1.0, 0.3, 2.0), ValueError, "difference is 2.0"),
        (lambda: halfspace.CombinedMaterial(1.0, 0.3, bodies=3), TypeError, "bodies is 3, but"),
    ],
)
def test_what_no_body_is_made_of(make, error, match):
    with pytest.raises(error, match=match):
        make()


@pytest.mark.parametrize("pair", [(210000.0, 0.3), [210000, 0.3], np.array([210000.0, 0.3])])
@pytest.mark.parametrize("other", [None, Material(E=210000.0, nu=0.3), (70000.0, 0.33)])
def test_bare_numbers_are_refused_in_the_place_of_both_bodies_or_of_one(pair, other):
    """Taken for a shear modulus, Young's modulus is silently 2.6 times too stiff."""
    g = np.full((4, 4), 0.1)
    bound = {"bound": g, "element": (1.0, 1.0)}
    for material in (pair, (pair, other), (other, pair)) if other else (pair,):
        for solve in (
            lambda m: normal_contact(g, (1.0, 1.0), material=m, force=1.0),
            lambda m: friction(**bound, material=m, shift=(0.1, 0.0)),
            lambda m: rolling(**bound, material=m, lateral=0.1),
            lambda m: halfspace.influence_matrix("z", (4, 4), (1.0, 1.0), m),
        ):
            with pytest.raises(TypeError, match=r"Material\(E=.*, nu=.*\) .*from_shear\("):
                solve(material)
