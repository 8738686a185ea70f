"""The potential contact area: a grid of elements on the half-space, and its matrices."""

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg import halfspace
from toeplitz_mg._typing import Array, Element, Mask
from toeplitz_mg.contact.steady_matrices import invert_shifted, subtract_operators
from toeplitz_mg.engine.vectors import ALONE, Vectors
from toeplitz_mg.halfspace import CombinedMaterial
from toeplitz_mg.halfspace.materials import combine
from toeplitz_mg.halfspace.matrices import quadrant
from toeplitz_mg.operators import CoupledOperator, MaskedOperator, ToeplitzOperator
from toeplitz_mg.preconditioners.candidates import quick_fsai
from toeplitz_mg.preconditioners.traits import fragmentation
from toeplitz_mg.preconditioners.trigonometric import cosine_preconditioner
from toeplitz_mg.values import field, in_range, positive

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
        In plane strain, the distance at which a line load moves nothing.
    vectors : Vectors
        The inner products, sums and extremes of fields.
    """

    vectors: ClassVar[Vectors] = ALONE
    shape: tuple[int, ...]
    element: tuple[float, ...]
    material: CombinedMaterial
    reference: float

    @classmethod
    def of(
        cls, shape: tuple[int, ...], element: Element, material: Any, reference: float | None
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
        if reference is None:
            reference = sizes[0] * shape[0]
        elif len(sizes) == 2:
            raise ValueError(
                f"reference is {reference}, but only plane strain (an element of one size) "
                "leaves a constant displacement open"
            )
        return cls(shape, sizes, material, positive("reference", reference))

    @property
    def area(self) -> float:
        """The area of an element; in plane strain per unit of length, its width."""
        return float(np.prod(self.element))

    @property
    def components(self) -> int:
        """The components of a tangential traction: one in line contact, two on a surface."""
        return len(self.shape)

    def centres(self) -> tuple[Array, ...]:
        """Return the centres of the elements along each axis, zero in the middle of the grid."""
        return tuple(
            h * (np.arange(n) - (n - 1) / 2.0)
            for n, h in zip(self.shape, self.element, strict=False)
        )

    def coarser(self) -> "Grid | None":
        """Return the grid of elements twice the size, or None where that would be too coarse."""
        if max(self.shape) <= COARSEST:
            return None
        halved = [n > 1 for n in self.shape] + [False] * (len(self.element) - len(self.shape))
        shape = tuple(-(-n // 2) for n in self.shape)
        element = tuple(2.0 * h if two else h for h, two in zip(self.element, halved, strict=True))
        return Grid(shape, element, self.material, self.reference)

    def agree(self) -> AbstractContextManager[dict[str, Any]]:
        """Return what checks of arguments are made in (see `slabs.Slab.agree`)."""
        return nullcontext({})

    def coarsen(self, x: Array) -> Array:
        """Return the averages of a field, of any components, on the coarser grid."""
        return coarsen(x, len(self.shape))

    def refine(self, x: Array) -> Array:
        """Interpolate a field, of any components, from the coarser grid."""
        return refine(x, self.shape)

    def lines(self, x: Array, axis: int) -> Array:
        """Return the lines of a field along an axis, as the last axis."""
        return np.moveaxis(x, axis, -1)

    def fragmentation(self, C: Mask) -> float:
        """Return how long the edge of some elements is (see `traits.fragmentation`)."""
        return fragmentation(C)

    def normal(self) -> ToeplitzOperator:
        """Return the matrix of the normal displacements by the pressures (Eq. 6-7)."""
        return self._matrix("z")

    def normal_coefficients(self) -> Array:
        """Return the first column of the matrix of normal contact, in the shape of the grid."""
        return quadrant("zz", self.shape, self.element, self.material, self.reference)

    def scaled_normal(self) -> tuple[ToeplitzOperator, float]:
        """Return the matrix of normal contact over its diagonal, and that."""
        c = self.normal_coefficients()
        unit = float(c.flat[0])
        return ToeplitzOperator(c / unit), unit

    def tangential(self) -> ToeplitzOperator | CoupledOperator:
        """Return the matrix of the tangential displacements by the tractions (Eq. 6-7)."""
        return self._matrix("xy"[: self.components])

    def upstream(self) -> ToeplitzOperator | CoupledOperator:
        """Return the matrix of the tangential displacements one element ahead, at x + h1.

        When the contact rolls towards positive x, what is here now was there one step before.
        """
        return self._matrix("xy"[: self.components], ahead=1)

    def steady(self, A: Any) -> Any:
        """Return the matrix of steady rolling, A - S with A and S = `tangential` and `upstream`."""
        return subtract_operators(A, self.upstream())

    def invert_shifted(self, K: Any, shift: float, dtype: DTypeLike) -> Any:
        """Return an approximate inverse of the matrix of steady rolling."""
        return invert_shifted(K, shift).astype(dtype)

    def invert_by_cosine(self, A: Any, dtype: DTypeLike | None = None) -> Any:
        """Return an approximate inverse of a matrix of this grid."""
        return cosine_preconditioner(A, dtype=dtype)

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

    def _matrix(self, directions: str, ahead: int = 0) -> Any:
        return halfspace.influence_matrix(
            directions,
            self.shape,
            self.element,
            self.material,
            reference=self.reference,
            ahead=ahead,
        )


def coarsen(x: Array, axes: int = 2) -> Array:
    """Average 2 elements along each of the last axes; a last one alone counts twice.

    Parameters
    ----------
    x : ndarray
    axes : int
        The number of axes of the grid; before them are components.
    """
    for axis in range(-axes, 0):
        n = x.shape[axis]
        if n == 1:
            continue
        if n % 2:
            x = np.concatenate([x, np.take(x, [-1], axis)], axis=axis)
        behind = (slice(None),) * (-1 - axis)
        even: Any = (..., slice(0, None, 2), *behind)
        odd: Any = (..., slice(1, None, 2), *behind)
        x = 0.5 * (x[even] + x[odd])
    return x


def refine(x: Array, shape: tuple[int, ...]) -> Array:
    """Interpolate a field of a coarser grid: 3/4 of the nearest element, 1/4 of the next.

    Parameters
    ----------
    x : ndarray
    shape : tuple of int
        The shape of the finer grid, whose axes are the last ones of `x`.
    """
    for axis, n in zip(range(-len(shape), 0), shape, strict=True):
        if n == 1:
            continue
        before = np.concatenate([np.take(x, [0], axis), np.delete(x, -1, axis)], axis=axis)
        after = np.concatenate([np.delete(x, 0, axis), np.take(x, [-1], axis)], axis=axis)
        pair = np.stack([0.75 * x + 0.25 * before, 0.75 * x + 0.25 * after], axis=axis % x.ndim + 1)
        fine = [*x.shape]
        fine[axis] *= 2
        x = np.take(pair.reshape(fine), np.arange(n), axis=axis)
    return x
