"""Which preconditioner for which matrix and mask, and why: the one place that chooses.

Facts come from `toeplitz_mg.preconditioners.traits`; out go candidates with reasons, the fastest
first. `default_preconditioner` makes the first that is not refused, `select_preconditioner` lists
them (both in `default`), and the active sets of `toeplitz_mg.contact` ask whether FSAI is worth its
set-up.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from itertools import chain
from typing import NamedTuple

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Mask
from toeplitz_mg.columns.first_column import RESOLVED
from toeplitz_mg.columns.spectral_factor import factor_symbol
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator
from toeplitz_mg.operators.base import require_numpy
from toeplitz_mg.operators.lifting import (
    check_hermitian,
    components,
    unwrap,
    unwrap_toeplitz,
)
from toeplitz_mg.operators.symbol import symbol_of_line
from toeplitz_mg.preconditioners import traits
from toeplitz_mg.preconditioners.candidates import (
    OF_ANY_LINE,
    OF_ANY_MATRIX,
    OF_LINE_WITH_GAPS,
    OF_SMOOTH,
    OTHERS,
    couple,
    factorise,
    quick_fsai,
)
from toeplitz_mg.preconditioners.direct import DIRECT
from toeplitz_mg.preconditioners.fsai.preconditioner import fsai_preconditioner
from toeplitz_mg.preconditioners.fsai.stencil import NEIGHBOURS
from toeplitz_mg.preconditioners.selection import Candidate
from toeplitz_mg.preconditioners.spectral import spectral_inverse, spectral_preconditioner
from toeplitz_mg.preconditioners.trigonometric import (
    cosine_inverse,
    cosine_preconditioner,
    sine_inverse,
    sine_preconditioner,
)
from toeplitz_mg.values import count

# `python -m comparisons.preconditioners` measures both sides of these, and of DIRECT:
FEW = 40_000  # Most unknowns of one blob that sine transforms solve for before FSAI is set up.
COMPACT = 5.0  # Largest `fragmentation` of one blob.
LONG = 2**14  # Fewest elements of a grid whose transforms take longer than the calls of FSAI.

ALIKE = 0.5  # Least `likeness_of_axes` at which a sine transform is as good as for squares.

# x is the column of the spectral factor of a line.
WELL_RESOLVED = 0.01  # Largest ‖A x - e₁‖ of a symbol that n coefficients of any sign resolve.
HARDLY_RESOLVED = 100.0  # Largest ‖A x - e₁‖ at which a symbol is of use where they decrease.

# `python -m comparisons.theory` shows these, by the products on rough surfaces.
LARGE = 2**16  # Fewest elements of a grid on which an active set is worth a set-up of FSAI.
SETTLED = 0.05  # Largest share of a set that changed where FSAI is set up: it soon changes no more.
# Largest share of a set that changed where FSAI is kept. Where more did, a set-up, which takes as
# long as one to three products, saves more than that; where less did, it saves about one.
KEPT = 0.004


class Plan(NamedTuple):
    """A `Selection` whose candidates and components are found as they are asked for, once."""

    A: LinearOperator  # The matrix that they are made of, on a line without axes of one element.
    candidates: Iterator[Candidate]
    others: tuple[Candidate, ...]
    needs_trial: bool
    components: Iterator["Plan"]


def plan(A: LinearOperator, solves: int) -> Plan:
    """Return what may be taken of a matrix."""
    require_numpy(A, "a choice of preconditioners")
    is_worth_set_up = count("solves", solves) > 1
    full, mask = unwrap(A)
    if not isinstance(full, CoupledOperator):
        return _plan(A, is_worth_set_up)
    check_hermitian(full)
    # A product of several components costs more, and so few iterations are worth more.
    parts = (_plan(component, True) for component in components(full, mask))
    return Plan(A, _of_all_components(A, mask), (), False, parts)


def _plan(A: LinearOperator, is_worth_set_up: bool) -> Plan:
    """Return what may be taken of one component."""
    full, mask = unwrap_toeplitz(A, check_hermitian)
    full = full.squeezed
    # What is made of even coefficients is not for a complex matrix.
    is_complex = full.dtype.kind == "c"
    others = (OF_ANY_MATRIX,) if is_complex else OTHERS
    is_part = mask is not None and not mask.all()
    if not is_part and len(full.grid_shape) == 1:
        of_symbol = iter(()) if is_complex else candidates_of_line(full)
        of_line = chain(_of_few(full.shape[0]), of_symbol, [OF_ANY_LINE])
        return Plan(full, of_line, others, False, iter(()))
    if is_complex:
        candidates = iter(others)
    elif mask is not None and is_part:
        candidates = _of_mask(full, mask.reshape(full.grid_shape), is_worth_set_up)
    else:
        candidates = _of_grid(full)
    needs_trial = is_complex or not traits.decreases_along_axes(full)
    return Plan(A, chain(_of_few(A.shape[0]), candidates), others, needs_trial, iter(()))


def _of_few(unknowns: int) -> Iterator[Candidate]:
    if unknowns <= DIRECT:
        yield Candidate("Cholesky factor", f"at most {DIRECT} unknowns", factorise, is_exact=True)


def _of_all_components(A: LinearOperator, mask: Mask | None) -> Iterator[Candidate]:
    """Yield what may be taken of coupled components together."""
    yield from _of_few(A.shape[0])
    if mask is not None and not mask.all() and A.dtype.kind != "c":
        reason = "a mask; of all components together, if their coupling is strong"
        yield Candidate("fsai_preconditioner", reason, couple)


def candidates_of_line(A: ToeplitzOperator) -> Iterator[Candidate]:
    """Yield the preconditioners of a whole line that its symbol allows, the fastest first.

    There may be none: where the symbol has no positive samples and no zero at an end, or is not
    resolved by n coefficients at all.

    Parameters
    ----------
    A : ToeplitzOperator
        Symmetric, of one axis. The candidates are for this matrix alone.
    """
    if len(A.c) >= LONG and traits.decays_slowly(A.c):
        # 4 to 12 iterations, but next to no set-up, and cheap ones.
        yield Candidate.of(fsai_preconditioner, "a long line of slow decay")
    A = A.astype(np.float64)
    samples = symbol_of_line(A)
    by_sine = partial(sine_inverse, samples=samples)
    by_cosine = partial(cosine_inverse, samples=samples)
    is_smooth = traits.decreases(A.c)
    if traits.has_zero_at_start(samples):
        # The sines do not see it: 3 to 10 iterations to 1e-8.
        yield Candidate.of(sine_preconditioner, "a zero of the symbol at θ = 0", by_sine)
    elif traits.has_zero_at_start(samples[::-1]):
        # The cosines do not see that.
        yield Candidate.of(cosine_preconditioner, "a zero of the symbol at θ = π", by_cosine)
    elif is_smooth and traits.decays_exponentially(A.c):
        # As wide as the matrix, more or less: 2 to 5 iterations.
        yield Candidate.of(cosine_preconditioner, "an exponential covariance", by_cosine)
    else:
        with suppress(np.linalg.LinAlgError):  # The symbol may not be positive.
            factor = factor_symbol(A, samples)
            is_resolved = factor.residual <= RESOLVED and factor.is_definite
            if is_resolved or not is_smooth:
                # 1 to 8 iterations. Of coefficients that go on and on, as isolated ones do, a
                # rough factor takes more.
                near = RESOLVED if is_smooth else WELL_RESOLVED
                of_factor = partial(spectral_inverse, residual=near, factor=factor)
                is_near = factor.residual <= near
                trait = "a symbol that is resolved" if is_near else "no decrease with the lag"
                yield Candidate.of(spectral_preconditioner, trait, of_factor)
            elif factor.residual <= HARDLY_RESOLVED:
                # As wide as the matrix, with a simple tail: 2 to 6 iterations.
                yield Candidate.of(cosine_preconditioner, "a wide covariance", by_cosine)


def _of_grid(A: ToeplitzOperator) -> Iterator[Candidate]:
    """Yield what may be taken of the whole of a grid."""
    if _has_slow_transforms(A):
        yield Candidate.of(fsai_preconditioner, "slow transforms, and slow decay", quick_fsai)
    yield Candidate.of(cosine_preconditioner, "all of a grid")
    if len(A.grid_shape) == 2 and A.is_even:
        yield Candidate.of(fsai_preconditioner, "as many neighbours as the kernel needs")
        yield OF_SMOOTH
        yield Candidate.of(fsai_preconditioner, f"{NEIGHBOURS} neighbours", quick_fsai)


def _has_slow_transforms(A: ToeplitzOperator) -> bool:
    """Whether FSAI is faster on the whole of a grid in two axes.

    Where a length is slow for transforms the cosine takes twice the iterations. FSAI needs
    coefficients that decay slowly along both axes, as those of a half-space.
    """
    return (
        A.c.ndim == 2
        and A.c.size >= LONG
        and A.is_even
        and traits.has_slow_length(A.grid_shape)
        and traits.decays_slowly(A.c[0])
        and traits.decays_slowly(A.c[:, 0])
    )


def _of_mask(A: ToeplitzOperator, mask: Mask, is_worth_set_up: bool) -> Iterator[Candidate]:
    """Yield what may be taken on a mask."""
    if len(A.grid_shape) > 2:
        yield Candidate.of(sine_preconditioner, "a mask in three axes or more")
    elif not A.is_even:
        yield Candidate.of(sine_preconditioner, "a mask, and a kernel that is not even")
    elif is_worth_set_up:
        yield Candidate.of(fsai_preconditioner, "a mask, and a set-up that pays off")
        yield OF_SMOOTH
    elif len(A.grid_shape) == 1:
        yield OF_LINE_WITH_GAPS
        yield OF_SMOOTH
    elif (trait := _why_fsai(A, mask)) is not None:
        yield Candidate.of(fsai_preconditioner, f"{trait}; {NEIGHBOURS} neighbours", quick_fsai)
        yield OF_SMOOTH
    else:
        yield Candidate.of(sine_preconditioner, "one small blob, and one solve")


def _why_fsai(A: ToeplitzOperator, mask: Mask) -> str | None:
    """Return why FSAI is worth its set-up on a mask, or None where it is not."""
    if np.count_nonzero(mask) >= FEW:
        return "many unknowns"
    if traits.fragmentation(mask) > COMPACT:
        return "a fragmented mask"
    if traits.likeness_of_axes(A) < ALIKE:
        return "stretched elements"
    return None


def is_fsai_worthwhile(
    elements: int, fragmentation: Callable[[], float], change: float = 0.0
) -> bool:
    """Whether FSAI is worth its set-up on a set of unknowns, a share of which has just changed.

    Parameters
    ----------
    elements : int
        Those of the grid, of all components.
    fragmentation : callable
        Returns that of the set: it takes long enough to be asked for last.
    change : float, optional
    """
    return change <= SETTLED and elements >= LARGE and fragmentation() > COMPACT


def is_fsai_kept(change: float) -> bool:
    """Whether FSAI still serves a set of unknowns, a share of which has changed since."""
    return change <= KEPT
