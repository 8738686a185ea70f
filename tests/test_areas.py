"""Iterations on the areas of the comparison `areas`, on large grids."""

import pytest

import toeplitz_mg as tmg
from comparisons.systems import masks
from tests.test_fsai import both_iterations, half_space
from tests.test_fsai_coupled import tangential
from toeplitz_mg.paper.problems import test1 as line_contact

pytestmark = pytest.mark.slow  # The grids have up to 2048² elements.


@pytest.fixture(scope="module")
def full():
    return tmg.ToeplitzOperator(half_space(512))


@pytest.mark.parametrize(
    ("area", "most"),
    [
        ("rough, 5 %", (9, 10)),
        ("rough, 30 %", (9, 10)),
        ("rough, 60 %", (10, 11)),
        ("random, 50 %", (11, 12)),
        ("stripes", (10, 11)),
        ("checkerboard", (10, 11)),
        ("circle", (9, 10)),
        ("two patches", (9, 10)),
    ],
)
def test_on_512_squared(full, area, most):
    """The right-hand side is constant, or random, the relative residual 1e-8."""
    found = both_iterations(tmg.MaskedOperator(full, masks.FRAGMENTED[area](512)))
    assert found[0] <= most[0]
    assert found[1] <= most[1]


def test_on_2048_squared():
    """It takes at most two iterations more than on 512²."""
    constant, random = both_iterations(
        tmg.MaskedOperator(
            tmg.ToeplitzOperator(half_space(2048)), masks.FRAGMENTED["rough, 30 %"](2048)
        )
    )
    assert constant <= 11
    assert random <= 12


def test_on_ten_thousand_islands_of_a_line():
    n = 2**20
    A = tmg.MaskedOperator(line_contact(n).A, masks.islands(10_000, n))
    assert max(both_iterations(A)) <= 10


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
