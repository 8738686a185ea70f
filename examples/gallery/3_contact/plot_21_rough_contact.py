"""
A class: contact of rough surfaces
==================================

From one sphere to a surface with all wavelengths: what the half-space model says of area, pressure
and gap, where it is exact, and where it ends.
"""

# %%
# One asperity
# ------------
# Hertz: the radius of contact goes with the cube root of the force, so the area with the power 2/3.
import warnings

import matplotlib.pyplot as plt
import numpy as np

from toeplitz_mg import contact

warnings.simplefilter("ignore", contact.ContactWarning)  # We come to them below.
bodies = (contact.Material(E=1.0, nu=0.0), contact.Material.rigid())  # E* = 1 N/mm²
n = 96
element = (2.0 / n, 2.0 / n)
sphere = contact.surfaces.sphere((n, n), element, radius=10.0)
forces = np.geomspace(1e-4, 2e-2, 6)
areas = []
for force in forces:
    areas.append(contact.normal_contact(sphere, element, material=bodies, force=force).area)
exponent = np.polyfit(np.log(forces[2:]), np.log(areas[2:]), 1)[0]
print(f"area goes with the force to the power {exponent:.3f}, by theory 0.667")

# %%
# A wave
# ------
# A surface that is a cosine along x, of the amplitude A, touches in strips. By Westergaard their
# width over the wavelength λ is 2/π arcsin √(p/p*), and all of it touches at the mean pressure
# p* = π E* A/λ. *Exercise: find that pressure for a wave in two directions, which has no formula.*
amplitude, wavelength = 1e-3, 2.0
wave = amplitude * (1 - np.cos(np.pi * contact.surfaces.centres((n, 8), element)[0]))
full = np.pi * amplitude / wavelength  # E* is 1.
wave_force = full * wavelength * 8 * element[1]
for share in (0.1, 0.3, 0.6, 0.9, 1.05):
    pressed = contact.normal_contact(
        np.broadcast_to(wave, (n, 8)), element, material=bodies, force=share * wave_force,
        periodic=True,
    )  # fmt: skip
    expected = 2 / np.pi * np.arcsin(np.sqrt(min(share, 1.0)))
    print(f"p/p* {share:.2f}: {pressed.contact_fraction:.3f} touches, by theory {expected:.3f}")

# %%
# Many wavelengths
# ----------------
# A self-affine surface has a power spectrum that falls with the wavenumber to the power -2 - 2H.
# Each shorter wave adds more slope than height: what decides is the root mean square slope h′.
rough = contact.surfaces.rough(
    (n, n), element, rms=2e-3, hurst=0.8, longest=0.5, shortest=8 * element[0], seed=3
)
slope = np.sqrt(sum((s**2).mean() for s in np.gradient(rough, element[0])))
print(f"heights {rough.std():.4f} mm, slope {slope:.4f}")

# %%
# Area over load
# --------------
# At light loads the area of rough surfaces is proportional to the load, with a factor of 1.6 to 2
# over E* times the slope: that is why friction is proportional to the load. The sphere is not so.
# On this coarse grid small spots are too large, as each is of whole elements, and so is the factor.
relative = np.array([0.02, 0.04, 0.08, 0.16, 0.32])
found = [
    contact.normal_contact(rough, element, material=bodies, force=load * slope * 4.0, periodic=True)
    for load in relative
]
for load, pressed in zip(relative, found, strict=True):
    print(
        f"load {load:.2f}: area {pressed.contact_fraction:.4f}, factor "
        f"{pressed.contact_fraction / load:.2f}, {pressed.products} products"
    )

# %%
# Where it touches
# ----------------
# Spots grow, and join. Within each the pressures are as under a small, uneven sphere.
for pressed in found[2::2]:
    fig, ax = plt.subplots(layout="compressed")
    shown = np.where(pressed.contact, pressed.pressure / slope, np.nan)
    image = ax.imshow(shown.T, origin="lower", extent=(0, 2, 0, 2), cmap="YlOrRd", vmin=0, vmax=1)
    ax.set(title=f"{100 * pressed.contact_fraction:.0f} % in contact")
    ax.set(xlabel="x [mm]", ylabel="y [mm]")
    bar = ax.inset_axes((1.05, 0.0, 0.05, 1.0))
    fig.colorbar(image, cax=bar, extend="max", label="pressure / (E* h′) [–]")

# %%
# Pressures
# ---------
# Their distribution falls to zero at zero pressure, as Persson's theory says: at the edge of a spot
# the pressure goes to zero with a square root.
fig, ax = plt.subplots(layout="constrained")
for load, pressed in zip(relative[1::2], found[1::2], strict=True):
    p = pressed.pressure[pressed.contact] / slope
    ax.hist(p, bins=40, density=True, histtype="step", label=f"load {load:.2f}")
ax.set(xlabel="pressure / (E* h′) [–]", ylabel="density [–]")
ax.legend()

# %%
# What leaks: the gap
# -------------------
# The gap under load is what a fluid would pass. *Exercise: at which area is there no path across?*
gap = found[-1].gap
print(f"mean gap {gap.mean():.2e} mm, at the start {(rough - rough.min()).mean():.2e} mm")

# %%
# What may be wrong
# -----------------
# A result says why it may not be of the problem that was meant. Here spots have few elements:
# halve the elements, and see which figures stay.
for doubt in found[0].warnings:
    print("-", doubt)
plt.show()
