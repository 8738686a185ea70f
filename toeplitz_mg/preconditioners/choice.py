"""Which preconditioner for which matrix and area, and why: `default_preconditioner`."""

import logging
from collections.abc import Iterable, Iterator
from functools import partial
from itertools import islice
from math import log2
from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator
from toeplitz_mg.operators.structure import componentwise, unwrap, unwrap_toeplitz
from toeplitz_mg.preconditioners.circulant import chan_preconditioner
from toeplitz_mg.preconditioners.direct import DenseInverse
from toeplitz_mg.preconditioners.fsai.line import LONG, decays_slowly
from toeplitz_mg.preconditioners.fsai.preconditioner import coupled_fsai, fsai_preconditioner
from toeplitz_mg.preconditioners.fsai.stencil import NEIGHBOURS
from toeplitz_mg.preconditioners.jacobi import ScaledIdentity
from toeplitz_mg.preconditioners.positivity import precision
from toeplitz_mg.preconditioners.spectral import spectral_preconditioner
from toeplitz_mg.preconditioners.trial import better_than_none
from toeplitz_mg.preconditioners.trigonometric import cosine_preconditioner, sine_preconditioner
from toeplitz_mg.preconditioners.whole_line import (
    Preconditioner,
    decreases,
    named,
    of_whole_line,
)
from toeplitz_mg.values import count

logger = logging.getLogger(__name__)

DIRECT = 600  # unknowns, or fewer, are solved for directly: with a Cholesky factor of 3 MB
FEW = 40_000  # unknowns of one blob that sine transforms solve for before FSAI is set up
ALIKE = 0.5  # coupling of neighbours in one axis, of that in the other; 0.36 of elements 1:4
COMPACT = 5.0  # `fragmentation` of one blob: 4.0 of a square, 4.5 of a circle, 7.8 of an annulus

quick_fsai = named(partial(fsai_preconditioner, neighbours=NEIGHBOURS), fsai_preconditioner)
fsai_of_24_neighbours = named(  # for smoother covariances
    partial(fsai_preconditioner, neighbours=24), fsai_preconditioner
)


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
        Of the shape of `A`, symmetric positive definite. Where none is better than no
        preconditioner it is a multiple of the unit matrix.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where A is not positive definite: of at most 600 unknowns for certain, of more where it
        shows.
    TypeError, ValueError
        Where `A` is no Toeplitz operator, or not symmetric, or `solves` is below 1.

    Notes
    -----
    At most 600 unknowns, of all components together, are solved for directly, by a Cholesky
    factorisation. Else the choice is that of the fastest in the comparison `areas`:

    ======================== ================================= ==============================
    axes, area               preconditioner                    iterations to 1e-8
    ======================== ================================= ==============================
    one, all of it           FSAI where 2¹⁴ coefficients or    4 to 8; 1 to 6; 2 to 10
                             more decay slowly; spectral;
                             sine or cosine where the symbol
                             has a zero, or n coefficients do
                             not resolve it
    one, a mask              FSAI                              5 to 9, sine 13 to over 150
    two, all of it           cosine; FSAI where a length has   9 to 13, FSAI 7 to 9
                             a prime factor above 61, and the
                             coefficients decay slowly, and
                             where cosine is refused
    two, one small blob      sine; FSAI for more solves, and   10 to 14, FSAI 8 to 10
                             for coupled components, and for
                             stretched elements
    two, any other mask      FSAI                              7 to 10, sine 12 to 67
    three or more            cosine; on a mask sine            9 to 20
    ======================== ================================= ==============================

    Coupled components are treated each by itself, but by FSAI on a mask together if their coupling
    is strong.

    Of FSAI for one solve it is that of 12 neighbours, for more that of as many as the kernel needs.
    It is not refused where they are not enough, as for a smooth covariance on a mask any other
    takes several times the iterations.

    This is for coefficients that are positive and decrease along each axis, as those of a
    half-space and of most covariances do. For others, and where all of these are refused, as for a
    covariance that is smooth and as wide as its grid, it is the best of what there is, sine,
    cosine and T. Chan's circulant in twenty steps of conjugate gradients, if it is better than
    nothing: a circulant may take ten times the iterations of none. Not so on the whole of a line,
    where the spectral factor is as good as the inverse. The logger of this module tells what is
    refused and why, at the level INFO.

    ``python -m comparisons.default_choice`` measures this against no preconditioner, on matrices
    of every kind.

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
    solves = count("solves", solves)
    full, mask = unwrap(A)
    is_coupled = isinstance(full, CoupledOperator)
    is_on_mask = mask is not None and not mask.all()
    if is_coupled and full.is_symmetric and (inverse := _direct(A, full, dtype)) is not None:
        return inverse
    if is_coupled and is_on_mask:
        try:
            if (joint := coupled_fsai(A, dtype)) is not None:
                return joint
        except np.linalg.LinAlgError as error:
            logger.info("FSAI of all components is refused, and each taken by itself: %s", error)
    # A product of several components costs more, and so few iterations are worth more.
    return _default(A, solves > 1 or is_coupled, dtype)


