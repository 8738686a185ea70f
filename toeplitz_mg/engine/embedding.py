"""The eigenvalues of the matrix in which a product embeds a Toeplitz matrix, axis by axis.

The last axis is transformed at the frequencies k + 1/4 (see `products.ToeplitzProduct`), or at the
frequencies k if the matrix is complex. For each frequency, a Toeplitz matrix on the other axes
remains, which is embedded in a circulant. The frequencies are independent, so that they can be
processed in parts or by several processes. The arrays may belong to any library.
"""

from math import pi, prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg.engine.lengths import embedding_lengths
from toeplitz_mg.engine.work import count_transforms

PARTS = 8  # Most parts in which frequencies are processed: only one part is padded at a time.
LEAST = 2**22  # Fewest numbers in a part, padding included: less work is too little for a GPU.


def cut(axis: int, start: int, stop: int | None = None, step: int = 1) -> Any:
    """Return the index that slices an array along an axis."""
    return (*[slice(None)] * axis, slice(start, stop, step), ...)


def zeros(library: Any, array: Any, axis: int, length: int) -> Any:
    """Return zeros with the shape and dtype of an array, except for the length along an axis."""
    shape = (*array.shape[:axis], length, *array.shape[axis + 1 :])
    return library.xp.zeros(shape, dtype=array.dtype, device=library.device)


def phases(library: Any, length: int, angle: float, dtype: DTypeLike) -> Any:
    """Return exp(-i k angle), k = 0 ... length - 1."""
    k = library.cast(library.arange(length), np.complex128)
    return library.cast(library.xp.exp(k * (-1j * angle)), dtype)


def parts_of(n: int, numbers: int) -> list[slice]:
    """Return slices of n lines, `numbers` numbers in total, to process one after the other."""
    count = max(1, min(PARTS, n, numbers // LEAST))
    return [slice(n * k // count, n * (k + 1) // count) for k in range(count)]


def split(library: Any, a: Any, axis: int, sign: int) -> tuple[Any, Any]:
    """Return the coefficients with lag ≥ 0, and those with lag < 0, both by increasing lag.

    Parameters
    ----------
    sign : {1, -1, 0}
        1 or -1 if `a` contains lags ≥ 0 only and the coefficients are even or odd along this axis;
        0 if `a` contains all lags, lag zero in the centre.
    """
    if not sign:
        n = a.shape[axis] // 2
        return a[cut(axis, n)], a[cut(axis, 0, n)]
    behind = library.xp.flip(a[cut(axis, 1)], axis=axis)
    return a, behind if sign > 0 else -behind


def around(
    library: Any, ahead: Any, behind: Any, axis: int, length: int, *, is_straight: bool = False
) -> Any:
    """Return the first column of a circulant along an axis.

    Parameters
    ----------
    is_straight : bool
        Whether the gap is filled by linear interpolation between the last coefficient in `ahead`
        and the first in `behind`, which keeps odd blocks odd and even ones even, or by zeros.
    """
    missing = length - ahead.shape[axis] - behind.shape[axis]
    between = zeros(library, ahead, axis, missing)
    if is_straight:
        first = ahead[cut(axis, ahead.shape[axis] - 1)]
        last = behind[cut(axis, 0, 1)] if behind.shape[axis] else first
        t = library.cast((library.arange(missing) + 1.0) / (missing + 1.0), library.dtype(ahead))
        between = first + library.xp.reshape(t, (-1, *[1] * (ahead.ndim - 1 - axis))) * (
            last - first
        )
    return library.xp.concat([ahead, between, behind], axis=axis)


def transform_around(library: Any, ahead: Any, behind: Any, axis: int, length: int) -> Any:
    """Return the transform of a circulant's first column along an axis, divided by its length."""
    column = around(library, ahead, behind, axis, length)
    return library.fft.fft(column, axis=axis, norm="forward", **library.in_place)


def transform_last(library: Any, a: Any, sign: int, length: int, is_complex: bool = False) -> Any:
    """Return the transform of coefficients (see `split`) along the last axis over its length."""
    last = a.ndim - 1
    ahead, behind = split(library, library.cast(a, np.complex128), last, sign)
    if is_complex:
        return transform_around(library, ahead, behind, last, length)
    # Entries that wrap around are multiplied by i.
    column = library.xp.concat(
        [zeros(library, behind, last, length - behind.shape[last]), behind], axis=last
    )
    column *= 1j
    column += library.pad(ahead, (length,))
    column *= phases(library, length, pi / (2 * length), np.complex128)
    return library.fft.fft(column, axis=last, norm="forward", **library.in_place)


def embed(library: Any, a: Any, is_complex: bool, dtype: DTypeLike) -> Any:
    """Return the eigenvalues of the embedding, divided by the transform lengths.

    They are real if the matrix is Hermitian.

    Parameters
    ----------
    library : Library
    a : Coefficients
    is_complex : bool
        Whether the matrix is multiplied as a complex one.
    dtype : dtype
        The precision of the result.
    """
    xp, lengths = library.xp, embedding_lengths(a.grid_shape, is_complex=is_complex)
    count_transforms(1, *(2 * n for n in a.grid_shape))
    sign, is_real = int(a.is_even), a.is_hermitian

    def transform_rest(S: Any) -> Any:
        for axis in reversed(range(len(lengths) - 1)):
            S = transform_around(library, *split(library, S, axis, sign), axis, lengths[axis])
        return library.cast_numbers(xp.real(S) if is_real else S, dtype)

    rows = transform_last(library, a.array, sign, lengths[-1], is_complex)
    parts = parts_of(lengths[-1], prod(lengths))
    spectra = [transform_rest(rows[..., part]) for part in parts]
    del rows
    return spectra[0] if len(spectra) == 1 else xp.concat(spectra, axis=-1)
