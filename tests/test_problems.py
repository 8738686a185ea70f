"""The three problems have the data of the paper, for any n."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from toeplitz_mg import halfspace
from toeplitz_mg.paper.problems import test1, test2, test3

TESTS = [test1, test2, test3]


@pytest.mark.parametrize("n", [2, 3, 17, 64, 100])
def test_the_papers_data(n):
    x = -4 + 8 / n * (np.arange(n) + 0.5)
    first, second, third = (test(n) for test in TESTS)
    assert_allclose(first.x, x)
    assert (first.b == 0.0008).all()
    assert_allclose(second.b, x)
    inside = ((x > -4) & (x < -2)) | ((x > 0) & (x < 4))
    assert np.array_equal(third.A.mask, inside)
    assert_allclose(third.x, x[inside])
    assert third.b.shape == (inside.sum(),)
    for problem, material in ((first, (82000.0, 0.28)), (second, (0.3, 0.49))):
        c = halfspace.influence_xx(
            8 / n * np.arange(n), 0.0, (8 / n, 100.0), G=material[0], nu=material[1]
        )
        assert_allclose(problem.A.c, c, rtol=1e-14)
        assert problem.h == 8 / n


@pytest.mark.parametrize("test", TESTS)
def test_another_grid_has_the_same_matrix_as_the_problem_on_it(test):
    A = test(64).operator_of_grid_shape((32,))
    other = test(32).A
    assert np.array_equal(A.c, getattr(other, "full", other).c)


@pytest.mark.parametrize("test", TESTS)
def test_refuses_bad_n(test):
    with pytest.raises(ValueError, match="n is 0"):
        test(0)
    with pytest.raises(TypeError, match=r"n is 8\.0, but must be an integer"):
        test(8.0)


def test_three_needs_an_element_in_contact():
    with pytest.raises(ValueError, match="n is 1, but test 3 needs at least 2"):
        test3(1)


def test_problems_are_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        test1(4).h = 1.0
