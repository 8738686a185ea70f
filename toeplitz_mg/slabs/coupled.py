"""M of coupled components on slabs: a small matrix is inverted at each frequency."""

from math import prod
from typing import Any

import numpy as np
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.embedding import around, split
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.library import NUMPY
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.preconditioners.fft import BLOCK_SUBJECT, invert_matrices
from toeplitz_mg.preconditioners.positivity import require_positive
from toeplitz_mg.slabs.line import LongTransform
from toeplitz_mg.slabs.operators import CoupledOperator, ToeplitzOperator
from toeplitz_mg.slabs.product import turns_of
from toeplitz_mg.slabs.slab import Slab

ROBUST = "fsai_preconditioner(A), or cg without M"
Parity = tuple[int, ...]  # Along each axis: 1 of even coefficients, -1 of odd ones.


class GridSymbol:
    """The symbols of blocks on a grid, at the frequencies of which this rank has columns."""

    def __init__(self, slab: Slab) -> None:
        self.slab = slab
        self._lengths = tuple(near_fast_length(2 * n - 1) for n in slab.shape)
        *others, last = self._lengths
        self._columns = (*others, last // 2 + 1)  # Those of other frequencies are conjugate.

    def sample(self, c: Array, parity: Parity) -> Array:
        """Return the symbol of a block."""
        for axis in reversed(range(1, c.ndim)):
            ahead, behind = split(NUMPY, c, axis, parity[axis])
            c = around(NUMPY, ahead, behind, axis, self._lengths[axis], is_straight=True)
            c = (fft.rfft if axis == c.ndim - 1 else fft.fft)(c, axis=axis)
        own = self.slab.columns(self._columns[-1])
        S = np.empty((*self._columns[:-1], own.stop - own.start), complex)
        for turn in turns_of(self.slab, self._columns, S.itemsize):
            a, b = turn[self.slab.comm.rank]
            ahead, behind = split(NUMPY, self.slab.to_columns(c, turn), 0, parity[0])
            column = around(NUMPY, ahead, behind, 0, self._lengths[0], is_straight=True)
            S[..., a - own.start : b - own.start] = fft.fft(column, axis=0, overwrite_x=True)
        return S

    def lags(self, S: Array) -> Array:
        """Return this rank's rows of the coefficients of the lags that are not negative."""
        slab, own = self.slab, self.slab.columns(self._columns[-1])
        rows = np.empty((slab.local[0], *self._columns[1:]), complex)
        for turn in turns_of(slab, self._columns, rows.itemsize):
            a, b = turn[slab.comm.rank]
            C = fft.ifft(S[..., a - own.start : b - own.start], axis=0)[: slab.shape[0]]
            slab.to_rows(C, rows, turn)
        for axis in range(1, rows.ndim - 1):
            rows = fft.ifft(rows, axis=axis).take(range(slab.shape[axis]), axis)
        return fft.irfft(rows, self._lengths[-1])[..., : slab.shape[-1]]


class LineSymbol:
    """The same on one axis."""

    def __init__(self, slab: Slab) -> None:
        self.slab, self._n = slab, prod(slab.shape)
        self._length = near_fast_length(2 * self._n - 1)
        self._transform = LongTransform(slab, self._length // 2 + 1, self._length)

    def sample(self, c: Array, parity: Parity) -> Array:
        """Return the symbol of a block."""
        sign, c = prod(parity), c.reshape(-1)
        if self.slab.comm.rank == self.slab.comm.size - 1:
            # Straight from the last coefficient to that of the opposite lag.
            ahead = self._length - (2 * self._n - 1)
            t = np.arange(1.0, self._length // 2 - self._n + 2) / (ahead + 1)
            c = np.concatenate([c, c[-1] + t * (sign - 1) * c[-1]])
        return self._transform.sums(c, sign)

    def lags(self, S: Array) -> Array:
        """Return this rank's part of the coefficients of the lags that are not negative."""
        c = self._transform.backward(np.array(S, complex))
        return c[: prod(self.slab.local)].reshape(self.slab.local)


def invert_coupled(A: CoupledOperator, dtype: np.dtype[Any]) -> CoupledOperator:
    """Return the leading block of the inverse of the block circulant that embeds `A`.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where that is not positive definite.
    ValueError
        Where A is not symmetric, the block of a component on itself is zero, or the blocks are
        neither even nor odd along each axis, all components alike.
    """
    A.check_symmetric()
    slab, components = A.slab, range(len(A.blocks))
    signs = _signs(A)
    symbol = (LineSymbol if slab.is_line else GridSymbol)(slab)
    S: list[list[Any]] = [[0.0 for _ in components] for _ in components]
    for i in components:
        for j in range(i + 1):
            if (block := A.blocks[i][j]) is not None:
                count_transforms(1, *(2 * n for n in slab.local))
                S[i][j] = symbol.sample(block.c.astype(np.float64, copy=False), block.parity)
                S[j][i] = S[i][j].conj()
        S[i][i] = S[i][i].real
    extents = []
    with np.errstate(divide="ignore", invalid="ignore"):  # Refused when all pivots are known.
        invert_matrices(S, lambda pivot: extents.append(np.array(slab.extent(pivot))))
    for extent in extents:
        require_positive(extent, dtype, BLOCK_SUBJECT, ROBUST)
    blocks: list[list[ToeplitzOperator | None]] = [[None for _ in components] for _ in components]
    for i in components:
        for j in range(i + 1):
            if np.ndim(S[i][j]) == 0:
                continue  # The block is zero.
            count_transforms(1, *(2 * n for n in slab.local))
            parity = tuple(a * b for a, b in zip(signs[i], signs[j], strict=True))
            c = symbol.lags(S[i][j]).astype(dtype)
            S[i][j] = S[j][i] = 0.0  # It is of no more use, and large.
            for axis in (axis for axis, sign in enumerate(parity) if sign < 0):
                if axis or slab.rows.start == 0:
                    np.moveaxis(c, axis, 0)[0] = 0.0  # But for rounding it is.
            make = A.library.from_numpy
            blocks[i][j] = blocks[j][i] = ToeplitzOperator(make(c), slab, parity=parity)
            if prod(parity) < 0:
                blocks[j][i] = ToeplitzOperator(make(-c), slab, parity=parity)
    return CoupledOperator(blocks)


def _signs(A: CoupledOperator) -> list[Parity]:
    """Return signs of the components, of which the products are the parities of the blocks.

    Then the blocks of the inverse have these parities.
    """
    axes = len(A.slab.shape)
    signs: list[Parity] = [(1,) * axes for _ in A.blocks]
    for i, row in enumerate(A.blocks):
        known = next(((block, signs[j]) for j, block in enumerate(row[:i]) if block), None)
        if known is not None:
            signs[i] = tuple(a * b for a, b in zip(known[0].parity, known[1], strict=True))
    for i, row in enumerate(A.blocks):
        for j, block in enumerate(row):
            parity = tuple(a * b for a, b in zip(signs[i], signs[j], strict=True))
            if block is not None and (block.behind is not None or block.parity != parity):
                raise ValueError(
                    f"the block ({i}, {j}) of A is {block!r} of parity {block.parity}, but for M "
                    "the blocks must be even or odd along each axis, as products of signs of "
                    "their components: use cosine_preconditioner(A) or fsai_preconditioner(A)"
                )
    return signs
