"""With FSAI, iterations on large grids hardly depend on the area, the kernel or the size."""

import pytest

import toeplitz_mg as tmg
from comparisons.systems import masks
from tests.budgets import assert_within_budget
from tests.test_fsai import both_iterations, half_space
from tests.test_fsai_coupled import tangential

pytestmark = pytest.mark.slow  # The grids have up to 2048² elements.


@pytest.fixture(scope="module")
def full():
    return tmg.ToeplitzOperator(half_space(512))


AREAS = ["rough, 5 %", "rough, 30 %", "rough, 60 %", "random, 50 %", "stripes", "checkerboard"]


@pytest.mark.parametrize("area", [*AREAS, "circle", "two patches"])
def test_on_512_squared(full, area):
    """The right-hand side is constant, or random, the relative residual 1e-8."""
    found = both_iterations(tmg.MaskedOperator(full, masks.FRAGMENTED[area](512)))
    assert_within_budget("FSAI, areas of 512 squared", iterations=max(found))


def test_on_2048_squared(full):
    """It takes at most two iterations more than on 512²."""
    area = masks.FRAGMENTED["rough, 30 %"]
    large = tmg.MaskedOperator(tmg.ToeplitzOperator(half_space(2048)), area(2048))
    found, few = both_iterations(large), both_iterations(tmg.MaskedOperator(full, area(512)))
    assert found[0] <= few[0] + 2
    assert found[1] <= few[1] + 2


@pytest.mark.parametrize("ratio", [1.0, 4.0, 0.25])
@pytest.mark.parametrize("area", ["circle", "rough, 30 %", "random, 50 %", "stripes"])
def test_coupled_and_stretched_are_within_a_third_of_the_normal_ones(area, ratio):
    """The components are tangential, for ν = 1/2, where the coupling is strongest."""
    n = 256
    mask = masks.FRAGMENTED[area](n)
    least = both_iterations(tmg.MaskedOperator(tmg.ToeplitzOperator(half_space(n)), mask))
    for kernel in (tmg.ToeplitzOperator(half_space(n, ratio)), tangential((n, n), ratio=ratio)):
        found = both_iterations(tmg.MaskedOperator(kernel, mask))
        assert found[0] <= 1.3 * least[0]
        assert found[1] <= 1.3 * least[1]
