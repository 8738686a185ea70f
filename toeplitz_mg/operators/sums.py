"""Sums of Toeplitz matrices scaled by diagonal ones, and a Toeplitz matrix near such a sum."""

from collections.abc import Iterable
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.sparse import issparse

from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.operators.base import GridOperator, MatrixOperator, require_numpy
from toeplitz_mg.values import refuse_masked

if TYPE_CHECKING:  # At run time it would be a circular import.
    from toeplitz_mg.operators.toeplitz import ToeplitzOperator


class Term(NamedTuple):
    """The product of a diagonal matrix, a Toeplitz matrix and another diagonal matrix."""

    left: Any  # The entries, or a number; None for the unit matrix.
    A: "ToeplitzOperator"
    right: Any


class ToeplitzSum(MatrixOperator):
    """A sum Σ L A R + D with Toeplitz matrices A and diagonal matrices L, R and D.

    Made by ``A + D``, ``D @ A``, ``A @ D`` and their sums, where D is a diagonal matrix of SciPy
    (`scipy.sparse.diags_array`, `scipy.sparse.eye_array`). If the result is Toeplitz, for example
    because D is constant, it is a ToeplitzOperator.

    Parameters
    ----------
    terms : iterable of Term
        The matrices are ToeplitzOperators on one grid. L and R are arrays of shape (N,), numbers,
        or None for the unit matrix.
    diagonal : ndarray of shape (N,), optional
        The entries of D, by default zero.

    Attributes
    ----------
    terms : tuple of Term
        Numbers are multiplied into the matrices, and terms with the same L and R are added.
    offset : ndarray of shape (N,) or None
        The entries of D.
    is_symmetric : bool
        Equal to its transpose ``A.T``.
    is_hermitian : bool
        Equal to its conjugate transpose ``A.H``. For a real matrix this is the same.
    grid_shape : tuple of int

    Raises
    ------
    ValueError
        If there is no term, a matrix lives on another grid, or a diagonal has another shape or
        entries that are not finite.
    TypeError
        If a matrix is not a ToeplitzOperator.

    See Also
    --------
    ToeplitzOperator : the Toeplitz matrices.
    tau_preconditioner : a preconditioner for fractional diffusion.
    gmres : a solver for sums that are not symmetric.

    Notes
    -----
    A product costs one work unit for each Toeplitz matrix.

    Preconditioners approximate a sum S by one Toeplitz matrix. S is first scaled from both sides by
    the inverse square roots of its diagonal; then each diagonal matrix is replaced by its mean, and
    each Toeplitz matrix by its symmetric part (unless the preconditioner takes any matrix). The
    result is symmetric positive definite: use `cg` if S is symmetric and `gmres` otherwise. The
    number of iterations stays bounded if the coefficients are smooth. A LinAlgError is raised if
    the diagonal of S is not positive, or if the Toeplitz matrix is not positive definite, which can
    happen for a positive definite S if neighbouring entries of D differ by orders of magnitude.
    (See `toeplitz_mg.operators.sums.average`.)

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.sparse import diags_array
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator([2.0, -1.0, 0.0])
    >>> S = diags_array([1.0, 2.0, 3.0]) @ A + diags_array([0.0, 0.0, 1.0])
    >>> S
    <ToeplitzSum D A + D, 3, general, float64>
    >>> S.toarray()
    array([[ 2., -1.,  0.],
           [-2.,  4., -2.],
           [ 0., -3.,  7.]])
    """

    def __init__(self, terms: Iterable[Term], diagonal: Array | None = None) -> None:
        given = _read_terms(terms)
        n = given[0].A.shape[0]
        diagonal = _freeze("diagonal", diagonal, n)
        frozen = collect(
            Term(_freeze("left", left, n), A, _freeze("right", right, n))
            for left, A, right in given
        )
        parts = chain((diagonal,), *frozen)
        dtype = np.result_type(*(part.dtype for part in parts if part is not None))
        # Convert all parts to the precision of the sum, which its dtype promises.
        self.terms = tuple(Term(*(_cast(part, dtype) for part in term)) for term in frozen)
        self.offset = _cast(diagonal, dtype)
        work = sum(term.A.work for term in self.terms)
        super().__init__(dtype, self.terms[0].A.grid_shape, work)
        self.is_symmetric = self.is_hermitian = self._is(self._transposed_terms())
        if dtype.kind == "c":
            is_real = diagonal is None or not diagonal.imag.any()
            self.is_hermitian = is_real and self._is(self._adjoint_terms())

    def scaled(self, left: Any = None, right: Any = None) -> Any:
        """Return L A R (see `GridOperator.scaled`)."""
        terms: tuple[Term, ...] = self.terms
        offset = self.offset
        for D, is_left in ((left, True), (right, False)):
            offset = None if offset is None else _times(offset, D)
            if (constant := constant_of(D)) is not None:
                # Into the Toeplitz matrices, so that equal diagonals stay equal and symmetric.
                terms = tuple(Term(L, A.times(constant), R) for L, A, R in terms)
            elif is_left:
                terms = tuple(Term(_times(D, L), A, R) for L, A, R in terms)
            else:
                terms = tuple(Term(L, A, _times(R, D)) for L, A, R in terms)
        return simplify(terms, offset)

    def plus(self, other: Any) -> Any:
        """Return the sum (see `GridOperator.plus`)."""
        if isinstance(other, np.ndarray):
            return simplify(self.terms, _plus(self.offset, other))
        if not isinstance(other, GridOperator) or other.grid_shape != self.grid_shape:
            return NotImplemented
        terms, offset = terms_of(other)
        return simplify(self.terms + terms, _plus(self.offset, offset)) if terms else NotImplemented

    def _cast(self, dtype: np.dtype[Any]) -> "ToeplitzSum":
        terms = (Term(*(_cast(part, dtype) for part in term)) for term in self.terms)
        return ToeplitzSum(terms, _cast(self.offset, dtype))

    @property
    def norm_bound(self) -> float:
        """An upper bound of the 2-norm: the sum of the bounds of the terms."""
        bound = _largest(self.offset) if self.offset is not None else 0.0
        for left, A, right in self.terms:
            bound += _largest(left) * float(A.norm_bound) * _largest(right)
        return bound

    def entries(self, rows: Array, columns: Array) -> Array:
        """Return the entries in these rows and columns, positions in the flattened grid."""
        total = np.zeros((len(rows), len(columns)), self.dtype)
        if self.offset is not None:
            total += np.where(np.equal.outer(rows, columns), self.offset[columns], 0)
        for left, A, right in self.terms:
            part = A.entries(rows, columns)
            part = part if left is None else left[rows, np.newaxis] * part
            total += part if right is None else part * right[columns]
        return total

    def diagonal(self) -> Array:
        """Return the entries (i, i), shape (N,)."""
        total = np.zeros(self.shape[0], self.dtype)
        for left, A, right in self.terms:
            total += _times(_times(left, A.diagonal()), right)
        return total if self.offset is None else total + self.offset

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        if out is None:
            out = np.empty(X.shape, np.result_type(X, self.dtype))
        total = workspace(X.shape, out.dtype)
        np.multiply(X, 0.0 if self.offset is None else self.offset, out=total)
        part = workspace(X.shape, out.dtype)
        for left, A, right in self.terms:
            np.multiply(X, 1.0 if right is None else right, out=part)
            A.apply(part, part)
            if left is not None:
                part *= left
            total += part
        out[...] = total
        return out

    def _adjoint(self) -> "ToeplitzSum":
        return self if self.is_hermitian else ToeplitzSum(self._adjoint_terms(), _conj(self.offset))

    def _transposed(self) -> "ToeplitzSum":
        return ToeplitzSum(self._transposed_terms(), self.offset)

    def _adjoint_terms(self) -> list[Term]:
        return [Term(_conj(right), A.H, _conj(left)) for left, A, right in self.terms]

    def _transposed_terms(self) -> list[Term]:
        return [Term(right, A.T, left) for left, A, right in self.terms]

    def _is(self, terms: list[Term]) -> bool:
        """Whether the sum has these terms, in any order."""
        return all(any(_is_same_term(term, other) for other in self.terms) for term in terms)

    def __repr__(self) -> str:
        names = [
            f"{'D ' * (left is not None)}A{' D' * (right is not None)}"
            for left, _, right in self.terms
        ] + ["D"] * (self.offset is not None)
        return f"<ToeplitzSum {' + '.join(names)}, {self._describe()}>"


