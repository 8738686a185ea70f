"""The levels of a multilevel sparse approximate inverse on a mask, new or changed from others."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csr_array

from toeplitz_mg.preconditioners.fsai_table import (
    Stencil,
    block_loads,
    chunks,
    refused,
    rows_of_G,
)

Array = NDArray[Any]

DENSE = 600  # unknowns that are solved for directly


@dataclass(frozen=True)
class Cells:
    """The matrix c_i T(i-j) c_j with the diagonal d, on the flattened grid of a `Stencil`.

    Attributes
    ----------
    c : ndarray
        The load of an unknown, 1 in full contact.
    d : ndarray
        1 where there is no contact.
    smooth : ndarray
        What the vector of ones is on this level; 0 where there is no contact.
    finest : bool
        Whether it is A itself: c = smooth = 1 and d = T(0) in contact.
    """

    c: Array
    d: Array
    smooth: Array
    finest: bool = False

    @classmethod
    def of_mask(cls, stencil: Stencil, mask: Array) -> "Cells":
        """Return those of A."""
        contact = stencil.place(mask, False)
        return cls(contact, np.broadcast_to(stencil.T[0, 0], contact.shape), contact, True)

    def changed_from(self, old: "Cells") -> Array:
        """Where the unknowns are not those of `old`."""
        changed = self.c != old.c
        if not self.finest:
            changed |= (self.d != old.d) | (self.smooth != old.smooth)
        return np.asarray(changed)


@dataclass(frozen=True)
class Direct:
    """The coarsest level, by Cholesky's factorisation.

    Attributes
    ----------
    cells : Cells
    factor : ndarray of shape (N, N)
    """

    cells: Cells
    factor: Array

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of unknowns."""
        return (len(self.factor),)

    @property
    def multiplications(self) -> int:
        """Multiplications of one application."""
        return self.factor.size

    def __call__(self, x: Array) -> Array:
        """Apply it to a vector, or to the columns of x."""
        return np.asarray(cho_solve((self.factor, False), x, check_finite=False))


