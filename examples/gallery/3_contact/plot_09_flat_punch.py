"""
A flat punch, with coupled components
=====================================

A square punch that is bonded to a half-space and shifted along x: tractions along x and y are
coupled, so the unknowns are twice as many as the elements.
"""

# %%
# The matrix of both components. The kernel of xy changes its sign from quadrant to quadrant:
# `influence_matrix` knows it.
import matplotlib.pyplot as plt
import numpy as np

import toeplitz_mg as tmg

n = 96
element = (2 / n, 2 / n)  # The punch is [-1, 1]².
x, y = tmg.halfspace.all_offsets((n, n), element)
kernels = (tmg.halfspace.influence_xx, tmg.halfspace.influence_xy, tmg.halfspace.influence_yy)
xx, xy, yy = (
    tmg.ToeplitzOperator.from_lags(kernel(x, y, element, G=1.0, nu=0.28)) for kernel in kernels
)
A = tmg.CoupledOperator([[xx, xy], [xy, yy]])
b = np.repeat([1.0, 0.0], n * n)
for M in (tmg.default_preconditioner(A), tmg.fsai_preconditioner(A)):
    residuals = []
    q, info = tmg.cg(A, b, M=M, rtol=1e-8, residuals=residuals)
    print(info, len(residuals) - 1, "iterations with", M)

# %%
# The kernels are those of two half-spaces that both give way: on a rigid one the force is twice as
# large. Over G and the displacement it tends to 5.36516 for half a side of 1 (as the page on three
# dimensions of this site says).
force = q[: n * n].sum() * element[0] * element[1]
print(f"force {2 * force:.4f}, of the limit 5.36516")

# %%
qx, qy = q.reshape(2, n, n)
for field, name in ((qx, "x"), (qy, "y")):
    fig, ax = plt.subplots(layout="compressed")
    most = np.quantile(abs(field), 0.98)
    image = ax.imshow(
        field.T, origin="lower", extent=(-1, 1, -1, 1), cmap="PuOr", vmin=-most, vmax=most
    )
    bar = ax.inset_axes((1.04, 0.0, 0.05, 1.0))
    fig.colorbar(image, cax=bar, extend="both", label="traction / G [–]")
    ax.set(xlabel="x [mm]", ylabel="y [mm]", title=f"Traction along {name}")
# sphinx_gallery_thumbnail_number = 2
plt.show()
