"""How many neighbours a kernel needs in a sparse approximate inverse, judged on a window.

Twelve cells before its own are enough for a row of G where the kernel decays slowly, as that of a
half-space. A covariance that is as smooth as Matérn's needs more, the more so where few cells are
in contact: of many that matter a row sees one or two then. This is seen on a few aggregates, with
dense matrices: P of two levels, with the E that is applied, where all cells are in contact, where
every other is, by chance, and, on more aggregates, where one of ten is. The condition number of P A
is multiplied by that of the next level in full contact, but where cells are few.
It tells how well conjugate gradients will do, whatever the area: at the limits below they take some
15 iterations, at most, to a relative residual of 1e-8. So it is of kernels that decay. What acts
along chains of cells longer than a window is not seen: coefficients at isolated lags, a Laplacian
that is nearly singular.

Very long elements show in another place. The load of an aggregate is nearly a difference then, and
that of a part of one is not like it. The diagonal of E sinks below 1.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.preconditioners.fsai.stencil import NEIGHBOURS, Stencil, refused
from toeplitz_mg.preconditioners.positivity import for_smooth_kernels

# By the number of neighbours, half of the cells within 2, 3 and 4 of their own: the condition that
# is good enough, in one level and in two, where half of the cells are in contact, or all.
GOOD = {NEIGHBOURS: (1.9, 2.3), 24: (1.5, 2.0), 40: (1.45, 1.63)}
GOOD_SPARSE = 2.1, 2.56  # where a tenth is; it is 2.52 for tangential tractions, elements 1:50
LOADED = 0.985  # the least diagonal of E for long elements; 0.99 of 1:100
SPARSE, HALVED, FULL = 6, 3, 2  # aggregates of the windows in either axis; in one level squared


@dataclass(frozen=True)
class Stencils:
    """The stencils of a kernel.

    Attributes
    ----------
    T : ndarray of shape (n1, n2)
        Coefficients, even in both axes; one level is 1 x n.
    neighbours : int, optional
        Of a cell, where it is not for the window to tell how many.
    """

    T: Array
    neighbours: int | None = None

    @cached_property
    def smallest(self) -> Stencil:
        """That with the fewest neighbours."""
        return Stencil.of(self.T)

    @cached_property
    def sufficient(self) -> Stencil:
        """That with the fewest neighbours that are enough."""
        if self.neighbours is not None:
            return Stencil.of(self.T, self.neighbours)
        two_levels = self.T.shape[0] > 1
        loaded = float(self.smallest.coarser.zero[0])
        if two_levels and 1 in self.smallest.grid.block and loaded < LOADED:
            raise np.linalg.LinAlgError(
                f"the diagonal of E is {loaded:.3g} in the sparse approximate inverse, but must be "
                f"at least {LOADED}: elements are too long; {for_smooth_kernels(self.T.shape)}. "
                f"neighbours={NEIGHBOURS} takes them all the same, in more iterations"
            )
        for neighbours, good in GOOD.items():
            stencil = self.smallest if neighbours == NEIGHBOURS else Stencil.of(self.T, neighbours)
            limits = good[two_levels], GOOD_SPARSE[two_levels]
            found = condition(stencil), sparse_condition(stencil)
            if found[0] <= limits[0] and found[1] <= limits[1]:
                return stencil
        raise np.linalg.LinAlgError(
            f"the condition number of P A is {found[0]:.3g} on a window and {found[1]:.3g} on one "
            f"with a tenth of its cells, P a sparse approximate inverse with {neighbours} "
            f"neighbours, but must be at most {limits[0]} and {limits[1]}: too smooth a kernel for "
            f"it; {for_smooth_kernels(self.T.shape)}. A number of neighbours that is given takes "
            "it all the same, in more iterations"
        )


def condition(stencil: Stencil) -> float:
    """Estimate the condition number of P A where half of the cells or all are in contact."""
    half, full = _window(stencil, HALVED, 0.5), _window(stencil, FULL)
    fine = max(condition_on(stencil, half), condition_on(stencil, full))
    return fine * condition_on(stencil.coarser, _window(stencil.coarser, FULL))


def sparse_condition(stencil: Stencil) -> float:
    """Estimate the condition number of P A where a tenth of the cells is in contact."""
    return condition_on(stencil, _window(stencil, SPARSE, 0.1))


def _window(stencil: Stencil, across: int, density: float = 1.0) -> Array:
    """Return so many whole aggregates in either axis, as far as the grid goes.

    This part of their cells is in contact, by chance, but at least one.
    """
    shape = stencil.grid.kernel.shape
    count = (1, across**2) if shape[0] == 1 else (across, across)
    window = np.minimum(np.multiply(count, stencil.grid.block), shape)
    chance: Array = np.random.default_rng(1).random(window)
    return np.asarray(chance <= max(density, chance.min()))


def condition_on(stencil: Stencil, contact: Array) -> float:
    """Return the condition number of P A on a window, P of two levels; infinite if it has none.

    Parameters
    ----------
    stencil : Stencil
    contact : ndarray of bool, of two axes
        The cells of the window that are in contact; its first cell is that of an aggregate.
    """
    cells = np.argwhere(contact)
    A = stencil.at(0, 0, cells[:, None] - cells)
    G = _factor(stencil, contact, cells)
    B = G @ A @ G.T
    try:
        root = np.linalg.cholesky(B)
    except np.linalg.LinAlgError:
        smallest = float(np.linalg.eigvalsh(A)[0])
        raise refused("an eigenvalue of A on a window is", smallest, contact.shape) from None
    blocks, number = np.unique(cells // stencil.grid.block, axis=0, return_inverse=True)
    W = (number.reshape(-1, 1) == np.arange(len(blocks))) * G.sum(axis=1)[:, None]
    norm = np.linalg.norm(W, axis=0)
    W /= norm
    c = norm / stencil.totals[0]
    E = c[:, None] * stencil.coarser.at(0, 0, blocks[:, None] - blocks) * c
    np.fill_diagonal(E, np.einsum("ij,ij->j", W, B @ W))
    P = np.identity(len(B)) - W @ W.T + W @ np.linalg.solve(E, W.T)
    spectrum = np.linalg.eigvalsh(root.T @ P @ root)
    return float(spectrum[-1] / spectrum[0]) if spectrum[0] > 0.0 else np.inf


def _factor(stencil: Stencil, contact: Array, cells: Array) -> Array:
    """Return G of the cells in contact, a dense matrix."""
    grid, local = stencil.grid, stencil.near[0].local
    p1, p2 = grid.reach
    number = np.full(np.add(contact.shape, np.multiply(2, grid.reach)), -1)
    number[p1 : p1 + contact.shape[0], p2 : p2 + contact.shape[1]][contact] = np.arange(len(cells))
    near = cells[:, None] + grid.offsets + grid.reach
    column = number[near[..., 0], near[..., 1]]
    known = column >= 0
    S = np.where(known[:, :, None] & known[:, None], local, np.identity(len(local)))
    rows = np.linalg.inv(S)[:, 0]
    if not rows[:, 0].min() > 0.0:
        raise refused("a pivot is", float(rows[:, 0].min()), contact.shape)
    G = np.zeros((len(cells), len(cells)))
    i, k = np.nonzero(known)
    G[i, column[i, k]] = rows[i, k] / np.sqrt(rows[i, 0])
    return G
