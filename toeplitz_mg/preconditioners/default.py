"""The default preconditioner, by the table of `toeplitz_mg.preconditioners.choice`."""

import logging
from collections.abc import Iterable, Iterator
from math import log2

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.engine.arrays.library import NUMPY
from toeplitz_mg.operators import BlockDiagonal, CoupledOperator, ToeplitzSum
from toeplitz_mg.operators.base import grid_of, library_for
from toeplitz_mg.operators.lifting import (
    check_hermitian,
    lift,
    restrict,
    stand_in,
    unwrap,
    unwrap_toeplitz,
)
from toeplitz_mg.operators.positivity import LAST_RESORT, precision
from toeplitz_mg.operators.sums import average
from toeplitz_mg.preconditioners.choice import Candidate, Plan, Selection, plan
from toeplitz_mg.preconditioners.circulant import chan_preconditioner
from toeplitz_mg.preconditioners.direct import NotPositiveDefinite
from toeplitz_mg.preconditioners.fsai.preconditioner import fsai_preconditioner
from toeplitz_mg.preconditioners.jacobi import ScaledIdentity
from toeplitz_mg.preconditioners.trial import better_than_none
from toeplitz_mg.preconditioners.trigonometric import cosine_preconditioner
from toeplitz_mg.values import count

logger = logging.getLogger(__name__)


