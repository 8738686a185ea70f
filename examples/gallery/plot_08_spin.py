"""
Spin, and its arrows
====================

A wheel whose contact is inclined turns about the normal of the contact while it rolls. This spin
alone makes a force across the direction of rolling, and tractions that go around.
"""

# %%
# The tractions of pure spin.
import matplotlib.pyplot as plt
import numpy as np

from toeplitz_mg import contact

n, mu = 48, 0.3
element, steel = (0.026, 0.026), contact.Material(E=210000.0, nu=0.28)
gap = contact.surfaces.sphere((n, n), element, radius=50.0)
pressed = contact.normal_contact(gap, element, material=steel, force=100.0)
rolled = contact.rolling(mu * pressed.pressure, element, material=steel, spin=0.008)
print(rolled)
print(f"force along {rolled.force[0]:.3f} N, across {rolled.force[1]:.3f} N")

# %%
# Arrows of the traction over its size; rolling is towards +x.
x, y = rolled.x.ravel(), rolled.y.ravel()
fig, ax = plt.subplots(figsize=(5.4, 4.4), layout="constrained")
size = (x[0], x[-1], y[0], y[-1])
shown = np.where(rolled.contact, rolled.magnitude, np.nan)
image = ax.imshow(shown.T, origin="lower", extent=size, cmap="Oranges")
fig.colorbar(image, label="traction (N/mm²)")
few = np.s_[::3, ::3]
qx, qy = (np.where(rolled.contact, q, np.nan)[few].T for q in rolled.traction)
ax.quiver(x[::3], y[::3], qx, qy)
ax.contour(x, y, rolled.stick.T, levels=[0.5], colors="tab:blue")
ax.set(xlabel="x, the direction of rolling (mm)", ylabel="y (mm)", title="Blue: what sticks")
plt.show()
