"""
A class: rolling contact
========================

Why a wheel that drives creeps. From a line, where Carter knows the answer, to a surface, where
Kalker's linear theory knows its beginning.
"""

# %%
# Stick and slip on a line
# ------------------------
# A cylinder rolls along +x. Material enters at the front without traction, sticks, and is strained
# more and more, until friction can hold it no longer: it slips at the back.
import matplotlib.pyplot as plt
import numpy as np

from toeplitz_mg import contact

mu, R, a, n = 0.3, 500.0, 4.0, 300
steel = contact.Material(E=210000.0, nu=0.28)
x, h = contact.surfaces.centres(n, 10.0 / n)[0], 10.0 / n
pressure = steel.E_star / (4 * R) * np.sqrt(np.maximum(a**2 - x**2, 0.0))
full = mu * a / R  # The creepage ξ₀ from which all of it slips.
fig, ax = plt.subplots(layout="constrained")
ax.plot(x, mu * pressure, "k--", label="μ p")
for share in (0.2, 0.5, 0.8):
    rolled = contact.rolling(
        bound=mu * pressure, element=h, material=steel, longitudinal=-share * full
    )
    ax.plot(x, rolled.traction.ravel(), lw=2, label=f"{share} ξ₀")
    force = float(np.ravel(rolled.force)[0]) / (mu * pressure.sum() * h)
    sticks = rolled.stick.sum() / rolled.contact.sum()
    print(
        f"{share}: force {force:.4f}, Carter {1 - (1 - share) ** 2:.4f}; "
        f"sticks {sticks:.3f}, Carter {1 - share:.3f}"
    )
ax.set(xlabel="x [mm], rolling to the right", ylabel="traction [N/mm²]", ylim=(0, 215))
ax.legend(ncols=2, loc="upper center")

# %%
# How it comes about
# ------------------
# A cylinder that stands still and is pulled by half of what friction carries has the tractions of
# Cattaneo, the same at both ends. When it begins to roll, `rolling_steps` goes from these to
# Carter's, an element a step: after a length of the contact or two nothing changes any more. The
# creepage that the force needs is found in each step.
strips, width = 100, 0.1
places = contact.surfaces.centres(strips, width)[0]
limit = mu * steel.E_star / (4 * R) * np.sqrt(np.maximum(a**2 - places**2, 0.0))
pull = 0.5 * limit.sum() * width
at_rest = contact.friction(bound=limit, element=width, material=steel, force=pull)
on_the_way = list(
    contact.rolling_steps(
        bound=limit, element=width, material=steel, force=pull, steps=160, previous=at_rest
    )
)
fig, ax = plt.subplots(layout="constrained")
ax.plot(places, limit, "k--", label="μ p")
ax.plot(places, at_rest.traction, label="at rest")
for count in (10, 40, 160):
    state = on_the_way[count - 1]
    ax.plot(places, state.traction, label=f"rolled {count * width:g} mm")
    print(f"rolled {count * width:4.1f} mm: creepage {1e3 * float(state.creepages):.4f} per mille")
ax.set(xlabel="x [mm], rolling to the right", ylabel="traction [N/mm²]", ylim=(0, 215))
ax.legend(ncols=2, loc="upper center")

# %%
# On a surface
# ------------
# A sphere on a flat. The sign: a negative creepage is the slip of a wheel that drives, and its
# force is along +x.
element = (0.018, 0.018)
gap = contact.surfaces.sphere((44, 44), element, radius=50.0)
pressed = contact.normal_contact(gap, element, material=steel, force=100.0)
radius = np.sqrt(pressed.area / np.pi)
driven = [share * mu * radius / 50.0 for share in (0.3, 0.7)]
few = [contact.rolling(pressed, mu=mu, longitudinal=-x) for x in driven]
for rolled in few:
    rolled.plot()

# %%
# Kalker's linear theory
# ----------------------
# At small creepage the force is proportional to it: F = -C₁₁ G a b ξ, with C₁₁ about 4.1 to 4.2 for
# a circle and ν of 1/4 to 0.28. On a coarse grid it is approached from one side.
creepage = 0.02 * mu * radius / 50.0
slow = contact.rolling(pressed, mu=mu, longitudinal=-creepage)
print(f"C11 {slow.force[0] / (steel.G * radius**2 * creepage):.3f}")

# %%
# Spin
# ----
# A contact that is inclined turns about its normal. Spin alone gives a force across.
spun = contact.rolling(pressed, mu=mu, spin=0.004)
print(f"along {spun.force[0]:.3f} N, across {spun.force[1]:.3f} N")

# %%
# What friction leaves
# --------------------
# The creepage is lost: force times creepage is the work of slip over the distance. Added up over
# the elements from `traction` and `slip` it is less exact: *refine the grid, and see it converge.*
rolled = few[1]
lost = -(rolled.traction * rolled.slip).sum() * element[0] * element[1]
print(f"lost in slip {lost:.5f} N, force times creepage {rolled.force[0] * driven[1]:.5f} N")
plt.show()
