"""Where the search for the steady state of rolling starts: from the leading edge backwards.

Kalker's simplified theory does so: from one element to the next the tractions grow as they would
without slip, and where they exceed the bound they are cut to it.
"""

import numpy as np

from toeplitz_mg._typing import Array

# Part of the bound beyond which elements are taken to slide, where some exceed it: tractions that
# are cut elsewhere are carried by others.
NEARLY = 0.6


def roll_backwards(bonded: Array, g: Array) -> tuple[Array, Array]:
    """Return tractions that grow as those without slip, within the bound, and where they slide.

    Parameters
    ----------
    bonded : ndarray of shape (components, ...)
        The tractions without slip.
    g : ndarray
        The traction bound.
    """
    q = bonded[0] if len(bonded) == 1 else bonded[0] + 1j * bonded[1]  # In the plane.
    growth = q.copy()
    growth[:-1] -= q[1:]
    now, sizes = np.zeros_like(q[0]), np.empty(g.shape)
    for i in range(len(g) - 1, -1, -1):
        now = now + growth[i]
        of_row = np.abs(now, out=sizes[i, ...])
        exceeds = of_row > g[i]
        now = now * np.divide(g[i], of_row, where=exceeds, out=np.ones(of_row.shape))
        q[i] = now
    slide = sizes > g
    if slide.any():
        slide = sizes > NEARLY * g
    return (q[None] if len(bonded) == 1 else np.stack([q.real, q.imag])), slide
