"""Levels of a multilevel sparse approximate inverse of two components, built for a mask."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor
from scipy.sparse import csr_array

from toeplitz_mg.preconditioners.fsai_apply import Cells, Direct, Level, Rows
from toeplitz_mg.preconditioners.fsai_coupled import CoupledStencil
from toeplitz_mg.preconditioners.fsai_levels import CHUNK, chunks, few
from toeplitz_mg.preconditioners.fsai_table import block_loads, check, refused

Array = NDArray[Any]


def cells_of_masks(stencil: CoupledStencil, masks: Array) -> Cells:
    """Return those of A, of one component after the other."""
    contact = np.concatenate([stencil.cells.place(mask, False) for mask in masks])
    return Cells(contact, np.repeat(stencil.zero, stencil.size), True)


def build_coupled(stencil: CoupledStencil, cells: Cells, dtype: np.dtype[Any]) -> Level | Direct:
    """Build this level and those below, as `fsai_levels.build`.

    Parameters
    ----------
    stencil : CoupledStencil
    cells : Cells
        Of one component after the other.
    dtype : dtype
        Of what is applied; everything is computed in float64.
    """
    at = np.flatnonzero(cells.contact)
    if few(cells):
        return _direct(stencil, cells, at, dtype)
    number = cells.number
    parts = np.split(at, at.searchsorted([stencil.size]))
    x, y = (_rows(stencil, cells, a, part) for a, part in enumerate(parts))
    G = _factor(stencil, (x, y), parts, number).astype(dtype, copy=False)
    sums = np.zeros((2, *cells.c.shape))
    for part, rows in zip(parts, (x, y), strict=True):
        for u, of_rows in zip(sums, rows.sums, strict=True):
            u[part] = of_rows.take(rows.place)
    on_coarse, W = _aggregated(stencil, cells, (x, y), sums, parts)
    coarse = build_coupled(stencil.coarser, on_coarse, dtype)
    return Level(cells, x, at, G, W.astype(dtype, copy=False), coarse)


def _rows(stencil: CoupledStencil, cells: Cells, a: int, at: Array) -> Rows:
    """Return rows of G in one component, for each of the cells `at` the place of its row.

    Their sums are the products with the loads of either component, its own first. The first row
    is that of full contact. On the finest level there is one for each pattern of neighbours.
    """
    own, steps = len(stencil.cells.steps), stencil.steps[a]
    full, d_full = np.ones((len(steps), 1)), stencil.diagonal[a][:, None]
    if cells.finest:
        pattern = _patterns(cells.contact, steps, at)
        last = 2 ** (len(steps) - 1) - 1
        count = np.bincount(pattern, minlength=last + 1)
        count[last] = 0  # it comes first
        there = np.flatnonzero(count)
        number = np.zeros(len(count), np.int32)
        number[there] = np.arange(1, len(there) + 1)
        place = number.take(pattern)
        bits = there >> np.arange(len(steps) - 1)[:, None] & 1
        c = np.concatenate([np.ones((1, len(there))), bits])
        d = np.where(c > 0.0, d_full, 1.0)
    else:
        # Where aggregates are all in full contact their rows are alike, and their loads 1, but for
        # less than a thousandth, by the parts in the other component.
        alike = cells.d == np.repeat(stencil.zero, stencil.size)
        other = np.logical_not(alike.take(steps[:, None] + at).all(axis=0))
        place = np.cumsum(other, dtype=np.int32) * other
        near = steps[:, None] + at[other]
        c, d = cells.c.take(near), cells.d.take(near)
    c, d = np.hstack([full, c]), np.hstack([d_full, d])
    rows, sums = np.empty(c.shape), np.empty((2, c.shape[1]))
    for part in chunks(c.shape[1], 2 * CHUNK):
        rows[:, part] = stencil.rows(a, c[:, part], d[:, part])
    np.einsum("km,km->m", rows[:own], c[:own], out=sums[0])
    np.einsum("km,km->m", rows[own:], c[own:], out=sums[1])
    return Rows(rows, sums, place)


def _patterns(contact: Array, steps: Array, at: Array) -> Array:
    """Return for each of these cells which of its neighbours are in contact, as bits."""
    if not len(at):
        return np.zeros(0, np.int16)
    start, stop = at[0], at[-1] + 1
    pattern = np.zeros(stop - start, np.int16)
    for step in steps[:0:-1].tolist():
        pattern += pattern
        pattern += contact[start + step : stop + step]
    return np.asarray(pattern.take(at - start))


def _factor(
    stencil: CoupledStencil, rows: tuple[Rows, Rows], parts: list[Array], number: Array
) -> csr_array:
    """Return G."""
    table = np.vstack([rows[0].rows.T, rows[1].rows.T])
    known = table != 0.0
    K = table.shape[1]
    starts = np.append(np.int32(0), np.cumsum(known, dtype=np.int32)[K - 1 :: K])
    lowest = stencil.steps.min(axis=1, keepdims=True)
    columns = np.repeat(stencil.steps - lowest, [r.rows.shape[1] for r in rows], axis=0)
    shape = (len(table), int(columns.max()) + 1)
    G = csr_array((table[known], columns[known].astype(np.int32), starts), shape)
    G = G[np.concatenate([rows[0].place, rows[1].place + rows[0].rows.shape[1]])]
    first = np.concatenate([at + low for at, low in zip(parts, lowest, strict=True)])
    first = first.astype(np.int32)  # that each might see
    for part in chunks(len(first), 4 * CHUNK):
        starts = G.indptr[part.start : part.stop + 1]
        columns = G.indices[starts[0] : starts[-1]]
        columns += np.repeat(first[part], np.diff(starts))
        number.take(columns, out=columns, mode="clip")
    return csr_array((G.data, G.indices, G.indptr), (len(first), len(first)))


def _aggregated(
    stencil: CoupledStencil, cells: Cells, rows: tuple[Rows, Rows], sums: Array, parts: list[Array]
) -> tuple[Cells, csr_array]:
    """Return the cells of E, and W."""
    grid, coarser = stencil.cells, stencil.coarser
    J = coarser.cells.inside
    (xx, yy), (xy, yx) = (stencil.blocks(u) for u in sums)  # U_J in cells of x, in those of y
    norms = [np.einsum("ihjk,ihjk->ij", u, u) for u in (xx, yy)]
    there = [square > 0.0 for square in norms]
    # A component that is not in contact in a block is taken for another, orthogonal vector.
    gxx = np.where(there[0], norms[0] + np.einsum("ihjk,ihjk->ij", yx, yx), 1.0)
    gyy = np.where(there[1], norms[1] + np.einsum("ihjk,ihjk->ij", xy, xy), 1.0)
    gxy = np.einsum("ihjk,ihjk->ij", xx, xy) + np.einsum("ihjk,ihjk->ij", yy, yx)
    gxy *= there[0] & there[1]
    # With s² the determinant (UᵀU)^(1/2) = (UᵀU + s I)/t, its inverse (adj(UᵀU) + s I)/(s t).
    product = np.sqrt(gxx) * np.sqrt(gyy)
    square = 1.0 - (gxy / product) ** 2  # of the sine of their angle
    check("the sine of the angle of two vectors of W is, squared,", float(square.min()), grid)
    s = product * np.sqrt(square)
    t = np.sqrt(gxx + gyy + 2.0 * s)
    c, d = np.zeros((2, coarser.size)), np.ones((2, coarser.size))
    for a, g in enumerate((gxx, gyy)):
        c[a, J] = (there[a] * (g + s) / t / stencil.full_load[a].sum()).ravel()
        norm = np.sqrt(norms[a]).ravel()
        d[a, J] = _diagonal(stencil, cells, rows[a], a, parts[a], sums[0], norm)
    on_coarse = Cells(c.ravel(), d.ravel())
    inverse = np.zeros((3, coarser.size))
    for entry, value in enumerate((there[0] * (gyy + s), there[1] * (gxx + s), -gxy)):
        inverse[entry, J] = (value / (s * t)).ravel()
    number = on_coarse.number.reshape(2, -1)
    ends = [0, len(parts[0]), len(parts[0]) + len(parts[1])]
    W, columns = np.empty((ends[2], 2)), np.empty((ends[2], 2), np.int32)
    for a, at in enumerate(parts):
        for part in chunks(len(at), 4 * CHUNK):
            lines = slice(ends[a] + part.start, ends[a] + part.stop)
            block = J.take(grid.block_of.take(at[part] - a * stencil.size))
            own, other = sums[0].take(at[part]), sums[1].take(at[part])
            mixed = inverse[2].take(block)
            W[lines, 0] = own * inverse[a].take(block) + other * mixed
            W[lines, 1] = own * mixed + other * inverse[1 - a].take(block)
            columns[lines, 0] = number[a].take(block)
            columns[lines, 1] = number[1 - a].take(block)
    starts = np.arange(0, W.size + 1, 2, dtype=np.int32)
    return on_coarse, csr_array((W.ravel(), columns.ravel(), starts), (len(W), on_coarse.count))


def _diagonal(
    stencil: CoupledStencil,
    cells: Cells,
    rows: Rows,
    a: int,
    at: Array,
    sums: Array,
    norm: Array,
) -> Array:
    """Return the diagonal of E for all blocks of a component, 1 where there is no contact."""
    grid = stencil.cells
    place = np.full(len(cells.c), -1, np.int32)
    place[at] = rows.place
    d = np.where(norm > 0.0, stencil.coarser.T[a, a, 0, 0], 1.0)
    full = (stencil.blocks(place)[a] == 0).all(axis=(1, 3)).ravel()
    new = np.flatnonzero((norm > 0.0) & ~(full & cells.finest))
    for part in chunks(len(new)):
        J = new[part]
        origins = grid.origins[J] + a * stencil.size
        slots = grid.slots[:, None] + origins
        w = sums.take(slots) / norm[J]
        loads = block_loads(grid, rows.rows[: len(grid.steps)], place.take(slots), w)
        own: Any = 0.0
        if not cells.finest:
            window = grid.window[:, None] + origins
            c = cells.c.take(window)
            own = (loads**2 * (cells.d.take(window) - stencil.zero[a] * c**2)).sum(axis=0)
            loads *= c
        d[J] = own + ((stencil.own[a] @ loads) * loads).sum(axis=0)
    return d


def _direct(stencil: CoupledStencil, cells: Cells, at: Array, dtype: np.dtype[Any]) -> Direct:
    component, cell = np.divmod(at, stencil.size)
    E = stencil.matrix(component, np.stack(np.divmod(cell, stencil.cells.padded[1]), axis=-1))
    c = cells.c[at]
    E = c * E * c[:, None]
    np.fill_diagonal(E, cells.d[at])
    try:
        factor, _ = cho_factor(E)
    except np.linalg.LinAlgError:
        smallest = float(np.linalg.eigvalsh(E)[0])
        raise refused("an eigenvalue of the coarsest matrix is", smallest, stencil.cells) from None
    return Direct(cells, factor.astype(dtype))
