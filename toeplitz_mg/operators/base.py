"""The base class of all operators; vectors are rows, on the last axis of an array."""

from collections.abc import Callable
from functools import wraps
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse import issparse
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import NUMPY, Library
from toeplitz_mg.engine.ranks import SERIAL, is_serial
from toeplitz_mg.engine.vectors import VECTORS, Vectors
from toeplitz_mg.operators import algebra
from toeplitz_mg.operators.coefficients import check_precision

NUMBERS = "fcbui"  # Kinds of dtypes that can be multiplied: real, complex, boolean, integer.


def _check_vectors(x: Any) -> Any:
    """Return `x` if an operator can be multiplied with it; refuse other objects."""
    if type(x) is np.ndarray and x.dtype.kind in NUMBERS:
        return x
    if isinstance(x, LinearOperator) or issparse(x):
        return x
    dtype = NUMPY.read("x", x).dtype
    if dtype.kind not in NUMBERS:
        raise TypeError(f"x has dtype {dtype}, but must be of numbers")
    return x


def _of_numbers(name: str) -> Callable[[Any, Any], Any]:
    """Return a method of SciPy's operators that accepts only arrays of numbers."""
    method = getattr(LinearOperator, name)

    @wraps(method)
    def multiply(A: Any, x: Any) -> Any:
        if A.library is NUMPY:
            return method(A, _check_vectors(x))
        return _multiply(name, A, A.library.read("x", x))

    return multiply


