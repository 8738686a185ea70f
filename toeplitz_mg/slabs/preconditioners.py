"""M, and what a cosine or sine transform diagonalises, on slabs: the same transforms, by axis."""

from collections.abc import Callable
from functools import partial, wraps
from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy import fft

from toeplitz_mg import operators
from toeplitz_mg._typing import Array
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.transforms import LONG
from toeplitz_mg.engine.work import axes_of, count_transforms, count_work
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.operators.coefficients import check_precision
from toeplitz_mg.preconditioners.positivity import require_positive, require_range
from toeplitz_mg.preconditioners.symbol import continue_axis
from toeplitz_mg.slabs.coupled import ROBUST, invert_coupled
from toeplitz_mg.slabs.line_preconditioners import DiagonalisedLine, check_samples, invert_line
from toeplitz_mg.slabs.operators import (
    CoupledOperator,
    MaskedOperator,
    SlabOperator,
    ToeplitzOperator,
)
from toeplitz_mg.slabs.product import turns_of
from toeplitz_mg.slabs.slab import Slab

Make = Callable[[ToeplitzOperator, np.dtype[Any]], SlabOperator]


def restricted(make: Make, of_coupled: Any = None) -> Callable[..., SlabOperator]:
    """Return the preconditioner that takes masks and components too.

    Parameters
    ----------
    make : callable
        A function of an even `ToeplitzOperator` and of the precision of the result. On a mask the
        preconditioner is the restriction of that of the whole grid; of coupled components it
        treats each by itself.
    of_coupled : callable, optional
        The function of a `CoupledOperator` in the place of that.
    """

    @wraps(make)
    def preconditioner(A: SlabOperator, *, dtype: DTypeLike | None = None) -> SlabOperator:
        full: Any = A.full if isinstance(A, MaskedOperator) else A
        if not isinstance(full, ToeplitzOperator | CoupledOperator):
            raise TypeError(
                f"A is a {type(A).__name__}, but must be a ToeplitzOperator or a CoupledOperator "
                "of toeplitz_mg.slabs, or a MaskedOperator of one"
            )
        if isinstance(full, CoupledOperator) and of_coupled is not None:
            M: SlabOperator = of_coupled(full, _precision(full, dtype))
        elif isinstance(full, CoupledOperator):
            parts = [row[i] for i, row in enumerate(full.blocks)]
            M = BlockDiagonal([_make(make, part, dtype) for part in parts])
        else:
            M = _make(make, full, dtype)
        return MaskedOperator(M, A.mask) if isinstance(A, MaskedOperator) else M

    return preconditioner


def _make(make: Make, A: ToeplitzOperator | None, dtype: DTypeLike | None) -> SlabOperator:
    if A is None or not A.is_even:
        raise ValueError(f"A, or a component's block on itself, is {A!r}, but must be even")
    return make(A, _precision(A, dtype))


def _precision(A: Any, dtype: DTypeLike | None) -> np.dtype[Any]:
    """Return the precision of a preconditioner of A (see `positivity.precision`)."""
    with A.slab.agree() as same:
        same["dtype"] = precision = check_precision(A.dtype if dtype is None else dtype, A.dtype)
    blocks = A.blocks if isinstance(A, CoupledOperator) else ((A,),)
    for block in (row[i] for i, row in enumerate(blocks)):
        if block is not None:
            # Rank 0 has the diagonal.
            require_range(abs(A.slab.gather(block.c.flat[0])[0]), precision)
    return precision


