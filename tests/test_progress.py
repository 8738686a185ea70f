"""Progress of contact problems: told after each product, on coarser grids too."""

from itertools import pairwise

import numpy as np
import pytest

from toeplitz_mg.contact import (
    ContactError,
    Material,
    SteadyOptions,
    friction,
    frictional_contact,
    frictional_rolling,
    normal_contact,
    rolling,
    surfaces,
)

SOFT = Material.from_shear(0.7, 0.3)
N, H = 72, (2.0 / 72, 2.0 / 72)
GAP = surfaces.sphere((N, N), H, radius=1.0)
X, Y = surfaces.centres((N, N), H)
BOUND = 0.1 * np.sqrt(np.maximum(0.0, 0.36 - X**2 - Y**2))
BODIES = {"bound": BOUND, "element": H, "material": SOFT}

SOLVERS = {
    "normal": lambda **options: normal_contact(GAP, H, material=SOFT, force=0.2, **options),
    "friction": lambda **options: friction(**BODIES, shift=(0.02, 0.01), **options),
    "force": lambda **options: friction(**BODIES, force=(0.01, 0.02), **options),
    "rolling": lambda **options: rolling(**BODIES, longitudinal=0.02, **options),
}


def told(solve, **options):
    """The result, and what was told on the coarser grids and on the finest one."""
    seen = []
    result = solve(progress=lambda *now: seen.append(now), **options)
    first = next(k for k, (products, _) in enumerate(seen) if products)
    assert all(products for products, _ in seen[first:])
    return result, seen[:first], seen[first:]


@pytest.mark.parametrize("name", SOLVERS)
def test_it_is_told_after_each_product(name):
    result, coarse, fine = told(SOLVERS[name])
    counts = [products for products, _ in fine]
    # Only of what is before the first look, and after the last, is there nothing to tell.
    assert counts[0] <= 2
    assert all(later - former == 1 for former, later in pairwise(counts))
    assert result.products - 1 <= counts[-1] <= result.products
    assert len(coarse) >= 5
    residuals = [residual for _, residual in fine]
    assert residuals[-1] < residuals[0] < np.inf
    assert np.array_equal(result.traction, SOLVERS[name]().traction)  # Telling changes nothing.


def test_without_coarser_grids_none_is_told_of():
    _, coarse, fine = told(SOLVERS["normal"], nested=False)
    assert not coarse
    assert fine


UNLIKE = {"material": (SOFT, Material.rigid()), "mu": 0.3, "force": 0.2}
COUPLED = {
    "pressed": lambda **options: frictional_contact(GAP, H, **UNLIKE, **options),
    "rolled": lambda **options: frictional_rolling(GAP, H, longitudinal=0.02, **UNLIKE, **options),
}


@pytest.mark.parametrize("name", COUPLED)
def test_both_problems_of_unlike_bodies_are_told_of(name):
    seen = []
    result = COUPLED[name](progress=lambda *now: seen.append(now))
    counts = [products for products, _ in seen]
    # Before the first look at a problem there is nothing to tell of its first products.
    assert all(0 <= later - former <= 5 for former, later in pairwise(counts))
    assert sum(b == a + 1 for a, b in pairwise(counts)) > 0.5 * counts[-1]
    total = result.normal.products + result.tangential.products
    assert total - 1 <= counts[-1] <= total
    # After each iteration its violation is told, and then that one all through the next.
    told = [residual for _, residual in seen]
    assert told[-1] == result.residual
    assert set(result.residuals) <= set(told)
    assert np.array_equal(COUPLED[name]().normal.pressure, result.normal.pressure)


def test_rolling_on_goes_on_counting():
    """Where the search for the steady state rolls step by step, its products are told of too."""
    seen = []
    with pytest.raises(ContactError, match=r"after 20\d products"):
        SOLVERS["rolling"](
            nested=False,
            options=SteadyOptions(iterations=20, patience=1),
            max_products=200,
            progress=lambda *now: seen.append(now),
        )
    counts = [products for products, _ in seen]
    assert counts[-1] >= 200
    assert counts == sorted(counts)
    assert max(later - former for former, later in pairwise(counts)) <= 5
