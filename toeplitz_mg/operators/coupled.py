"""Toeplitz matrices that couple the components of a field on one grid."""

from collections.abc import Callable, Iterable, Sequence
from math import prod, sqrt
from operator import index
from typing import Any, cast

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.multilevel import MultilevelProduct
from toeplitz_mg.operators.base import MatrixOperator, require_serial
from toeplitz_mg.operators.coefficients import ROUNDING
from toeplitz_mg.operators.sums import constant_of
from toeplitz_mg.operators.toeplitz import ToeplitzOperator
from toeplitz_mg.values import refuse_masked

Rows = Sequence[Sequence[ToeplitzOperator | None]]


class CoupledOperator(MatrixOperator):
    """A matrix of Toeplitz blocks, which couple the components of a field on one grid.

    Vectors are fields of shape (components, n1, ..., nd), flattened in C order.

    Parameters
    ----------
    blocks : sequence of sequences of ToeplitzOperator or None
        ``blocks[i][j]`` maps component j of the vector to component i of the result; None is a zero
        block. All blocks live on one grid.

    Attributes
    ----------
    grid_shape : tuple of int
        (components, n1, ..., nd).
    blocks : tuple of tuples of ToeplitzOperator or None
    is_symmetric : bool
        Equal to its transpose ``A.T``.
    is_hermitian : bool
        Equal to its conjugate transpose ``A.H``. For a real matrix this is the same.

    Raises
    ------
    TypeError
        If there are no rows, or a block is not a ToeplitzOperator.
    ValueError
        If the array is not square, the grids differ, or a row or a column has nothing but
        zeros.

    See Also
    --------
    ToeplitzOperator : a block.
    componentwise : precondition each component separately.

    Notes
    -----
    One product transforms each component once in each direction: one work unit for each component.
    If one block is complex, all are multiplied as complex ones.

    If all blocks (i, j) equal the transposes of the blocks (j, i) up to 8 eps, they are averaged,
    so that the matrix is exactly symmetric (or Hermitian). The difference is relative to the
    largest coefficient of both, or to the geometric mean of those of the blocks (i, i) and (j, j)
    if that is larger.

    For half-spaces, pass coefficients at the points of `halfspace.offsets` to
    ``ToeplitzOperator(c)``, and those at `halfspace.all_offsets` to
    ``ToeplitzOperator.from_lags(lags)``, as A_xy needs, which is odd.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> from toeplitz_mg import halfspace
    >>> element = (0.25, 0.25)
    >>> x, y = halfspace.all_offsets((8, 8), element)
    >>> xx, xy, yy = (
    ...     tmg.ToeplitzOperator.from_lags(a(x, y, element, G=1.0, nu=0.28))
    ...     for a in (halfspace.influence_xx, halfspace.influence_xy, halfspace.influence_yy)
    ... )
    >>> A = tmg.CoupledOperator([[xx, xy], [xy, yy]])
    >>> A
    <CoupledOperator of 2 components, 8 x 8, symmetric, float64>
    >>> u = (A @ np.ones(2 * 8 * 8)).reshape(2, 8, 8)
    """

    def __init__(
        self,
        blocks: Sequence[Sequence[ToeplitzOperator | None]],
        *,
        product: Any = None,
    ) -> None:
        rows = read_blocks(blocks, _check_block)
        given = [block for row in rows for block in row if block is not None]
        dtype = np.result_type(*(block.dtype for block in given))
        library = given[0].library
        grid_shape = (len(rows), *given[0].grid_shape)
        work = 1.0 if product is None else product.points / prod(grid_shape)
        super().__init__(dtype, grid_shape, work, library=library)
        # Use one precision, as the preconditioners of the blocks do.
        cast_rows, self.is_symmetric = symmetrise(_cast(rows, dtype), dtype, Transposes())
        self.is_hermitian = self.is_symmetric
        if self.dtype.kind == "c":
            of_conjugates = Transposes(conjugate=True)
            cast_rows, self.is_hermitian = symmetrise(cast_rows, dtype, of_conjugates)
        self.blocks = rows = tuple(map(tuple, cast_rows))
        self._product = product or MultilevelProduct.of(
            library,
            _each(rows, lambda block: block.coefficients),
            self.dtype,
            _each(rows, self._spectrum_of),
        )

    def _spectrum_of(self, block: ToeplitzOperator) -> Array | None:
        """Return the eigenvalues that the product of a block already has, if its dtype fits."""
        return block.embedding_spectrum if block.dtype == self.dtype else None

    @property
    def norm_bound(self) -> float:
        """An upper bound of the 2-norm: that of the embedding circulant."""
        return self._product.norm_bound

    def component(self, i: int) -> ToeplitzOperator:
        """Return the diagonal block of component i.

        Raises
        ------
        IndexError
            If there is no such component.
        ValueError
            If the block is zero.
        """
        if not 0 <= index(i) < len(self.blocks):
            raise IndexError(
                f"i is {i}, but must be one of the components 0 ... {len(self.blocks) - 1}"
            )
        block = self.blocks[i][i]
        if block is None:
            raise ValueError(f"the diagonal block of component {i} is zero, but must not be")
        return block

    def _cast(self, dtype: np.dtype[Any]) -> "CoupledOperator":
        product = self._product.astype(dtype) if dtype.itemsize < self.dtype.itemsize else None
        return CoupledOperator(_cast(self.blocks, dtype), product=product)

    def scaled(self, left: Any = None, right: Any = None) -> Any:
        """Return L A R for multiples of the unit matrix (see `GridOperator.scaled`)."""
        factors = [constant_of(D) for D in (left, right) if D is not None]
        if any(factor is None for factor in factors):
            return NotImplemented
        factor = prod(factors)
        return CoupledOperator(_each(self.blocks, lambda block: block.times(factor)))

    def plus(self, other: Any) -> Any:
        """Return the sum with a multiple of the unit matrix or another CoupledOperator."""
        if isinstance(other, np.ndarray):
            return self._plus_unit(constant_of(other))
        if not isinstance(other, CoupledOperator) or other.grid_shape != self.grid_shape:
            return NotImplemented
        pairs = [zip(*rows, strict=True) for rows in zip(self.blocks, other.blocks, strict=True)]
        return CoupledOperator(
            [[a.plus(b) if a and b else a or b for a, b in row] for row in pairs]
        )

    def _plus_unit(self, factor: Any) -> Any:
        if factor is None:
            return NotImplemented
        zero = next(filter(None, self.blocks[0])).times(0.0)
        rows = [list(row) for row in self.blocks]
        for i, row in enumerate(rows):
            row[i] = (row[i] or zero).plus_unit(factor)
        return CoupledOperator(rows)

    def block(self, index: Array) -> Array:
        """Return the principal submatrix at these positions in the flattened field."""
        index = refuse_masked("index", index)
        return self.entries(index, index)

    def entries(self, rows: Array, columns: Array) -> Array:
        """Return the entries in these rows and columns, positions in the flattened field."""
        size = self.shape[0] // len(self.blocks)
        rows, columns = refuse_masked("rows", rows), refuse_masked("columns", columns)
        (of_row, row), (of_column, column) = np.divmod(rows, size), np.divmod(columns, size)
        result = np.zeros((len(rows), len(columns)), self.dtype)
        for i, blocks in enumerate(self.blocks):
            for j, block in enumerate(blocks):
                if block is not None:
                    part = block.entries(row[of_row == i], column[of_column == j])
                    result[np.ix_(of_row == i, of_column == j)] = part
        return result

    def diagonal(self) -> Array:
        """Return the entries (i, i), shape (N,)."""
        size = self.shape[0] // len(self.blocks)
        zero = np.zeros(size, self.dtype)
        own = [row[i] for i, row in enumerate(self.blocks)]
        return np.concatenate([zero if block is None else block.diagonal() for block in own])

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        return self._product(X, out)

    def _adjoint(self) -> "CoupledOperator":
        if self.is_hermitian:
            return self
        blocks = _each(zip(*self.blocks, strict=True), lambda block: block.H)
        return CoupledOperator(blocks, product=self._product.adjoint())

    def _transposed(self) -> "CoupledOperator":
        return CoupledOperator(_each(zip(*self.blocks, strict=True), lambda block: block.T))

    def __repr__(self) -> str:
        size = self._describe(self.grid_shape[1:])
        return f"<CoupledOperator of {len(self.blocks)} components, {size}>"


