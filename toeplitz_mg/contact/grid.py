"""The potential contact area: a grid of elements on the half-space, and its matrices."""

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import lru_cache
from math import prod
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import DTypeLike
from scipy import fft
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg import halfspace
from toeplitz_mg._typing import Array, Element, Mask
from toeplitz_mg.contact.steady_matrices import ShiftedInverses, subtract_operators
from toeplitz_mg.engine.products import DiagonalisedProduct
from toeplitz_mg.engine.vectors import ALONE, Vectors
from toeplitz_mg.halfspace import CombinedMaterial
from toeplitz_mg.halfspace.materials import combine
from toeplitz_mg.halfspace.matrices import coupling_matrices, quadrant
from toeplitz_mg.halfspace.periodic import (
    periodic_eigenvalues,
    strip_eigenvalues,
    strip_length,
    tangential_eigenvalues,
)
from toeplitz_mg.operators import (
    CoupledOperator,
    DiagonalisedOperator,
    MaskedOperator,
    ToeplitzOperator,
)
from toeplitz_mg.operators.block_diagonal import BlockDiagonal
from toeplitz_mg.preconditioners.candidates import quick_fsai
from toeplitz_mg.preconditioners.positivity import require_positive
from toeplitz_mg.preconditioners.traits import fragmentation
from toeplitz_mg.preconditioners.trigonometric import cosine_preconditioner
from toeplitz_mg.values import field, in_range, positive

SMALL = 2**11  # Most elements of a grid whose matrices are kept: half a megabyte each, at most.
KEPT = 32  # Grids whose matrices are kept.
DENSE = 300  # Most unknowns of a matrix that is kept as an array, to be solved directly.
COARSEST = 32  # Elements along the longest axis from which nested iteration coarsens no further.


