"""
Nearly full contact
===================

Where nearly everything touches, few elements are left without pressure, and most methods take
hundreds of iterations to find them. The search by active sets takes as many as elsewhere.
"""

# %%
# A soft body, whose gap is pressed closed by more and more. A product is one multiplication with
# the matrix, which is what an iteration of any method costs.
import matplotlib.pyplot as plt

from toeplitz_mg import contact

n = 128
element = (1.0 / n, 1.0 / n)
gap = contact.surfaces.rough((n, n), element, rms=1e-3, longest=0.25, shortest=8.0 / n, seed=1)
rubber = (contact.Material(E=2.0, nu=0.5), contact.Material.rigid())
found = []
for force in (0.03, 0.06, 0.1, 0.13, 0.2):
    pressed = contact.normal_contact(gap, element, material=rubber, force=force, periodic=True)
    found.append(pressed)
    print(f"{100 * pressed.contact_fraction:6.1f} % {pressed.products:4d} products")

# %%
# What is left open. Blue is the gap that remains, white is contact.
fig, axes = plt.subplots(1, 3, figsize=(13, 3.6), layout="compressed")
for ax, pressed in zip(axes, (found[0], found[1], found[3]), strict=True):
    pressed.plot("gap", ax=ax)
    ax.set_title(f"{100 * pressed.contact_fraction:.1f} % in contact")
plt.show()