def read_blocks(blocks: Any, check: Callable[[str, Any, Any], None]) -> tuple[Any, ...]:
    """Return the rows of an array of blocks; raise an error if it is not valid.

    ``check(name, block, first)`` is called for each block, with the first block.
    """
    try:
        rows = tuple(map(tuple, blocks))
    except TypeError:
        raise TypeError(
            f"blocks is {blocks!r}, but must have rows, such as [[xx, xy], [xy, yy]]"
        ) from None
    if not rows or any(len(row) != len(rows) for row in rows):
        lengths = [len(row) for row in rows]
        raise ValueError(f"blocks has rows of lengths {lengths}, but must be a square array")
    first = None
    for i, row in enumerate(rows):
        for kind, line in (("row", row), ("column", [other[i] for other in rows])):
            if all(block is None for block in line):
                raise ValueError(
                    f"{kind} {i} of the blocks is zero, but the matrix must not be singular"
                )
        for j, block in enumerate(row):
            if block is not None:
                first = first or block
                check(f"blocks[{i}][{j}]", block, first)
    return rows


def _check_block(name: str, block: Any, first: Any) -> None:
    require_serial(name, block)
    if not isinstance(block, ToeplitzOperator):
        raise TypeError(
            f"{name} is of type {type(block).__name__}, but must be a ToeplitzOperator or None"
        )
    first.library.read(f"c of {name}", block.c)
    if block.grid_shape != first.grid_shape:
        raise ValueError(
            f"{name} lives on the grid {block.grid_shape}, but must live on that of the "
            f"others, {first.grid_shape}"
        )


