"""Preconditioners on slabs that a cosine or sine transform diagonalises."""

from functools import partial
from math import prod
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.work import axes_of, count_transforms, count_work
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.preconditioners.trigonometric import take_eigenvalues
from toeplitz_mg.slabs.line import LongTransform
from toeplitz_mg.slabs.operators import SlabOperator, ToeplitzOperator
from toeplitz_mg.slabs.structure import ROBUST, restricted
from toeplitz_mg.slabs.symbol import GridSymbol, sum_line


class DiagonalisedGrid(SlabOperator):
    """The inverse of the matrix that a transform diagonalises, with samples of the symbol of A.

    Parameters
    ----------
    A : ToeplitzOperator
    dtype : float32 or float64
    first : {0, 1}
        The number of the first sample along each axis: 0 for the cosine, 1 for the sine transform.
    """

    def __init__(self, A: ToeplitzOperator, dtype: np.dtype[Any], first: int) -> None:
        slab, library = A.slab, A.library
        super().__init__(slab, dtype, slab.local, library=library)
        self._transforms = (library.cosine, library.sine)[first]
        self._lengths = tuple(map(near_fast_length, slab.shape))
        count_transforms(1, *slab.local)

        def sample(first: int) -> Array:
            numbers = [range(first, first + n) for n in self._lengths]
            symbol = GridSymbol(slab, [2 * n for n in self._lengths], numbers)
            return symbol.sample(A.c.astype(np.float64), A.parity, is_continued=True)

        samples = take_eigenvalues(sample, first, dtype, slab.vectors, ROBUST)
        inverse = np.reciprocal(samples, out=samples).astype(dtype, copy=False)
        self._inverse = library.from_numpy(inverse)

    def multiply(self, x: Any, y: Any) -> Any:
        """Multiply a vector into another, which may be the same; return the result."""
        slab, library, lengths = self.slab, self.library, self._lengths
        count_work(1, prod(x.shape) / 2 ** axes_of(slab.shape))
        forward, backward = self._transforms
        local_axes = tuple(range(1, len(lengths)))
        Z = library.enlarge(library.xp.reshape(x, slab.local), lengths[1:], self.dtype)
        rows = library.to_numpy(forward(Z, axes=local_axes, **library.in_place))
        rows = rows if rows.flags.writeable else rows.copy()
        for own, turn in slab.turns_of(lengths, rows.itemsize):
            host = workspace((*lengths[:-1], own.stop - own.start), self.dtype)
            slab.to_columns(rows, turn, host[: slab.shape[0]])
            host[slab.shape[0] :] = 0.0
            C = forward(library.from_numpy(host), axes=(0,), **library.in_place)
            C *= self._inverse[..., own]
            C = library.to_numpy(backward(C, axes=(0,), **library.in_place))
            slab.to_rows(C[: slab.shape[0]], rows, turn)
        Z = backward(library.from_numpy(rows), axes=local_axes, **library.in_place)
        result = library.xp.reshape(Z[tuple(slice(n) for n in slab.local)], x.shape)
        if y is None:
            return result
        y[...] = result
        return y


class DiagonalisedLine(SlabOperator):
    """The same on one axis, by transforms of zero-padded vectors.

    With w = exp(-iθ/2) at the frequencies θ = πk/n, the real part of w times the transform of x is
    the cosine sum of x at the points j + 1/2, and the imaginary part its sine sum. Arrays of other
    libraries than NumPy are processed in the memory of the processor.
    """

    def __init__(self, A: ToeplitzOperator, dtype: np.dtype[Any], first: int) -> None:
        slab, n = A.slab, prod(A.slab.shape)
        super().__init__(slab, dtype, slab.local, library=A.library)
        self._first, half = first, near_fast_length(n)
        c = sum_line(slab, A.c.ravel().astype(np.float64, copy=False), half)
        of_samples = LongTransform(slab, half + 1, 2 * half)
        samples, k = of_samples.sums(c), of_samples.numbers

        def sample(first: int) -> Array:
            # Count one of two frequencies with the same sample.
            is_last = k == half * (1 - first)
            return samples[~is_last & ((k <= half) | ~of_samples.have_both)]

        least = slab.vectors.min(take_eigenvalues(sample, first, dtype, slab.vectors, ROBUST))
        self._inverse = (2.0 / np.maximum(samples, least)).astype(dtype)
        self._w = np.exp(-0.5j * np.pi / half * k).astype(dtype.char.upper())
        self._transform = LongTransform(slab, n, 2 * half, dtype)

    def multiply(self, x: Any, y: Any) -> Any:
        """Multiply a vector into another, which may be the same; return the result."""
        count_work(1, prod(x.shape) / 2)
        U = self._transform.forward(self.library.to_numpy(x))
        U *= self._w
        (U.real if self._first else U.imag)[...] = 0.0
        U *= self._inverse
        U *= self._w.conj()
        result = self.library.from_numpy(self._transform.backward(U))
        return self.library.join([result], y)


def _diagonalise(A: ToeplitzOperator, dtype: np.dtype[Any], first: int) -> SlabOperator:
    return (DiagonalisedLine if A.slab.is_line else DiagonalisedGrid)(A, dtype, first)


cosine_preconditioner = restricted("cosine_preconditioner", partial(_diagonalise, first=0))
sine_preconditioner = restricted("sine_preconditioner", partial(_diagonalise, first=1))