def _direct(
    A: LinearOperator, full: ToeplitzOperator | CoupledOperator, dtype: DTypeLike | None
) -> LinearOperator | None:
    """Return the inverse of a small matrix, or None where it is not small, or its precision is."""
    if A.shape[0] > DIRECT:
        return None
    inverse = DenseInverse(A, precision(full, dtype))
    return inverse if inverse.is_accurate else None


@componentwise
def _default(A: LinearOperator, is_worth_set_up: bool, dtype: DTypeLike | None) -> LinearOperator:
    full, mask = unwrap_toeplitz(A)
    if (inverse := _direct(A, full, dtype)) is not None:
        return inverse
    full = full.squeezed
    shape = full.grid_shape
    mask = np.ones(shape, dtype=bool) if mask is None else mask.reshape(shape)
    whole_line = len(shape) == 1 and mask.all()
    if whole_line:
        A = full
    tried = list(islice(_accepted(_candidates(full, mask, is_worth_set_up), A, dtype), 1))
    if tried and (whole_line or _decreases(full)):
        return tried[0].M
    resorts = [sine_preconditioner, cosine_preconditioner, chan_preconditioner]
    others = [f for f in resorts if not tried or f is not tried[0].made_by]
    tried += _accepted(others, A, dtype)
    diagonal = float(full.c.flat[0])
    if not (tried and diagonal > 0.0):
        raise np.linalg.LinAlgError(
            f"A is {A!r}, not positive definite or nearly singular, as not even T. Chan's "
            "circulant is positive definite: use cg without M"
        )
    # A power of two: the iterates are those without a preconditioner, to the last bit.
    scale = 2.0 ** -round(log2(diagonal))
    none = ScaledIdentity(precision(full, dtype), full.grid_shape, A.shape[0], scale)
    return better_than_none(A, none, [accepted.M for accepted in tried])


class _Accepted(NamedTuple):
    made_by: Preconditioner
    M: LinearOperator


def _accepted(
    preconditioners: Iterable[Preconditioner], A: LinearOperator, dtype: DTypeLike | None
) -> Iterator[_Accepted]:
    """Yield the preconditioners that are not refused."""
    for preconditioner in preconditioners:
        try:
            yield _Accepted(preconditioner, preconditioner(A, dtype=dtype))
        except np.linalg.LinAlgError as error:
            logger.info("%s is refused: %s", preconditioner.__name__, error)


def _decreases(full: ToeplitzOperator) -> bool:
    """Whether coefficients are positive and decrease along each axis."""
    axes = np.identity(full.c.ndim, dtype=bool)
    return full.is_even and all(
        decreases(full.c[tuple(slice(None) if own else 0 for own in axis)]) for axis in axes
    )


def _candidates(
    full: ToeplitzOperator, mask: Array, is_worth_set_up: bool
) -> Iterator[Preconditioner]:
    """Yield what may be taken, the fastest first."""
    levels = len(full.grid_shape)
    if levels == 1 and mask.all():
        yield from of_whole_line(full)
        yield spectral_preconditioner
    elif mask.all():
        if _is_of_slow_lengths(full):
            yield quick_fsai
        yield cosine_preconditioner
        if levels == 2 and full.is_even:
            yield fsai_preconditioner
            yield fsai_of_24_neighbours
            yield quick_fsai
    elif levels <= 2 and full.is_even:
        is_small_blob = fragmentation(mask) <= COMPACT and np.count_nonzero(mask) < FEW
        if levels == 1 or is_worth_set_up or not is_small_blob or _is_stretched(full):
            yield fsai_preconditioner if is_worth_set_up else quick_fsai
            yield fsai_of_24_neighbours
        else:
            yield sine_preconditioner
    else:
        yield sine_preconditioner


def _is_of_slow_lengths(full: ToeplitzOperator) -> bool:
    """Whether FSAI is faster on the whole of a grid in two levels.

    Where a length is slow for transforms the cosine takes twice the iterations. FSAI needs
    coefficients that decay slowly along both axes, as those of a half-space.
    """
    return (
        full.c.ndim == 2
        and full.c.size >= LONG
        and full.is_even
        and any(near_fast_length(n) != n for n in full.grid_shape)
        and decays_slowly(full.c[0])
        and decays_slowly(full.c[:, 0])
    )


def _is_stretched(full: ToeplitzOperator) -> bool:
    """Whether neighbours in one axis are coupled much less than in the other."""
    first, second = abs(full.c[1, 0]), abs(full.c[0, 1])
    return bool(min(first, second) < ALIKE * max(first, second))


def fragmentation(mask: Array) -> float:
    """Return the edges between elements in contact and others, over the root of the elements.

    In two levels: the length of the edge over the root of the area.

    Examples
    --------
    >>> import numpy as np
    >>> from toeplitz_mg.preconditioners.choice import fragmentation
    >>> fragmentation(np.ones((9, 9), dtype=bool))
    4.0
    """
    padded = np.pad(mask, 1)
    edges = sum(np.count_nonzero(np.diff(padded, axis=k)) for k in range(mask.ndim))
    return float(edges / np.count_nonzero(mask) ** (1.0 - 1.0 / mask.ndim))