def _each(rows: Iterable[Iterable[Any]], function: Callable[[Any], Any]) -> list[list[Any]]:
    """Apply a function to each block; None stays None."""
    return [[block and function(block) for block in row] for row in rows]


def _cast(rows: Rows, dtype: np.dtype[Any]) -> list[list[Any]]:
    """Return the blocks in the precision of `dtype`; real blocks of a complex matrix stay real."""
    real = dtype.char.lower()
    return _each(rows, lambda block: block.astype(dtype if block.dtype.kind == "c" else real))


class Transposes:
    """Compares blocks (i, j) with the (conjugate) transposes of the blocks (j, i)."""

    def __init__(self, *, conjugate: bool = False) -> None:
        self.conjugate = conjugate

    def is_own(self, block: Any) -> bool:
        """Whether a block is known to be its own transpose without inspecting coefficients."""
        return block.dtype.kind != "c" and bool(block.is_symmetric)

    def largest(self, block: Any) -> float:
        """Return the largest absolute value of a coefficient."""
        return self._largest(block, self._lags(block))

    def difference(self, block: Any, other: Any) -> float:
        """Return the largest difference between a block and the transpose of another."""
        return self._largest(block, self._lags(block) - self._mirror(other))

    def average(self, block: Any, other: Any) -> tuple[Any, Any]:
        """Return the mean of a block and the transpose of another, and its transpose."""
        return self._make(block, (self._lags(block) + self._mirror(other)) / 2)

    def _make(self, block: Any, lags: Array) -> tuple[Any, Any]:
        mean = ToeplitzOperator.from_lags(lags)
        return mean, mean.H if self.conjugate else mean.T

    def _lags(self, block: Any) -> Array:
        return cast(Array, block.lags)

    def _mirror(self, block: Any) -> Array:
        lags = block.library.xp.flip(block.lags)
        return cast(Array, block.library.conj(lags) if self.conjugate else lags)

    def _largest(self, block: Any, lags: Array) -> float:
        xp = block.library.xp
        return float(xp.max(xp.abs(lags)))


def symmetrise(rows: Any, dtype: np.dtype[Any], transposes: Any) -> tuple[Any, bool]:
    """Return blocks averaged with the opposite ones, and whether they agree up to rounding.

    If a block does not agree with the transpose of its opposite, all are returned unchanged.
    """
    differences = asymmetries(rows, transposes)
    if max(differences.values()) > ROUNDING * float(np.finfo(dtype).eps):
        return rows, False
    averaged = [list(row) for row in rows]
    for (i, j), difference in differences.items():
        if difference:
            averaged[i][j], averaged[j][i] = transposes.average(rows[i][j], rows[j][i])
    return averaged, True


def asymmetries(rows: Any, transposes: Any) -> dict[tuple[int, int], float]:
    """Return the largest difference between each block (i, j), j ≤ i, and the transpose of (j, i).

    It is relative to the largest coefficient of both, or to the geometric mean of those of the
    blocks (i, i) and (j, j) if that is larger.
    """
    pairs = [(i, j) for i in range(len(rows)) for j in range(i + 1)]
    return {(i, j): _asymmetry(rows, i, j, transposes) for i, j in pairs}


def _asymmetry(rows: Any, i: int, j: int, transposes: Any) -> float:
    block, other = rows[i][j], rows[j][i]
    if block is None or other is None:
        return 0.0 if block is other else 1.0
    if block is other and transposes.is_own(block):
        return 0.0
    if not (difference := transposes.difference(block, other)):
        return 0.0
    largest = transposes.largest
    of_i, of_j = (0.0 if D is None else largest(D) for D in (rows[i][i], rows[j][j]))
    both = max(largest(block), largest(other))
    return float(difference / max(both, sqrt(of_i) * sqrt(of_j)))
