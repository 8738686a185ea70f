"""The levels of a multilevel sparse approximate inverse on a mask, new or changed from others."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csc_array, csr_array

from toeplitz_mg.preconditioners.fsai_table import (
    AGGREGATE,
    Stencil,
    block_loads,
    check,
    refused,
    rows_of_G,
)

Array = NDArray[Any]

DENSE = 600  # unknowns that are solved for directly
CHUNK = 2048  # cells or blocks that are treated together, in the cache


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
        Columns of rows of G, in float64: by pattern on the finest level, else by unknown.
    G, W : csr_array
        Their rows are the unknowns, in the order of the grid.
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

    @cached_property
    def transposed(self) -> tuple[csc_array, csc_array]:
        """Views of G and W, which would take their time in each application."""
        return self.G.T, self.W.T

    def __call__(self, x: Array) -> Array:
        """Apply it to a vector, or to the columns of x."""
        y = self.G @ x
        a = self.transposed[1] @ y
        y += self.W @ (self.coarse(a) - a)
        return np.asarray(self.transposed[0] @ y)


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
    contact = cells.smooth.astype(bool, copy=False)
    at = np.flatnonzero(contact)
    if len(at) <= DENSE:
        return _direct(stencil, cells, at, dtype)
    old = old if isinstance(old, Level) else None
    new = contact  # where the rows of G are not known yet
    if old is not None:
        changed = cells.changed_from(old.cells)
        if not changed.any():
            return old
        new = _seeing(stencil, changed)
    number = _numbered(at, len(contact))
    if cells.finest:
        place, rows = _patterns(stencil, contact), stencil.table
        pattern = place[at]
        G = _on_cells(stencil, stencil.sparse_table[pattern], at, number)
        v = rows.sum(axis=0)[pattern]
    else:
        place, rows = number, _rows_by_cell(stencil, cells, at, old, new)
        G = _on_cells(stencil, stencil.sparse(rows), at, number)
        v = G @ cells.smooth[at]

    block_of = stencil.block_of[at].astype(np.intp)
    smooth = np.sqrt(np.bincount(block_of, v * v, len(stencil.origins)))
    norm = smooth[block_of]
    check("the norm of a vector of W is", norm.min(), stencil)
    v /= norm
    has_contact = smooth > 0.0
    blocks = np.flatnonzero(has_contact)
    column = _numbered(blocks, len(smooth))[block_of]
    W = csr_array((v, column, np.arange(len(at) + 1, dtype=np.int32)), (len(at), len(blocks)))

    coarser = stencil.coarser
    c, d = np.zeros(len(smooth)), np.ones(len(smooth))
    todo = has_contact
    if old is not None:
        todo = np.zeros_like(has_contact)
        todo[stencil.block_of[new]] = True
        todo &= has_contact
        kept = has_contact & ~todo
        c[kept] = coarser.without_margin(old.coarse.cells.c).ravel()[kept]
        d[kept] = coarser.without_margin(old.coarse.cells.d).ravel()[kept]
    if cells.finest:  # what is exact there need not be computed
        in_full_contact = pattern == rows.shape[1] - 1
        full = np.bincount(block_of[in_full_contact], minlength=len(c)) == AGGREGATE
        c[full], d[full] = 1.0, coarser.T[0, 0]
        todo = todo & ~full
    blocks = np.flatnonzero(todo)
    w = np.append(v, 0.0)  # where the number is -1
    for part in chunks(len(blocks)):
        J = blocks[part]
        slots = stencil.slots[:, None] + stencil.origins[J]
        loads = block_loads(stencil, rows, place[slots], w[number[slots]])
        c[J], d[J] = _aggregated(stencil, cells, J, loads)
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


def chunks(m: int, size: int = CHUNK) -> Iterator[slice]:
    """Cut range(m) into slices."""
    return (slice(k, min(k + size, m)) for k in range(0, m, size))


def _numbered(at: Array, size: int) -> Array:
    """Return the numbers of the places `at`, and -1 in others."""
    number = np.full(size, -1, np.int32)
    number[at] = np.arange(len(at), dtype=np.int32)
    return number


def _patterns(stencil: Stencil, contact: Array) -> Array:
    """Return for each cell its place in `Stencil.table`."""
    neighbour = contact.astype(np.int16)
    pattern = np.zeros(len(contact), np.int16)
    for step in stencil.steps[1:]:
        pattern[-step:] |= neighbour[:step]
        neighbour += neighbour
    return pattern


def _seeing(stencil: Stencil, changed: Array) -> Array:
    """Return the cells of which one of the cells in their rows of G has changed."""
    seeing = changed.copy()
    for step in stencil.steps[1:]:
        seeing[-step:] |= changed[:step]
    return seeing


def _rows_by_cell(
    stencil: Stencil, cells: Cells, at: Array, old: Level | None, new: Array
) -> Array:
    if old is None:
        rows = np.empty((len(stencil.steps), len(at)))
    else:  # of a cell that was not in contact any
        rows = old.rows.take(_numbered(np.flatnonzero(old.cells.smooth), len(new))[at], axis=1)
    todo = np.flatnonzero(new[at])
    for part in chunks(len(todo)):
        near = stencil.steps[:, None] + at[todo[part]]
        rows[:, todo[part]] = rows_of_G(stencil, cells.c.take(near), cells.d.take(near))
    return rows


def _on_cells(stencil: Stencil, rows: csr_array, at: Array, number: Array) -> csr_array:
    """Return G from the rows of the cells `at`, as of `Stencil.sparse`, which are overwritten."""
    first = (at + stencil.steps.min()).astype(np.int32)
    for part in chunks(len(at), 4 * CHUNK):
        starts = rows.indptr[part.start : part.stop + 1]
        columns = rows.indices[starts[0] : starts[-1]]
        columns += np.repeat(first[part], np.diff(starts))
        number.take(columns, out=columns, mode="clip")
    return csr_array((rows.data, rows.indices, rows.indptr), (len(at), len(at)))


def _aggregated(stencil: Stencil, cells: Cells, blocks: Array, loads: Array) -> tuple[Array, Array]:
    """Return c and the diagonal d of E for these blocks, exactly, from their loads Gᵀ w."""
    own: Any = 0.0
    if not cells.finest:
        window = stencil.window[:, None] + stencil.origins[blocks]
        c = cells.c[window]
        own = (loads**2 * (cells.d[window] - stencil.T[0, 0] * c**2)).sum(axis=0)
        loads = loads * c
    own = own + ((stencil.own @ loads) * loads).sum(axis=0)
    return loads.sum(axis=0) / stencil.full_load.sum(), own
