"""
Load against area
=================

The area of contact of a rough surface grows with the load almost in proportion, until much of the
surface touches. Persson's theory has it at all loads for a surface that is self-affine and large.
"""

# %%
# A random surface: a Hurst exponent of 0.8, wavelengths from 1/4 of the side to 8 elements.
import warnings

import matplotlib.pyplot as plt
import numpy as np
from scipy.special import erf

from toeplitz_mg import contact

n, side = 128, 1.0  # The side in mm.
element = (side / n, side / n)
gap = contact.surfaces.rough(
    (n, n), element, rms=1e-3, hurst=0.8, longest=side / 4, shortest=8 * side / n, seed=2
)
slopes = np.gradient(gap, side / n)
slope = np.sqrt(sum((s**2).mean() for s in slopes))
print(f"rms slope {slope:.4f}")

# %%
# One problem for each load, from the solution of the one before. The modulus of contact is 1 N/mm²
# here: loads are relative to it.
warnings.simplefilter("ignore", contact.ContactWarning)  # The smallest spots are coarse.
body = (contact.Material(E=1.0, nu=0.0), contact.Material.rigid())
loads = slope * np.geomspace(0.01, 2.0, 9)
shares = []
curve = contact.load_curve(gap, element, material=body, forces=loads * side**2, periodic=True)
for load, pressed in zip(loads, curve, strict=True):
    shares.append(pressed.contact_fraction)
    print(f"{load / slope:6.3f}{shares[-1]:8.3f}{pressed.products:5d} products")

# %%
# Persson: erf(√2 p / (E* h')), with the rms slope h'. The surface is periodic, without an edge. At
# light loads his area is 1.6 p/(E* h') and that of solutions like these some 2.2, on a grid as
# coarse as this one even more: the smallest spots are of whole elements. Towards full contact both
# agree.
fig, ax = plt.subplots(layout="constrained")
theory = np.geomspace(0.01, 2.0, 100)
ax.loglog(theory, erf(np.sqrt(2) * theory), "-", lw=2, label="Persson")
ax.loglog(loads / slope, shares, "o", label="computed")
ax.set(xlabel="mean pressure / (E* h′) [–]", ylabel="share in contact [–]")
ax.legend()
plt.show()
