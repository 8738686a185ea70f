"""Which preconditioner for which matrix and area, and why: `default_preconditioner`."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.masked import toeplitz_and_mask
from toeplitz_mg.operators.transforms import near_fast_length
from toeplitz_mg.preconditioners.circulant import chan_preconditioner
from toeplitz_mg.preconditioners.componentwise import componentwise
from toeplitz_mg.preconditioners.fsai import fsai_preconditioner
from toeplitz_mg.preconditioners.fsai_line import LONG, decays_slowly
from toeplitz_mg.preconditioners.spectral import spectral_preconditioner
from toeplitz_mg.preconditioners.symbol import sampled_symbol
from toeplitz_mg.preconditioners.trigonometric import cosine_preconditioner, sine_preconditioner

Array = NDArray[Any]

FEW = 100_000  # unknowns of one blob that sine transforms solve for before FSAI is set up
COMPACT = 5.0  # `fragmentation` of one blob: 4.0 of a square, 4.5 of a circle, 7.8 of an annulus


@componentwise
def default_preconditioner(
    A: LinearOperator, *, solves: int = 1, dtype: DTypeLike | None = None
) -> LinearOperator:
    """Return the preconditioner with which conjugate gradients are soonest done.

    Parameters
    ----------
    A : ToeplitzOperator, or CoupledOperator, or MaskedOperator of one
        Symmetric positive definite, of any number of levels.
    solves : int
        For how many right-hand sides it is made: more are worth a longer set-up.
    dtype : float32 or float64, optional
        The precision in which it is kept and applied, that of `A` by default.

    Returns
    -------
    LinearOperator
        Of the shape of `A`, symmetric positive definite.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where A is not positive definite.
    TypeError, ValueError
        Where `A` is no Toeplitz operator, or not symmetric, or `solves` is below 1.

    Notes
    -----
    The choice is that of the fastest in the comparison `areas`:

    ======================== ================================= ==============================
    levels, area             preconditioner                    iterations to 1e-8
    ======================== ================================= ==============================
    one, all of it           FSAI where 2¹⁴ coefficients or    4 to 8; 1 to 6; 3 to 10
                             more decay slowly; spectral;
                             sine or cosine where the symbol
                             has a zero
    one, a mask              FSAI                              5 to 9, sine 13 to over 150
    two, all of it           cosine                            9 to 13
    two, one small blob      sine, for more solves FSAI        10 to 14, FSAI 8
    two, any other mask      FSAI                              7 to 10, sine 12 to 67
    three or more            cosine; on a mask sine            9 to 20
    ======================== ================================= ==============================

    Where one is refused, as FSAI is for a very smooth covariance, the next is taken: sine, cosine
    and at last T. Chan's circulant, which is positive definite whenever A is.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator(np.exp(-np.hypot(*np.indices((40, 40)) / 4.0)))
    >>> tmg.default_preconditioner(A)
    <DiagonalisedOperator 40 x 40, cosine transform, float64>
    >>> checkered = np.indices((40, 40)).sum(axis=0) % 2 == 0
    >>> tmg.default_preconditioner(tmg.MaskedOperator(A, checkered)).shape
    (800, 800)
    """
    if not solves >= 1:
        raise ValueError(f"solves is {solves}, but must be at least 1")
    full, mask = toeplitz_and_mask(A)
    for preconditioner in _candidates(full, mask, solves):
        with suppress(np.linalg.LinAlgError):
            return preconditioner(A, dtype=dtype)
    return chan_preconditioner(A, dtype=dtype)


def _candidates(
    full: ToeplitzOperator, mask: Array | None, solves: int
) -> Iterator[Callable[..., LinearOperator]]:
    """Yield what may be taken, the fastest first."""
    levels = sum(n > 1 for n in full.grid_shape)
    if levels <= 1 and (mask is None or mask.all()):
        if len(full.grid_shape) == 1:
            if len(full.c) >= LONG and decays_slowly(full.c):
                yield fsai_preconditioner
            samples = sampled_symbol(full, (near_fast_length(full.shape[0]),))
            if samples[0] < samples[1] / 2:  # a zero at θ = 0, which a sine does not see
                yield sine_preconditioner
            elif samples[-1] < samples[-2] / 2:  # the same at π
                yield cosine_preconditioner
            yield spectral_preconditioner
        yield cosine_preconditioner
    elif mask is None or mask.all():
        yield cosine_preconditioner
    elif len(full.grid_shape) <= 2 and full.is_even:
        is_small_blob = fragmentation(mask) <= COMPACT and np.count_nonzero(mask) < FEW
        if levels == 1 or solves > 1 or not is_small_blob:
            yield fsai_preconditioner
    yield sine_preconditioner
    yield cosine_preconditioner


def fragmentation(mask: Array) -> float:
    """Return the edges between elements in contact and others, over the root of the elements.

    In two levels: the length of the edge over the root of the area.

    Examples
    --------
    >>> import numpy as np
    >>> from toeplitz_mg.preconditioners.default import fragmentation
    >>> fragmentation(np.ones((9, 9), dtype=bool))
    4.0
    """
    padded = np.pad(mask, 1)
    edges = sum(np.count_nonzero(np.diff(padded, axis=k)) for k in range(mask.ndim))
    return float(edges / np.count_nonzero(mask) ** (1.0 - 1.0 / mask.ndim))
