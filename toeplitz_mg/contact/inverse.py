"""Approximate inverses on areas of contact: by a cosine transform, on fragmented ones by FSAI."""

from contextlib import suppress

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.operators import CoupledOperator, MaskedOperator, ToeplitzOperator, apply_to_rows
from toeplitz_mg.preconditioners.candidates import quick_fsai
from toeplitz_mg.preconditioners.choice import is_fsai_kept, is_fsai_worthwhile
from toeplitz_mg.preconditioners.symbol import sample_symbol
from toeplitz_mg.preconditioners.trigonometric import cosine_inverse


class LocalInverse:
    """FSAI on some elements, and the identity on others.

    Parameters
    ----------
    A : ToeplitzOperator or CoupledOperator
    C : ndarray of bool, of the shape of a field
    dtype : float32 or float64, optional
        The precision in which FSAI is kept and applied, that of `A` by default.

    Raises
    ------
    numpy.linalg.LinAlgError
        As `fsai_preconditioner`.
    """

    def __init__(
        self, A: ToeplitzOperator | CoupledOperator, C: Array, dtype: DTypeLike | None = None
    ) -> None:
        self.C = C
        self._P = quick_fsai(MaskedOperator(A, C), dtype=dtype)
        self._elements = np.flatnonzero(C)

    def __call__(self, r: Array) -> Array:
        """Apply it to a field."""
        y = r.flatten()
        y[self._elements] = apply_to_rows(self._P, y[self._elements])
        return y.reshape(r.shape)


class Inverse:
    """An approximate inverse for sets that change.

    Parameters
    ----------
    A : ToeplitzOperator
        Its diagonal is 1.

    Attributes
    ----------
    dtype : dtype
        Single precision, unless A is too ill-conditioned for that, as it is of very long elements.
    """

    def __init__(self, A: ToeplitzOperator) -> None:
        self._A = A
        self._before = np.zeros(A.grid_shape, bool)
        self._local: LocalInverse | None = None
        symbol = sample_symbol(A, tuple(near_fast_length(n) for n in A.grid_shape))
        try:
            self._cosine = cosine_inverse(A, symbol, np.float32)
        except np.linalg.LinAlgError:  # the symbol sinks into the rounding
            self._cosine = cosine_inverse(A, symbol)
        self.dtype = self._cosine.dtype

    def fit(self, C: Array) -> None:
        """Choose for a set: FSAI of one that is alike is kept, and else it is set up anew."""
        before, self._before = self._before, C
        if self._local is not None and is_fsai_kept(_measure_change(C, self._local.C)):
            return
        self._local = None
        if is_fsai_worthwhile(self._A, C, _measure_change(C, before)):
            with suppress(np.linalg.LinAlgError):
                self._local = LocalInverse(self._A, C, self.dtype)

    def __call__(self, r: Array) -> Array:
        """Apply it to a field that is zero outside of the set; the result is not."""
        if self._local is not None:
            return self._local(r)
        return apply_to_rows(self._cosine, r.reshape(-1)).reshape(r.shape)


def _measure_change(C: Array, before: Array) -> float:
    """Return the elements that differ, as a share of those of the set."""
    return int(np.count_nonzero(C ^ before)) / int(np.count_nonzero(C))
