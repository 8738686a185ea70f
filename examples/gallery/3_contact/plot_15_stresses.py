"""
Stresses below a contact
========================

Metals yield below the surface first, where the stress of von Mises is the largest. Friction takes
that place towards the surface.
"""

# %%
# A cylinder of steel on a flat of steel: line contact, forces in N per mm of length.
import matplotlib.pyplot as plt
import numpy as np

from toeplitz_mg import contact

n, width = 160, 0.05
steel = contact.Material(E=210000.0, nu=0.3)
gap = contact.surfaces.cylinder(n, width, radius=400.0)
pressed = contact.normal_contact(gap, width, material=steel, force=1000.0)
depths = np.linspace(0.0, 4.0, 81)
below = contact.subsurface_stresses(pressed, depths=depths)
below.plot()

# %%
# By Hertz the largest shear is 0.30 p₀, at a depth of 0.79 a.
a, p0 = pressed.area / 2, pressed.max_pressure
shear = below.max_shear[:, n // 2]
print(f"largest shear {shear.max() / p0:.2f} p0 at {depths[shear.argmax()] / a:.2f} a")

# %%
# The same with friction: all of it slides.
sliding = contact.friction(pressed, mu=0.3, shift=1.0)
contact.subsurface_stresses(pressed, sliding, depths=depths).plot()
plt.show()
