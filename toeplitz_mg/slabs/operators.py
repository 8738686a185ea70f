"""Toeplitz matrices on slabs: each rank multiplies its own rows.

They are not `scipy.sparse.linalg.LinearOperator` and have no ``matvec``, because the inner products
of SciPy's iterations would cover one rank only. `toeplitz_mg.cg` and `toeplitz_mg.richardson` take
their inner products from the operator.

There is no multigrid on slabs: a cycle moves six times as many bytes as an iteration of `cg` with
`fsai_preconditioner`, and more cycles are needed.
"""

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from toeplitz_mg import operators
from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import NUMPY, Library, library_of
from toeplitz_mg.engine.products import NEAR_ONE
from toeplitz_mg.operators.base import MatrixOperator
from toeplitz_mg.operators.coefficients import check_finite, require_digits
from toeplitz_mg.operators.masked import check_booleans
from toeplitz_mg.slabs.product import SlabProduct, embed_on_slab
from toeplitz_mg.slabs.slab import Slab, require_slab


class SlabOperator:
    """A rank's part of a square matrix; all ranks must take part in a product.

    Attributes
    ----------
    slab, ranks : Slab
    grid_shape : tuple of int
        The shape of this rank's part of the grid.
    shape : (int, int)
        The number of unknowns of this rank, twice.
    dtype : dtype
    vectors : Vectors
        Inner products and updates of vectors, over all ranks.
    work : float
        The cost of one application, in products with a Toeplitz matrix.
    """

    product: Any  # Does the multiplication, unless a class defines `multiply`.
    made_by = ""  # The function that made it, if several make operators of the same class.
    work = 1.0

    def __init__(
        self,
        slab: Slab,
        dtype: DTypeLike,
        grid_shape: tuple[int, ...],
        size: int | None = None,
        library: Library = NUMPY,
    ) -> None:
        self.slab = self.ranks = slab
        self.library = library
        self.vectors: Any = library.vectors_of(slab.gather)
        self.dtype, self.grid_shape = np.dtype(dtype), grid_shape
        self.shape = (prod(grid_shape) if size is None else size,) * 2

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X`, without the checks of ``A @ x``.

        Parameters
        ----------
        X : ndarray of shape (..., n)
            Real; n may be 0.
        out : ndarray of the shape of `X`, optional
            Array for the result. It may be `X`.
        """
        if out is None:
            out = self.library.allocate(X, self.dtype)
        return self.library.each(self.multiply, X, out)

    def multiply(self, x: Array, y: Array) -> Any:
        """Multiply a vector into another, which may be the same; return the result."""
        return self.product.apply(x, y)

    @property
    def norm_bound(self) -> float:
        """An upper bound of the 2-norm: that of the embedding matrix."""
        return float(self.product.norm_bound)

    def __matmul__(self, x: ArrayLike) -> Array:
        with self.slab.agree() as same:
            vector = self.library.read("x", x)
            dtype = self.library.dtype(vector)
            if dtype.kind not in "buif":
                raise TypeError(f"x has dtype {vector.dtype}, but must be of real numbers")
            if vector.shape != self.shape[:1]:
                raise ValueError(f"x has shape {vector.shape}, but A has {self.shape}")
            same["the matrix"], same["the dtype of x"] = self.kind, dtype
        # Scale, because single precision has a smaller range than double precision.
        peak = self.vectors.peak(vector) if self.dtype.char == "f" and dtype.char == "d" else 1.0
        low, high = NEAR_ONE
        if not 0.0 < peak < np.inf or low < peak < high:
            return self.apply(vector)
        return self.apply(vector / peak) * peak

    astype = MatrixOperator.astype

    def _cast(self, dtype: np.dtype[Any]) -> Any:
        raise TypeError(f"A is {self!r}, which has a fixed precision: give dtype to its function")

    @property
    def kind(self) -> str:
        """A description to compare: ranks with different operators would wait forever."""
        what = f"{type(self).__name__} {self.made_by}".rstrip()
        return f"{what} on the grid {self.slab.shape}, {self.dtype}"

    def __repr__(self) -> str:
        # The same on all ranks, for error messages.
        return f"<{type(self).__name__} of {self.slab.name}, {self.dtype}>"


class ToeplitzOperator(SlabOperator):
    """A real Toeplitz matrix of any number of axes, of which each rank has some rows.

    Parameters
    ----------
    c : array_like of shape ``slab.local``
        This rank's rows of the first column: the coefficients of the nonnegative lags. For arrays
        of CuPy, torch or JAX the transforms are made by that library, on the device of the array.
    slab : Slab
    parity : tuple of {1, -1}, optional
        Whether the coefficients are even (1, the default) or odd (-1) in each axis; those of A_xy
        are odd in both.
    behind : array_like of shape ``slab.local``, optional
        This rank's rows of the coefficients of the lags 0, -1, -2, … along the first axis, if they
        are neither even nor odd in it.

    Raises
    ------
    ValueError, TypeError
        On all ranks, if `toeplitz_mg.ToeplitzOperator` refuses the coefficients of one rank, their
        shape is not that of the rank's rows, or the ranks give different matrices.

    See Also
    --------
    toeplitz_mg.ToeplitzOperator : the operator for one process; describes the attributes.

    Examples
    --------
    >>> from mpi4py import MPI
    >>> from toeplitz_mg import cg, halfspace, slabs
    >>> slab, element = slabs.Slab(MPI.COMM_WORLD, (32, 16)), (0.25, 0.5)
    >>> x, y = slab.offsets(element)
    >>> A = slabs.ToeplitzOperator(halfspace.influence_zz(x, y, element, G=1.0, nu=0.28), slab)
    >>> pressure, info = cg(A, np.ones(A.shape[0]), M=slabs.sine_preconditioner(A))
    >>> info
    0
    """

    def __init__(
        self,
        c: ArrayLike,
        slab: Slab,
        *,
        parity: tuple[int, ...] | None = None,
        behind: ArrayLike | None = None,
        product: Any = None,
    ) -> None:
        require_slab(slab)
        with slab.agree() as same:
            library = library_of(c)
            self.c = _check_rows("c", c, library, slab)
            same["the library of c"] = library.name
            self.behind = None if behind is None else _check_rows("behind", behind, library, slab)
            self.parity = _read_parity(parity, slab)
            _check_zeros(self.c, self.behind, self.parity, slab)
            same["the dtype of c"], same["parity"] = self.c.dtype, self.parity
            same["whether behind is given"] = behind is not None
        sizes = np.abs(self.c)
        with np.errstate(over="ignore"):  # If the sum overflows to inf it is refused.
            total = slab.vectors.sum(sizes) * 2.0 ** len(slab.shape)
        largest = slab.vectors.max(sizes)
        require_digits("c", self.c.dtype, tuple(2 * n - 1 for n in slab.shape), total, largest)
        super().__init__(slab, self.c.dtype, slab.local, library=library)
        self.is_symmetric = prod(self.parity) == 1 and behind is None
        self.is_even = set(self.parity) == {1} and behind is None
        self.product = product or self._make_product()

    def _make_product(self) -> Any:
        if self.slab.is_line and self.slab.comm.size == 1:
            # Treating the line as a matrix of rows would save communication, but take twice as
            # long.
            lags = np.concatenate([self.opposite.ravel()[:0:-1], self.c.ravel()])
            return operators.ToeplitzOperator.from_lags(self.library.from_numpy(lags))
        return SlabProduct(self.slab, self.library, [[embed_on_slab(self)]], self.dtype)

    @property
    def blocks(self) -> "tuple[tuple[ToeplitzOperator]]":
        """The matrix as the only block of one component."""
        return ((self,),)

    @property
    def diagonal_entry(self) -> float:
        """The coefficient of lag zero, which is on the first rank."""
        return float(self.slab.gather(self.c.flat[0])[0])

    @property
    def opposite(self) -> Array:
        """The coefficients of the lags opposite to those of `c`."""
        behind = self.parity[0] * self.c if self.behind is None else self.behind
        return prod(self.parity[1:]) * behind

    @property
    def spectrum(self) -> Array:
        """The eigenvalues of the embedding, at the frequencies of this rank."""
        product = self.product
        return product.spectra[0][0] if isinstance(product, SlabProduct) else embed_on_slab(self)

    def _cast(self, dtype: np.dtype[Any]) -> "ToeplitzOperator":
        return ToeplitzOperator(
            self.library.from_numpy(self.c.astype(dtype)),
            self.slab,
            parity=self.parity,
            behind=None if self.behind is None else self.behind.astype(dtype),
            product=self.product.astype(dtype) if dtype.itemsize < self.dtype.itemsize else None,
        )

    def __repr__(self) -> str:
        kind = "symmetric" if self.is_symmetric else "general"
        return f"<ToeplitzOperator {self.slab.name}, {kind}, {self.dtype}>"


class MaskedOperator(SlabOperator):
    """The rows and columns of an operator where a mask is true, on this rank's rows.

    Parameters
    ----------
    A : SlabOperator
        An operator on the whole grid.
    mask : array_like of bool, of shape ``A.grid_shape``
        True at the unknowns; for coupled components, one mask may serve all. Some ranks may have no
        unknowns.

    See Also
    --------
    toeplitz_mg.MaskedOperator : the operator for one process. Errors of one rank are raised on all.
    """

    def __init__(self, A: Any, mask: ArrayLike) -> None:
        if not isinstance(A, SlabOperator) or isinstance(A, MaskedOperator):
            raise TypeError(
                f"A is of type {type(A).__name__}, but must be an operator of toeplitz_mg.slabs on "
                "a whole grid"
            )
        with A.slab.agree() as same:
            same["A"] = A.kind
            mask = library_of(mask).to_numpy(mask)
            self.mask = check_booleans(mask, A.grid_shape, len(A.grid_shape) > len(A.slab.shape))
        if not A.slab.vectors.count(self.mask):
            raise ValueError("mask is nowhere true on any rank: there are no unknowns")
        index = np.flatnonzero(self.mask)
        super().__init__(A.slab, A.dtype, A.grid_shape, len(index), A.library)
        self.full, self._cells = A, A.library.cells(index, self.mask.size)

    def _cast(self, dtype: np.dtype[Any]) -> "MaskedOperator":
        return MaskedOperator(self.full.astype(dtype), self.mask)

    apply = operators.MaskedOperator.apply

    @property
    def kind(self) -> str:
        """A description, the same on all ranks."""
        return f"MaskedOperator of a {self.full.kind}"

    def __repr__(self) -> str:
        return f"<MaskedOperator of {self.full!r}>"


def _check_rows(name: str, values: ArrayLike, library: Library, slab: Slab) -> Array:
    """Return this rank's rows of real coefficients; raise an error if they are not valid.

    The result is a copy, which the caller cannot change, in the native byte order, which MPI needs.
    """
    c = library.to_numpy(library.read(name, values))
    if c.shape != slab.local:
        raise ValueError(f"{name} has shape {c.shape}, but this rank's rows have {slab.local}")
    c = check_finite(c, name)
    if c.dtype.kind == "c":
        raise TypeError(f"{name} has dtype {c.dtype}, but coefficients on slabs must be real")
    return np.array(c, c.dtype.newbyteorder("="), order="C")


def _read_parity(parity: Any, slab: Slab) -> tuple[int, ...]:
    """Return 1 (even) or -1 (odd) for each axis; raise an error for other values."""
    if parity is None:
        return (1,) * len(slab.shape)
    signs = tuple(parity) if isinstance(parity, Sequence) else ()
    if len(signs) != len(slab.shape) or not all(sign in (1, -1) for sign in signs):
        raise ValueError(
            f"parity is {parity}, but must say 1 (even) or -1 (odd) for each axis of {slab.shape}"
        )
    return signs


def _check_zeros(c: Array, behind: Array | None, parity: tuple[int, ...], slab: Slab) -> None:
    """Refuse coefficients of the lag zero that contradict the parity."""
    is_first = slab.rows.start == 0
    for axis, sign in enumerate(parity):
        if sign < 0 and (axis or is_first) and np.moveaxis(c, axis, 0)[0].any():
            raise ValueError(
                f"parity is {parity}, but if c is odd, along axis {axis}, its coefficients of "
                "the lag zero must be zero"
            )
    if behind is not None and is_first and not np.array_equal(c[0], behind[0]):
        raise ValueError("behind and c differ in their first row, but must both have lag 0 there")