def terms_of(A: Any) -> tuple[tuple[Term, ...], Array | None]:
    """Return the terms and the diagonal of a sum or a Toeplitz matrix; no terms for others."""
    if isinstance(A, ToeplitzSum):
        return A.terms, A.offset
    is_toeplitz = isinstance(A, GridOperator) and A._is_toeplitz
    return ((Term(None, A, None),) if is_toeplitz else ()), None


def collect(terms: Iterable[Term]) -> list[Term]:
    """Return the same sum with fewer terms.

    Numbers and constant diagonals are multiplied into the Toeplitz matrices, and matrices between
    equal diagonals are added.
    """
    simple: list[Term] = []
    for left, A, right in terms:
        for factor in map(constant_of, (left, right)):
            A = A if factor is None else A.times(factor)
        left, right = (
            None if constant_of(factor) is not None else factor for factor in (left, right)
        )
        for k, other in enumerate(simple):
            if _is_same(left, other.left) and _is_same(right, other.right):
                simple[k] = Term(left, other.A.plus(A), right)
                break
        else:
            simple.append(Term(left, A, right))
    return simple


def simplify(terms: Iterable[Term], diagonal: Array | None = None) -> Any:
    """Return a sum as a ToeplitzOperator if it is one, otherwise as a ToeplitzSum of few terms."""
    simple = collect(terms)
    constant = constant_of(diagonal)
    for k, (left, A, right) in enumerate(simple):
        if constant is not None and left is None and right is None:
            simple[k], diagonal = Term(None, A.plus_unit(constant), None), None
    if len(simple) == 1 and simple[0].left is None and simple[0].right is None and diagonal is None:
        return simple[0].A
    return ToeplitzSum(simple, diagonal)


