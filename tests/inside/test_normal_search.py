"""The search for active sets ends at the solution, also where its sets lead nowhere.

And what it is given: FSAI of a set stays positive definite on any other one, coarser grids keep
means and constants, and products have the precision of what is multiplied.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from toeplitz_mg import halfspace
from toeplitz_mg.contact.coarsening import coarsen, refine
from toeplitz_mg.contact.inverse import LocalInverse
from toeplitz_mg.contact.normal.search import find_set
from toeplitz_mg.contact.products import Products

UNIT = halfspace.Material.from_shear(0.7, 0.3)


class Law(NamedTuple):
    residual: float


class Stuck:
    """Non-negative least squares, by a search whose sets never change anything."""

    def __init__(self, A, b, tolerance, progress):
        self.A, self.b, self.tolerance, self.progress = A, b, tolerance, progress

    def look(self, now):
        return Law(float(np.abs(np.minimum(now.p, now.u - self.b)).max()))

    def advance(self, A, now, law, eta):
        return now, 1

    def project(self, p):
        return np.maximum(p, 0.0)

    def set_of(self, p):
        return p > 0.0


def search_for(kind, limit, tolerance, start=0.0, progress=None):
    """Run a search of one kind: its products, and what is found."""
    A = tmg.ToeplitzOperator(0.6 ** np.arange(30))
    b = np.random.default_rng(0).standard_normal(30)
    search, products = kind(A, b, tolerance, progress), Products(A, limit)
    return search, products, *find_set(search, products, np.full(30, start), b > 0.0, eta=1.0)


def test_projected_gradients_lead_on_where_the_energy_does_not_fall():
    told = []
    search, products, now, law, _ = search_for(
        Stuck, 10**4, 1e-7, progress=lambda count, residual: told.append(count)
    )
    L = np.linalg.cholesky(search.A.toarray())
    b = scipy.linalg.solve_triangular(L, search.b, lower=True)
    expected, _ = scipy.optimize.nnls(L.T, b)
    assert law.residual <= 1e-7
    assert_allclose(now.p, expected, atol=1e-6)
    assert np.array_equal(now.C, now.p > 0.0)
    assert told == [*range(1, products.count + 1)]


def test_it_ends_where_the_products_are_used_up():
    _, products, now, law, _ = search_for(Stuck, 50, 1e-10, start=1.0)
    assert products.exhausted
    assert law.residual > 1e-10
    assert now.p.min() >= 0.0


def test_an_answer_is_multiplied_anew_before_it_is_believed():
    class Rough(Stuck):
        def advance(self, A, now, law, eta):
            x = np.linalg.solve(self.A.toarray(), self.b)
            return replace(now, p=x, u=self.b.copy(), is_exact=False), 1

        def look(self, now):
            return Law(float(np.abs(now.u - self.b).max()))

    _, products, now, *_ = search_for(Rough, 10, 1e-10)
    assert products.count == 1
    assert now.is_exact


def test_the_inverse_of_a_set_is_positive_definite_on_another():
    A = halfspace.influence_matrix("z", (16, 16), (0.1, 0.1), UNIT)
    A = tmg.ToeplitzOperator(A.c / A.c[0, 0])
    rng = np.random.default_rng(0)
    C, other = rng.random((2, 16, 16)) < 0.5
    M = LocalInverse(tmg.fsai_preconditioner(tmg.MaskedOperator(A, C)), C)
    units = np.eye(256)[other.ravel()].reshape(-1, 16, 16)
    P = np.stack([M(e)[other] for e in units])
    assert_allclose(P, P.T, atol=1e-14)
    assert np.linalg.eigvalsh(P).min() > 0.0
    block = A.block(np.flatnonzero(other))
    assert np.linalg.cond(P @ block) < np.linalg.cond(block)


def test_fields_are_multiplied_in_their_precision():
    products = Products(halfspace.influence_matrix("z", (9, 7), (0.1, 0.1), UNIT), 10)
    x = np.random.default_rng(0).random((9, 7))
    assert products(x).dtype == np.float64
    single = products(x.astype(np.float32))
    assert single.dtype == np.float32
    assert_allclose(single, products(x), rtol=1e-5)
    assert products.count == 3


@pytest.mark.parametrize("shape", [(1,), (7,), (8,), (5, 8), (1, 6), (3, 1)])
def test_coarser_grids_keep_constants(shape):
    coarse = coarsen(np.full(shape, 3.0), (True,) * len(shape))
    assert coarse.shape == tuple(-(-n // 2) for n in shape)
    assert_allclose(coarse, 3.0)
    assert_allclose(refine(np.stack([coarse, coarse]), shape), np.full((2, *shape), 3.0))


@pytest.mark.parametrize(
    ("shape", "halved"), [((8,), (True,)), ((8, 6), (True, True)), ((8, 5), (True, False))]
)
def test_coarser_grids_go_around_where_the_surface_repeats(shape, halved):
    x = np.random.default_rng(0).random(shape)
    coarse = coarsen(x, halved)
    assert_allclose(coarse.mean(), x.mean())
    assert_allclose(coarsen(np.roll(x, 2, axis=0), halved), np.roll(coarse, 1, axis=0))
    around = halved, (True,) * len(shape)
    fine = refine(coarse, shape, *around)
    assert fine.shape == shape
    assert_allclose(fine.mean(), coarse.mean())
    rolled = refine(np.roll(coarse, 1, axis=0), shape, *around)
    assert_allclose(rolled, np.roll(fine, 2, axis=0))
