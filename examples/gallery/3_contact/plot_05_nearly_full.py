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
# What is left open: blue is the gap that remains, white is contact.
ax = found[1].plot("gap")
ax.set_title(f"{100 * found[1].contact_fraction:.0f} % in contact")
ax = found[3].plot("gap")
ax.set_title(f"{100 * found[3].contact_fraction:.1f} % in contact")
plt.show()
