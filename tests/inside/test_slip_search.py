"""Stick and slip: Coulomb's law as a residual, steps towards it, and how they are followed.

On given areas of stick and slip the iteration for rolling is GMRES, and Newton's linear systems
leave what is orthogonal to the tangents. Displacements that follow the tractions step by step, in
single precision, are off by no more than is said of them.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from toeplitz_mg.contact import Material
from toeplitz_mg.contact.dense import DenseMatrix
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.products import Displacements, Products
from toeplitz_mg.contact.tangential.iteration import Iteration
from toeplitz_mg.contact.tangential.law import Areas, Problem, clip, linearise, size
from toeplitz_mg.contact.tangential.loads import Loads, look
from toeplitz_mg.contact.tangential.newton import solve_on_tangents
from toeplitz_mg.contact.tangential.settling import settle
from toeplitz_mg.engine.vectors import Vectors, gram

SHAPES = (9,), (5, 4)


def grid_of(shape):
    return Grid.of(shape, (0.3, 0.2)[: len(shape)], Material.from_shear(1.0, 0.2), None)


def bonded(shape):
    """A contact that sticks everywhere, the products with its matrix, and approximate inverses."""
    grid = grid_of(shape)
    K = Products(grid.steady(grid.tangential()), 100)
    b = np.random.default_rng(0).standard_normal((grid.components, *shape))
    problem = Problem(grid, np.full(shape, np.inf), b, 1e-10)
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
        v, _, _ = step(look(problem, loads, areas, q, u), areas, q, u, 1.0)
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

    def twice_as_far(now, areas, q, u, eta):
        # Whole, it only turns what is wrong around.
        return 2.0 * (inverse @ now.law.r.ravel()).reshape(q.shape), None, 1

    guess = np.zeros_like(problem.b), areas
    state = settle(problem, loads, K, guess, twice_as_far, patience=30)
    assert state.residual <= problem.tolerance


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_slip_along_the_traction_is_a_violation(sign):
    """All slide, and Coulomb's law wants the slip to oppose the traction."""
    g = np.full((4, 3), 0.3)
    q, b = np.stack([g, 0.0 * g]), np.stack([sign * np.ones_like(g), 0.0 * g])
    slide = np.ones(g.shape, bool)
    problem = Problem(grid_of(g.shape), g, b, 1e-8)  # Minus the slip is b - u.
    found = linearise(problem, Areas(~slide, slide), q, np.zeros_like(q))
    assert found.residual == (0.0 if sign > 0.0 else 1.0)


# Nothing slides, some, most, all.
@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.75, 0.9, 1.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_what_newtons_system_leaves_is_orthogonal_to_the_tangents(share, shape):
    rng, grid = np.random.default_rng(int(100 * share) + len(shape)), grid_of(shape)
    contact = rng.random(shape) < 0.8
    K, m = DenseMatrix(grid.steady(grid.tangential()), contact), np.count_nonzero(contact)
    slide = rng.permutation(m) < share * m
    q, r = rng.standard_normal((grid.components, m)), rng.standard_normal((3, grid.components, m))
    n = np.where(slide, q / np.linalg.norm(q, axis=0), 0.0)
    # Some slide without any slip so far, and some with much of it.
    stiffness = slide * K.array[0, 0] * rng.choice([0.0, 0.1, 10.0, 1e6], m)
    for precisely, rounding in ((True, 1e-9), (False, 1e-3)):
        v = solve_on_tangents(K, Areas(~slide, slide), n, stiffness, r, precisely=precisely)
        assert_allclose((v * n).sum(axis=1), 0.0, atol=1e-12 * np.abs(v).max(initial=1.0))
        for one, of_one in zip(v, r, strict=True):
            left = of_one - (K.array @ one.ravel()).reshape(one.shape) - stiffness * one
            along_tangents = left - n * (n * left).sum(axis=0)
            # Where it slides, of all that adds up to this.
            size = np.abs(of_one) + np.abs(stiffness * one)
            assert np.abs(along_tangents).max() <= rounding * size.max()


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


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("n", [7, 10_001])
def test_inner_products_of_several_fields_are_right_to_rounding(n, dtype):
    X = np.random.default_rng(2).standard_normal((4, n)).astype(dtype)
    exact = X.astype(np.longdouble) @ X.T.astype(np.longdouble)
    # The bound of an inner product's rounding is n machine epsilons of the sizes.
    rounding = n * np.finfo(dtype).eps * exact.max()
    assert_allclose(gram(X), exact, rtol=0, atol=rounding)
    of_two = Vectors(lambda part: [part, part])
    assert_allclose(of_two.gram(X), 2 * exact, rtol=0, atol=2 * rounding)


@pytest.mark.parametrize("components", [1, 2])
def test_clipped_tractions_are_the_nearest_within_the_bound(components):
    """To the last bit within it; those of two components are only made shorter."""
    rng = np.random.default_rng(components)
    q, g = rng.standard_normal((components, 500)), rng.uniform(0.0, 2.0, 500)
    clipped = clip(q, g)
    assert (size(clipped) <= g).all()
    assert_allclose(size(q - clipped), np.maximum(size(q) - g, 0.0), atol=1e-13)
    inside = size(q) < 0.999 * g
    assert inside.any()
    assert np.array_equal(clipped[:, inside], q[:, inside])
