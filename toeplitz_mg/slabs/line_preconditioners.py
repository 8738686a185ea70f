"""M, and what a cosine or sine transform diagonalises, of one axis on slabs: by long transforms."""

from math import prod
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.transforms import LONG
from toeplitz_mg.engine.work import count_work
from toeplitz_mg.preconditioners.positivity import require_positive
from toeplitz_mg.preconditioners.symbol import Tail, continue_axis, tail_length
from toeplitz_mg.preconditioners.trigonometric import lift_lowest
from toeplitz_mg.slabs.coupled import ROBUST
from toeplitz_mg.slabs.line import LongTransform
from toeplitz_mg.slabs.operators import SlabOperator, ToeplitzOperator
from toeplitz_mg.slabs.slab import Slab
from toeplitz_mg.slabs.windows import Windows


def invert_line(A: ToeplitzOperator, dtype: np.dtype[Any]) -> ToeplitzOperator:
    """Return M of one axis."""
    n, known = prod(A.slab.shape), prod(A.slab.local)
    length, c = 2 * n - 1, A.c.ravel().astype(np.float64, copy=False)
    if n >= LONG and near_fast_length(length) != length:
        length = 2 * near_fast_length(n)
        c = _continue_line(A.slab, c, length // 2)
    transform = LongTransform(A.slab, length // 2 + 1, length)
    eigenvalues = transform.sums(c)
    subject = "the embedding of A in a circulant, which M inverts, has the eigenvalue"
    require_positive(np.array(A.slab.extent(eigenvalues)), dtype, subject, ROBUST)
    inverse = transform.backward((1.0 / eigenvalues).astype(complex))[:known]
    rows = inverse.reshape(A.slab.local).astype(dtype)
    return ToeplitzOperator(A.library.from_numpy(rows), A.slab)


def _last_of_line(slab: Slab, c: Array, count: int) -> Array:
    """Return so many of the last coefficients of one axis, on all ranks."""
    ends = slab.starts * (prod(slab.shape) // slab.shape[0])
    first = np.full(slab.comm.size, max(0, ends[-1] - count))
    return Windows(slab, ends, first, np.full(slab.comm.size, ends[-1])).spread(c)


def _continue_line(slab: Slab, c: Array, length: int) -> Array:
    """Continue one axis to the lags 0 … `length`, on the last rank (see `continue_axis`)."""
    last, n = _last_of_line(slab, c, 2), prod(slab.shape)
    if slab.comm.rank < slab.comm.size - 1:
        return c
    return np.concatenate([c, continue_axis(last, 0, length - n + len(last))[len(last) :]])


def _sum_line(slab: Slab, c: Array, length: int) -> Array:
    """Return this rank's part of what `sum_tail` does, or of the coefficients that continue."""
    n = prod(slab.shape)
    last, first = _last_of_line(slab, c, tail_length(n)), slab.gather(c[0])[0]
    if (tail := Tail.of(first, last, n)) is None:
        return _continue_line(slab, c, length)
    start = slab.rows.start * (n // slab.shape[0])
    is_last = slab.comm.rank == slab.comm.size - 1
    lags = np.arange(float(start), length + 1.0 if is_last else start + len(c))
    sums = np.concatenate([c, tail.beyond(lags[len(c) :])]) + tail.of_periods(lags, length)
    around = np.where(
        lags > 0.0, 2.0 * length - lags, 0.0
    )  # Those of the negative lags: of lag 0 they are a period further.
    return sums + np.where(lags > 0.0, tail.beyond(around), 0.0) + tail.of_periods(around, length)


def check_samples(slab: Slab, samples: Array, dtype: np.dtype[Any], name: str) -> Array:
    """Return the samples of a symbol, lifted where that is right, or refuse them."""
    samples = lift_lowest(samples, dtype, slab.vectors)
    subject = f"the symbol of A, which the {name} preconditioner samples, has the value"
    require_positive(np.array(slab.extent(samples)), dtype, subject, ROBUST)
    return samples


class DiagonalisedLine(SlabOperator):
    """What `DiagonalisedOperator` is, on one axis, by transforms of a vector extended by zeros.

    With w = exp(-iθ/2) at the frequencies θ = πk/n, the real parts of w times the transform of x
    are the cosine sums of x at the points j + 1/2, and the imaginary parts its sine sums. On
    other arrays than NumPy's it is applied in the memory of the processor.
    """

    def __init__(self, A: ToeplitzOperator, dtype: np.dtype[Any], first: int, name: str) -> None:
        slab, n = A.slab, prod(A.slab.shape)
        super().__init__(slab, dtype, slab.local, library=A.library)
        self._first, self._name, half = first, name, near_fast_length(n)
        c = _sum_line(slab, A.c.ravel().astype(np.float64, copy=False), half)
        of_samples = LongTransform(slab, half + 1, 2 * half)
        samples, k = of_samples.sums(c), of_samples.numbers
        # Of two frequencies with the same sample one counts.
        is_sampled = (k != half * (1 - first)) & ((k <= half) | ~of_samples.have_both)
        checked = check_samples(slab, samples[is_sampled], dtype, name)
        self._inverse = (2.0 / np.maximum(samples, slab.vectors.min(checked))).astype(dtype)
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

    def __repr__(self) -> str:
        return f"<DiagonalisedLine by the {self._name} transform on {self.slab!r}, {self.dtype}>"