def hermitian_part(A: Any) -> Any:
    """Return (A + Aᴴ)/2; A itself if it is Hermitian."""
    return A if A.H is A else (A + A.H) / 2


def advise_of_negative(largest: float) -> str:
    """Return additional advice if the largest diagonal entry of a matrix is negative."""
    if not largest < 0.0:
        return ""
    return "; the diagonal of -A is positive: if -A is positive definite solve -A x = -b"


def average(
    A: ToeplitzSum, mask: Mask | None = None, *, is_any: bool = False
) -> tuple["ToeplitzOperator", Array]:
    """Return a Toeplitz matrix T and the entries of a diagonal matrix D with D T⁻¹ D ≈ A⁻¹.

    D² is the inverse of the diagonal of A. In D A D, whose diagonal is all ones, each diagonal
    matrix is replaced by its mean; T is the Hermitian part of the result. For a sum A + L with a
    small L this is A plus the mean of L; for L A it is A, scaled from both sides.

    Parameters
    ----------
    A : ToeplitzSum
    mask : ndarray of bool, optional
        The unknowns, over which the means are taken.
    is_any : bool
        Whether T may be any matrix; its Hermitian part is not taken then.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the diagonal is not positive.

    References
    ----------
    X. Huang, X.-L. Lin, M. K. Ng, H.-W. Sun, Spectral analysis for preconditioning of
    multi-dimensional Riesz fractional diffusion equations, Numer. Math. Theor. Meth. Appl. 15
    (2022). X.-L. Lin, X. Huang, M. K. Ng, H.-W. Sun, A τ-preconditioner for a non-symmetric linear
    system arising from multi-dimensional Riemann-Liouville fractional diffusion equation, Numer.
    Algorithms 92 (2023), for the symmetric part.
    """
    unknowns = slice(None) if mask is None else mask.ravel()
    diagonal = A.diagonal()[unknowns].real.astype(np.float64)
    if not diagonal.min() > 0.0:
        raise np.linalg.LinAlgError(
            f"the diagonal of A has the entry {diagonal.min():.3g}, but must be positive for a "
            f"preconditioner: use GMRES without one{advise_of_negative(float(diagonal.max()))}"
        )
    mean: Any = 0
    for left, T, right in A.terms:
        weights = 1.0 / diagonal
        for factor in (left, right):
            weights = weights if factor is None else weights * factor[unknowns]
        mean = mean + weights.mean() * T
    if A.offset is not None:
        mean = mean.plus_unit(np.mean(A.offset[unknowns] / diagonal))
    # The mean of a Hermitian sum is Hermitian up to the rounding of complex weights.
    mean = mean if is_any and not A.is_hermitian else hermitian_part(mean)
    return mean.astype(A.dtype), 1.0 / np.sqrt(diagonal)


