"""The levels of a multilevel sparse approximate inverse, built for a mask."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor
from scipy.sparse import csr_array

from toeplitz_mg.preconditioners.fsai_apply import Cells, Direct, Level, Rows
from toeplitz_mg.preconditioners.fsai_table import Near, Stencil, block_loads, check, refused

Array = NDArray[Any]

DENSE = 600  # unknowns that are solved for directly
CHUNK = 2048  # blocks that are treated together, in the cache


def build(stencil: Stencil, cells: Cells, dtype: np.dtype[Any]) -> Level | Direct:
    """Build this level and those below.

    Parameters
    ----------
    stencil : Stencil
    cells : Cells
    dtype : dtype
        Of what is applied; everything is computed in float64.
    """
    at = np.flatnonzero(cells.contact)
    if few(cells):
        return _direct(stencil, cells, at, dtype)
    table, sums, index = rows_of(stencil, cells, at)
    place = np.zeros(len(cells.c), index.dtype)
    place[at] = index
    rows = Rows(table, sums, place)
    m = stencil.coarser.padded[0] * stencil.coarser.padded[1]
    touched = np.zeros(len(stencil.origins), bool)
    touched[stencil.block_of.take(at)] = True
    on_coarse = aggregated(stencil, cells, rows, touched, Cells(np.zeros(m), np.ones(m)), 0.0)
    G = factor(stencil, cells, rows, at, cells.number, len(at)).astype(dtype, copy=False)
    coarse = build(stencil.coarser, on_coarse, dtype)
    block = stencil.aggregate_of(at)
    w = aggregation(stencil, rows, on_coarse, at, block).astype(dtype, copy=False)
    W = one_each(w, coarse.number.take(block), coarse.length)
    return Level(cells, rows, block, G, W, coarse)


def few(cells: Cells) -> bool:
    """Whether the unknowns are solved for directly."""
    return cells.count <= DENSE


def rows_of(stencil: Stencil, cells: Cells, at: Array) -> tuple[Array, Array, Array]:
    """Return rows of G in columns, their products with c, and which of them are those of `at`.

    On the finest level they are the table of all patterns, else computed for these cells.
    """
    if cells.finest:
        return stencil.table, stencil.table_sums, _patterns(stencil, cells.contact, at)
    rows, sums = np.empty((len(at), len(stencil.steps))), np.empty(len(at))
    for part in chunks(len(at), 2 * CHUNK):
        near = stencil.steps[:, None] + at[part]
        c = cells.c.take(near)
        found = rows_of_G(stencil, c, cells.d.take(near))
        rows[part] = found.T
        sums[part] = np.einsum("km,km->m", found, c)
    return rows.T, sums, np.arange(len(at), dtype=np.int32)


def _patterns(stencil: Stencil, contact: Array, at: Array) -> Array:
    """Return the places of these cells, in order, in `Stencil.table`."""
    if not len(at):
        return np.zeros(0, np.int16)
    low, start, stop = int(stencil.steps.min()), at[0], at[-1] + 1
    if len(stencil.steps) * len(at) < stop - start:
        bits = np.int16(1) << np.arange(len(stencil.steps) - 1, dtype=np.int16)
        return np.asarray(bits @ contact.take(stencil.steps[1:, None] + at))
    neighbour = contact[start + low : stop].astype(np.int16)
    pattern = np.zeros(stop - start, np.int16)
    for shift in (stencil.steps[:0:-1] - low).tolist():
        pattern += pattern
        pattern |= neighbour[shift : shift + len(pattern)]
    return np.asarray(pattern.take(at - start))


def aggregated(
    stencil: Stencil, cells: Cells, rows: Rows, touched: Array, old: Cells, kept: float
) -> Cells:
    """Return the cells of E, which in the blocks that are not touched are the old ones.

    The load of a block is cᵀGᵀw_J = ‖(G c)_J‖, in units of that of full contact. Where it differs
    by less than this relative to the old one, d is left.
    """
    coarser, total = stencil.coarser, float(stencil.full_load.sum())
    c, d = old.c.copy(), old.d.copy()
    blocks = np.flatnonzero(touched)
    for part in chunks(len(blocks)):
        slots = stencil.slots[:, None] + stencil.origins[blocks[part]]
        within, place = cells.contact.take(slots), rows.place.take(slots)
        u = rows.sums.take(place) * within
        norm = np.sqrt(np.einsum("im,im->m", u, u))
        # No contact any more: the load is 0, the diagonal 1.
        empty = np.logical_not(within.any(axis=0))
        check("the norm of a vector of W is", (norm + empty).min(), stencil)
        J = coarser.inside[blocks[part]]
        before = c[J]
        c[J] = norm / total
        d[J[empty]] = 1.0
        new = (np.abs(c[J] - before) >= kept * before) & ~empty
        if cells.finest:  # what is exact in full contact need not be computed
            full = (within & (place == rows.rows.shape[1] - 1)).all(axis=0)
            d[J[full]] = coarser.T[0, 0]
            new &= ~full
        if not new.all():
            place, u = place.compress(new, axis=1), u.compress(new, axis=1)
        loads = block_loads(stencil, rows.rows, place, u / norm[new])
        d[J[new]] = _diagonal(stencil, cells, slots[0, new], loads)
    return Cells(c, d)


def _diagonal(stencil: Stencil, cells: Cells, origins: Array, loads: Array) -> Array:
    """Return the diagonal of E for these blocks, exactly, from their loads Gᵀ w."""
    own: Any = 0.0
    if not cells.finest:
        window = stencil.window[:, None] + origins
        c = cells.c[window]
        own = (loads**2 * (cells.d[window] - stencil.T[0, 0] * c**2)).sum(axis=0)
        loads = loads * c
    return np.asarray(own + ((stencil.own @ loads) * loads).sum(axis=0))


def factor(
    stencil: Stencil, cells: Cells, rows: Rows, at: Array, number: Array, n: int
) -> csr_array:
    """Return the rows of G of the cells `at`, of n columns with this number.

    On a level above the finest these are the last of `rows`.
    """
    if cells.finest:
        G = stencil.sparse_table[rows.place.take(at)]
    else:
        G = stencil.sparse(rows.rows.T[len(rows.sums) - len(at) :])
    first = (at + stencil.steps.min()).astype(np.int32)  # the first that each might see
    for part in chunks(len(first), 4 * CHUNK):
        starts = G.indptr[part.start : part.stop + 1]
        columns = G.indices[starts[0] : starts[-1]]
        columns += np.repeat(first[part], np.diff(starts))
        number.take(columns, out=columns, mode="clip")
    return csr_array((G.data, G.indices, G.indptr), (len(first), n))


def aggregation(stencil: Stencil, rows: Rows, on_coarse: Cells, at: Array, block: Array) -> Array:
    """Return the entries of W in the rows of the cells `at` of these aggregates."""
    w = rows.sums.take(rows.place.take(at))
    w /= on_coarse.c.take(block) * stencil.full_load.sum()
    return np.asarray(w)


def one_each(entries: Array, columns: Array, n: int) -> csr_array:
    """Return a matrix of n columns with one entry in each row."""
    return csr_array(
        (entries, columns, np.arange(len(entries) + 1, dtype=np.int32)), (len(entries), n)
    )


def rows_of_G(stencil: Near, c: Array, d: Array) -> Array:
    """Return rows of G for the matrix c_i T(i-j) c_j with the diagonal d.

    Parameters
    ----------
    stencil : Near
    c, d : ndarray of shape (K, m)
        Of a cell and its neighbours; 0 and 1 where they are not in contact.

    Returns
    -------
    ndarray of shape (K, m)
        S⁻¹ e / √(eᵀ S⁻¹ e), S the matrix of these cells and e the first; zero where there is no
        contact.
    """
    # All systems together, entry by entry: much faster than LAPACK, one by one. With C = diag(c)
    # it is C⁻¹ S C⁻¹ that is factorised, which is the kernel's but for its diagonal; that is
    # infinite where there is no contact. The first row and column, of e, are left as they are.
    K = len(c)
    S = np.empty((K, *c.shape))  # on and below the diagonal C⁻¹ S C⁻¹, above it the factors
    absent = c == 0.0
    divisor = c + absent
    added = d / divisor**2 - stencil.T[0, 0]
    added[absent] = np.inf
    for k in range(K - 1, 0, -1):
        row = S[k, : k + 1]
        np.einsum("jm,jim->im", S[k, k + 1 :], S[k + 1 :, : k + 1], out=row)
        np.subtract(stencil.local[k, : k + 1, None], row, out=row)
        row[k] += added[k]
        check("a pivot is", row[k].min(), stencil)
        np.divide(row[:k], row[k], out=S[:k, k])
    coupled = np.einsum("jm,jm->m", S[0, 1:], S[1:, 0])
    pivot = d[0] + c[0] ** 2 * (stencil.local[0, 0] - stencil.T[0, 0] - coupled)
    check("a pivot is", pivot.min(), stencil)
    rows = np.empty(c.shape)
    rows[0] = c[0] / np.sqrt(pivot)
    for k in range(1, K):
        rows[k] = -np.einsum("jm,jm->m", S[:k, k], rows[:k])
    rows /= divisor
    rows[0] = 1.0 / np.sqrt(pivot)
    return rows


def _direct(stencil: Stencil, cells: Cells, at: Array, dtype: np.dtype[Any]) -> Direct:
    i, j = np.divmod(at, stencil.padded[1])
    E = stencil.T.take(np.abs(i[:, None] - i) * stencil.T.shape[1] + np.abs(j[:, None] - j))
    c = cells.c[at]
    E *= c
    E *= c[:, None]
    np.fill_diagonal(E, cells.d[at])
    try:
        factor, _ = cho_factor(E)
    except np.linalg.LinAlgError:
        smallest = float(np.linalg.eigvalsh(E)[0])
        raise refused("an eigenvalue of the coarsest matrix is", smallest, stencil) from None
    return Direct(cells, factor.astype(dtype))


def chunks(m: int, size: int = CHUNK) -> Iterator[slice]:
    """Cut range(m) into slices."""
    return (slice(k, min(k + size, m)) for k in range(0, m, size))
