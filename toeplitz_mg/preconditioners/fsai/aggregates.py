"""The aggregates of a level: the tentative prolongator, and the coarse Galerkin matrix."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.small_matrices import multiply
from toeplitz_mg.engine.threads import share_slices
from toeplitz_mg.preconditioners.fsai.levels import LevelMatrix
from toeplitz_mg.preconditioners.fsai.rows import CHUNK, add_loads, require_positive
from toeplitz_mg.preconditioners.fsai.stencil import Stencil


class Rows(NamedTuple):
    """Rows of G in float64: a table by pattern, or one row for each unknown.

    Attributes
    ----------
    rows : ndarray of shape (K, any)
        The rows, stored as columns.
    sums : ndarray of shape (d, any)
        The products of the rows with c, in their own component and in the other.
    place : ndarray of int
        The index of the row for the unknown at each place.
    """

    rows: Array
    sums: Array
    place: Array


def aggregate(
    stencil: Stencil, coarser: Stencil, matrix: LevelMatrix, rows: Rows, at: Array
) -> tuple[LevelMatrix, Array]:
    """Return the coarse Galerkin matrix E, and the matrices that make W orthonormal.

    The weight c of an aggregate is its load cᵀGᵀw_J divided by that of a fully active aggregate.

    Parameters
    ----------
    stencil, coarser : Stencil
        For this level and for E; the cells of E are the aggregates here.
    matrix : LevelMatrix
    rows : Rows
    at : ndarray of int
        The places of the unknowns.
    """
    grid = stencil.grid
    d = len(stencil.components)
    c, diagonal = np.zeros(d * coarser.grid.size), np.ones(d * coarser.grid.size)
    inverse = np.zeros((1 if d == 1 else 3, coarser.grid.size))
    blocks = _touched_blocks(stencil, at)

    def work(part: slice) -> None:
        origins, J = grid.origins[blocks[part]], coarser.grid.inside[blocks[part]]
        slots = [grid.slots[:, None] + origins + a * grid.size for a in stencil.components]
        within = [matrix.active.take(s) for s in slots]
        place = [rows.place.take(s) for s in slots]
        U = [rows.sums.take(p, axis=1) * w for p, w in zip(place, within, strict=True)]
        # If a component has no unknown in a block, its load is 0 and its diagonal 1.
        empty: list[Array] = [np.logical_not(w.any(axis=0)) for w in within]
        norms = [np.sqrt(np.einsum("im,im->m", u[0], u[0])) for u in U]
        for norm, none in zip(norms, empty, strict=True):
            require_positive("the norm of a vector of W is", (norm + none).min())
        if d == 1:
            loads, inverse[0, J] = norms, 1.0 / norms[0]
        else:
            loads, inverse[:, J] = _orthonormalise(U, norms, empty)
        for a in stencil.components:
            K = J + a * coarser.grid.size
            c[K] = loads[a] / stencil.totals[a]
            new = ~empty[a]
            if matrix.by_table:
                # For a fully active aggregate the diagonal is that of the coarser kernel.
                full = (within[a] & (place[a] == (a + 1) * stencil.patterns - 1)).all(axis=0)
                diagonal[K[full]] = coarser.zero[a]
                new &= ~full
            w = U[a][0].compress(new, axis=1) / norms[a][new]
            index = place[a].compress(new, axis=1)
            diagonal[K[new]] = _diagonal(stencil, matrix, rows, a, slots[a][0, new], index, w)

    share_slices(work, len(blocks), CHUNK, len(at) * len(stencil.steps[0]))
    return LevelMatrix(c, diagonal), inverse


def _touched_blocks(stencil: Stencil, at: Array) -> Array:
    """Return the numbers of the blocks that contain some of these places."""
    touched = np.zeros(len(stencil.grid.origins), bool)
    for a, part in enumerate(stencil.split(at)):
        touched[stencil.grid.block_of.take(part - a * stencil.grid.size)] = True
    return np.flatnonzero(touched)


def _orthonormalise(
    U: Sequence[Array], norms: Sequence[Array], empty: Sequence[Array]
) -> tuple[list[Array], list[Array]]:
    """Return the diagonal of (U_JᵀU_J)^(1/2), and the entries xx, yy and xy of its inverse.

    Parameters
    ----------
    U : two ndarrays of shape (2, h1 h2, m)
        The sums of rows in the cells of either component: for loads in their own component, and for
        loads in the other.
    norms : two ndarrays of shape (m,)
        The norms of the sums for loads in their own component.
    empty : two ndarrays of bool, of shape (m,)
        Whether a component has no unknown; its vector is then taken as orthogonal to the other.
    """
    there = [~none for none in empty]
    (xx, xy), (yy, yx) = U
    gxx = np.where(there[0], norms[0] ** 2 + np.einsum("im,im->m", yx, yx), 1.0)
    gyy = np.where(there[1], norms[1] ** 2 + np.einsum("im,im->m", xy, xy), 1.0)
    gxy = np.einsum("im,im->m", xx, xy) + np.einsum("im,im->m", yy, yx)
    gxy *= there[0] & there[1]
    # With s² = det(UᵀU): (UᵀU)^(1/2) = (UᵀU + s I)/t, with the inverse (adj(UᵀU) + s I)/(s t).
    product = np.sqrt(gxx) * np.sqrt(gyy)
    square = 1.0 - (gxy / product) ** 2  # The squared sine of the angle between the vectors.
    subject = "the sine of the angle of two vectors of W is, squared,"
    require_positive(subject, float(square.min()))
    s = product * np.sqrt(square)
    t = np.sqrt(gxx + gyy + 2.0 * s)
    loads = [there[0] * (gxx + s) / t, there[1] * (gyy + s) / t]
    entries = [there[0] * (gyy + s), there[1] * (gxx + s), -gxy]
    return loads, [entry / s / t for entry in entries]  # The product s t may overflow.


def _diagonal(
    stencil: Stencil,
    matrix: LevelMatrix,
    rows: Rows,
    a: int,
    origins: Array,
    index: Array,
    w: Array,
) -> Array:
    """Return the exact diagonal of E for blocks of a component with these entries of W.

    For coupled components only the loads in the component itself are included.
    """
    grid = stencil.grid
    loads = add_loads(grid, rows.rows[: len(grid.steps)], index, w)
    own: Any = 0.0
    if not matrix.by_table:
        window = grid.window[:, None] + origins
        c = matrix.c.take(window)
        own = (loads**2 * (matrix.d.take(window) - stencil.zero[a] * c**2)).sum(axis=0)
        loads *= c
    return own + (multiply(stencil.own[a], loads) * loads).sum(axis=0)


def prolong(
    stencil: Stencil, coarser: Stencil, rows: Rows, inverse: Array, at: Array
) -> tuple[Array, Array]:
    """Return the entries of W in the rows at these places, and the places of their columns.

    Both have the shape (m, d), with the component of the row first.
    """
    sums, size = rows.sums, coarser.grid.size
    entries, columns = [], []
    for a, part in enumerate(stencil.split(at)):
        block = stencil.grid.block_of.take(part - a * stencil.grid.size)
        J = coarser.grid.inside.take(block)
        place = rows.place.take(part)
        own = sums[0].take(place)
        if len(sums) == 1:
            own *= inverse[0].take(J)
            return own[:, None], J[:, None]
        other, mixed = sums[1].take(place), inverse[2].take(J)
        first = own * inverse[a].take(J) + other * mixed
        second = own * mixed + other * inverse[1 - a].take(J)
        entries.append(np.stack([first, second], axis=-1))
        columns.append(np.stack([J + a * size, J + (1 - a) * size], axis=-1))
    return np.concatenate(entries), np.concatenate(columns)
