"""The iteration towards the steady state of rolling: on given areas it is GMRES."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from toeplitz_mg.contact import Material
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.products import LOST, Displacements, Products
from toeplitz_mg.contact.tangential.coulomb import Areas
from toeplitz_mg.contact.tangential.given_loads import Loads, look
from toeplitz_mg.contact.tangential.iteration import Iteration
from toeplitz_mg.contact.tangential.problem import Problem
from toeplitz_mg.contact.tangential.settling import settle
from toeplitz_mg.engine.vectors import Vectors, gram

SHAPES = (9,), (5, 4)


def bonded(shape):
    """A contact that sticks everywhere, the products with its matrix, and approximate inverses."""
    grid = Grid.of(shape, (0.3,) * len(shape), Material.from_shear(1.0, 0.2), None)
    K = Products(grid.steady(grid.tangential()), 100)
    b = np.random.default_rng(0).standard_normal((grid.components, *shape))
    problem = Problem(grid, np.full(shape, np.inf), b, None, 1e-10)
    nothing = np.empty((0, *b.shape))
    areas = Areas(np.ones(shape, bool), np.zeros(shape, bool))
    M = grid.invert_shifted(K.A, np.float64)
    return problem, Loads(nothing, nothing, np.empty(0)), areas, K, M


@pytest.mark.parametrize("shape", SHAPES)
def test_on_given_areas_it_is_gmres(shape):
    problem, loads, areas, K, M = bonded(shape)
    b, inverse = problem.b, M.at(np.zeros(shape))
    step, q, u = Iteration(problem, loads, M, depth=6), np.zeros_like(b), np.zeros_like(b)

    def invert(r):
        return inverse(r, lambda X: X)  # Tractions may change everywhere.

    krylov = [K(invert(b))]
    r = b
    for k in range(6):
        v = step(look(problem, loads, areas, q, u), areas, q, u)
        # Of the residuals that the Krylov space leaves it takes the least, and then the inverse.
        basis = np.array(krylov[:k]).reshape(k, b.size).T
        least = b.ravel() - basis @ np.linalg.lstsq(basis, b.ravel())[0]
        left = least.reshape(b.shape)
        r = r - K(v)
        assert_allclose(r, left - K(invert(left)), rtol=0, atol=1e-4 * np.abs(b).max())
        q = q + v
        u = K(q)
        krylov.append(K(invert(krylov[-1])))


@pytest.mark.parametrize("shape", SHAPES)
def test_steps_that_go_round_in_a_circle_are_made_in_part(shape):
    problem, loads, areas, K, _ = bonded(shape)
    inverse = np.linalg.inv(K.A @ np.eye(K.A.shape[0]))

    def twice_as_far(now, areas, q, u):
        # Whole, it only turns what is wrong around.
        return 2.0 * (inverse @ now.law.r.ravel()).reshape(q.shape)

    guess = np.zeros_like(problem.b), areas
    state = settle(problem, loads, K, guess, twice_as_far, patience=30)
    assert state.residual <= problem.tolerance


@pytest.mark.parametrize("shape", SHAPES)
def test_displacements_are_off_by_no_more_than_they_say(shape):
    problem, _, _, K, _ = bonded(shape)
    rng = np.random.default_rng(1)
    q = rng.standard_normal(problem.b.shape)
    follows = Displacements(K, q, np.float32)
    lost = []
    for change in 10.0 ** -np.arange(9.0):
        q = q + change * rng.standard_normal(q.shape)
        follows.follow(q, change, allowed=1e-9)
        assert np.abs(follows.u - K(q)).max() <= follows.lost + 1e-14
        lost.append(follows.lost)
    # The one product in double precision is where what comes after loses nothing that matters.
    assert max(lost) > 1e-9 >= lost[-1]
    assert lost.count(0.0) == 1
    assert LOST * 10.0 ** -lost.index(0.0) <= 1e-10


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("n", [7, 10_001])
def test_gram(n, dtype):
    X = np.random.default_rng(2).standard_normal((4, n)).astype(dtype)
    exact = X.astype(np.longdouble) @ X.T.astype(np.longdouble)
    # The bound of an inner product's rounding is n machine epsilons of the sizes.
    rounding = n * np.finfo(dtype).eps * exact.max()
    assert_allclose(gram(X), exact, rtol=0, atol=rounding)
    of_two = Vectors(lambda part: [part, part])
    assert_allclose(of_two.gram(X), 2 * exact, rtol=0, atol=2 * rounding)
