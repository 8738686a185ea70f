"""Fields without their part in a few others, such as tractions that change no load."""

import numpy as np
from numpy.typing import DTypeLike
from scipy.linalg.lapack import dpotrf, dtrtri

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.vectors import Vectors

DEPENDENT = 1e-12  # Relative size below which a field is taken for a combination of others.


def inner_products(fields: Array, v: Array, vectors: Vectors) -> Array:
    """Return the inner products of some fields, or of none, with another."""
    if not len(fields):
        return np.zeros(0)
    return vectors.dots(fields.reshape(len(fields), -1), v.reshape(-1))


class Complement:
    """The fields that are orthogonal to some others.

    Parameters
    ----------
    fields : ndarray of shape (m, components, ...)
    vectors : Vectors
        The inner products of fields.
    weights : ndarray, optional
        How much a change in each element costs less than elsewhere: what is added to a field is in
        proportion to it. By default it costs the same in all.
    """

    def __init__(self, fields: Array, vectors: Vectors, weights: Array | None = None) -> None:
        self._vectors, self._fields = vectors, fields
        self._added = fields if weights is None else fields * weights
        gram = np.array([inner_products(fields, f, vectors) for f in self._added])
        self._inverse = _invert(gram) if len(fields) else np.zeros((0, 0))

    def adding(self, added: Array) -> "Complement":
        """Return the same by other fields that are added, which have these products with them."""
        other = object.__new__(Complement)
        other.__dict__.update(self.__dict__)
        other._added = added
        return other

    def astype(self, dtype: DTypeLike) -> "Complement":
        """Return the same with fields in another precision."""
        other = object.__new__(Complement)
        other.__dict__.update(self.__dict__)
        other._fields, other._added = (x.astype(dtype) for x in (self._fields, self._added))
        return other

    def coordinates(self, v: Array) -> Array:
        """Return the weights of the fields in the combination of them that is nearest to v."""
        return self._inverse @ inner_products(self._fields, v, self._vectors)

    def reach(self, products: Array) -> Array:
        """Return the least field with these inner products with the fields."""
        return self._vectors.combine(self._inverse @ products, self._added)

    def __call__(self, v: Array) -> Array:
        """Return the nearest field that is orthogonal to the fields."""
        if not len(self._fields):
            return v
        return v - self._vectors.combine(self.coordinates(v), self._added)


def _invert(gram: Array) -> Array:
    """Return the inverse of a few inner products, of fields that may depend on each other."""
    sizes = np.sqrt(gram.diagonal())
    sizes[sizes == 0.0] = 1.0
    scale = sizes[:, None] * sizes
    cosines = gram / scale
    factor, fails = dpotrf(cosines)
    # The squares are what each field has in common with none before it.
    if fails or not (factor.diagonal() ** 2 > DEPENDENT).all():
        return np.linalg.pinv(cosines, DEPENDENT) / scale
    inverse, _ = dtrtri(factor)
    return inverse @ inverse.T / scale
