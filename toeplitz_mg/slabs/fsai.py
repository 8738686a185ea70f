"""The multilevel sparse approximate inverse of a matrix on slabs."""

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.operators.base import require_numpy
from toeplitz_mg.operators.positivity import precision
from toeplitz_mg.preconditioners.fsai.build import Options
from toeplitz_mg.preconditioners.fsai.coupled import select_coupled_stencil
from toeplitz_mg.preconditioners.fsai.neighbours import choose_stencil
from toeplitz_mg.preconditioners.fsai.preconditioner import check_neighbours
from toeplitz_mg.preconditioners.fsai.rows import advise
from toeplitz_mg.slabs.coupled import CoupledOperator
from toeplitz_mg.slabs.fsai_levels import (
    CommonLevel,
    SlabLevel,
    SlabMatrix,
    build_on_slab,
    find_near,
)
from toeplitz_mg.slabs.operators import SlabOperator, ToeplitzOperator
from toeplitz_mg.slabs.slab import Slab
from toeplitz_mg.slabs.structure import unwrap

Blocks = Sequence[Sequence[Any]]  # ToeplitzOperator or None.

INSTEAD = (
    "try cosine_preconditioner(A), on a mask sine_preconditioner(A), and if these are refused "
    "use fft_preconditioner(A), or cg without M"
)
OTHERS = "fft, cosine and sine of toeplitz_mg.slabs"  # They support arrays of any library.
REPEATED = 1 / 64  # Most cells of a level built on every rank, in total, relative to the grid.


class SlabSparseInverse(SlabOperator):
    """P = Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G ≈ A⁻¹ on slabs, returned by `fsai_preconditioner`.

    Attributes
    ----------
    sizes : tuple of tuples of int
        The number of unknowns on each level, on all ranks, for all components or for each.
    """

    def __init__(
        self,
        levels: list[SlabLevel | CommonLevel],
        counts: list[int],
        slab: Slab,
        dtype: DTypeLike,
        grid_shape: tuple[int, ...],
    ) -> None:
        super().__init__(slab, dtype, grid_shape, sum(counts))
        self.sizes = tuple(level.sizes for level in levels)
        self._levels, self._ends = levels, np.cumsum([0, *counts])

    def multiply(self, x: Array, y: Array) -> None:
        """Multiply a vector into another, which may be the same."""
        for k, level in enumerate(self._levels):
            part = slice(*self._ends[k : k + 2])
            own = x[part].astype(self.dtype, copy=False)
            if y.dtype == self.dtype:
                level(own, y[part])
            else:
                y[part] = level(own)

    def __repr__(self) -> str:
        sizes = ", ".join(" > ".join(map(str, sizes)) for sizes in self.sizes)
        return f"<SlabSparseInverse {sizes} (direct) on {self.slab!r}, {self.dtype}>"


def fsai_preconditioner(
    A: Any, *, neighbours: int | None = None, dtype: DTypeLike | None = None
) -> SlabSparseInverse:
    """Return a multilevel sparse approximate inverse of A, efficient on fragmented masks.

    It is that of `toeplitz_mg.fsai_preconditioner`. Neighbouring ranks exchange a few rows, while
    the other preconditioners exchange the whole grid.

    Parameters
    ----------
    A : ToeplitzOperator or CoupledOperator of `toeplitz_mg.slabs`, or MaskedOperator of one
        Symmetric positive definite, of one or two axes (not counting axes of one element), and
        symmetric along each of them.
    neighbours : int, optional
        Number of preceding cells that a row of the factor G uses, 1 to 100, the same on all ranks.
    dtype : float32 or float64, optional
        Precision in which it is stored and applied; by default that of `A`.

    Returns
    -------
    SlabSparseInverse
        This rank's rows of a symmetric positive definite operator, for `toeplitz_mg.cg`.

    Raises
    ------
    numpy.linalg.LinAlgError, ValueError, TypeError
        On all ranks, as for `toeplitz_mg.fsai_preconditioner`; also for arrays of other libraries
        than NumPy.

    See Also
    --------
    toeplitz_mg.fsai_preconditioner : when to use it, and how it is built.
    """
    full = unwrap(A)
    slab, blocks = full.slab, full.blocks
    with slab.agree() as same:
        same["the preconditioner"], same["A"] = "fsai_preconditioner", A.kind
        require_numpy(full, "fsai_preconditioner on slabs", OTHERS)
        options = Options(check_neighbours(neighbours))
        same["neighbours"] = options.neighbours
    dtype = precision(full, dtype)
    _require_symmetric(full, blocks)
    mask = np.ones(full.grid_shape, bool) if A is full else A.mask
    most = REPEATED * prod(slab.shape) / slab.comm.size
    with advise(INSTEAD):
        joint = None if options.neighbours else _joint(blocks, mask)
        each = mask.reshape(len(blocks), -1)
        parts = [(joint, options)] if joint else _separate(blocks, each, options)
        levels = [build_on_slab(*part, dtype, most) for part in parts]
    counts = [int(np.count_nonzero(part.c)) for part, _ in parts]
    return SlabSparseInverse(levels, counts, slab, dtype, full.grid_shape)


