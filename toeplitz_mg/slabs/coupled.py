"""Toeplitz matrices that couple the components of a field on slabs."""

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.operators import coupled
from toeplitz_mg.operators.coupled import asymmetries, read_blocks, symmetrise
from toeplitz_mg.slabs.operators import SlabOperator, ToeplitzOperator
from toeplitz_mg.slabs.product import SlabProduct
from toeplitz_mg.slabs.slab import Slab
from toeplitz_mg.values import refuse_mixed


class CoupledOperator(SlabOperator):
    """A matrix of Toeplitz blocks, which couple the components of a field on one grid.

    The vectors hold this rank's rows of one component after the other.

    Parameters
    ----------
    blocks : sequence of sequences of ToeplitzOperator or None
        ``blocks[i][j]`` maps component j of the vector to component i of the result; None is a zero
        block. All blocks live on one slab.

    See Also
    --------
    toeplitz_mg.CoupledOperator : the operator for one process. Errors of one rank are raised on
        all.
    """

    def __init__(self, blocks: Sequence[Sequence[ToeplitzOperator | None]]) -> None:
        slab = _find_slab(blocks)
        if slab is None:
            raise TypeError(
                f"blocks is {blocks!r}, but must have rows of ToeplitzOperator of "
                "toeplitz_mg.slabs, or None, such as [[xx, xy], [xy, yy]]"
            )
        with slab.agree() as same:
            rows = read_blocks(blocks, _check_block)
            given = [block for row in rows for block in row if block is not None]
            same["which blocks there are"] = [[b is not None for b in row] for row in rows]
            same["the dtypes of the blocks"] = [block.dtype.name for block in given]
            same["which blocks are one operator"] = [given.index(block) for block in given]
        dtype = np.result_type(*(block.dtype for block in given))
        # The preconditioner of a block has the precision of the block.
        cast_rows = [[block and block.astype(dtype) for block in row] for row in rows]
        cast_rows, self.is_symmetric = symmetrise(cast_rows, dtype, Transposes())
        self.blocks = tuple(map(tuple, cast_rows))
        library = given[0].library
        super().__init__(slab, dtype, (len(rows), *slab.local), library=library)
        spectra = [[block and block.spectrum for block in row] for row in self.blocks]
        self.product = SlabProduct(slab, library, spectra, self.dtype)

    def _cast(self, dtype: np.dtype[Any]) -> "CoupledOperator":
        return CoupledOperator(
            [[block and block.astype(dtype) for block in row] for row in self.blocks]
        )

    def check_symmetric(self) -> None:
        """Raise a ValueError if it is not symmetric, or a diagonal block is zero."""
        for i, row in enumerate(self.blocks):
            if row[i] is None:
                raise ValueError(f"the diagonal block of component {i} is zero, but must not be")
        if not self.is_symmetric:
            shares = asymmetries(self.blocks, Transposes())
            i, j = max(shares, key=shares.__getitem__)
            raise ValueError(
                f"A is not symmetric: its blocks ({i}, {j}) and ({j}, {i}) are not each other's "
                "transpose"
            )

    def __repr__(self) -> str:
        return f"<CoupledOperator of {len(self.blocks)} components {self.slab.name}, {self.dtype}>"


def _find_slab(blocks: Any) -> Slab | None:
    """Return the slab of some block, which lets the ranks agree about the other blocks."""
    if isinstance(blocks, ToeplitzOperator):
        return blocks.slab
    parts = blocks if isinstance(blocks, Sequence) and not isinstance(blocks, str) else ()
    return next((slab for part in parts if (slab := _find_slab(part)) is not None), None)


def _check_block(name: str, block: Any, first: Any) -> None:
    if not isinstance(block, ToeplitzOperator):
        raise TypeError(
            f"{name} is of type {type(block).__name__}, but must be a ToeplitzOperator of "
            "toeplitz_mg.slabs, or None"
        )
    if block.slab is not first.slab:
        raise ValueError("the blocks live on several slabs, but must live on one")
    if block.library is not first.library:
        refuse_mixed(name, block.library.name, first.library.name)


class Transposes(coupled.Transposes):
    """Compares blocks (i, j) with the transposes of the blocks (j, i), on all ranks."""

    def difference(self, block: ToeplitzOperator, other: ToeplitzOperator) -> float:
        """Return the largest difference between a block and the transpose of another."""
        is_alike = block.parity[1:] == other.parity[1:]
        return super().difference(block, other) if is_alike else np.inf

    def _lags(self, block: ToeplitzOperator) -> Array:
        return np.stack([block.c, block.opposite])

    def _mirror(self, block: ToeplitzOperator) -> Array:
        return self._lags(block)[::-1]

    def _largest(self, block: ToeplitzOperator, lags: Array) -> float:
        return float(block.slab.vectors.max(np.abs(lags)))

    def _make(self, block: ToeplitzOperator, lags: Array) -> tuple[Any, Any]:
        signs, make = block.parity[1:], block.library.from_numpy
        means = []
        for c, opposite in (lags, lags[::-1]):
            behind = prod(signs) * opposite
            # Find out whether a mean is even or odd along the first axis, as most blocks are.
            sign = next((k for k in (1, -1) if not block.slab.vectors.count(behind != k * c)), 0)
            other = None if sign else make(behind)
            parity = (sign or 1, *signs)
            means.append(ToeplitzOperator(make(c), block.slab, parity=parity, behind=other))
        return means[0], means[1]
