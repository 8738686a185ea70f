"""The aggregates of a multilevel sparse approximate inverse: W, and the diagonal of E."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.preconditioners.fsai.levels import Cells, Rows
from toeplitz_mg.preconditioners.fsai.stencil import Stencil, block_loads, check

CHUNK = 2048  # blocks that are treated together, in the cache


def aggregated(
    stencil: Stencil, cells: Cells, rows: Rows, touched: Array, old: Cells, kept: float
) -> tuple[Cells, Array]:
    """Return the cells of E, which in the blocks that are not touched are the old ones.

    The load of a block is cᵀGᵀw_J in units of that of full contact. Where it differs by less than
    `kept` relative to the old one, d is left. What the columns of W are normalised with, for
    `aggregation`, is the second.
    """
    grid, coarser = stencil.grid, stencil.coarser
    c, d = old.c.copy(), old.d.copy()
    inverse = np.zeros((1 if len(stencil.T) == 1 else 3, coarser.grid.size))
    blocks = np.flatnonzero(touched)
    for part in chunks(len(blocks)):
        origins, J = grid.origins[blocks[part]], coarser.grid.inside[blocks[part]]
        slots = [grid.slots[:, None] + origins + a * grid.size for a in stencil.components]
        within = [cells.contact.take(s) for s in slots]
        place = [rows.place.take(s) for s in slots]
        U = [rows.sums.take(p, axis=1) * w for p, w in zip(place, within, strict=True)]
        # No contact any more: the load is 0, the diagonal 1.
        empty: list[Array] = [np.logical_not(w.any(axis=0)) for w in within]
        norms = [np.sqrt(np.einsum("im,im->m", u[0], u[0])) for u in U]
        for norm, none in zip(norms, empty, strict=True):
            check("the norm of a vector of W is", (norm + none).min(), grid.kernel.shape)
        if len(U) == 1:
            loads, inverse[0, J] = norms, 1.0 / (norms[0] + empty[0])
        else:
            loads, inverse[:, J] = _orthonormal(U, norms, empty, grid.kernel.shape)
        for a in stencil.components:
            K = J + a * coarser.grid.size
            before = c[K]
            c[K] = loads[a] / stencil.totals[a]
            d[K[empty[a]]] = 1.0
            new = (np.abs(c[K] - before) >= kept * before) & ~empty[a]
            if cells.finest:  # what is exact in full contact need not be computed
                full = (within[a] & (place[a] == (a + 1) * stencil.patterns - 1)).all(axis=0)
                d[K[full]] = coarser.zero[a]
                new &= ~full
            w = U[a][0].compress(new, axis=1) / norms[a][new]
            index = place[a].compress(new, axis=1)
            d[K[new]] = _diagonal(stencil, cells, rows, a, slots[a][0, new], index, w)
    return Cells(c, d), inverse


def _orthonormal(
    U: Sequence[Array], norms: Sequence[Array], empty: Sequence[Array], shape: tuple[int, ...]
) -> tuple[list[Array], list[Array]]:
    """Return the diagonal of (U_JᵀU_J)^(1/2), and the entries xx, yy and xy of its inverse.

    Parameters
    ----------
    U : two ndarrays of shape (2, h1 h2, m)
        In the cells of either component the sums of rows with loads in their own, and the other.
    norms : two ndarrays of shape (m,)
        Of those of their own.
    empty : two ndarrays of bool, of shape (m,)
        Where a component is not in contact. It is taken for another, orthogonal vector.
    shape : tuple of int
        Of the grid, for errors.
    """
    there = [~none for none in empty]
    (xx, xy), (yy, yx) = U
    gxx = np.where(there[0], norms[0] ** 2 + np.einsum("im,im->m", yx, yx), 1.0)
    gyy = np.where(there[1], norms[1] ** 2 + np.einsum("im,im->m", xy, xy), 1.0)
    gxy = np.einsum("im,im->m", xx, xy) + np.einsum("im,im->m", yy, yx)
    gxy *= there[0] & there[1]
    # With s² the determinant (UᵀU)^(1/2) = (UᵀU + s I)/t, its inverse (adj(UᵀU) + s I)/(s t).
    product = np.sqrt(gxx) * np.sqrt(gyy)
    square = 1.0 - (gxy / product) ** 2  # of the sine of their angle
    check("the sine of the angle of two vectors of W is, squared,", float(square.min()), shape)
    s = product * np.sqrt(square)
    t = np.sqrt(gxx + gyy + 2.0 * s)
    loads = [there[0] * (gxx + s) / t, there[1] * (gyy + s) / t]
    entries = [there[0] * (gyy + s), there[1] * (gxx + s), -gxy]
    return loads, [entry / (s * t) for entry in entries]


def _diagonal(
    stencil: Stencil, cells: Cells, rows: Rows, a: int, origins: Array, index: Array, w: Array
) -> Array:
    """Return the diagonal of E for blocks of a component, exactly, with these entries of W.

    Of a coupled component by the loads of its own only.
    """
    grid = stencil.grid
    loads = block_loads(grid, rows.rows[: len(grid.steps)], index, w)
    own: Any = 0.0
    if not cells.finest:
        window = grid.window[:, None] + origins
        c = cells.c.take(window)
        own = (loads**2 * (cells.d.take(window) - stencil.zero[a] * c**2)).sum(axis=0)
        loads *= c
    return np.asarray(own + ((stencil.own[a] @ loads) * loads).sum(axis=0))


def aggregation(stencil: Stencil, rows: Rows, inverse: Array, at: Array) -> tuple[Array, Array]:
    """Return the entries of W in the rows of these places, and the places of their columns.

    Both are of shape (m, d), with the component of the row first.
    """
    sums, size = rows.sums, stencil.coarser.grid.size
    entries, columns = [], []
    for a, part in enumerate(stencil.split(at)):
        J = stencil.coarser.grid.inside.take(
            stencil.grid.block_of.take(part - a * stencil.grid.size)
        )
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


def chunks(m: int, size: int = CHUNK) -> Iterator[slice]:
    """Cut range(m) into slices."""
    return (slice(k, min(k + size, m)) for k in range(0, m, size))
