"""
A creep curve
=============

The force of a wheel that drives, over its creepage: Carter's theory for a cylinder, and the same
for a sphere, which has no formula.
"""

# %%
# The cylinder. The force over that of full sliding is 1 - (1 - ξ/ξ₀)², ξ₀ = μ a/R.
import matplotlib.pyplot as plt
import numpy as np

from toeplitz_mg import contact

mu, steel = 0.3, contact.Material(E=210000.0, nu=0.28)
R, half, n = 500.0, 4.0, 256
x, h = contact.surfaces.centres(n, 10.0 / n)[0], 10.0 / n
pressure = steel.E_star / (4 * R) * np.sqrt(np.maximum(half**2 - x**2, 0.0))
creepages = mu * half / R * np.linspace(0.1, 1.2, 8)
line = []
for creepage in creepages:
    rolled = contact.rolling(bound=mu * pressure, element=h, material=steel, longitudinal=-creepage)
    line.append(rolled.force / (mu * pressure.sum() * h))

# %%
# A sphere on a flat.
element, radius = (0.03, 0.03), 50.0
gap = contact.surfaces.sphere((40, 40), element, radius=radius)
pressed = contact.normal_contact(gap, element, material=steel, force=100.0)
shares = np.array([0.05, 0.15, 0.3, 0.5, 0.7, 0.9, 1.2])
of_sphere = mu * np.sqrt(pressed.area / np.pi) / radius * shares
curve = contact.creep_curve(pressed, mu=mu, longitudinal=-of_sphere)
surface = curve.force[:, 0] / (mu * pressed.force)

# %%
fig, ax = plt.subplots(layout="constrained")
relative = np.linspace(0, 1, 100)
ax.plot(relative, 1 - (1 - relative) ** 2, lw=2, label="Carter's theory")
ax.plot(creepages * R / (mu * half), line, "o", label="cylinder")
scaled = of_sphere * radius / (mu * np.sqrt(pressed.area / np.pi))
ax.plot(scaled, surface, "s--", label="sphere")
ax.set(xlabel="creepage × R / (μ a) [–]", ylabel="force / (μ P) [–]")
ax.legend()
plt.show()
