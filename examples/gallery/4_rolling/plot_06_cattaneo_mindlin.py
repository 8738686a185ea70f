"""
Cattaneo and Mindlin
====================

A sphere is pressed, and then pulled along the flat by less than friction carries: the middle
sticks, a ring slips. Cattaneo (1938) and Mindlin (1949) know how far, with one simplification.
"""

# %%
# Press, then pull by half of what friction carries.
import matplotlib.pyplot as plt
import numpy as np

from toeplitz_mg import contact

n, R, force, mu = 64, 50.0, 100.0, 0.3
element = (0.8 / n, 0.8 / n)
material = contact.Material(E=210000.0, nu=0.28)
gap = contact.surfaces.sphere((n, n), element, radius=R)
pressed = contact.normal_contact(gap, element, material=material, force=force)
pull = 0.5 * mu * force
shifted = contact.friction(pressed, mu=mu, force=(pull, 0.0))
print(shifted)

# %%
# The radius c that sticks is a (1 - Q/μP)^(1/3). Theory leaves out the tractions across the pull,
# which exist unless ν = 0: the area that sticks is not quite a circle.
a = np.sqrt(pressed.area / np.pi)
c = np.sqrt(shifted.stick.sum() * element[0] * element[1] / np.pi)
print(f"c/a {c / a:.4f}, by theory {0.5 ** (1 / 3):.4f}")
across = np.abs(shifted.traction[1]).max() / np.abs(shifted.traction[0]).max()
print(f"largest traction across over along the pull: {across:.3f}")

# %%
# The tractions along the middle: the sum of two semi-ellipses.
x = pressed.x.ravel()
fig, ax = plt.subplots(layout="constrained")
ax.plot(x, mu * pressed.pressure[:, n // 2], "--", lw=2, label="μ p")
ax.plot(x, shifted.traction[0][:, n // 2], lw=2, label="traction")
ax.set(xlabel="x [mm]", ylabel="traction [N/mm²]")
ax.legend()

# %%
# Where the bodies stick (blue), and where they slip.
shifted.plot()
# sphinx_gallery_thumbnail_number = 2
plt.show()
