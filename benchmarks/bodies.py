"""Contact of elastic bodies."""

import numpy as np

from toeplitz_mg import contact

STEEL = contact.Material(E=210000.0, nu=0.3)
SIDE, ELEMENT = 128, (0.01, 0.01)


class Contact:
    """A sphere of steel that is pressed, shifted and rolled on 128 × 128 elements."""

    def setup(self):
        """Press it once."""
        self.gap = contact.surfaces.sphere((SIDE, SIDE), ELEMENT, radius=50.0)
        self.pressed = contact.normal_contact(self.gap, ELEMENT, material=STEEL, force=50.0)
        self.bound = 0.3 * self.pressed.traction

    def time_normal_contact(self):
        """Press it."""
        contact.normal_contact(self.gap, ELEMENT, material=STEEL, force=50.0)

    def track_products_of_normal_contact(self):
        """Products with the matrix."""
        return self.pressed.products

    def time_rough_contact(self):
        """Press a random surface."""
        gap = self.gap + 1e-4 * np.random.default_rng(0).random(self.gap.shape)
        contact.normal_contact(gap, ELEMENT, material=STEEL, force=50.0)

    def time_friction(self):
        """Shift it."""
        contact.friction(bound=self.bound, element=ELEMENT, material=STEEL, force=(7.0, 0.0))

    def time_rolling(self):
        """Roll it."""
        contact.rolling(bound=self.bound, element=ELEMENT, material=STEEL, longitudinal=1e-3)
