"""The three problems have the data of the paper, for any n."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.systems import refuses
from toeplitz_mg.paper import algorithm
from toeplitz_mg.paper.problems import TESTS, test1, test3


@pytest.mark.parametrize("n", [2, 3, 17, 64, 100])
@pytest.mark.parametrize("number", TESTS)
def test_the_papers_data(number, n):
    problem, (A, u) = TESTS[number](n), algorithm.system(number, n)
    assert_allclose(getattr(problem.A, "full", problem.A).c, A.t, rtol=1e-11)
    assert np.array_equal(getattr(problem.A, "mask", np.ones(n, bool)), A.contact)
    assert_allclose(problem.b, u, atol=1e-15)
    assert_allclose(problem.x, (-4 + 8 / n * (np.arange(n) + 0.5))[A.contact], atol=1e-15)
    assert problem.h == 8 / n


@pytest.mark.parametrize("test", TESTS.values())
def test_another_grid_has_the_same_matrix_as_the_problem_on_it(test):
    A = test(64).operator_of_grid_shape((32,))
    other = test(32).A
    assert np.array_equal(A.c, getattr(other, "full", other).c)


def test_refuses_bad_n_and_that_anything_is_changed():
    refuses(ValueError, "n is 1, but test 3 needs at least 2", test3, 1)
    with pytest.raises(dataclasses.FrozenInstanceError):
        test1(4).h = 1.0
    for test in TESTS.values():
        refuses(ValueError, "n is 0", test, 0)
        refuses(TypeError, r"n is 8\.0, but must be an integer", test, 8.0)