@dataclass(frozen=True)
class Grid:
    """Elements on a surface, and the material below.

    What the searches do with more than one element is here and in `vectors`, so that they need not
    know whether a field is in one piece. `toeplitz_mg.slabs` has a grid that is not.

    Attributes
    ----------
    shape : (int,) or (int, int)
        One axis is line contact: strips across the direction of x.
    element : tuple of float
        (h1, h2), the size of an element; of strips (h, b), their width and length, or (h,) where
        they are of infinite length, which is plane strain.
    material : CombinedMaterial
        Of the two bodies.
    reference : float
        In plane strain, and on a surface that repeats along one axis, the distance at which a line
        load moves nothing.
    periodic : tuple of bool
        Along which axes the surface repeats.
    directions : str
        Of tangential tractions: "x" or "xy".
    vectors : Vectors
        The inner products, sums and extremes of fields.
    """

    vectors: ClassVar[Vectors] = ALONE
    shape: tuple[int, ...]
    element: tuple[float, ...]
    material: CombinedMaterial
    reference: float
    periodic: tuple[bool, ...]
    directions: str = "xy"

    @classmethod
    def of(
        cls,
        shape: tuple[int, ...],
        element: Element,
        material: Any,
        reference: float | None,
        periodic: Any = False,
    ) -> Self:
        """Return a grid of what the user gave, or say what is wrong with it."""
        if len(shape) not in (1, 2) or min(shape) < 1:
            raise ValueError(
                f"the grid has shape {shape}, but must be (n1, n2), or (n,) for line contact"
            )
        given = np.atleast_1d(field("element", element))
        sizes = tuple(given.ravel().tolist())
        if given.ndim > 1 or len(sizes) not in (1, 2) or len(sizes) < len(shape):
            raise ValueError(
                f"element is {element}, but the grid {shape} needs two sizes (h1, h2); line "
                "contact also takes one, the width of strips of infinite length"
            )
        if not all(0.0 < h < np.inf for h in sizes):
            raise ValueError(f"element is {element}, but its sizes must be positive and finite")
        material = combine(material)
        for name, value in (("element", min(sizes)), ("element", max(sizes)), ("G", material.G)):
            in_range(name, value)
        repeats = _read_periodic(periodic, len(shape))
        ends = [k for k in range(len(sizes)) if not (*repeats, False)[k]]
        # One axis that ends, of a body that goes on for ever along the other, is a line contact.
        is_line = len(ends) == 1 and (len(sizes) == 1 or any(repeats))
        if reference is None:
            axis = ends[0] if is_line else 0
            reference = sizes[axis] * (*shape, 1)[axis]
        elif not is_line:
            raise ValueError(
                f"reference is {reference}, but only plane strain (an element of one size) and "
                "a surface that repeats along one of two axes have a constant displacement that "
                "it decides"
            )
        # In line contact lateral tractions are the exception.
        directions = "xy"[: len(shape)]
        reference = positive("reference", reference)
        grid = cls(shape, sizes, material, reference, repeats, directions)
        if grid.has_free_mean and max(shape) == 1:
            raise ValueError(
                f"the grid has shape {shape}, but where it repeats along all axes it must have "
                "more than one element: the mean displacement is no part of the answer"
            )
        return grid

    @property
    def area(self) -> float:
        """The area of an element; in plane strain per unit of length, its width."""
        return float(np.prod(self.element))

    @property
    def components(self) -> int:
        """The components of a tangential traction: on a surface two, in line contact mostly one."""
        return len(self.directions)

    @property
    def has_free_mean(self) -> bool:
        """Whether a mean pressure moves the surface by any distance, as of one without ends."""
        return all(self.periodic) and len(self.element) == len(self.shape)

    def centres(self) -> tuple[Array, ...]:
        """Return the centres of the elements along each axis, zero in the middle of the grid."""
        return tuple(
            h * (np.arange(n) - (n - 1) / 2.0)
            for n, h in zip(self.shape, self.element, strict=False)
        )

    def coarser(self) -> "Grid | None":
        """Return the grid of elements twice the size, or None where that would be too coarse."""
        if max(self.shape) <= COARSEST or not any(self.halved):
            return None
        factors = [1 + two for two in self.halved]
        shape = tuple(-(-n // two) for n, two in zip(self.shape, factors, strict=True))
        element = tuple(h * two for h, two in zip(self.element, (*factors, 1), strict=False))
        return replace(self, shape=shape, element=element)

    @property
    def halved(self) -> tuple[bool, ...]:
        """The axes along which two elements are one of the coarser grid.

        Where the surface repeats, an odd number of them cannot be halved.
        """
        return tuple(
            n > 1 and not (repeats and n % 2)
            for n, repeats in zip(self.shape, self.periodic, strict=True)
        )

    def agree(self) -> AbstractContextManager[dict[str, Any]]:
        """Return what checks of arguments are made in (see `slabs.Slab.agree`)."""
        return nullcontext({})

    def coarsen(self, x: Array) -> Array:
        """Return the averages of a field, of any components, on the coarser grid."""
        return coarsen(x, self.halved)

    def refine(self, x: Array) -> Array:
        """Interpolate a field, of any components, from the coarser grid."""
        return refine(x, self.shape, self.halved, self.periodic)

    def lines(self, x: Array, axis: int) -> Array:
        """Return the lines of a field along an axis, as the last axis."""
        return np.moveaxis(x, axis, -1)

    def fragmentation(self, C: Mask) -> float:
        """Return how long the edge of some elements is (see `traits.fragmentation`)."""
        return fragmentation(C)

    def normal(self) -> ToeplitzOperator:
        """Return the matrix of the normal displacements by the pressures (Eq. 6-7)."""
        return self._normal()[0]

    def normal_coefficients(self) -> Array:
        """Return the first column of the matrix of normal contact, in the shape of the grid."""
        return quadrant("zz", self.shape, self.element, self.material, self.reference)

    def scaled_normal(self) -> tuple[ToeplitzOperator, float]:
        """Return the matrix of normal contact over its diagonal, and that."""
        return self._normal(is_scaled=True)

    def _normal(self, *, is_scaled: bool = False) -> tuple[ToeplitzOperator, float]:
        """Return the matrix of normal contact, over its diagonal if so wanted, and that."""
        product = None
        if any(self.periodic):
            eigenvalues, lengths = self._waves()
            column = fft.irfftn(eigenvalues, s=lengths)
            c = np.ascontiguousarray(column[tuple(map(slice, self.shape))])
        else:
            c = self.normal_coefficients()
        unit = float(c.flat[0])
        if is_scaled:
            c /= unit
        if any(self.periodic):
            eigenvalues /= unit if is_scaled else 1.0
            product = DiagonalisedProduct(eigenvalues, lengths, self.shape)
        return ToeplitzOperator(c, product=product), unit

    def _tangential_of_waves(self) -> ToeplitzOperator | CoupledOperator:
        if not self.has_free_mean:
            raise ValueError(
                f"periodic is {self.periodic}, but friction is for a surface that repeats along "
                "all axes, or along none"
            )
        if len(self.shape) == 1:
            return self.normal()  # In plane strain both have the same coefficients.
        blocks = {}
        for name, eigenvalues in self._tangential_waves().items():
            column = fft.irfftn(eigenvalues, s=self.shape)
            lags = np.ix_(*((np.arange(2 * n - 1) - (n - 1)) % n for n in self.shape))
            # Without coupling, as where ν is zero, the block is zero.
            blocks[name] = ToeplitzOperator.from_lags(column[lags]) if column.any() else None
        return CoupledOperator([[blocks["xx"], blocks["xy"]], [blocks["xy"], blocks["yy"]]])

    def _tangential_waves(self) -> dict[str, Array]:
        (n1, n2), (h1, h2) = self.shape, self.element
        G, nu = self.material.G, self.material.nu
        return tangential_eigenvalues((n1, n2), (h1, h2), G=G, nu=nu)

    def _waves(self) -> tuple[Array, tuple[int, ...]]:
        """Return the eigenvalues of a circulant that has the matrix in it, and its lengths."""
        if self.has_free_mean:
            return self._all_waves(), self.shape
        n1, n2 = (*self.shape, 1)[:2]
        h1, h2 = self.element
        axis, G, nu = self.periodic.index(True), self.material.G, self.material.nu
        eigenvalues = strip_eigenvalues(
            (n1, n2), (h1, h2), axis, G=G, nu=nu, reference=self.reference
        )
        if len(self.shape) == 1:  # Strips of finite length, one element long.
            return eigenvalues[: n1 // 2 + 1, 0], self.shape
        return eigenvalues, (n1, strip_length(n2)) if axis == 0 else (strip_length(n1), n2)

    def _all_waves(self) -> Array:
        """Return the eigenvalues where the surface repeats along all axes."""
        G, nu = self.material.G, self.material.nu
        return periodic_eigenvalues(self.shape, self.element, G=G, nu=nu)

    def tangential(self) -> ToeplitzOperator | CoupledOperator:
        """Return the matrix of the tangential displacements by the tractions (Eq. 6-7)."""
        if any(self.periodic):
            return self._tangential_of_waves()
        return self._matrix(self.directions)

    def upstream(self) -> ToeplitzOperator | CoupledOperator:
        """Return the matrix of the tangential displacements one element ahead, at x + h1.

        When the contact rolls towards positive x, what is here now was there one step before.
        """
        return self._matrix(self.directions, ahead=1)

    def coupling(self, ahead: int = 0) -> tuple[ToeplitzOperator | None, ...]:
        """Return the matrices of the tangential displacements by the pressures, by components."""
        return coupling_matrices(
            self.directions, self.shape, self.element, self.material, ahead=ahead
        )

    def steady(self, A: Any) -> Any:
        """Return the matrix of steady rolling, A - S with A and S = `tangential` and `upstream`."""
        return _steady(self) if self._is_kept else subtract_operators(A, self.upstream())

    def steady_array(self, K: Any) -> Array | None:
        """Return the matrix of steady rolling as an array where it is small, or else None."""
        return _steady_array(self) if self._is_kept and K.shape[0] <= DENSE else None

    def invert_shifted(self, K: Any, shifts: Array, dtype: DTypeLike) -> Any:
        """Return approximate inverses of the matrix of steady rolling with additions."""
        if self._is_kept:
            return _inverses(self, tuple(shifts.tolist()), np.dtype(dtype))
        return ShiftedInverses(K, shifts, np.dtype(dtype))

    def invert_by_cosine(self, A: Any, dtype: DTypeLike | None = None) -> Any:
        """Return an approximate inverse of a matrix of this grid."""
        if any(self.periodic):
            return self._invert_waves(A, dtype)
        return cosine_preconditioner(A, dtype=dtype)

    def _invert_waves(self, A: Any, dtype: DTypeLike | None) -> LinearOperator:
        """Return the inverse of a matrix of waves, but for its mean, and where the surface ends.

        An axis that ends is taken for one that repeats. The mean, which has no eigenvalue then, is
        given that of a wave of twice the longest. Components are inverted each by itself.
        """
        precision = np.dtype(dtype or A.dtype)
        if isinstance(A, CoupledOperator):
            waves = self._tangential_waves()
            inverses = [self._invert_eigenvalues(waves[name], precision) for name in ("xx", "yy")]
            return BlockDiagonal(inverses, A.grid_shape)
        eigenvalues, lengths = self._waves()
        if lengths != self.shape:
            eigenvalues = self._all_waves()
        eigenvalues *= A.norm_bound / eigenvalues.max()
        return self._invert_eigenvalues(eigenvalues, precision)

    def _invert_eigenvalues(self, eigenvalues: Array, dtype: np.dtype[Any]) -> DiagonalisedOperator:
        if eigenvalues.flat[0] == 0.0:
            eigenvalues.flat[0] = 2.0 * eigenvalues.max()
        subject = "the matrix of waves has the eigenvalue"
        require_positive(eigenvalues, dtype, subject, "dtype=np.float64")
        product = DiagonalisedProduct(1.0 / eigenvalues, self.shape, self.shape, dtype)
        return DiagonalisedOperator(product, "inverse of waves")

    def invert_by_fsai(self, A: Any, C: Mask, dtype: DTypeLike | None = None) -> Any:
        """Return an approximate inverse of a matrix of this grid on some elements."""
        return quick_fsai(MaskedOperator(A, C), dtype=dtype)

    def restrict(self, A: Any, C: Mask) -> Any:
        """Return the rows and columns of some elements of a matrix of this grid."""
        return MaskedOperator(A, C)

    def diagonal(self, A: Any) -> float:
        """Return the entry on the diagonal of a matrix of this grid, of the first component."""
        first = A.component(0) if isinstance(A, CoupledOperator) else A
        return float(first.c.flat[0])

    @property
    def _is_kept(self) -> bool:
        """Whether the matrices are kept for the next case on the same grid."""
        return prod(self.shape) <= SMALL

    def _matrix(self, directions: str, ahead: int = 0) -> Any:
        compute = _matrix if self._is_kept else Grid._compute
        return compute(self, directions, ahead)

    def _compute(self, directions: str, ahead: int) -> Any:
        return halfspace.influence_matrix(
            directions,
            self.shape,
            self.element,
            self.material,
            reference=self.reference,
            ahead=ahead,
        )


# Tables are made of many small cases on one grid, whose matrices take longer than a case. They are
# kept by all that a grid is, never changed, and no part of any result.


@lru_cache(maxsize=KEPT)
def _matrix(grid: Grid, directions: str, ahead: int) -> Any:
    return grid._compute(directions, ahead)


@lru_cache(maxsize=KEPT)
def _steady(grid: Grid) -> Any:
    return subtract_operators(grid.tangential(), grid.upstream())


@lru_cache(maxsize=KEPT)
def _steady_array(grid: Grid) -> Array:
    array: Array = _steady(grid).toarray()
    array.flags.writeable = False
    return array


@lru_cache(maxsize=KEPT)
def _inverses(grid: Grid, shifts: tuple[float, ...], dtype: np.dtype[Any]) -> ShiftedInverses:
    return ShiftedInverses(_steady(grid), np.array(shifts), dtype)


def coarsen(x: Array, halved: tuple[bool, ...] = (True, True)) -> Array:
    """Average 2 elements along each of the last axes; a last one alone counts twice.

    Parameters
    ----------
    x : ndarray
    halved : tuple of bool
        Whether elements are averaged, for each axis of the grid; before these axes are components.
    """
    for axis, two in zip(range(-len(halved), 0), halved, strict=True):
        n = x.shape[axis]
        if n == 1 or not two:
            continue
        if n % 2:
            x = np.concatenate([x, np.take(x, [-1], axis)], axis=axis)
        behind = (slice(None),) * (-1 - axis)
        even: Any = (..., slice(0, None, 2), *behind)
        odd: Any = (..., slice(1, None, 2), *behind)
        x = 0.5 * (x[even] + x[odd])
    return x


def refine(
    x: Array,
    shape: tuple[int, ...],
    halved: tuple[bool, ...] = (True, True),
    periodic: tuple[bool, ...] = (False, False),
) -> Array:
    """Interpolate a field of a coarser grid: 3/4 of the nearest element, 1/4 of the next.

    Parameters
    ----------
    x : ndarray
    shape : tuple of int
        The shape of the finer grid, whose axes are the last ones of `x`.
    halved : tuple of bool
        The axes along which the coarser grid has half of the elements.
    periodic : tuple of bool
        The axes along which the first element is the next of the last one.
    """
    for k, n in enumerate(shape):
        axis = k - len(shape)
        if n == 1 or not halved[k]:
            continue
        if periodic[k]:
            before, after = np.roll(x, 1, axis), np.roll(x, -1, axis)
        else:
            before = np.concatenate([np.take(x, [0], axis), np.delete(x, -1, axis)], axis=axis)
            after = np.concatenate([np.delete(x, 0, axis), np.take(x, [-1], axis)], axis=axis)
        pair = np.stack([0.75 * x + 0.25 * before, 0.75 * x + 0.25 * after], axis=axis % x.ndim + 1)
        fine = [*x.shape]
        fine[axis] *= 2
        x = np.take(pair.reshape(fine), np.arange(n), axis=axis)
    return x


def _read_periodic(periodic: Any, axes: int) -> tuple[bool, ...]:
    """Return along which axes a surface repeats, or say what is wrong with what was given."""
    given = tuple(periodic) if np.iterable(periodic) else (periodic,) * axes
    if len(given) != axes or not all(isinstance(value, bool | np.bool_) for value in given):
        raise ValueError(
            f"periodic is {periodic!r}, but must be True or False, or one of these for each axis, "
            "as (True, False)"
        )
    return tuple(map(bool, given))