@partial(restricted, of_coupled=invert_coupled)
def fft_preconditioner(A: ToeplitzOperator, dtype: np.dtype[Any]) -> SlabOperator:
    """Return M, the paper's FFT preconditioner (see `toeplitz_mg.fft_preconditioner`).

    Parameters
    ----------
    A : ToeplitzOperator or CoupledOperator of this package, or MaskedOperator of one
        Even along each axis; of coupled components symmetric, its blocks even or odd. Cosine and
        sine transforms treat each component by itself.
    dtype : float32 or float64, optional
        The precision in which it is kept and applied, that of `A` by default.

    Returns
    -------
    SlabOperator
        M ≈ A⁻¹, symmetric positive definite.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where an eigenvalue of the embedding in a circulant is not positive, on all ranks.
    TypeError, ValueError
        Where `A` is no Toeplitz operator on a slab, or not even.

    See Also
    --------
    toeplitz_mg.fft_preconditioner : the same on one machine.
    """
    slab, shape = A.slab, A.slab.shape
    if slab.is_line:
        return invert_line(A, dtype)
    is_fast = all(near_fast_length(2 * n - 1) == 2 * n - 1 for n in shape)
    is_exact = is_fast or prod(shape) < LONG

    lengths = tuple(map(near_fast_length, shape))

    def forward(x: Array, axis: int) -> Array:
        if is_exact:
            mirror = np.flip(x, axis).take(range(shape[axis] - 1), axis)
            return fft.rfft(np.concatenate([x, mirror], axis), axis=axis).real
        # The rows are complete.
        x = continue_axis(x, axis, lengths[axis]) if axis else x
        return fft.dct(x, type=1, axis=axis)

    def backward(f: Array, axis: int) -> Array:
        n = shape[axis]
        x = fft.irfft(f, 2 * n - 1, axis) if is_exact else fft.idct(f, type=1, axis=axis)
        return x.take(range(n), axis)

    count_transforms(2, *(2 * n for n in slab.local))
    ahead, rows = (slab, A.c.astype(np.float64)) if is_exact else _continue_rows(A, lengths[0])
    for axis in range(1, rows.ndim):
        rows = forward(rows, axis)
    low, high = np.inf, -np.inf
    for turn in turns_of(slab, rows.shape, 4 * rows.itemsize):
        f = forward(ahead.to_columns(rows, turn), 0)
        low, high = min(low, f.min(initial=np.inf)), max(high, f.max(initial=-np.inf))
        with np.errstate(divide="ignore"):  # What is not positive is refused, when all is known.
            inverse = backward(np.reciprocal(f, out=f), 0)
        slab.to_rows(inverse, rows[: slab.local[0]], turn)
    low, high = min(slab.gather(low)), max(slab.gather(high))
    subject = "the embedding of A in a circulant, which M inverts, has the eigenvalue"
    require_positive(np.array([low, high]), dtype, subject, ROBUST)
    rows = rows[: slab.local[0]]
    for axis in reversed(range(1, rows.ndim)):
        rows = backward(rows, axis)
    return ToeplitzOperator(A.library.from_numpy(rows.astype(dtype)), slab)


def _continue_rows(A: ToeplitzOperator, length: int) -> tuple[Slab, Array]:
    """Continue the first axis of A's coefficients to the lags 0 … `length`, on the last rank.

    It is the first axis to be continued, as `continue_axis` does not do the same after a transform.
    """
    slab, c = A.slab, A.c.astype(np.float64)
    last = slab.with_rows_above(c, 1)[-2:]
    if slab.comm.rank == slab.comm.size - 1:
        more = continue_axis(last, 0, length - slab.shape[0] + len(last))[len(last) :]
        c = np.concatenate([c, more])
    return slab.longer(length + 1), c


@restricted
def cosine_preconditioner(A: ToeplitzOperator, dtype: np.dtype[Any]) -> SlabOperator:
    """Return the inverse of a DCT-II matrix (see `toeplitz_mg.cosine_preconditioner`).

    Parameters, results and errors are those of `fft_preconditioner`. It moves half the bytes.

    See Also
    --------
    toeplitz_mg.cosine_preconditioner : the same on one machine.
    """
    return (DiagonalisedLine if A.slab.is_line else DiagonalisedOperator)(A, dtype, 0, "cosine")


@restricted
def sine_preconditioner(A: ToeplitzOperator, dtype: np.dtype[Any]) -> SlabOperator:
    """Return the inverse of a DST-II matrix (see `toeplitz_mg.sine_preconditioner`).

    Parameters, results and errors are those of `fft_preconditioner`. It moves half the bytes.

    See Also
    --------
    toeplitz_mg.sine_preconditioner : the same on one machine.
    """
    return (DiagonalisedLine if A.slab.is_line else DiagonalisedOperator)(A, dtype, 1, "sine")


