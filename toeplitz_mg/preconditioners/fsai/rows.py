"""Rows of the factor G, by patterns of active neighbours or one by one, and their refusal."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.preconditioners.fsai.cellgrid import CellGrid

CHUNK = 2048  # Blocks treated together: their arrays of some 100 doubles stay in the cache.


class Refused(np.linalg.LinAlgError):
    """A matrix has no sparse approximate inverse; the message gives the reason, without advice."""


@contextmanager
def advise(advice: str) -> Iterator[None]:
    """Add advice to the error of a refused matrix."""
    try:
        yield
    except Refused as error:
        raise np.linalg.LinAlgError(f"{error}; {advice}") from None


def require_positive(subject: str, value: float) -> None:
    """Raise the error of `refusal` if a number is not positive."""
    if not value > 0.0:
        raise refusal(subject, value)


def refusal(subject: str, value: float) -> Refused:
    """Return the error for a kernel with a number that must be positive but is not."""
    return Refused(
        f"{subject} {value:.3g} in the sparse approximate inverse, but must be positive: A is not "
        "positive definite, or too smooth a kernel for it"
    )


class Neighbourhood(NamedTuple):
    """The matrix of the cells in a row of G, with the row's own cell first.

    Attributes
    ----------
    local : ndarray of shape (K, K)
        A, minus τ within a component.
    zero : ndarray of shape (K,)
        The diagonal of A.
    """

    local: Array
    zero: Array


def tabulate_rows(near: Neighbourhood) -> Array:
    """Return the rows of G for every pattern of active neighbours, as columns of shape (K,).

    The farthest neighbours are eliminated first, once for all patterns that share them.
    """
    S = near.local[:, :, None]
    eliminated = []
    for k in range(len(S) - 1, 0, -1):
        require_positive("a pivot is", S[k, k].min())
        factors = S[k, :k] / S[k, k]
        without, S = S[:k, :k], S[:k, :k] - factors[:, None] * S[k, :k]
        S = np.stack([without, S], axis=-1).reshape(k, k, -1)
        eliminated.append(np.stack([np.zeros(factors.shape), factors], axis=-1))
    require_positive("a pivot is", S.min())
    rows = np.empty((len(near.local), S.size))
    rows[0] = 1.0 / np.sqrt(S[0, 0])
    for k, factors in enumerate(reversed(eliminated), 1):
        factors = factors.reshape(k, -1)
        known = rows[:k].reshape(k, factors.shape[1], -1)
        rows[k] = -np.einsum("js,jsr->sr", factors, known).ravel()
    return rows


def solve_rows(near: Neighbourhood, c: Array, d: Array) -> Array:
    """Return rows of G for the matrix c_i K(i-j) c_j with the diagonal d.

    Parameters
    ----------
    near : Neighbourhood
    c, d : ndarray of shape (K, m)
        The weights and the diagonal of a cell and its neighbours; 0 and 1 for inactive ones.

    Returns
    -------
    ndarray of shape (K, m)
        S⁻¹ e / √(eᵀ S⁻¹ e), where S is the matrix of these cells and e the unit vector of the
        first; zero for an inactive neighbour.
    """
    # All systems are solved together, entry by entry, much faster than one by one with LAPACK. With
    # C = diag(c), C⁻¹ S C⁻¹ is factorised: the kernel's matrix except for its diagonal, which is
    # infinite for an inactive cell. The first row and column are not scaled.
    K = len(c)
    S = np.empty((K, *c.shape))  # C⁻¹ S C⁻¹ on and below the diagonal, the factors above.
    absent = c == 0.0
    divisor = c + absent
    added = d / divisor**2 - near.zero[:, None]
    added[absent] = np.inf
    for k in range(K - 1, 0, -1):
        row = S[k, : k + 1]
        np.einsum("jm,jim->im", S[k, k + 1 :], S[k + 1 :, : k + 1], out=row)
        np.subtract(near.local[k, : k + 1, None], row, out=row)
        row[k] += added[k]
        require_positive("a pivot is", row[k].min())
        np.divide(row[:k], row[k], out=S[:k, k])
    coupled = np.einsum("jm,jm->m", S[0, 1:], S[1:, 0])
    pivot = d[0] + c[0] ** 2 * (near.local[0, 0] - near.zero[0] - coupled)
    require_positive("a pivot is", pivot.min())
    rows = np.empty(c.shape)
    rows[0] = c[0] / np.sqrt(pivot)
    for k in range(1, K):
        rows[k] = -np.einsum("jm,jm->m", S[:k, k], rows[:k])
    rows /= divisor
    rows[0] = 1.0 / np.sqrt(pivot)
    return rows


def add_loads(grid: CellGrid, rows: Array, index: Array, w: Array) -> Array:
    """Return the loads Gᵀ w of blocks on their windows, of shape (window, m).

    Parameters
    ----------
    grid : CellGrid
    rows : ndarray of shape (K, any)
        Rows of G, as columns.
    index : ndarray of int, shape (h1 h2, m)
        The index of the row for each cell of the blocks.
    w : ndarray of shape (h1 h2, m)
        Zero in inactive cells.
    """
    (h1, h2), (p1, p2) = grid.block, grid.reach
    loads = np.zeros((*grid.window_shape, w.shape[1]))
    index = index.astype(np.intp, copy=False)
    for g, (a, b) in zip(rows, grid.offsets, strict=True):
        part = loads[p1 + a : p1 + a + h1, p2 + b : p2 + b + h2]
        part += (g.take(index) * w).reshape(part.shape)
    return loads.reshape(len(grid.window), w.shape[1])
