"""A result that is given to another function is checked as an array is: no NaN is taken for zero."""

from dataclasses import replace

import numpy as np
import pytest

from toeplitz_mg import contact

ELEMENT = (0.02, 0.02)
STEEL = contact.Material(E=210000.0, nu=0.28)
GAP = contact.surfaces.sphere((24, 24), ELEMENT, radius=25.0)


@pytest.fixture(scope="module")
def pressed():
    return contact.normal_contact(GAP, ELEMENT, material=STEEL, force=20.0)


def with_a_value(result, name, value):
    field = getattr(result, name).copy()
    field[..., 12, 12] = value  # In the middle of the contact.
    return replace(result, **{name: field})


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize(
    "use",
    [
        lambda wrong: contact.friction(wrong, mu=0.3, force=(1.0, 0.0)),
        lambda wrong: contact.rolling(wrong, mu=0.3, longitudinal=1e-3),
        lambda wrong: next(contact.rolling_steps(wrong, mu=0.3, longitudinal=1e-3, steps=2)),
        lambda wrong: contact.normal_contact(
            GAP, ELEMENT, material=STEEL, force=21.0, previous=wrong
        ),
        lambda wrong: contact.subsurface_stresses(wrong, depths=[0.1]),
    ],
    ids=["friction", "rolling", "steps", "previous", "stresses"],
)
def test_a_pressure_that_is_no_number_is_refused(pressed, use, value):
    with pytest.raises(ValueError, match=f"has the traction {value}, but tractions must be finite"):
        use(with_a_value(pressed, "pressure", value))


def test_a_negative_pressure_is_refused(pressed):
    wrong = with_a_value(pressed, "pressure", -1.0)
    with pytest.raises(ValueError, match="but a traction bound is at least zero"):
        contact.friction(wrong, mu=0.3, force=(1.0, 0.0))


def test_a_history_that_is_no_number_is_refused(pressed):
    before = contact.friction(pressed, mu=0.3, shift=(1e-5, 0.0))
    wrong = with_a_value(before, "traction", np.nan)
    with pytest.raises(ValueError, match="previous has the traction nan"):
        contact.friction(pressed, mu=0.3, shift=(1e-5, 0.0), previous=wrong)
