"""The inverse of a Toeplitz matrix from its first column and row, by the Gohberg-Semencul formula.

`GohbergSemencul` checks the input; `GohbergSemenculProduct` multiplies with FFTs.
"""

from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.fourstep import Factors
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.products import multiply_rows
from toeplitz_mg.engine.transforms import plan_of
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.base import GridOperator
from toeplitz_mg.values import refuse_masked


class GohbergSemencul(GridOperator):
    """The inverse of a Toeplitz matrix A, given its first column and its first row.

    A product costs two work units, somewhat more if n has a large prime factor, for which
    transforms are slow.

    Parameters
    ----------
    x : ndarray of shape (n,), real or complex
        First column of the inverse, A⁻¹ e₁, whose first entry must not be zero.
    y : ndarray of shape (n,), optional
        First row of the inverse, A⁻ᵀ e₁; its first entry is ignored, because it is x[0]. By default
        the matrix is symmetric or Hermitian and positive definite: the row is x̄, and x[0] must be
        positive.

    Raises
    ------
    numpy.linalg.LinAlgError
        If x[0] is zero, or, without `y`, not positive: no such matrix has this inverse.
    ValueError
        If `x` and `y` have different lengths.

    References
    ----------
    I. Gohberg, A. Semencul, On the inversion of finite Toeplitz matrices and their continuous
    analogs, Mat. Issled. 7 (1972). For the form with circulants see `GohbergSemenculProduct`.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.linalg import toeplitz
    >>> A = toeplitz([2.0, 1.0, 0.0], [2.0, -1.0, 3.0])
    >>> inverse = np.linalg.inv(A)
    >>> G = GohbergSemencul(inverse[:, 0], inverse[0])
    >>> bool(np.allclose(G @ np.eye(3), inverse))
    True
    """

    def __init__(
        self, x: Array, y: Array | None = None, *, product: "GohbergSemenculProduct | None" = None
    ) -> None:
        x = refuse_masked("x", x)
        self.is_hermitian = y is None
        if y is None:
            if not (x[0].real > 0.0 and x[0].imag == 0.0):
                raise np.linalg.LinAlgError(
                    f"the first entry of the inverse is {x[0]:.3g}, but must be positive for a "
                    "positive definite matrix"
                )
            y = x.conj() if x.dtype.kind == "c" else x
        y = refuse_masked("y", y)
        if y.shape != x.shape:
            raise ValueError(f"x has shape {x.shape} and y has {y.shape}, but must have the same")
        if x[0] == 0.0:
            raise np.linalg.LinAlgError(
                "the first entry of the inverse is 0, but the formula divides by it: A without its "
                "last row and column is singular; solve_toeplitz((c, r), b) needs no inverse"
            )
        dtype = np.result_type(x, y)
        self.x = x.astype(dtype)
        self.y = self.x if y is x else y.astype(dtype)
        self.y[0] = self.x[0]
        self.x.flags.writeable = self.y.flags.writeable = False
        if product is None:
            column, row = (a.astype(np.result_type(dtype, np.float64)) for a in (self.x, self.y))
            product = GohbergSemenculProduct.of(column, None if self.is_hermitian else row, dtype)
        self._product = product
        super().__init__(dtype, product.grid_shape, product.points / len(x))

    def apply(self, V: Array, out: Array | None = None) -> Array:
        """Multiply each row of `V` (see `GridOperator.apply`)."""
        return self._product(V, out)

    def _adjoint(self) -> "GohbergSemencul":
        if self.is_hermitian:
            return self
        return GohbergSemencul(self.y.conj(), self.x.conj(), product=self._product.adjoint())

    def __repr__(self) -> str:
        return f"<GohbergSemencul {self.shape[0]}, {self.dtype}>"