@lift(accepts="Hermitian", parts=())
def default_preconditioner(
    A: LinearOperator, *, solves: int = 1, dtype: DTypeLike | None = None
) -> LinearOperator:
    """Return a preconditioner for `cg`, selected by the axes, the mask and the coefficients.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Symmetric or complex Hermitian positive definite, of any number of axes.
    solves : int
        Number of right-hand sides to be solved for: more are worth a longer set-up.
    dtype : float32 or float64, optional
        Precision in which the preconditioner is stored and applied; by default that of `A`.

    Returns
    -------
    LinearOperator
        Hermitian positive definite, same shape as `A`. If no preconditioner is better than none, a
        multiple of the unit matrix is returned.

    Raises
    ------
    numpy.linalg.LinAlgError
        If A is found not to be positive definite, which is certain for up to 600 unknowns.
    TypeError, ValueError
        If `A` is not a Toeplitz operator, or not Hermitian (use `chan_preconditioner` and `gmres`),
        or if `solves` is below 1.

    See Also
    --------
    select_preconditioner : names the preconditioner and the reason, without building it.

    Notes
    -----
    Up to 600 unknowns (all components together) are solved by a dense Cholesky factorisation.
    For larger real systems it is the fastest in ``python -m comparisons.preconditioners``:

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
    two, one blob            sine; FSAI for more solves, for   10 to 14, FSAI 8 to 10
                             coupled components, and where
                             the grid has 2¹⁴ elements
    two, any other mask      FSAI                              7 to 10, sine 12 to 67
    three or more            cosine; on a mask sine            9 to 20
    ======================== ================================= ==============================

    For larger complex matrices it is the spectral factor on one axis without a mask, and otherwise
    T. Chan's circulant, unless that is worse than no preconditioner.

    Coupled components are preconditioned separately, except by FSAI on a mask if their coupling is
    strong.

    For arrays of other libraries it is FSAI on a mask and cosine on a whole grid; T. Chan's
    circulant if these are refused, and for complex matrices.

    FSAI has 12 neighbours for a single solve, and for several solves as many as the kernel needs.
    It is used even if these are not enough, because every other preconditioner takes several times
    the iterations for a smooth covariance on a mask.

    The table holds for coefficients that are positive and decrease along each axis, like those of a
    half-space and of most covariances. For others, a trial with ten steps of CG in total compares
    the preconditioner of the table with sine, T. Chan's circulant and none; on a grid whose kernel
    is not even along each axis also with M. The circulant is left out if every preconditioner of
    the table is refused. On one axis without a mask there is a trial only if all are refused,
    because the spectral factor is nearly the inverse. The logger of this module reports refusals
    and their reasons at the level INFO.

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
    if library_for(A) is not NUMPY:
        count("solves", solves)
        return _make_elsewhere(A, dtype)
    return _make(plan(A, solves), dtype)


def _candidates_elsewhere(A: LinearOperator) -> list[Candidate]:
    """Return the candidates that support arrays of any library, in order of preference."""
    full, mask = unwrap(A)
    if isinstance(full, CoupledOperator):
        check_hermitian(full)
    else:
        unwrap_toeplitz(A, check_hermitian)
    candidates = [
        Candidate("cosine_preconditioner", "a whole grid", cosine_preconditioner),
        Candidate("chan_preconditioner", "any kernel", chan_preconditioner),
    ]
    is_mask = mask is not None and not mask.all()
    if is_mask and len(grid_of(A)) <= 2 + isinstance(full, CoupledOperator):
        candidates.insert(0, Candidate("fsai_preconditioner", "a mask", fsai_preconditioner))
    return candidates


def _make_elsewhere(A: LinearOperator, dtype: DTypeLike | None) -> LinearOperator:
    """Build the first candidate for arrays of any library that is not refused."""
    refusals = []
    for candidate in _candidates_elsewhere(A):
        try:
            return candidate.make(A, dtype=dtype)
        except (np.linalg.LinAlgError, ValueError) as error:
            logger.info("%s is refused: %s", candidate.name, error)
            refusals.append(error)
    raise refusals[-1]


def select_preconditioner(A: LinearOperator, *, solves: int = 1) -> Selection:
    """Return what `default_preconditioner` would build, and why, without building it.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Symmetric or complex Hermitian positive definite, of any number of axes.
    solves : int
        Number of right-hand sides to be solved for: more are worth a longer set-up.

    Returns
    -------
    Selection
        Prints as a list. Its attribute `candidates` has the preconditioners in the order in which
        they are tried, each with its `name` and `reason`. Whether a candidate is refused, for
        example because it is not positive definite, is known only when it is built.

    Raises
    ------
    TypeError, ValueError
        As for `default_preconditioner`.

    See Also
    --------
    default_preconditioner : builds what this lists.

    Notes
    -----
    The coefficients are inspected; on one axis without a mask, where the symbol decides, this takes
    a few transforms.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator(1.0 / (1.0 + np.hypot(*np.indices((40, 40)))))
    >>> checkered = np.indices((40, 40)).sum(axis=0) % 2 == 0
    >>> tmg.select_preconditioner(tmg.MaskedOperator(A, checkered))
    fsai_preconditioner: one solve; 12 neighbours
    if refused, fsai_preconditioner: 24 neighbours, for a smooth kernel
    if all are refused, the best of sine_preconditioner and none, by a trial of 10 steps of CG in
    all
    """
    A = stand_in(A)
    full, mask = unwrap(A)
    if isinstance(full, ToeplitzSum):
        A = restrict(average(full, mask)[0], mask)
    if library_for(A) is not NUMPY:
        count("solves", solves)
        return Selection(tuple(_candidates_elsewhere(A)))
    return _list(plan(A, solves))


def _list(plan: Plan) -> Selection:
    components = tuple(map(_list, plan.components))
    return Selection(tuple(plan.candidates), plan.others, plan.needs_trial, components)


def _make(plan: Plan, dtype: DTypeLike | None) -> LinearOperator:
    """Build the first candidate that is not refused, or the best one in a trial."""
    taken = next(_accept(plan.candidates, plan.A, dtype), None)
    if taken is not None and (taken[0].is_exact or not plan.needs_trial):
        return taken[1]
    if not plan.others:
        return BlockDiagonal([_make(part, dtype) for part in plan.components], grid_of(plan.A))
    others = (other for other in plan.others if taken is None or other.name != taken[0].name)
    tried = [] if taken is None else [taken[1]]
    tried += [M for _, M in _accept(others, plan.A, dtype)]
    return better_than_none(plan.A, _none(plan.A, bool(tried), dtype), tried)


def _accept(
    candidates: Iterable[Candidate], A: LinearOperator, dtype: DTypeLike | None
) -> Iterator[tuple[Candidate, LinearOperator]]:
    """Build the candidates, and yield those that are not refused."""
    for candidate in candidates:
        try:
            yield candidate, candidate.make(A, dtype=dtype)
        except NotPositiveDefinite:
            raise
        except np.linalg.LinAlgError as error:
            logger.info("%s is refused: %s", candidate.name, error)


def _none(A: LinearOperator, is_any_accepted: bool, dtype: DTypeLike | None) -> ScaledIdentity:
    """Return a multiple of the unit matrix, which stands for no preconditioner.

    If no preconditioner is accepted, T. Chan's circulant must be positive definite, as it is for
    every positive definite A; otherwise A is refused.
    """
    full, _ = unwrap_toeplitz(A, check_hermitian)
    diagonal = float(full.c.flat[0].real)
    circulant = Candidate("chan_preconditioner", "definite wherever A is", chan_preconditioner)
    is_accepted = is_any_accepted or any(_accept([circulant], A, dtype))
    if not (is_accepted and diagonal > 0.0):
        raise np.linalg.LinAlgError(
            f"A is {A!r}, but must be positive definite and not nearly singular (T. Chan's "
            f"circulant is not positive definite): use {LAST_RESORT}"
        )
    # With a power of two the iterates are bit for bit those without a preconditioner.
    scale = 2.0 ** -round(log2(diagonal))
    return ScaledIdentity(precision(full, dtype), full.grid_shape, A.shape[0], scale)
