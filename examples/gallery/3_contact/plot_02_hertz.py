"""
Hertz against theory
====================

A sphere of steel on a flat of steel: the pressures, the approach and the radius of contact beside
those of Hertz (1881).
"""

# %%
# The gap of a sphere, pressed by a force. Lengths are in mm, forces in N, moduli in N/mm².
import matplotlib.pyplot as plt
import numpy as np

from toeplitz_mg import contact

R, force, n = 50.0, 100.0, 128
element = (0.9 / n, 0.9 / n)
steel = contact.Material(E=210000.0, nu=0.3)
gap = contact.surfaces.sphere((n, n), element, radius=R)
pressed = contact.normal_contact(gap, element, material=steel, force=force)
print(pressed)

# %%
# Theory. Of two equal bodies the modulus of contact is half of E/(1 - ν²).
modulus = steel.E_star / 2
a = (3 * force * R / (4 * modulus)) ** (1 / 3)
p0 = 3 * force / (2 * np.pi * a**2)
for name, ours, exact in (
    ("approach (mm)", pressed.approach, a**2 / R),
    ("largest pressure (N/mm²)", pressed.pressure.max(), p0),
    ("radius of contact (mm)", np.sqrt(pressed.area / np.pi), a),
):
    print(f"{name:26s}{ours:12.6g}{exact:12.6g}")

# %%
# The pressures along the middle.
fig, ax = plt.subplots(layout="constrained")
r = np.linspace(-0.45, 0.45, 500)
ax.plot(r, p0 * np.sqrt(np.maximum(1 - (r / a) ** 2, 0)), lw=2, label="Hertz")
ax.plot(pressed.x[::3], pressed.pressure[::3, n // 2], "o", label="computed")
ax.set(xlabel="x [mm]", ylabel="pressure [N/mm²]", ylim=(0, 1.35 * p0))
ax.legend(ncols=2, loc="upper center")

# %%
# All of them.
pressed.plot()
plt.show()
