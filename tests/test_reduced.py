"""Newton's linear systems with the matrix as an array, in tractions or in slips."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from toeplitz_mg.contact import Material
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.steady_matrices import SteadyArray
from toeplitz_mg.contact.tangential.coulomb import Areas
from toeplitz_mg.contact.tangential.reduced import solve_on_tangents


def steady_array(components, rng):
    shape, element = ((5, 4), (0.3, 0.2)) if components == 2 else ((12,), (0.3,))
    grid = Grid.of(shape, element, Material.from_shear(2.0, 0.3), None)
    contact = rng.random(shape) < 0.8
    return SteadyArray(grid.steady(grid.tangential()), contact), np.count_nonzero(contact)


# Nothing slides, some, most, all: the unknowns are slips or tractions, whichever are fewer.
@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.75, 0.9, 1.0])
@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("precisely", [True, False])
def test_what_is_left_is_orthogonal_to_the_tangents(share, components, precisely):
    rng = np.random.default_rng(int(100 * share) + components)
    K, m = steady_array(components, rng)
    slide = rng.permutation(m) < share * m
    q = rng.standard_normal((components, m))
    n = np.where(slide, q / np.linalg.norm(q, axis=0), 0.0)
    # Some slide without any slip so far, and some with much of it.
    stiffness = slide * K.array[0, 0] * rng.choice([0.0, 0.1, 10.0, 1e6], m)
    r = rng.standard_normal((3, components, m))
    v = solve_on_tangents(K, Areas(~slide, slide), n, stiffness, r, precisely=precisely)
    assert_allclose((v * n).sum(axis=1), 0.0, atol=1e-12 * np.abs(v).max(initial=1.0))
    for one, of_one in zip(v, r, strict=True):
        left = of_one - (K.array @ one.ravel()).reshape(one.shape) - stiffness * one
        along_tangents = left - n * (n * left).sum(axis=0)
        # Where it slides, of all that adds up to this.
        size = np.abs(of_one) + np.abs(stiffness * one)
        assert np.abs(along_tangents).max() <= (1e-9 if precisely else 1e-3) * size.max()


def test_a_singular_system_has_no_solution():
    rng = np.random.default_rng(0)
    K, m = steady_array(2, rng)
    slide = np.arange(m) < 3
    n = np.zeros((2, m))  # A traction of zero has no direction in which it could turn.
    r = rng.standard_normal((1, 2, m))
    assert solve_on_tangents(K, Areas(~slide, slide), n, np.zeros(m), r, precisely=True) is None
