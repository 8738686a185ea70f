"""Exact scaling by powers of two, so that no square overflows or underflows."""

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.vectors import power_above

SMALLEST = float(np.finfo(np.float64).tiny)  # Smallest number with all 53 bits of float64.


def exponents(a: Array) -> Array:
    """Return the powers of two that scale the rows of `a` to numbers up to between 1/2 and 1.

    For complex numbers this holds for the larger of all real and imaginary parts.
    """
    return power_above(_peaks(a))


def _peaks(a: Array) -> Array:
    """Return the largest absolute real or imaginary part in each row of `a`, as a column."""
    # The absolute value of a complex number may overflow.
    parts = (a.real, a.imag) if a.dtype.kind == "c" else (a,)
    sizes = [np.abs(part).max(axis=-1, keepdims=True, initial=0.0) for part in parts]
    return np.maximum.reduce(sizes)


def scale_back(X: Array, powers: Array, parts: int = 1) -> Array:
    """Return the rows of X times these powers of two, if float64 can represent them.

    Parameters
    ----------
    X : ndarray of shape (rows, n)
    powers : ndarray of int, of shape (rows, 1)
    parts : int
        2 if the second half of the rows are the imaginary parts of the first.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a number overflows, or the largest of a row is so small that digits are lost.
    """
    half = powers // 2
    with np.errstate(over="ignore"):
        Y = X * np.ldexp(1.0, half) * np.ldexp(1.0, powers - half)
    # The smaller part of a complex number need not have all digits.
    peaks = np.tile(_peaks(Y).reshape(parts, -1).max(axis=0), parts)
    is_exact = (Y * np.ldexp(1.0, -half) * np.ldexp(1.0, half - powers) == X).all(axis=1)
    is_lost = np.isinf(peaks) | ~(is_exact | (peaks >= SMALLEST))
    if is_lost.any():
        row = int(np.argmax(is_lost))
        size = np.log10(np.abs(X[row]).max()) + float(powers[row, 0]) * np.log10(2.0)
        raise np.linalg.LinAlgError(
            f"the solution is of size 1e{size:+.0f}, but must be within the range of float64: "
            "scale A or b"
        )
    return Y
