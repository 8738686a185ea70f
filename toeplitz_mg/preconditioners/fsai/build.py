"""The levels of a multilevel sparse approximate inverse, built for a mask."""

from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csr_array

from toeplitz_mg._typing import Array
from toeplitz_mg.preconditioners.fsai.aggregates import CHUNK, aggregated, aggregation, chunks
from toeplitz_mg.preconditioners.fsai.levels import Cells, Direct, Level, Rows
from toeplitz_mg.preconditioners.fsai.stencil import Near, Stencil, check, refused, require_definite

DENSE = 600  # unknowns that are solved for directly


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
    own = rows_of(stencil, cells, at)
    place = np.zeros(len(cells.c), own.place.dtype)
    place[at] = own.place
    rows = Rows(own.rows, own.sums, place)
    m = len(stencil.T) * stencil.coarser.grid.size
    none = Cells(np.zeros(m), np.ones(m))
    on_coarse, inverse = aggregated(stencil, cells, rows, blocks_of(stencil, at), none, 0.0)
    G = factor(stencil, cells, own, at, cells.number, len(at)).astype(dtype, copy=False)
    coarse = build(stencil.coarser, on_coarse, dtype)
    w, block = aggregation(stencil, rows, inverse, at)
    W = aggregates(w.astype(dtype, copy=False), coarse.number.take(block), coarse.length)
    return Level(cells, rows, block, G, W, coarse)


def few(cells: Cells) -> bool:
    """Whether the unknowns are solved for directly."""
    return cells.count <= DENSE


def blocks_of(stencil: Stencil, at: Array) -> Array:
    """Return which blocks have some of these places."""
    touched = np.zeros(len(stencil.grid.origins), bool)
    for a, part in enumerate(stencil.split(at)):
        touched[stencil.grid.block_of.take(part - a * stencil.grid.size)] = True
    return touched


def rows_of(stencil: Stencil, cells: Cells, at: Array) -> Rows:
    """Return rows of G, with the places of those of `at` among them.

    On the finest level they are the table of all patterns, else computed for these places.
    """
    parts = stencil.split(at)
    if cells.finest:
        index = [
            _patterns(stencil.steps[a], cells.contact, part) + np.int16(a * stencil.patterns)
            for a, part in enumerate(parts)
        ]
        return Rows(stencil.table, stencil.table_sums, np.concatenate(index))
    rows, sums = np.empty((len(at), stencil.steps.shape[1])), np.empty((len(stencil.T), len(at)))
    start = 0
    for a, places in enumerate(parts):
        for part in chunks(len(places), 2 * CHUNK):
            near = stencil.steps[a][:, None] + places[part]
            c = cells.c.take(near)
            found = rows_of_G(stencil.near[a], c, cells.d.take(near))
            own = slice(start + part.start, start + part.stop)
            rows[own], sums[:, own] = found.T, stencil.sums(found, c)
        start += len(places)
    return Rows(rows.T, sums, np.arange(len(at), dtype=np.int32))


def _patterns(steps: Array, contact: Array, at: Array) -> Array:
    """Return for each of these places, in order, which neighbours are in contact, as bits."""
    if not len(at):
        return np.zeros(0, np.int16)
    start, stop = at[0], at[-1] + 1
    if len(steps) * len(at) < stop - start:
        bits = np.int16(1) << np.arange(len(steps) - 1, dtype=np.int16)
        return np.asarray(bits @ contact.take(steps[1:, None] + at))
    pattern = np.zeros(stop - start, np.int16)
    for step in steps[:0:-1].tolist():
        pattern += pattern
        pattern |= contact[start + step : stop + step]
    return np.asarray(pattern.take(at - start))


def factor(
    stencil: Stencil, cells: Cells, rows: Rows, at: Array, number: Array, n: int
) -> csr_array:
    """Return the rows of G of the places `at`, of n columns with this number.

    Parameters
    ----------
    stencil : Stencil
    cells : Cells
    rows : Rows
        Of `rows_of`.
    at, number : ndarray of int
    n : int
    """
    parts = stencil.split(at)
    if cells.finest:
        G = stencil.sparse_table[rows.place]
    else:
        G = stencil.sparse(rows.rows, [len(part) for part in parts])
    # The first place that each might see.
    lowest = [part + steps.min() for part, steps in zip(parts, stencil.steps, strict=True)]
    first = np.concatenate(lowest).astype(np.int32)
    for part in chunks(len(first), 4 * CHUNK):
        starts = G.indptr[part.start : part.stop + 1]
        columns = G.indices[starts[0] : starts[-1]]
        columns += np.repeat(first[part], np.diff(starts))
        number.take(columns, out=columns, mode="clip")
    return csr_array((G.data, G.indices, G.indptr), (len(first), n))


def aggregates(entries: Array, columns: Array, n: int) -> csr_array:
    """Return W of n columns with these entries in each row, both of shape (rows, d)."""
    rows, d = entries.shape
    starts = np.arange(0, rows * d + 1, d, dtype=np.int32)
    return csr_array((entries.ravel(), columns.ravel(), starts), (rows, n))


def rows_of_G(near: Near, c: Array, d: Array) -> Array:
    """Return rows of G for the matrix c_i T(i-j) c_j with the diagonal d.

    Parameters
    ----------
    near : Near
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
    added = d / divisor**2 - near.zero[:, None]
    added[absent] = np.inf
    for k in range(K - 1, 0, -1):
        row = S[k, : k + 1]
        np.einsum("jm,jim->im", S[k, k + 1 :], S[k + 1 :, : k + 1], out=row)
        np.subtract(near.local[k, : k + 1, None], row, out=row)
        row[k] += added[k]
        check("a pivot is", row[k].min(), near.grid_shape)
        np.divide(row[:k], row[k], out=S[:k, k])
    coupled = np.einsum("jm,jm->m", S[0, 1:], S[1:, 0])
    pivot = d[0] + c[0] ** 2 * (near.local[0, 0] - near.zero[0] - coupled)
    check("a pivot is", pivot.min(), near.grid_shape)
    rows = np.empty(c.shape)
    rows[0] = c[0] / np.sqrt(pivot)
    for k in range(1, K):
        rows[k] = -np.einsum("jm,jm->m", S[:k, k], rows[:k])
    rows /= divisor
    rows[0] = 1.0 / np.sqrt(pivot)
    return rows


def _direct(stencil: Stencil, cells: Cells, at: Array, dtype: np.dtype[Any]) -> Direct:
    E = stencil.matrix(at)
    c = cells.c[at]
    E *= c
    E *= c[:, None]
    np.fill_diagonal(E, cells.d[at])
    try:
        factor, _ = cho_factor(E)
    except np.linalg.LinAlgError:
        smallest, shape = float(np.linalg.eigvalsh(E)[0]), stencil.T.shape[2:]
        raise refused("an eigenvalue of the coarsest matrix is", smallest, shape) from None
    require_definite(E, lambda v: cho_solve((factor, False), v), dtype)
    return Direct(cells, factor.astype(dtype))
