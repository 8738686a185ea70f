"""
A measured surface, from a file to pressures
============================================

A file of heights, as an instrument writes it, is read, levelled and pressed on a rigid flat.
"""

# %%
# A file to start from: 96 × 96 heights in nm, with a tilt, pixels of 2 µm. Yours takes its place.
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from toeplitz_mg import contact

path = Path(tempfile.mkdtemp()) / "heights.csv"
rough = contact.surfaces.rough((96, 96), (2.0, 2.0), rms=40.0, longest=100.0, seed=4)
np.savetxt(path, 0.5 * np.arange(96) - rough, delimiter=",")

# %%
# Read it. `unit` is that of the heights and that of the pixels; the result is in mm. The plane that
# fits the heights best is subtracted.
surface = contact.surfaces.read(path, level="plane", element=2.0, unit=("nm", "um"))
print(f"rms roughness {1e6 * surface.heights.std():.0f} nm")

# %%
# Press it by 10 N/mm² in the mean: summits of aluminium touch a flat that is rigid in comparison.
bodies = (contact.Material(E=70000.0, nu=0.33), contact.Material.rigid())
pressed = contact.normal_contact(heights=surface, material=bodies, pressure=10.0, periodic=True)
print(pressed.summary())

# %%
# The pressures.
pressed.plot()

# %%
# The gap that is left.
pressed.plot("gap")

# %%
# An array needs no file: `heights=` takes it, with its unit.
heights = 1e6 * surface.heights  # nm
again = contact.normal_contact(
    heights=heights, element=(2.0, 2.0), unit=("nm", "um"),
    material=bodies, pressure=10.0, periodic=True,
)  # fmt: skip
print(f"the same area of contact: {np.isclose(again.area, pressed.area)}")
plt.show()
