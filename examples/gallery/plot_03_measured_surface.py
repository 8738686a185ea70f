"""
A measured surface, from a file to pressures
============================================

Heights from a file of text, as instruments write them, are turned into a gap and pressed on a flat.
"""

# %%
# A file to start from: 96 × 96 heights in µm, with a tilt, 2 µm apart. Yours takes its place.
import tempfile
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from toeplitz_mg import contact

element = (2e-3, 2e-3)  # mm
path = Path(tempfile.mkdtemp()) / "heights.txt"
measured = -1e3 * contact.surfaces.rough((96, 96), element, rms=2e-4, longest=0.1, seed=4)
np.savetxt(path, measured + 0.002 * np.arange(96))

# %%
# Read it, into mm, and take the plane out that fits it best.
heights = 1e-3 * np.loadtxt(path)
x, y = np.broadcast_arrays(*contact.surfaces.centres(heights.shape, element))
plane = np.stack([np.ones(x.size), x.ravel(), y.ravel()], axis=1)
tilt = np.linalg.lstsq(plane, heights.ravel(), rcond=None)[0]
heights -= (plane @ tilt).reshape(heights.shape)
print(f"rms roughness {1e3 * heights.std():.3f} µm")

# %%
# The gap is positive where the bodies are apart: high is near. The surface is an aluminium one, the
# flat is rigid in comparison.
gap = heights.max() - heights
bodies = (contact.Material(E=70000.0, nu=0.33), contact.Material.rigid())
with warnings.catch_warnings(record=True):
    warnings.simplefilter("always")  # They are printed below.
    pressed = contact.normal_contact(gap, element, material=bodies, force=2.0)
print(pressed)
for warning in pressed.warnings:
    print("doubt:", warning)

# %%
# Pressures, and the gap that is left.
fig, (left, right) = plt.subplots(1, 2, figsize=(9.5, 3.9), layout="compressed")
pressed.plot(ax=left)
pressed.plot("gap", ax=right)
plt.show()