def _require_symmetric(full: SlabOperator, blocks: Blocks) -> None:
    """Raise a ValueError unless A is symmetric and its diagonal blocks are even in each axis."""
    if sum(n > 1 for n in full.slab.shape) > 2:
        raise ValueError(
            f"A lives on the grid {full.slab.shape}, but must have one axis or two: use "
            "fft_preconditioner(A)"
        )
    for i, row in enumerate(blocks):
        if row[i] is not None and not row[i].is_even:
            raise ValueError(f"the block ({i}, {i}) of A is not symmetric along each axis")
    if isinstance(full, CoupledOperator):
        full.check_symmetric()


def _kernel(A: ToeplitzOperator) -> Array:
    """Return this rank's rows of the coefficients of one component, in two axes."""
    return A.c.reshape(1, 1, *_rows(A.slab)[1]).astype(np.float64, copy=False)


def _rows(slab: Slab) -> tuple[Array, tuple[int, int]]:
    """Return the first row of each rank, and this rank's shape, as a grid of two axes.

    Axes of one element do not count. If the first axis has one element, this rank has everything.
    """
    n1, *others = slab.shape
    n2 = prod(others)
    if n1 > 1:
        return slab.starts, (slab.local[0], n2)
    n1 = next((n for n in others if 1 < n < n2), 1)
    return np.array([0, n1]), (n1, n2 // n1)


def _joint(blocks: Blocks, mask: Array) -> SlabMatrix | None:
    """Return the matrix of two components together if they are strongly coupled, else None."""
    if len(blocks) != 2 or mask.ndim != 3:
        return None
    (x, xy), (_, y) = blocks
    if xy is None or xy.parity != (-1, -1) or xy.behind is not None:
        return None
    slab = x.slab
    near = [find_near(slab, slab.starts, _kernel(A))[0, 0] for A in (x, xy, y)]
    with slab.agree() as same:
        stencil = select_coupled_stencil(np.array([near[:2], near[1:]]))
        same["whether components are coupled strongly"] = stencil is not None
    if stencil is None:
        return None
    kernel = np.array([[x.c, xy.c], [xy.c, y.c]], np.float64)
    return SlabMatrix(slab, slab.starts, stencil, kernel, mask)


def _separate(blocks: Blocks, mask: Array, options: Options) -> list[tuple[SlabMatrix, Options]]:
    """Return the matrix of each component that has unknowns, and its options."""
    matrices = []
    for i, row in enumerate(blocks):
        A, own = row[i], mask[i]
        slab, (starts, shape) = A.slab, _rows(A.slab)
        if not (unknowns := slab.vectors.count(own)):
            continue
        kernel = _kernel(A)
        near = find_near(slab, starts, kernel)
        is_line = 1 in (starts[-1], shape[1])
        with slab.agree() as same:
            is_whole = unknowns == starts[-1] * shape[1]
            stencil, some = choose_stencil(near[0, 0], is_line, unknowns, is_whole, options)
            same["how many neighbours are enough"] = stencil.neighbours
        matrices.append((SlabMatrix(slab, starts, stencil, kernel, own.reshape(1, *shape)), some))
    return matrices
