"""The kernel of two coupled components, for a multilevel sparse approximate inverse.

P = Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G as in `fsai`, of all unknowns together. Tangential tractions on a
half-space act on each other by A_xy, odd in both axes, on all scales alike: block diagonal
preconditioners leave the eigenvalues 1 ± (ν/2)/(1 - ν/2) at every wavelength, 2/3 and 4/3 for
ν = 1/2. So the coupling has a part in each of the steps, and on each level.

**Local factor.** A row of G sees two of the neighbours in the other component too, those of the
strongest coupling: where cells are square, the two before it on the diagonals. With these the
eigenvalues of G A Gᵀ for waves of 4 to 6 cells lie between 0.86 and 1.15 (ν = 1/2), without them
between 0.69 and 1.33. The constant τ is taken off within each component: of the coupling, which is
odd, there is none.

**Aggregates.** A displacement that is smooth is nearly a constant in each component on an aggregate
J, and G times it the sum of two vectors, with parts in both components. They are the columns of
U_J, (G c)_J for the loads c of x and for those of y; W_J = U_J (U_JᵀU_J)^(-1/2) is the orthonormal
pair nearest to them, each still that of one component. Their loads are (U_JᵀU_J)^(1/2). Without the
parts in the other component there is one iteration more on fragmented areas.

**E.** Off the diagonal it is c_J T(J-K) c_K, with the kernel's means over two blocks; c_J is the
diagonal of the loads, as what acts in the other component is less than a tenth. On the diagonal,
and in the kernel for near blocks, the loads of their own component only are taken, too.

The neighbours and aggregates are alike in both components: those of the mean of A_xx and A_yy.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from toeplitz_mg.operators import CoupledOperator
from toeplitz_mg.preconditioners.fsai_levels import rows_of_G
from toeplitz_mg.preconditioners.fsai_table import (
    AGGREGATE,
    EXACT,
    NEIGHBOURS,
    Stencil,
    averaged,
    block_loads,
    check,
)
from toeplitz_mg.preconditioners.fsai_window import Stencils

Array = NDArray[Any]

OTHERS = 2  # neighbours that a row of G sees in the other component too
COARSE = 14  # neighbours on the levels above the finest, where they cost little
STRONG = 0.2  # of the kernel, that of ν = 1/3: a weaker coupling is not worth its set-up
STRONGEST = 0.36  # 1/3 of ν = 1/2; a stronger one takes many iterations


class Seen(NamedTuple):
    """What a row of G sees, in both components: a `Near`."""

    T: Array
    local: Array


@dataclass(frozen=True)
class CoupledStencil:
    """One level for a kernel of two components: what `Stencil` is for one.

    Attributes
    ----------
    T : ndarray of shape (2, 2, n1, n2)
        Coefficients, those of a component even in both axes, those between the two odd in both.
    neighbours : int
        Cells before a cell that its row of G sees.
    """

    T: Array
    neighbours: int = NEIGHBOURS

    @cached_property
    def cells(self) -> Stencil:
        """The grid of either component: neighbours and aggregates are those of the mean."""
        return Stencil((self.T[0, 0] + self.T[1, 1]) / 2.0, self.neighbours)

    @cached_property
    def size(self) -> int:
        """The cells of a component with their margin."""
        return self.cells.padded[0] * self.cells.padded[1]

    @cached_property
    def zero(self) -> Array:
        """The diagonal of A in either component."""
        return self.T[[0, 1], [0, 1], 0, 0]

    def blocks(self, u: Array) -> Array:
        """Return what is on the cells of both components by blocks, shape (2, m1, h1, m2, h2)."""
        (m1, m2), (h1, h2), (p1, p2) = self.cells.blocks, self.cells.block, self.cells.reach
        inside = u.reshape(2, *self.cells.padded)[:, p1:, p2 : p2 + m2 * h2]
        return np.asarray(inside.reshape(2, m1, h1, m2, h2))

    @cached_property
    def others(self) -> Array:
        """Which of the neighbours a row sees in the other component too."""
        coupling = np.abs(self.at(0, 1, self.cells.offsets))
        return np.argsort(-coupling, kind="stable")[:OTHERS]

    @cached_property
    def coupling(self) -> float:
        """The coupling relative to the mean of A_xx and A_yy, at most, for the neighbours.

        On a half-space (ν/2)/(1 - ν/2), by which eigenvalues of a block diagonal preconditioner
        are off; less where elements are long, 1:8 or more, and no neighbours are on a diagonal.
        """
        offsets = self.cells.offsets
        return float(np.abs(self.at(0, 1, offsets) / self.cells.at(offsets)).max())

    @cached_property
    def steps(self) -> Array:
        """From an unknown of either component to those that its row of G sees, shape (2, K)."""
        own = self.cells.steps
        other = own[self.others]
        return np.array([[*own, *(other + self.size)], [*own, *(other - self.size)]])

    def at(self, a: Any, b: Any, k: Array) -> Array:
        """Return T between components a and b at lags of shape (..., 2), as `Stencil.at`."""
        n1, n2 = self.T.shape[2:]
        i, j = k[..., 0], k[..., 1]
        value = self.T[a, b, np.minimum(np.abs(i), n1 - 1), np.minimum(np.abs(j), n2 - 1)]
        return np.asarray(np.where(np.equal(a, b), value, np.sign(i) * np.sign(j) * value))

    def matrix(self, component: Array, cell: Array) -> Array:
        """Return A among cells, of shape (m, 2), of these components."""
        return self.at(component[:, None], component, cell[:, None] - cell)

    @cached_property
    def own(self) -> tuple[Array, Array]:
        """A of either component among the cells of one window."""
        window = self.cells.window_cells
        lags = window[:, None] - window
        return self.at(0, 0, lags), self.at(1, 1, lags)

    @cached_property
    def near(self) -> tuple[Seen, Seen]:
        """The matrix of a row's cells less τ within a component, for rows of either."""
        offsets = self.cells.offsets
        cells = np.concatenate([offsets, offsets[self.others]])
        result = []
        for a in (0, 1):
            component = np.repeat([a, 1 - a], [len(offsets), len(self.others)])
            S = self.matrix(component, cells)
            S -= self.cells.far * np.equal.outer(component, component)
            np.fill_diagonal(S, self.T[a, a, 0, 0] - self.cells.far)  # `rows_of_G` adds d
            result.append(Seen(self.T[a, a], S))
        return result[0], result[1]

    def rows(self, a: int, c: Array, d: Array) -> Array:
        """Return rows of G in component a, as `rows_of_G`, which of a stencil takes these two."""
        return rows_of_G(self.near[a], c, d)

    @cached_property
    def diagonal(self) -> Array:
        """The diagonal of A among the cells of a row of G, for rows of either component."""
        own, other = len(self.cells.steps), len(self.others)
        return np.stack([np.repeat(z, [own, other]) for z in (self.zero, self.zero[::-1])])

    @cached_property
    def full_load(self) -> tuple[Array, Array]:
        """The load of an aggregate of either component in full contact, on its window."""
        w = np.full((AGGREGATE, 1), AGGREGATE**-0.5)
        loads = []
        for a in (0, 1):
            d = self.diagonal[a][:, None]
            row = self.rows(a, np.ones(d.shape), d)[: len(self.cells.steps)]
            index = np.zeros((AGGREGATE, 1), int)
            loads.append(block_loads(self.cells, row, index, w).ravel())
            check("the load of an aggregate is", float(loads[a].sum()), self.cells)
        return loads[0], loads[1]

    @cached_property
    def coarser(self) -> "CoupledStencil":
        """The same for E, whose coefficients are those of aggregates in full contact."""
        cells, load = self.cells, self.full_load
        T = self.T
        for axis, (m, h) in enumerate(zip(cells.blocks, cells.block, strict=True)):
            T = averaged(T, axis + 2, m, h)
        total = np.array([load[0].sum(), load[1].sum()])
        T = total[:, None, None, None] * total[:, None, None] * T
        first, second = np.array(cells.window_shape) - 1
        lags = np.indices((2 * first + 1, 2 * second + 1)).reshape(2, -1).T - (first, second)
        cell = cells.window_cells @ (2 * second + 1, 1)
        between = (cell[:, None] - cell + len(lags) // 2).ravel()
        near = np.indices([min(m, EXACT) for m in cells.blocks]).reshape(2, -1).T
        shifted = (near * cells.block)[:, None] + lags
        for a, b in ((0, 0), (0, 1), (1, 1)):
            products = np.bincount(between, np.outer(load[a], load[b]).ravel(), len(lags))
            one = products.reshape(2 * first + 1, 2 * second + 1)
            both = one + one[::-1]  # of lags in either axis: even or odd, as A
            T[a, b, *near.T] = self.at(a, b, shifted) @ (both + both[:, ::-1]).ravel() / 4.0
        T[0, 1, 0], T[0, 1, :, 0] = 0.0, 0.0  # odd
        T[1, 0] = T[0, 1]
        return CoupledStencil(T, COARSE)


def strongly_coupled(A: CoupledOperator) -> CoupledStencil | None:
    """Return the kernel, if it is of this kind: two components, coupled as on a half-space.

    Each of them must be one for which few neighbours are enough.
    """
    x, y = (row[i] for i, row in enumerate(A.blocks[:2])) if len(A.blocks) == 2 else (None, None)
    xy = A.blocks[0][-1]
    if x is None or y is None or xy is None or not A.is_symmetric or len(x.grid_shape) != 2:
        return None
    between = xy.lags
    odd = all(np.array_equal(between, -np.flip(between, axis)) for axis in (0, 1))
    if not (x.is_even and y.is_even and odd):
        return None
    n1, n2 = x.grid_shape
    between = between[n1 - 1 :, n2 - 1 :]
    stencil = CoupledStencil(np.array([[x.c, between], [between, y.c]], np.float64))
    if not STRONG < stencil.coupling < STRONGEST:
        return None
    try:
        enough = [Stencils(component).sufficient.neighbours for component in (x.c, y.c)]
    except np.linalg.LinAlgError:
        return None  # which is what it says of the component by itself
    return stencil if enough == [NEIGHBOURS, NEIGHBOURS] else None