def _at_once(method: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Return a multiplication method that skips SciPy's checks for single vectors.

    With few unknowns these checks take several times as long as the product.
    """

    @wraps(method)
    def multiply(A: Any, x: Any) -> Any:
        if (
            type(x) is np.ndarray
            and x.shape == A.shape[1:]
            and x.dtype.kind in NUMBERS
            and A.library is NUMPY
        ):
            return A.apply(x)
        return method(A, x)

    return multiply


def _multiply(name: str, A: "GridOperator", x: Any) -> Any:
    """Do the same as a SciPy method, for arrays of another library, which SciPy might copy."""
    from_left = name in ("rdot", "__rmul__")
    columns = x.ndim > 1 and not from_left
    if x.ndim not in ((1, 2) if "dot" in name or from_left else (1 + ("mat" in name[-3:]),)) or (
        x.shape[-2 if columns else -1] != A.shape[0 if from_left or name[0] == "r" else 1]
    ):
        raise ValueError(f"x has shape {tuple(x.shape)}, but the operator has {A.shape}")
    if from_left:
        return A._transpose().apply(x)
    B = A._adjoint() if name[0] == "r" else A
    return B.apply(x.mT).mT if columns else B.apply(x)


class GridOperator(LinearOperator):
    """A square matrix that acts on a grid, or on the unknowns of a grid.

    A subclass defines `apply`; everything that SciPy's `LinearOperator` needs follows from it. The
    operator is Hermitian (symmetric if it is real), unless the subclass defines ``_adjoint``.

    Parameters
    ----------
    dtype : float32, float64, complex64 or complex128
    grid_shape : tuple of int
        The shape of the whole grid.
    work : float
        The cost of one application, in products with a Toeplitz matrix on the whole grid (the work
        unit of the paper, §5.2).
    size : int, optional
        The number of unknowns, if it is not the number of points of the grid.
    library : Library, optional
        The library of the arrays that it multiplies, by default NumPy. The dtype is always NumPy's.

    Attributes
    ----------
    grid_shape : tuple of int
    work : float
    library : Library
    ranks : Ranks
        The processes that share the rows of its vectors; here only one.
    """

    ranks = SERIAL
    _is_toeplitz = False  # Whether it is a Toeplitz matrix, which a ToeplitzSum may contain.

    def __init__(
        self,
        dtype: DTypeLike,
        grid_shape: tuple[int, ...],
        work: float,
        size: int | None = None,
        library: Library = NUMPY,
    ) -> None:
        n = prod(grid_shape) if size is None else size
        super().__init__(np.dtype(dtype), (n, n))
        self.grid_shape = grid_shape
        self.work = work
        self.library = library

    @property
    def vectors(self) -> Any:
        """The inner products and updates of the vectors of this operator."""
        return self.library.vectors

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X`, without the checks of ``A @ x``.

        Parameters
        ----------
        X : ndarray of shape (..., N)
        out : ndarray of the shape of `X`, optional
            Array for the result, which saves an allocation. It may be `X`.

        Returns
        -------
        ndarray of the shape of `X`
            `out`, or a new array with the dtype of NumPy's product of these dtypes.
        """
        # Not an `abstractmethod`, whose metaclass would make isinstance(A, GridOperator) slower.
        raise NotImplementedError

    def converges(self, A: LinearOperator) -> bool | None:
        """Whether the iteration x ← x + S (b - A x) converges, where S is this operator.

        Parameters
        ----------
        A : LinearOperator
            The Hermitian positive definite matrix of which this is an approximate inverse.

        Returns
        -------
        bool or None
            True if it converges (or almost certainly does), False if it may diverge, None if this
            is not known.
        """
        return None

    def _matvec(self, x: Array) -> Array:
        # SciPy before 1.18 passes a column of shape (n, 1) unchanged.
        n = self.shape[1]
        return self.apply(x.reshape(n) if x.shape == (n, 1) != (1, 1) else x)

    def _matmat(self, X: Array) -> Array:
        return self.apply(X.mT).mT

    def _adjoint(self) -> "GridOperator":
        return self

    def _transpose(self) -> "GridOperator":
        adjoint = self._adjoint()
        return Conjugate(adjoint) if self.dtype.kind == "c" else adjoint

    def conjugate(self) -> "GridOperator":
        """Return the complex conjugate of the matrix (a real matrix returns itself)."""
        return self._transpose()._adjoint() if self.dtype.kind == "c" else self

    # SciPy itself would ignore a mask, and accept any object with a shape.
    dot = _at_once(algebra.scaling("right", _of_numbers("dot")))
    __matmul__ = _at_once(LinearOperator.__matmul__)
    matvec = _at_once(_of_numbers("matvec"))
    matmat = _of_numbers("matmat")
    rmatvec = _of_numbers("rmatvec")
    rmatmat = _of_numbers("rmatmat")
    if hasattr(LinearOperator, "rdot"):  # Since SciPy 1.18.
        rdot = _of_numbers("rdot")
    __rmul__ = algebra.scaling("left", _of_numbers("__rmul__"))
    __add__ = __radd__ = algebra.add
    __sub__ = algebra.subtract
    __rsub__ = algebra.subtract_from
    __neg__ = algebra.negate
    __truediv__ = algebra.divide
    __pow__ = algebra.power

    def scaled(self, left: Any = None, right: Any = None) -> Any:
        """Return L A R in the form of this package, or NotImplemented.

        Parameters
        ----------
        left, right : number or ndarray of shape (N,), optional
            Multiples of the unit matrix, or the entries of diagonal matrices.
        """
        return NotImplemented

    def composed(self, other: Any) -> Any:
        """Return the product with an operator in the form of this package, or NotImplemented."""
        return NotImplemented

    def plus(self, other: Any) -> Any:
        """Return the sum in the form of this package, or NotImplemented.

        Parameters
        ----------
        other : LinearOperator, or ndarray of shape (N,)
            An operator, or the entries of a diagonal matrix.
        """
        return NotImplemented


class Conjugate(GridOperator):
    """The complex conjugate of a matrix, which maps x to the conjugate of A conj(x)."""

    def __init__(self, A: GridOperator) -> None:
        super().__init__(A.dtype, A.grid_shape, A.work, A.shape[0], A.library)
        self._A = A

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        Y = self._A.apply(self.library.conj(X), out)
        return np.conjugate(Y, out=Y) if self.library is NUMPY else self.library.conj(Y)

    def _adjoint(self) -> GridOperator:
        adjoint = self._A._adjoint()
        return self if adjoint is self._A else Conjugate(adjoint)

    def _transpose(self) -> GridOperator:
        return self._A._adjoint()

    def __repr__(self) -> str:
        return f"<Conjugate of {self._A!r}>"


class MatrixOperator(GridOperator):
    """A grid operator with known entries, which supports the operations of a matrix.

    A subclass defines `entries`, `diagonal`, `is_symmetric`, `is_hermitian`, ``_cast`` for another
    precision, and ``_transposed`` if it can be complex.
    """

    def astype(self: Any, dtype: DTypeLike) -> Any:
        """Return the matrix in another precision, or itself if it has that precision.

        Parameters
        ----------
        dtype : dtype
            float32 or float64; for a complex matrix complex64 or complex128.
        """
        with self.ranks.agree() as same:
            same["dtype"] = dtype = check_precision(dtype, self.dtype)
            self.library.require("dtype", dtype)
        return self if self.dtype == dtype else self._cast(dtype)

    def toarray(self) -> Array:
        """Return the matrix as a dense array of shape (N, N), without any transform."""
        index = np.arange(self.shape[0])
        return self.entries(index, index)

    if TYPE_CHECKING:  # SciPy has no type hints; `algebra` defines these at run time.

        def __mul__(self, x: complex) -> "MatrixOperator": ...
        def __rmul__(self, x: complex) -> "MatrixOperator": ...
        def __truediv__(self, x: complex) -> "MatrixOperator": ...
        def __neg__(self) -> "MatrixOperator": ...

    trace = algebra.trace
    __getitem__ = algebra.take
    __iter__ = None  # Python would iterate over row indices.

    def _transpose(self) -> Any:
        if self.is_symmetric:
            return self
        return self._transposed() if self.dtype.kind == "c" else self._adjoint()

    def _describe(self, grid_shape: tuple[int, ...] | None = None) -> str:
        """Return the grid, the symmetry and the precision, for a repr."""
        grid = " x ".join(map(str, grid_shape or self.grid_shape))
        if self.is_symmetric:
            return f"{grid}, symmetric, {self.dtype}"
        return f"{grid}, {'Hermitian' if self.is_hermitian else 'general'}, {self.dtype}"


def apply_to_rows(A: LinearOperator, X: Array, out: Array | None = None) -> Array:
    """Multiply each row of `X` by an operator, of this package or not.

    Parameters
    ----------
    A : LinearOperator of shape (n, n), or an object with `apply` and `vectors`
    X : ndarray of shape (n,) or (k, n)
    out : ndarray of the shape of `X`, optional
        Array for the result. It may be `X`.

    Returns
    -------
    ndarray of the shape of `X`

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.sparse.linalg import aslinearoperator
    >>> A = aslinearoperator(np.array([[1.0, 2.0], [3.0, 4.0]]))
    >>> apply_to_rows(A, np.array([[1.0, 0.0], [0.0, 1.0]]))
    array([[1., 3.],
           [2., 4.]])
    """
    if isinstance(A, GridOperator) or hasattr(A, "vectors"):
        return A.apply(X, out)
    # A user's operator may return shape (n, 1) or an np.matrix.
    Y = np.asarray(A._matvec(X) if X.ndim == 1 else A._matmat(X.T).T).reshape(X.shape)
    if out is None:
        return Y
    if Y.dtype.kind == "c" and out.dtype.kind != "c":
        raise TypeError(f"out has dtype {out.dtype}, but the product is complex")
    out[...] = Y
    return out


def grid_of(A: LinearOperator) -> tuple[int, ...]:
    """Return the shape of the grid on which an operator acts, (n,) if it has no `grid_shape`."""
    return A.grid_shape if isinstance(A, GridOperator) else (A.shape[0],)


def work_of(A: LinearOperator) -> float:
    """Return the work of one application of an operator, 0 if it has no `work`."""
    return A.work if isinstance(A, GridOperator) else 0.0


def vectors_of(A: Any) -> Vectors:
    """Return the vector operations of an operator or of a matrix."""
    return getattr(A, "vectors", VECTORS)


def library_for(A: Any) -> Library:
    """Return the array library of an operator or of a matrix."""
    return getattr(A, "library", NUMPY)


def require_numpy(
    A: Any, what: str, others: str = "fft, cosine, sine, chan, strang and fsai"
) -> None:
    """Raise a TypeError if A has arrays of another library, which `what` does not support.

    `others` names the preconditioners that do.
    """
    library = library_for(A)
    if library is not NUMPY:
        raise TypeError(
            f"A has arrays of {library.name}, but must have those of numpy for {what}: for others "
            f"use cg, gmres and richardson, and the preconditioners {others}"
        )


def require_serial(
    name: str,
    A: Any,
    instead: str = "toeplitz_mg.slabs has the preconditioners fft, cosine, sine and fsai for it, "
    "and cg and richardson take it",
) -> None:
    """Raise a TypeError for an operator on slabs if one of a single process is needed."""
    if not is_serial(A):
        raise TypeError(
            f"{name} is {A!r}, an operator on slabs, but must be one of a single process: {instead}"
        )
