"""Select a preconditioner for a matrix and a mask, with the reason.

The table `ROWS` is read from top to bottom; the rows that fit a matrix are its candidates, the
fastest first. `default_preconditioner` builds the first candidate that is not refused, and
`select_preconditioner` lists them (both in `default`). `toeplitz_mg.contact` asks here whether FSAI
is worth its set-up on an active set.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.columns.columns import Columns
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
from toeplitz_mg.operators.positivity import precision
from toeplitz_mg.operators.symbol import symbol_of_line
from toeplitz_mg.preconditioners import traits
from toeplitz_mg.preconditioners.circulant import chan_preconditioner
from toeplitz_mg.preconditioners.direct import DIRECT, DenseInverse
from toeplitz_mg.preconditioners.fft import fft_preconditioner
from toeplitz_mg.preconditioners.fsai.neighbours import NUMBERS
from toeplitz_mg.preconditioners.fsai.preconditioner import coupled_fsai, fsai_preconditioner
from toeplitz_mg.preconditioners.spectral import spectral_inverse, spectral_preconditioner
from toeplitz_mg.preconditioners.trigonometric import (
    cosine_inverse,
    cosine_preconditioner,
    sine_inverse,
    sine_preconditioner,
)
from toeplitz_mg.values import count

# Neighbours in a row of FSAI: for the shortest set-up, and for smooth kernels.
FEW, SMOOTH, _ = NUMBERS

# The constants that choose. `python -m comparisons.preconditioners` measures both sides of the
# first three and of DIRECT, its part `trials` those of a trial, and `python -m comparisons.theory`
# those of active sets, by the number of products on rough surfaces.
LONG = 2**14  # Fewest elements of a grid for which FSAI is faster than transforms.
COMPACT = 5.0  # Largest `fragmentation` of an area that counts as one blob.
HARDLY_RESOLVED = 100.0  # Largest ‖A x - e₁‖ of a useful spectral factor.
STEPS = 10  # CG steps in a trial, all candidates together.
STEPS_OF_EACH = 2  # CG steps after which the energy ranks the candidates.
NEARLY = 0.99  # CG without M is preferred if its energy falls by this share of that with M,
ADVANTAGE = 2.0  # and its residual is at most this many times that with M.
LARGE = 2**16  # Fewest elements of a grid on which FSAI is worth its set-up for an active set.
SETTLED = 0.05  # FSAI is set up only if at most this share of an active set has just changed.
# FSAI is rebuilt if more than this share of the active set has changed. Above it the set-up (one to
# three products) saves more than it costs; below it, it saves about one product.
KEPT = 0.004

Make = Callable[..., LinearOperator]


@dataclass(frozen=True)
class Candidate:
    """A preconditioner that may be selected.

    Attributes
    ----------
    name : str
        The function of this package that makes it, or a description.
    reason : str
        Why it is at this place in the list.
    make : callable
        ``make(A, dtype=dtype)`` returns it, or raises a LinAlgError if it is refused.
    is_exact : bool
        Whether it is the exact inverse, so that no trial is needed.
    """

    name: str
    reason: str
    make: Make = field(repr=False)
    is_exact: bool = False


@dataclass(frozen=True, repr=False)
class Selection:
    """What `default_preconditioner` would build for a matrix, and why.

    Attributes
    ----------
    candidates : tuple of Candidate
        The first that is not refused is used, unless there is a trial.
    others : tuple of Candidate
        A trial compares these with the first candidate and with no preconditioner.
    needs_trial : bool
        Whether a trial is made although a candidate is accepted, unless that is the exact inverse.
        If False, there is a trial only if all candidates are refused.
    components : tuple of Selection
        The selection for each component, used if all candidates for the coupled matrix are refused.
    """

    candidates: tuple[Candidate, ...]
    others: tuple[Candidate, ...] = ()
    needs_trial: bool = False
    components: tuple["Selection", ...] = ()

    def __repr__(self) -> str:
        lines = [f"{candidate.name}: {candidate.reason}" for candidate in self.candidates]
        lines = [("if refused, " if k else "") + line for k, line in enumerate(lines)]
        if self.others:
            names = ", ".join(candidate.name for candidate in self.others)
            when = "and then" if self.needs_trial else "if all are refused,"
            names = f"it, {names}" if self.needs_trial else names
            trial = f"by a trial of {STEPS} steps of CG in all"
            lines.append(f"{when} the best of {names} and none, {trial}")
        if self.components:
            lines.append(("if refused, " if lines else "") + "each component separately:")
            # Usually all components have the same selection, which is printed once.
            for text in dict.fromkeys(map(repr, self.components)):
                lines += [f"    {line}" for line in text.splitlines()]
        return "\n".join(lines)


class Plan(NamedTuple):
    """A `Selection` whose candidates and components are generated on demand, once."""

    A: LinearOperator  # The matrix to precondition; on a line, without axes of one element.
    candidates: Iterator[Candidate]
    others: tuple[Candidate, ...] = ()
    needs_trial: bool = False
    components: Iterator["Plan"] = iter(())


def plan(A: LinearOperator, solves: int) -> Plan:
    """Return the candidates for a matrix."""
    require_numpy(A, "a choice of preconditioners")
    is_worth_set_up = count("solves", solves) > 1
    full, mask = unwrap(A)
    if not isinstance(full, CoupledOperator):
        return _plan(A, is_worth_set_up)
    check_hermitian(full)
    # Products of several components cost more, so fewer iterations are worth a longer set-up.
    parts = (_plan(component, True) for component in components(full, mask))
    return Plan(A, _of_all_components(A, mask), components=parts)


def _plan(A: LinearOperator, is_worth_set_up: bool) -> Plan:
    """Return the candidates for one component."""
    facts = Facts(A, is_worth_set_up)
    needs_trial = not facts.is_line and not facts.decreases
    others = tuple(_read(OTHERS, facts))
    candidates = chain(_of_few(A), _read(ROWS, facts))
    return Plan(facts.full if facts.is_line else A, candidates, others, needs_trial)


def _of_few(A: LinearOperator) -> Iterator[Candidate]:
    """Yield the Cholesky factor if there are few unknowns."""
    if A.shape[0] <= DIRECT:
        yield Candidate("Cholesky factor", f"at most {DIRECT} unknowns", factorise, is_exact=True)


def _of_all_components(A: LinearOperator, mask: Mask | None) -> Iterator[Candidate]:
    """Yield the candidates that treat coupled components together."""
    yield from _of_few(A)
    if mask is not None and not mask.all() and A.dtype.kind != "c":
        reason = "a mask; of all components together, if their coupling is strong"
        yield Candidate("fsai_preconditioner", reason, couple)


class Facts:
    """The properties of a one-component matrix that the table asks for; slow ones on demand.

    Attributes
    ----------
    A : LinearOperator
    full : ToeplitzOperator
        The matrix on the whole grid, without axes of one element.
    is_worth_set_up : bool
        Whether fewer iterations are worth a longer set-up.
    is_complex : bool
    is_line, is_grid, is_mask : bool
        Whether the unknowns are a whole line, a whole grid of several axes, or part of either.
    """

    def __init__(self, A: LinearOperator, is_worth_set_up: bool) -> None:
        full, self._mask = unwrap_toeplitz(A, check_hermitian)
        self.A, self.full, self.is_worth_set_up = A, full.squeezed, is_worth_set_up
        self.is_complex = A.dtype.kind == "c"
        self.is_mask = self._mask is not None and not self._mask.all()
        self.is_line = not self.is_mask and len(self.full.grid_shape) == 1
        self.is_grid = not self.is_mask and not self.is_line

    @property
    def is_real_line(self) -> bool:
        """Whether the unknowns are a whole line and real, so that the symbol decides."""
        return self.is_line and not self.is_complex

    @property
    def is_large(self) -> bool:
        """Whether FSAI is faster than transforms of the grid."""
        return self.full.c.size >= LONG

    @cached_property
    def decreases(self) -> bool:
        """Whether the coefficients are positive and decrease along each axis."""
        if self.is_complex or not self.full.is_even:
            return False
        return all(map(traits.decreases, traits.along_axes(self.full.c)))

    @cached_property
    def decays_slowly(self) -> bool:
        """Whether the coefficients decay along each axis like those of a half-space."""
        return all(map(traits.decays_slowly, traits.along_axes(self.full.c)))

    # The symbol of a line -----------------------------------------------------------------------

    @cached_property
    def line(self) -> ToeplitzOperator:
        """The matrix in double precision."""
        return self.full.astype(np.float64)

    @cached_property
    def samples(self) -> Array:
        """The symbol at θ = πk/m, k = 0 … m."""
        return symbol_of_line(self.line)

    @cached_property
    def factor(self) -> Columns | None:
        """The column of the inverse from the spectral factor; None if complex or refused."""
        if self.is_complex:
            return None
        with suppress(np.linalg.LinAlgError):
            return factor_symbol(self.line, self.samples)
        return None

    @property
    def is_hardly_resolved(self) -> bool:
        """Whether the symbol is positive and the n lags resolve it at least roughly."""
        return self.factor is not None and self.factor.residual <= HARDLY_RESOLVED

    @property
    def is_resolved(self) -> bool:
        """Whether the column from the spectral factor makes a preconditioner."""
        factor = self.factor
        return factor is not None and factor.residual <= RESOLVED and factor.is_definite

    def invert(self, inverse: Callable[..., LinearOperator], **known: Any) -> Make:
        """Return a function that makes a preconditioner of the line from known data."""

        def make(_: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
            return inverse(self.full, **known, dtype=dtype)

        return make

    # FSAI ---------------------------------------------------------------------------------------

    @property
    def suits_fsai(self) -> bool:
        """Whether FSAI can be used: real even coefficients, one or two axes."""
        return not self.is_complex and len(self.full.grid_shape) <= 2 and self.full.is_even

    @cached_property
    def suits_sine(self) -> bool:
        """Whether a mask is one blob, or nearly, and FSAI is not worth its set-up."""
        shape, mask = self.full.grid_shape, self._mask
        if mask is None or not (self.is_mask and self.suits_fsai) or len(shape) == 1:
            return False
        is_quick = not (self.is_worth_set_up or self.is_large)
        return is_quick and traits.fragmentation(mask.reshape(shape)) <= COMPACT

    @property
    def may_be_fsai(self) -> bool:
        """Whether FSAI is a candidate: first on a mask, and on a grid if cosine is refused.

        On a line it would take hundreds of iterations for a smooth covariance as wide as the line.
        """
        if not self.suits_fsai or self.is_line or self.suits_sine:
            return False
        is_line = len(self.full.grid_shape) == 1
        return not (is_line and self.decreases) or self.is_hardly_resolved

    @property
    def has_slow_transforms(self) -> bool:
        """Whether a grid length is slow for transforms; the cosine then takes twice the iterations.

        FSAI replaces it if the coefficients decay slowly, like those of a half-space.
        """
        is_slow = self.is_large and traits.has_slow_length(self.full.grid_shape)
        return self.suits_fsai and is_slow and self.decays_slowly


# What the rows make -----------------------------------------------------------------------------


def factorise(A: LinearOperator, *, dtype: DTypeLike | None = None) -> DenseInverse:
    """Return the inverse by a Cholesky factor; refuse it if it is not accurate enough."""
    inverse = DenseInverse(A, precision(unwrap(A)[0], dtype))
    if not inverse.is_accurate:
        raise np.linalg.LinAlgError(f"A is too ill-conditioned for a factor in {inverse.dtype}")
    return inverse


def couple(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return FSAI for all components together; refuse it if their coupling is weak."""
    joint = coupled_fsai(A, dtype)
    if joint is None:
        raise np.linalg.LinAlgError("the coupling is weak, or not that of a half-space")
    return joint