@dataclass(frozen=True)
class Level:
    """Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G, with the next level for E⁻¹.

    Attributes
    ----------
    cells : Cells
    rows : ndarray of shape (K, any)
        Columns of rows of G, in float64: by pattern on the finest level, else by cell.
    G, W : csr_array
        Their rows are the unknowns, block by block.
    coarse : Level or Direct
    """

    cells: Cells
    rows: Array
    G: csr_array
    W: csr_array
    coarse: "Level | Direct"

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of unknowns on each level."""
        return (self.G.shape[0], *self.coarse.sizes)

    @property
    def multiplications(self) -> int:
        """Multiplications of one application."""
        return 2 * int(self.G.nnz + self.W.nnz) + self.coarse.multiplications

    def __call__(self, x: Array) -> Array:
        """Apply it to a vector, or to the columns of x."""
        y = self.G @ x
        a = self.W.T @ y
        y += self.W @ (self.coarse(a) - a)
        return np.asarray(self.G.T @ y)


def build(
    stencil: Stencil, cells: Cells, dtype: np.dtype[Any], old: Level | Direct | None = None
) -> Level | Direct:
    """Build this level and those below.

    Parameters
    ----------
    stencil : Stencil
    cells : Cells
    dtype : dtype
        Of what is applied; everything is computed in float64.
    old : Level or Direct, optional
        The same for another mask: only what differs from there is computed.
    """
    contact = cells.smooth != 0.0
    if np.count_nonzero(contact) <= DENSE:
        return _direct(stencil, cells, np.flatnonzero(contact), dtype)
    changed = None
    if isinstance(old, Level):
        changed = cells.changed_from(old.cells)
        if not changed.any():
            return old
    else:
        old = None
    blocks, at, block_of = _block_by_block(stencil, contact)
    if cells.finest:
        place = _patterns(stencil, contact)
        rows = _rows_by_pattern(stencil, place[at], old)
    else:
        place = np.arange(len(contact))
        rows = _rows_by_cell(stencil, cells, at, old, changed)
    G = _matrix(stencil, contact, at, rows, place)

    v = G @ cells.smooth[contact].astype(np.float64)
    norm = np.sqrt(np.bincount(block_of, v * v))
    if not norm.min() > 0.0:
        raise refused("the norm of a vector of W is", float(norm.min()), stencil)
    v /= norm[block_of]
    W = csr_array((v, block_of, np.arange(len(v) + 1, dtype=np.int32)), (len(v), len(blocks)))

    w = np.zeros(len(contact))
    w[at] = v
    coarser = stencil.coarser
    smooth = np.zeros(stencil.blocks)
    smooth.flat[blocks] = norm
    c, d = np.zeros(smooth.shape), np.ones(smooth.shape)
    if old is not None and changed is not None:
        kept = smooth > 0.0
        c[kept] = coarser.without_margin(old.coarse.cells.c)[kept]
        d[kept] = coarser.without_margin(old.coarse.cells.d)[kept]
        blocks = blocks[changed[stencil.origins[blocks, None] + stencil.window].any(axis=1)]
    for part in chunks(len(blocks)):
        J = blocks[part]
        c.flat[J], d.flat[J] = _aggregated(stencil, cells, rows, place, w, J)
    on_coarse = Cells(coarser.place(c, 0.0), coarser.place(d, 1.0), coarser.place(smooth, 0.0))
    coarse = build(coarser, on_coarse, dtype, None if old is None else old.coarse)
    return Level(cells, rows, G.astype(dtype, copy=False), W.astype(dtype, copy=False), coarse)


def _direct(stencil: Stencil, cells: Cells, at: Array, dtype: np.dtype[Any]) -> Direct:
    i, j = np.divmod(at, stencil.padded[1])
    E = stencil.T[np.abs(i[:, None] - i), np.abs(j[:, None] - j)]
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


def _block_by_block(stencil: Stencil, contact: Array) -> tuple[Array, Array, Array]:
    """Return the blocks with contact, the cells in contact in their order, the block of each."""
    (m1, m2), (h1, h2), (p1, p2) = stencil.blocks, stencil.block, stencil.reach
    grid = contact.reshape(stencil.padded)[p1:, p2 : p2 + m2 * h2]
    blocks = np.flatnonzero(grid.reshape(m1, h1, m2, h2).any(axis=(1, 3)))
    slots = stencil.origins[blocks, None] + stencil.slots
    inside = contact[slots]
    number = np.arange(len(blocks), dtype=np.int32)
    return blocks, slots[inside], np.repeat(number, np.count_nonzero(inside, axis=1))


def _patterns(stencil: Stencil, contact: Array) -> Array:
    """Return for each cell a number whose bit k - 1 says if neighbour k is in contact."""
    neighbour = contact.astype(np.int16)
    pattern = np.zeros(len(contact), np.int16)
    for bit, step in enumerate(stencil.steps[1:]):
        pattern[-step:] |= neighbour[:step] << bit
    return pattern


def _rows_by_pattern(stencil: Stencil, patterns: Array, old: Level | None) -> Array:
    """Return the rows of these patterns, and of those that are known; zero of others."""
    K = len(stencil.offsets)
    rows = np.zeros((K, 2 ** (K - 1))) if old is None else old.rows
    occurs = np.bincount(patterns, minlength=rows.shape[1]) > 0
    new = np.flatnonzero(occurs & (rows[0] == 0.0))
    if len(new):
        rows = rows.copy()
        rows[:, new] = stencil.rows_in_contact(new)
    return rows


def _rows_by_cell(
    stencil: Stencil, cells: Cells, at: Array, old: Level | None, changed: Array | None
) -> Array:
    near = at[:, None] + stencil.steps
    rows = np.zeros((len(stencil.offsets), len(cells.c)))
    if old is not None and changed is not None:
        rows[:, at] = old.rows[:, at]
        new = changed[near].any(axis=1)
        near, at = near[new], at[new]
    rows[:, at] = rows_of_G(stencil, cells.c[near], cells.d[near]).T
    return rows


def _matrix(stencil: Stencil, contact: Array, at: Array, rows: Array, place: Array) -> csr_array:
    """Return G from the rows of the cells `at`; its columns are in the order of the grid."""
    number = np.cumsum(contact, dtype=np.int32)
    number *= contact
    number -= 1  # so that it is -1 where there is no contact
    by_place = np.ascontiguousarray(rows.T)
    starts = np.zeros(len(at) + 1, np.int32)
    # Memory that is never written to is never mapped.
    entries, columns = np.empty(len(at) * len(rows)), np.empty(len(at) * len(rows), np.int32)
    end = 0
    for part in chunks(len(at)):
        near = number.take(at[part, None] + stencil.steps)
        known = near >= 0
        where = np.flatnonzero(known)
        begin, end = end, end + len(where)
        entries[begin:end] = by_place.take(place[at[part]], axis=0).take(where)
        columns[begin:end] = near.take(where)
        starts[1:][part] = np.count_nonzero(known, axis=1)
    np.cumsum(starts, out=starts)
    return csr_array((entries[:end], columns[:end], starts), (len(at),) * 2)


def _aggregated(
    stencil: Stencil, cells: Cells, rows: Array, place: Array, w: Array, blocks: Array
) -> tuple[Array, Array]:
    """Return the loads c and the diagonal d of E for these blocks, exactly."""
    origins = stencil.origins[blocks, None]
    slots = origins + stencil.slots
    loads = block_loads(stencil, rows, place[slots], w[slots])
    own: Any = 0.0
    if not cells.finest:
        window = origins + stencil.window
        c = cells.c[window]
        own = (loads**2 * (cells.d[window] - stencil.T[0, 0] * c**2)).sum(axis=1)
        loads *= c
    own = own + ((loads @ stencil.own) * loads).sum(axis=1)
    return loads.sum(axis=1) / stencil.full_load.sum(), own