class DiagonalisedOperator(SlabOperator):
    """The inverse of the matrix that a transform diagonalises, with samples of the symbol of A.

    Parameters
    ----------
    A : ToeplitzOperator
    dtype : float32 or float64
    first : {0, 1}
        The number of the first sample along each axis.
    name : str
        That of the transform.
    """

    def __init__(
        self,
        A: ToeplitzOperator,
        dtype: np.dtype[Any],
        first: int,
        name: str,
    ) -> None:
        slab, library = A.slab, A.library
        super().__init__(slab, dtype, slab.local, library=library)
        self._transforms, self._name = library.sine if first else library.cosine, name
        self._lengths = tuple(map(near_fast_length, slab.shape))
        count_transforms(1, *slab.local)
        ahead, rows = _continue_rows(A, self._lengths[0])
        for axis in range(1, rows.ndim):
            rows = self._sample(rows, axis, first)
        own = slab.columns(rows.shape[-1])
        samples = np.empty((*self._lengths[:-1], own.stop - own.start))
        for turn in turns_of(slab, self._lengths, 2 * rows.itemsize):
            a, b = turn[slab.comm.rank]
            samples[..., a - own.start : b - own.start] = self._sample(
                ahead.to_columns(rows, turn), 0, first
            )
        samples = check_samples(slab, samples, dtype, name)
        inverse = np.reciprocal(samples, out=samples).astype(dtype, copy=False)
        self._inverse = library.from_numpy(inverse)

    def _sample(self, x: Array, axis: int, first: int) -> Array:
        """Sample the symbol along an axis, of coefficients that are known as far as x goes."""
        length = self._lengths[axis]
        x = continue_axis(x, axis, length) if axis else x
        return fft.dct(x, type=1, axis=axis).take(range(first, first + length), axis)

    def multiply(self, x: Any, y: Any) -> Any:
        """Multiply a vector into another, which may be the same; return the result."""
        slab, library, lengths = self.slab, self.library, self._lengths
        count_work(1, prod(x.shape) / 2 ** axes_of(slab.shape))
        forward, backward = self._transforms
        local_axes = tuple(range(1, len(lengths)))
        Z = library.enlarge(library.xp.reshape(x, slab.local), lengths[1:], self.dtype)
        rows = library.to_numpy(forward(Z, axes=local_axes, **library.in_place))
        rows = rows if rows.flags.writeable else rows.copy()
        start = 0
        for turn in turns_of(slab, lengths, rows.itemsize):
            a, b = turn[slab.comm.rank]
            host = workspace((*lengths[:-1], b - a), self.dtype)
            slab.to_columns(rows, turn, host[: slab.shape[0]])
            host[slab.shape[0] :] = 0.0
            C = forward(library.from_numpy(host), axes=(0,), **library.in_place)
            C *= self._inverse[..., start : start + b - a]
            C = library.to_numpy(backward(C, axes=(0,), **library.in_place))
            slab.to_rows(C[: slab.shape[0]], rows, turn)
            start += b - a
        Z = backward(library.from_numpy(rows), axes=local_axes, **library.in_place)
        result = library.xp.reshape(Z[tuple(slice(n) for n in slab.local)], x.shape)
        if y is None:
            return result
        y[...] = result
        return y

    def __repr__(self) -> str:
        return (
            f"<DiagonalisedOperator by the {self._name} transform on {self.slab!r}, {self.dtype}>"
        )


class BlockDiagonal(SlabOperator):
    """Matrices of the components of a field, each of which acts on its own component."""

    def __init__(self, blocks: list[SlabOperator]) -> None:
        slab, dtype = blocks[0].slab, np.result_type(*(block.dtype for block in blocks))
        super().__init__(slab, dtype, (len(blocks), *slab.local), library=blocks[0].library)
        self.blocks = blocks

    apply = operators.BlockDiagonal.apply

    def __repr__(self) -> str:
        return f"<BlockDiagonal of {self.blocks!r}>"