class GohbergSemenculProduct:
    """Multiplication by the inverse of a Toeplitz matrix, given its first column x and row y.

    With the circulant C(a) and the skew-circulant S(a) that have the first column a, the inverse is

        (C(x) S(y)ᵀ + C(y)ᵀ S(x))/(2 x₀).

    For real x and y this is the real part of (C(x) - i C(y)ᵀ) (S(y)ᵀ + i S(x))/(2 x₀): four
    transforms of length n, as much work as two products with a Toeplitz matrix of that size. For
    complex x and y each term needs four transforms; a product with their matrix also costs twice as
    much.

    If y = x̄, all eigenvalues can be real. Let p + i q be those of C(x) and s + i t those of S(x).
    The terms are then the products of the matrices with the eigenvalues 2 p and s, and 2 q and t.
    For a real x their sum is the real part of one product, with p - q and 2 (s - t).

    If transforms of length n are slow, p zeros are appended to x, y and the vectors. This gives the
    formula for a matrix of size n + p with the original matrix as leading block (its further
    reflection coefficients are zero). Block elimination of the last p unknowns gives the inverse of
    the block: the large inverse minus Σ (Zˢ w) (Zˢ u)ᵀ/x₀, s < p. Here u is the reversed column [0
    x_(n-1) … x₁], w the reversed row, and Z shifts down by one.

    Parameters
    ----------
    factors : list of (tuple of float, list of ndarray)
        Factors of the products whose sum, or its real part, is the inverse (see `OneStep`).
    ends : (ndarray, ndarray), of shape (n + p - 1,)
        Vectors whose windows of length n are Zˢ u and Zˢ w, s = p - 1 … 0, divided by factors with
        the product 2 x₀.
    n : int
    dtype : float32, float64, complex64 or complex128
    plan : OneStep or FourStep
        Determines the order of the eigenvalues.

    References
    ----------
    G. Ammar, P. Gader, A variant of the Gohberg-Semencul formula involving circulant matrices,
    SIAM J. Matrix Anal. Appl. 12 (1991).
    """

    grid_shape: tuple[int, ...]

    def __init__(
        self, factors: Factors, ends: tuple[Array, Array], n: int, dtype: DTypeLike, plan: Any
    ) -> None:
        self._factors, self._ends, self._length = factors, ends, len(ends[0]) + 1
        self._plan = plan
        self.grid_shape, self.dtype, self.points = (n,), np.dtype(dtype), 2.0 * self._length

    @classmethod
    def of(cls, x: Array, y: Array | None, dtype: DTypeLike) -> "GohbergSemenculProduct":
        """Return the product for x and y in double precision; y = None stands for y = x̄."""
        n, m = len(x), near_fast_length(len(x))
        # Their divisors have the product 2 x₀, which may exceed the range of float32. They make x
        # and y equally large, because the larger one determines the rounding of a sum.
        size = 1.0 if y is None else sqrt(norm(x) / norm(y))
        root = sqrt(2.0 * abs(x[0]))
        u = _extend(x / (root * size), m)
        w = u.conj() if y is None else _extend(y * (size / root * abs(x[0]) / x[0]), m)
        plan = plan_of(m, np.float64, exact=True)
        of_products = plan.astype(np.dtype(dtype).char.upper())
        eigenvalues = of_products.eigenvalues

        def transform(a: Array) -> list[Array]:
            # The skew-circulant has the frequencies k + 1/2. A work unit is a complex transform for
            # a complex matrix, and a real transform of twice the length for a real one.
            count_transforms(2, m if a.dtype.kind == "c" else 2 * m)
            imag = a.imag if a.dtype.kind == "c" else None
            return [plan.spectrum(a.real, imag, shift) for shift in (0.5, 0.0)]

        is_complex = np.dtype(dtype).kind == "c"
        skew, circulant = transform(u)
        if y is not None:
            # The eigenvalues of Cᵀ are the conjugates of those of C̄.
            row_skew, row_circulant = map(np.conj, transform(w.conj()))
            if is_complex:
                pairs = [(row_skew, circulant), (skew, row_circulant)]
            else:
                pairs = [(row_skew + 1j * skew, circulant - 1j * row_circulant)]
        elif is_complex:
            pairs = [(2.0 * skew.real, circulant.real), (2.0 * skew.imag, circulant.imag)]
        else:
            pairs = [(2.0 * (skew.real - skew.imag), circulant.real - circulant.imag)]
        factors = [
            ((shift,) * len(pairs), [eigenvalues(spectrum) for spectrum in spectra])
            for shift, spectra in zip((0.5, 0.0), zip(*pairs, strict=True), strict=True)
        ]
        ends = u[:0:-1].astype(dtype), w[:0:-1].astype(dtype)
        return cls(factors, ends, n, dtype, of_products)

    def adjoint(self) -> "GohbergSemenculProduct":
        """Return the multiplication by the adjoint (column ȳ, row x̄), without any transform."""
        factors = [(shifts, [s.conj() for s in spectra]) for shifts, spectra in self._factors]
        u, w = self._ends
        (n,) = self.grid_shape
        return GohbergSemenculProduct(factors, (w.conj(), u.conj()), n, self.dtype, self._plan)

    __call__ = multiply_rows

    def multiply(self, X: Array, out: Array) -> None:
        """Multiply the rows of `X`, of shape (rows, N), into `out`, which may be `X`."""
        n, m = X.shape[1], self._length
        if m == n:
            self._plan.multiply(X, self._factors, out)
            return
        Z = workspace((len(X), m), self.dtype)
        Z[:, :n] = X
        Z[:, n:] = 0.0
        u, w = self._ends
        parts = [np.correlate(u, z.conj(), "valid") for z in Z[:, :n]]
        self._plan.multiply(Z, self._factors, Z)
        for z, part, y in zip(Z, parts, out, strict=True):
            np.subtract(z[:n], 2.0 * np.correlate(w, part.conj(), "valid"), out=y)


def _extend(a: Array, length: int) -> Array:
    """Append zeros."""
    extended = np.zeros(length, a.dtype)
    extended[: len(a)] = a
    return extended


class TriangularFactors(GridOperator):
    """The same inverse for arrays of another library, by products of triangular Toeplitz matrices.

    It is (L(x) U(y) - L(0, y_(n-1), …, y_1) U(0, x_(n-1), …, x_1))/x₀, where L has the given first
    column and U the given first row. A product costs four work units.

    Parameters
    ----------
    G : GohbergSemencul
    library : Library
    """

    def __init__(self, G: GohbergSemencul, library: Any) -> None:
        self.G, self.x, self.y, self.is_hermitian = G, G.x, G.y, G.is_hermitian
        super().__init__(G.dtype, G.grid_shape, 4.0, library=library)

        def triangle(values: Array, is_lower: bool) -> ToeplitzOperator:
            first = np.append(values[:1], 0.0 * values[1:])
            pair = (values, first) if is_lower else (first, values)
            return ToeplitzOperator(*map(library.from_numpy, pair))

        u, w = (np.append(0.0 * a[:1], a[:0:-1]) for a in (G.x, G.y))
        pairs = ((G.x / G.x[0], G.y), (w / -G.x[0], u))
        self._factors = [(triangle(a, True), triangle(b, False)) for a, b in pairs]

    def apply(self, V: Array, out: Array | None = None) -> Array:
        """Multiply each row of `V` (see `GridOperator.apply`)."""
        first, last = (L.apply(U.apply(V)) for L, U in self._factors)
        return first + last

    def _adjoint(self) -> "TriangularFactors":
        return self if self.is_hermitian else TriangularFactors(self.G.H, self.library)

    def __repr__(self) -> str:
        return f"<TriangularFactors {self.shape[0]}, {self.dtype}>"
