"""Rolling by loads that are nearly all that friction carries: it starts where all slides."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.test_friction import doubtful, semi_ellipse
from tests.test_rolling import assert_rolls
from toeplitz_mg.contact import Material, rolling, surfaces

BODY = Material.from_shear(1.0, 0.25)


def ellipse(n, h):
    """The bound of a contact of half width 1 on n x n elements."""
    x, y = surfaces.centres((n, n), h)
    return 3e-3 * semi_ellipse(np.hypot(x, y), 1.0)


@doubtful
@pytest.mark.parametrize("n", [10, 24, 60])
@pytest.mark.parametrize(
    ("creepages", "given"),
    [
        ((0.01, 0.04, -0.05), ("force", "moment")),  # Little sticks.
        ((0.03, 0.02, 0.1), ("force", "moment")),  # Nothing does.
        ((0.02, 0.01, 0.3), ("force",)),  # All slides by the spin, whatever the forces are.
        ((0.05, 0.02, 0.1), ("moment",)),
    ],
)
def test_loads_near_those_of_sliding_take_a_few_products_more_than_creepages(n, creepages, given):
    h = (2.0 / n, 2.0 / n)
    g, case = ellipse(n, h), {"material": BODY}
    names = ("longitudinal", "lateral", "spin")
    known = rolling(g, h, **dict(zip(names, creepages, strict=True)), **case)
    assert known.stick_area < 0.02 * known.area
    loads = {name: getattr(known, name) for name in given}
    left = {"force": names[:2], "moment": names[2:]}
    rest = {name for kind in given for name in left[kind]}
    others = {n: c for n, c in zip(names, creepages, strict=True) if n not in rest}
    result = rolling(g, h, **loads, **others, **case)
    assert_rolls(result, BODY)
    carried = float(g.sum()) * h[0] * h[1]
    assert_allclose(result.force, known.force, rtol=0.0, atol=1e-7 * carried)
    assert_allclose(result.moment, known.moment, rtol=0.0, atol=1e-7 * carried)
    assert result.products <= 2.5 * known.products


@pytest.mark.parametrize("given", ["both", "longitudinal"])
@pytest.mark.parametrize("angle", [0.2, 0.7, 1.3])
@pytest.mark.parametrize("creepage", [0.004, 0.005])  # Of the elements a third at most sticks.
@pytest.mark.parametrize("n", [80, 140])
def test_a_line_that_nearly_slides_starts_from_a_coarser_one(n, creepage, angle, given):
    h = 2.5 / n
    (x,) = surfaces.centres(n, h)
    g = 3e-3 * semi_ellipse(x, 1.0)
    along, across = creepage * np.cos(angle), creepage * np.sin(angle)
    known = rolling(g, h, longitudinal=along, lateral=across, material=BODY)
    assert known.stick_area < 0.35 * known.area
    if given == "both":
        result = rolling(g, h, force=tuple(known.force), material=BODY)
    else:
        result = rolling(g, h, force=(known.force[0], None), lateral=across, material=BODY)
    assert_rolls(result, BODY)
    assert_allclose(result.creepages[:2], (along, across), rtol=1e-4)
    assert result.products <= 2.5 * known.products


@pytest.mark.parametrize("n", [43, 80])
def test_an_element_or_two_that_stick_are_found_at_once(n):
    """Tractions of sliding along x alone are those of any creepage, so these say nothing of it."""
    h = 2.5 / n
    (x,) = surfaces.centres(n, h)
    g = 3e-3 * semi_ellipse(x, 1.0)
    known = rolling(g, h, longitudinal=0.0042, material=BODY)
    assert 0.0 < known.stick_area < 2.5 * h
    result = rolling(g, h, force=known.force, material=BODY)
    assert_rolls(result, BODY)
    assert result.creepages == pytest.approx(known.creepages, rel=1e-6)
    assert result.products <= 2.5 * known.products


@doubtful
@pytest.mark.parametrize(
    ("n", "spin", "given"),
    [(11, 0.02, ("moment",)), (11, 0.05, ("moment",)), (61, 0.3, ("force", "moment"))],
)
def test_slip_that_turns_around_an_element_that_sticks(n, spin, given):
    """No sliding tractions have the loads, as that element turns by any angle: some nearly do."""
    h = (2.2 / n, 2.2 / n)
    g, case = ellipse(n, h), {"material": BODY}
    known = rolling(g, h, spin=spin, **case)
    result = rolling(g, h, **{name: getattr(known, name) for name in given}, **case)
    assert_rolls(result, BODY)
    assert_allclose(result.traction, known.traction, atol=1e-5 * g.max())
    assert result.products <= 4 * known.products
