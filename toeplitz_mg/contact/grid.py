"""The potential contact area: a grid of elements on the half-space, and its matrices."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial, wraps
from math import prod
from typing import Any, Self, TypeVar, cast

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array, Element, Mask
from toeplitz_mg.contact.coarsening import coarsen, refine
from toeplitz_mg.contact.dense import DenseMatrix
from toeplitz_mg.contact.window import Window, box_around, ends_of
from toeplitz_mg.engine.arrays.library import NUMPY, Library
from toeplitz_mg.halfspace import CombinedMaterial
from toeplitz_mg.halfspace.materials import combine
from toeplitz_mg.halfspace.matrices import (
    assemble,
    coupling_matrices,
    evaluate_all,
    quadrant,
)
from toeplitz_mg.halfspace.periodic import Waves
from toeplitz_mg.operators import CoupledOperator, MaskedOperator, ToeplitzOperator
from toeplitz_mg.preconditioners.causal import FieldTransform, ShiftedInverses
from toeplitz_mg.preconditioners.choice import quick_fsai
from toeplitz_mg.preconditioners.runs import InverseOnRuns
from toeplitz_mg.preconditioners.traits import fragmentation
from toeplitz_mg.preconditioners.trigonometric import cosine_preconditioner
from toeplitz_mg.values import field, in_range, positive

# Results for small grids are cached: tables have many cases on one grid, and its matrices take
# longer than a case. The key is the grid itself; cached values are never modified.
SMALL = 2**11  # Number of elements of the largest such grid: at most half a megabyte per matrix.
KEPT = 32  # Cached results per function, by default.
# Most unknowns of a matrix that is stored as an array and solved directly, and the number of such
# arrays that are cached; one with 640 unknowns takes 7 MB.
DENSE, ARRAYS = 640, 8
COARSEST = 32  # Nested iteration stops at this number of elements along the longest axis.
COARSEST_LINE = 256  # The same for lines, where the overhead of more grids exceeds the products.

Asked = TypeVar("Asked")


def keep(function: Callable[..., Asked], most: int = KEPT) -> Callable[..., Asked]:
    """Cache the results of a function of a grid and hashable arguments, for small grids."""
    kept = lru_cache(maxsize=most)(function)

    @wraps(function)
    def look_up(grid: Any, *arguments: Any) -> Asked:
        return (kept if grid.is_small else function)(grid, *arguments)

    return look_up


@dataclass(frozen=True)
class Grid:
    """Elements on a surface, and the material below.

    The searches use this class and `vectors` for everything that involves several elements, so they
    do not depend on how fields are stored. `toeplitz_mg.slabs` has a distributed grid.
    """

    shape: tuple[int, ...]  # One axis is line contact: strips perpendicular to x.
    # (h1, h2), the size of an element; for strips (h, b), their width and length, or (h,) if they
    # are infinitely long, which is plane strain.
    element: tuple[float, ...]
    material: CombinedMaterial  # The combined constants of the two bodies.
    # In plane strain, and on a surface that repeats along one axis, the distance at which a line
    # load causes no displacement.
    reference: float
    periodic: tuple[bool, ...]  # Along which axes the surface repeats.
    directions: str = "xy"  # Directions of tangential tractions: "x" or "xy".
    library: Library = NUMPY  # The library of the arrays that hold fields.
    callers = 0  # Stack frames between the user and the function of `contact` that has made it.

    @classmethod
    def of(
        cls,
        shape: tuple[int, ...],
        element: Any,
        material: Any,
        reference: float | None,
        periodic: Any = False,
    ) -> Self:
        """Return the grid for the user's arguments, or raise an error.

        `toeplitz_mg.slabs` passes its grid instead of the size of an element.
        """
        if isinstance(element, Grid):
            return cast(Self, element)
        sizes = read_sizes(shape, element)
        material = combine(material)
        in_range("G", material.G)
        repeats = _read_periodic(periodic, len(shape))
        distance = _read_reference(reference, shape, sizes, repeats)
        # In line contact lateral tractions are the exception.
        grid = cls(shape, sizes, material, distance, repeats, directions="xy"[: len(shape)])
        if grid.has_free_mean and max(shape) == 1:
            raise ValueError(
                f"the grid has shape {shape}, but must have more than one element if it is "
                "periodic along all axes"
            )
        return grid

    @property
    def vectors(self) -> Any:
        """The inner products, sums and extremes of fields."""
        return self.library.vectors

    def agree(self, read: Callable[..., Asked], *arguments: Any) -> Asked:
        """Return the result of reading arguments, or raise an error, on all ranks alike."""
        return read(*arguments)

    @property
    def area(self) -> float:
        """The area of an element; in plane strain its width (area per unit of length)."""
        return prod(self.element)

    @property
    def force_unit(self) -> str:
        """The unit of forces; in plane strain it is per unit of length."""
        return "N/mm" if len(self.element) == 1 else "N"

    @property
    def components(self) -> int:
        """The components of a tangential traction: on a surface two, in line contact mostly one."""
        return len(self.directions)

    @property
    def is_small(self) -> bool:
        """Whether results for the grid are cached for the next case on it."""
        return prod(self.shape) <= SMALL

    @property
    def has_free_mean(self) -> bool:
        """Whether the mean displacement is undetermined, as for surfaces without ends."""
        return any(self.periodic) and self._waves.are_all

    def centres(self) -> tuple[Array, ...]:
        """Return the centres of the elements along each axis; zero is the middle of the grid."""
        return tuple(
            h * (np.arange(n) - (n - 1) / 2.0)
            for n, h in zip(self.shape, self.element, strict=False)
        )

    def coarser(self, coarsest: int | None = None) -> "Grid | None":
        """Return the grid with elements twice the size, or None if it would be too coarse.

        That is so if this grid has at most `coarsest` elements along its longest axis.
        """
        if max(self.shape) <= (coarsest or self.coarsest) or not any(self.halved):
            return None
        factors = [1 + two for two in self.halved]
        shape = tuple(-(-n // two) for n, two in zip(self.shape, factors, strict=True))
        element = tuple(h * two for h, two in zip(self.element, (*factors, 1), strict=False))
        return replace(self, shape=shape, element=element)

    @property
    def coarsest(self) -> int:
        """The elements along the longest axis from which nested iteration coarsens no further."""
        return COARSEST if sum(n > 1 for n in self.shape) > 1 else COARSEST_LINE

    @property
    def halved(self) -> tuple[bool, ...]:
        """The axes along which the coarser grid has half as many elements.

        Along periodic axes an odd number cannot be halved.
        """
        return tuple(
            n > 1 and not (repeats and n % 2)
            for n, repeats in zip(self.shape, self.periodic, strict=True)
        )

    def coarsen(self, x: Array) -> Array:
        """Return the averages of a field, with any components, on the coarser grid."""
        return coarsen(x, self.halved, self.library.xp)

    def refine(self, x: Array) -> Array:
        """Interpolate a field, with any components, from the coarser grid."""
        return refine(x, self.shape, self.halved, self.periodic, self.library.xp)

    def window(self, elements: Mask, margin: float = 0.0) -> Window:
        """Return the rectangle around some elements with a margin; the grid if there are none."""
        ends = (ends_of(elements, axis) for axis in range(elements.ndim))
        return Window(self, box_around(self, ends, margin))

    def lines(self, x: Array, axis: int) -> Array:
        """Return the lines of a field along an axis; they are the last axis of the result."""
        return np.moveaxis(x, axis, -1)

    def fragmentation(self, C: Mask) -> float:
        """Return the relative length of the edge of some elements (see `traits.fragmentation`)."""
        return fragmentation(self.library.to_numpy(C))

    @keep
    def scaled_normal(self) -> tuple[ToeplitzOperator, float]:
        """Return the matrix of normal displacements due to pressures, scaled (Eq. 6-7).

        Its diagonal is 1; the second value is the original diagonal.
        """
        if any(self.periodic):
            return self._waves.normal()
        c = quadrant("zz", self.shape, self.element, self.material, self.reference)
        unit = float(c.flat[0])
        c /= unit
        return ToeplitzOperator(self.library.from_numpy(c)), unit

    def scaled_inverse(self) -> tuple[ToeplitzOperator, float]:
        """Return the scaled matrix of pressures due to displacements, and its diagonal entry.

        For surfaces that repeat along all axes. A mean displacement needs no pressure.
        """
        return self._waves.inverse_of_normal()

    @keep
    def tangential(self) -> ToeplitzOperator | CoupledOperator:
        """Return the matrix of the tangential displacements due to the tractions (Eq. 6-7)."""
        if any(self.periodic):
            return self._waves.tangential(self.directions)
        return self._matrix(0)

    @keep
    def upstream(self) -> ToeplitzOperator | CoupledOperator:
        """Return the matrix of the tangential displacements one element ahead, at x + h1.

        When the contact rolls towards positive x, a point here now was there one step before.
        """
        return self._matrix(1)

    def coupling(self, ahead: int = 0) -> tuple[ToeplitzOperator | None, ...]:
        """Return the matrices of tangential displacements due to pressures, by component."""
        return coupling_matrices(
            self.directions, self.shape, self.element, self.material, ahead=ahead
        )

    @keep
    def steady(self, A: Any) -> Any:
        """Return the matrix of steady rolling, A - S with A and S = `tangential` and `upstream`."""
        return A - self.upstream()

    def dense(self, contact: Mask, *, steady: bool) -> DenseMatrix | None:
        """Return the matrix for shifted bodies or steady rolling as an array, if it is small."""
        if contact.all() and self.has_free_mean:
            return None  # It is singular: a mean traction causes no displacement.
        if self.is_small and 0 < self.components * np.count_nonzero(contact) <= DENSE:
            return self._dense(contact.tobytes(), steady)
        return None

    @partial(keep, most=ARRAYS)
    def _dense(self, contact: bytes, steady: bool) -> DenseMatrix:
        A = self.tangential()
        A = self.steady(A) if steady else A
        return DenseMatrix(A, np.frombuffer(contact, bool).reshape(self.shape))

    @keep
    def invert_shifted(self, K: Any, dtype: DTypeLike, own: tuple[Any, ...] = ()) -> Any:
        """Return approximate inverses of the matrix of steady rolling plus ν I, for several ν.

        Those of its components without ν may be known (`own`).
        """
        return ShiftedInverses.of(K, FieldTransform(self.shape, dtype), own)

    def invert_on_runs(self, C: Mask, dtype: DTypeLike) -> tuple[Any, ...]:
        """Return approximate inverses of the components of that matrix on a fragmented area."""
        longer = replace(self, shape=(self.shape[0] + 1, *self.shape[1:]))
        A = longer.tangential()
        return tuple(InverseOnRuns(A.component(i), C, dtype) for i in range(self.components))

    @keep
    def invert_by_transform(self, A: Any, dtype: DTypeLike | None = None) -> Any:
        """Return an approximate inverse of a matrix on this grid."""
        return (self._waves.invert if any(self.periodic) else cosine_preconditioner)(A, dtype=dtype)

    def invert_by_fsai(self, A: Any, C: Mask, dtype: DTypeLike | None = None) -> Any:
        """Return an approximate inverse of a matrix on this grid for some elements."""
        return quick_fsai(MaskedOperator(A, C), dtype=dtype)

    def restrict(self, A: Any, C: Mask) -> Any:
        """Return the rows and columns of a matrix on this grid for some elements."""
        return MaskedOperator(A, C)

    def diagonal(self, A: Any) -> float:
        """Return the diagonal entry of a matrix on this grid, for the first component."""
        return float(getattr(A, "blocks", ((A,),))[0][0].diagonal_entry)

    @property
    def is_line(self) -> bool:
        """Whether the elements lie along one axis."""
        return sum(n > 1 for n in self.shape) <= 1

    @property
    def _waves(self) -> Waves:
        """The kernels of a periodic surface."""
        return Waves(self.shape, self.element, self.material, self.periodic, self.reference)

    def _matrix(self, ahead: int) -> Any:
        """Return the matrix of the tangential displacements so many elements ahead."""
        coefficients = self._coefficients().items()
        own = {name: c[: self.shape[0] + ahead] for name, c in coefficients}
        return assemble(self.directions, own, ahead)

    @keep
    def _coefficients(self) -> dict[str, Array]:
        """Return the coefficients for a grid with one more element, which include those ahead."""
        longer = (self.shape[0] + 1, *self.shape[1:])
        return evaluate_all(self.directions, longer, self.element, self.material, self.reference)


def read_sizes(shape: tuple[int, ...], element: Element) -> tuple[float, ...]:
    """Return the sizes of an element of a grid, or raise an error for them or for the grid.

    There are two, along x and y, or one for infinitely long strips.
    """
    if len(shape) not in (1, 2) or min(shape) < 1:
        raise ValueError(
            f"the grid has shape {shape}, but must be (n1, n2), or (n,) for line contact"
        )
    given = np.atleast_1d(field("element", element, "mm"))
    sizes = tuple(given.ravel().tolist())
    if given.ndim > 1 or len(sizes) not in (1, 2) or len(sizes) < len(shape):
        raise ValueError(
            f"element is {element}, but must be "
            + ("h, or (h, length)" if len(shape) == 1 else "two sizes (h1, h2)")
            + f" for a grid of shape {shape}"
        )
    if not all(0.0 < h < np.inf for h in sizes):
        raise ValueError(f"element is {element}, but its sizes must be positive and finite")
    for value in (min(sizes), max(sizes)):
        in_range("element", value)
    return sizes


def _read_periodic(periodic: Any, axes: int) -> tuple[bool, ...]:
    """Return along which axes a surface repeats, or raise an error."""
    given = tuple(periodic) if np.iterable(periodic) else (periodic,) * axes
    if len(given) != axes or not all(isinstance(value, bool | np.bool_) for value in given):
        raise ValueError(
            f"periodic is {periodic!r}, but must be True or False, or one of these for each axis, "
            "as (True, False)"
        )
    return tuple(map(bool, given))


def _read_reference(
    reference: float | None,
    shape: tuple[int, ...],
    sizes: tuple[float, ...],
    periodic: tuple[bool, ...],
) -> float:
    """Return the distance at which a line load causes no displacement; by default the length."""
    ends = [axis for axis in range(len(sizes)) if not (*periodic, False)[axis]]
    # A surface that repeats along one axis and ends along the other is like a line contact.
    is_line = len(ends) == 1 and (len(sizes) == 1 or any(periodic))
    if reference is None:
        axis = ends[0] if is_line else 0
        return sizes[axis] * (*shape, 1)[axis]
    if not is_line:
        raise ValueError(
            f"reference is {reference}, but is only for plane strain (an element of one size), or "
            "for a surface that is periodic along one of two axes: leave it out"
        )
    return positive("reference", reference, "mm")