def quick_fsai(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return `fsai_preconditioner` with the fewest neighbours and the shortest set-up."""
    return fsai_preconditioner(A, neighbours=FEW, dtype=dtype)


# The table --------------------------------------------------------------------------------------


class Row(NamedTuple):
    """A row of the table.

    Attributes
    ----------
    function : callable
        The public function that makes the preconditioner.
    why : str
    when : callable
        ``when(facts)`` tells whether it is a candidate.
    how : callable, optional
        ``how(facts)`` returns a function that makes it; by default `function` is used.
    """

    function: Make
    why: str
    when: Callable[[Facts], bool]
    how: Callable[[Facts], Make] | None = None


def _read(rows: Iterable[Row], facts: Facts) -> Iterator[Candidate]:
    """Yield the candidates for a matrix."""
    for row in rows:
        if row.when(facts):
            make = row.function if row.how is None else row.how(facts)
            yield Candidate(row.function.__name__, row.why, make)


ROWS = (
    # A whole line; the numbers are iterations to 1e-8.
    Row(
        fsai_preconditioner,
        "a long line, slow decay",  # 4 to 12 iterations, cheap ones, and hardly any set-up.
        lambda f: f.is_real_line and f.is_large and f.decays_slowly,
    ),
    Row(
        sine_preconditioner,
        "a zero of the symbol at θ = 0",  # The sine transform does not sample it: 3 to 10.
        lambda f: f.is_real_line and traits.has_zero_at_start(f.samples),
        lambda f: f.invert(sine_inverse, samples=f.samples),
    ),
    Row(
        cosine_preconditioner,
        "a zero of the symbol at θ = π",  # The cosine transform does not sample it.
        lambda f: f.is_real_line and traits.has_zero_at_start(f.samples[::-1]),
        lambda f: f.invert(cosine_inverse, samples=f.samples),
    ),
    Row(
        cosine_preconditioner,
        "an exponential covariance",  # About as wide as the matrix: 2 to 5.
        lambda f: f.is_real_line and f.decreases and traits.decays_exponentially(f.line.c),
        lambda f: f.invert(cosine_inverse, samples=f.samples),
    ),
    Row(
        spectral_preconditioner,
        "a symbol that is resolved",  # 1 to 8.
        lambda f: f.is_real_line and f.is_resolved,
        lambda f: f.invert(spectral_inverse, factor=f.factor),
    ),
    Row(
        cosine_preconditioner,
        "a wide covariance",  # As wide as the matrix, with a simple tail: 2 to 6.
        lambda f: f.is_real_line and f.decreases and f.is_hardly_resolved,
        lambda f: f.invert(cosine_inverse, samples=f.samples),
    ),
    Row(
        spectral_preconditioner,
        "nearly the inverse, for any symbol",
        lambda f: f.is_line,
        lambda f: f.invert(spectral_inverse, factor=f.factor),
    ),
    # A whole grid of several axes.
    Row(
        fsai_preconditioner,
        f"slow transforms and slow decay; {FEW} neighbours",
        lambda f: f.is_grid and f.has_slow_transforms,
        lambda f: quick_fsai,
    ),
    Row(cosine_preconditioner, "a whole grid", lambda f: f.is_grid and not f.is_complex),
    # A mask, or a grid for which the cosine is refused.
    Row(
        sine_preconditioner,
        "a mask in three axes or more, or a kernel that is not even",
        lambda f: f.is_mask and not (f.is_complex or f.suits_fsai),
    ),
    Row(sine_preconditioner, "one blob on a small grid, and one solve", lambda f: f.suits_sine),
    Row(
        fsai_preconditioner,
        f"one solve; {FEW} neighbours",
        lambda f: f.may_be_fsai and not f.is_worth_set_up,
        lambda f: quick_fsai,
    ),
    Row(
        fsai_preconditioner,
        "more solves; as many neighbours as the kernel needs",
        lambda f: f.may_be_fsai and f.is_worth_set_up,
    ),
    Row(
        fsai_preconditioner,
        f"{SMOOTH} neighbours, for a smooth kernel",
        lambda f: f.may_be_fsai,
        lambda f: partial(fsai_preconditioner, neighbours=SMOOTH),
    ),
    Row(chan_preconditioner, "any kernel", lambda f: f.is_complex and not f.is_line),
)

# A trial compares the first accepted row of the table with these and with no preconditioner. Sine
# is as good as cosine if that is not in the table. T. Chan's circulant wraps around: for a
# covariance as wide as its grid it takes several times the iterations of no preconditioner.
OTHERS = (
    Row(sine_preconditioner, "any kernel", lambda f: not f.is_complex),
    Row(chan_preconditioner, "coefficients that do not decrease", lambda f: not f.decreases),
    Row(
        fft_preconditioner,
        "a kernel that is not even along each axis",  # A motion blur: 50 iterations, cosine 700.
        lambda f: f.is_grid and not (f.is_complex or f.full.is_even),
    ),
)


# Active sets ------------------------------------------------------------------------------------


def is_fsai_worthwhile(
    elements: int, fragmentation: Callable[[], float], change: float = 0.0
) -> bool:
    """Whether FSAI is worth its set-up on an active set.

    Parameters
    ----------
    elements : int
        The elements of the grid, all components together.
    fragmentation : callable
        Returns the fragmentation of the set; it is slow, and therefore called last.
    change : float, optional
        The share of the set that has just changed.
    """
    return change <= SETTLED and elements >= LARGE and fragmentation() > COMPACT


def is_fsai_kept(change: float) -> bool:
    """Whether FSAI is still good after this share of an active set has changed."""
    return change <= KEPT