def _read_terms(terms: Any) -> list[Term]:
    """Return the terms as a list; raise an error unless they are Toeplitz matrices on one grid."""
    given = list(terms) if isinstance(terms, Iterable) else None
    if given is None or not all(isinstance(term, tuple) and len(term) == 3 for term in given):
        raise TypeError(
            f"terms is {terms!r}, but must be a list of Terms (left, A, right), where left and "
            "right are None if there is no diagonal matrix"
        )
    if not given:
        raise ValueError("terms is empty, but must have at least one term")
    grid_shape = getattr(given[0][1], "grid_shape", None)
    for _, A, _ in given:
        if not (isinstance(A, GridOperator) and A._is_toeplitz):
            raise TypeError(f"terms has {A!r}, but the matrices must be ToeplitzOperators")
        require_numpy(A, "a sum with a diagonal matrix")
        if A.grid_shape != grid_shape:
            raise ValueError(
                f"terms has matrices on the grids {grid_shape} and {A.grid_shape}, but all must "
                "live on one"
            )
    return [Term(*term) for term in given]


def constant_of(factor: Any) -> Any:
    """Return the number if a factor is a number or a diagonal of equal entries; else None."""
    if np.ndim(factor) == 0:
        return factor
    return factor[0] if (factor == factor[0]).all() else None


def _freeze(name: str, factor: Any, n: int) -> Any:
    """Return a read-only array of the entries of a diagonal; a number or None unchanged."""
    if factor is None:
        return None
    if issparse(factor):
        raise TypeError(f"{name} is {factor!r}, but must be the entries D.diagonal()")
    entries = refuse_masked(name, factor)
    if entries.dtype.kind not in "buifc":
        raise TypeError(f"{name} has dtype {entries.dtype}, but must be of numbers")
    is_number = entries.ndim == 0 and name != "diagonal"
    if not is_number and entries.shape != (n,):
        raise ValueError(f"{name} has shape {entries.shape}, but must have the {n} entries of D")
    if not np.isfinite(entries).all():
        raise ValueError(f"{name} has entries that are not finite, but all must be")
    if is_number:
        return factor
    if entries.dtype.char not in "fdFD":  # Not a precision of matrices; sums may overflow.
        entries = entries.astype(np.complex128 if entries.dtype.kind == "c" else np.float64)
    if entries.flags.writeable or entries.base is not None:  # The caller could change it.
        entries = entries.copy()
        entries.flags.writeable = False
    return entries


def _times(a: Any, b: Any) -> Any:
    """Multiply factors; None stands for the unit matrix."""
    if a is None or b is None:
        return b if a is None else a
    return a * b


def _plus(a: Array | None, b: Array | None) -> Array | None:
    """Add diagonals; None stands for zero."""
    if a is None or b is None:
        return b if a is None else a
    return a + b


def _conj(factor: Array | None) -> Array | None:
    return factor if factor is None or factor.dtype.kind != "c" else factor.conj()


def _cast(part: Any, dtype: np.dtype[Any]) -> Any:
    """Return a part in the precision of `dtype`; real parts of a complex matrix stay real."""
    wanted = dtype if part is None or part.dtype.kind == "c" else np.dtype(dtype.char.lower())
    if part is None or part.dtype == wanted:
        return part
    part = part.astype(wanted)
    if isinstance(part, np.ndarray):
        part.flags.writeable = False
    return part


def _largest(factor: Array | None) -> float:
    """Return the largest absolute entry of a diagonal matrix; 1 for the unit matrix, None."""
    return 1.0 if factor is None else float(np.abs(factor).max())


def _is_same(a: Array | None, b: Array | None) -> bool:
    """Whether two diagonals are equal; None stands for the unit matrix."""
    if a is None or b is None:
        return a is b
    return a is b or np.array_equal(a, b)


def _is_same_term(term: Term, other: Term) -> bool:
    return (
        _is_same(term.left, other.left)
        and _is_same(term.right, other.right)
        and term.A.equals(other.A)
    )
