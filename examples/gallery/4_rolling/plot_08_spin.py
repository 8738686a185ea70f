"""
Spin, and its arrows
====================

A wheel whose contact is inclined turns about the normal of the contact while it rolls. This spin
alone makes a force across the direction of rolling, and tractions that go around.
"""

# %%
# The tractions of pure spin.
import matplotlib.pyplot as plt

from toeplitz_mg import contact

n, mu = 48, 0.3
element, steel = (0.017, 0.017), contact.Material(E=210000.0, nu=0.28)
gap = contact.surfaces.sphere((n, n), element, radius=50.0)
pressed = contact.normal_contact(gap, element, material=steel, force=100.0)
rolled = contact.rolling(pressed, mu=mu, spin=0.003)
print(rolled)
print(f"force along {rolled.force[0]:.3f} N, across {rolled.force[1]:.3f} N")

# %%
# Arrows of the traction over its size, where the wheel sticks in blue and where it slips in orange.
# Rolling is towards +x.
rolled.plot()

# %%
# The slip itself, over the distance rolled.
rolled.plot("slip")
plt.show()
