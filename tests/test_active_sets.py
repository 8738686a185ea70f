"""The search for active sets: where the sets lead nowhere, projected gradients do."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy.linalg
import scipy.optimize
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from toeplitz_mg.contact.active_sets import RESCUE, STRIKES, find_sets
from toeplitz_mg.contact.products import Products


class Law(NamedTuple):
    residual: float


class Stuck:
    """Non-negative least squares, by a search whose sets never change anything."""

    def __init__(self, A, b):
        self.A, self.b = A, b
        self.etas = []

    def look(self, now):
        return Law(float(np.abs(np.minimum(now.x, now.u - self.b)).max()))

    def advance(self, A, now, law, eta):
        self.etas.append(eta)
        return now, 1

    def project(self, x):
        return np.maximum(x, 0.0)

    def sets_of(self, x):
        return x > 0.0


def problem(n=30):
    A = tmg.ToeplitzOperator(0.6 ** np.arange(n))
    return A, np.random.default_rng(0).standard_normal(n)


def test_projected_gradients_lead_on_where_the_energy_does_not_fall():
    A, b = problem()
    search, products, seen = Stuck(A, b), Products(A, 10**4), []
    now, law, iterations = find_sets(
        search, products, np.zeros(30), b > 0.0, b=b, eta=1.0, tolerance=1e-7,
        progress=lambda *told: seen.append(told),
    )  # fmt: skip
    L = np.linalg.cholesky(A.toarray())
    expected, _ = scipy.optimize.nnls(L.T, scipy.linalg.solve_triangular(L, b, lower=True))
    assert law.residual <= 1e-7
    assert_allclose(now.x, expected, atol=1e-6)
    assert np.array_equal(now.sets, now.x > 0.0)
    assert_allclose(search.etas[: STRIKES + 1], [1.0, 1.0, 0.1, 0.01])
    assert len(iterations) == len(search.etas)
    assert [count for count, _ in seen] == [*range(1, products.count + 1)]
    assert products.count % (RESCUE + 1) == 0


def test_it_ends_where_the_products_are_used_up():
    A, b = problem()
    products = Products(A, 50)
    start = np.ones(30)
    now, law, _ = find_sets(
        Stuck(A, b), products, start, b > 0.0, b=b, eta=1.0, tolerance=1e-10, progress=None
    )
    assert products.exhausted
    assert law.residual > 1e-10
    assert now.x.min() >= 0.0


def test_an_answer_is_multiplied_anew_before_it_is_believed():
    A, b = problem()

    class Rough(Stuck):
        def advance(self, A, now, law, eta):
            x = np.linalg.solve(self.A.toarray(), self.b)
            return replace(now, x=x, u=self.b.copy(), is_exact=False), 1

        def look(self, now):
            return Law(float(np.abs(now.u - self.b).max()))

    products = Products(A, 10)
    now, *_ = find_sets(
        Rough(A, b), products, np.zeros(30), b > 0.0, b=b, eta=1.0, tolerance=1e-10, progress=None
    )
    assert products.count == 1
    assert now.is_exact
