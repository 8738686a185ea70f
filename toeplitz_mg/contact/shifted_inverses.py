"""Approximate inverses of the matrix of steady rolling with additions to its diagonal.

The inverse of a circulant that is near K is one of K, but for the edges of where tractions may
change: the leading edge of the contact, and the edge behind which elements slide. What is wrong
there is so on any scale, and would take more iterations the more elements there are.

Along the rolling direction K is the product of two factors, of the lags from 0 on and of those from
0 down (Wiener and Hopf). From an edge on, the inverse of K is that of the one, cut at the edge, and
then that of the other; up to an edge it is the same in the opposite order. And either is that of
the circulant at an edge of the other kind: so the sum of both orders, less the inverse of the
circulant, is right at both. With this the products do not depend on the number of elements.

References
----------
I. Gohberg, I. A. Feldman, Convolution equations and projection methods for their solution, AMS
(1974).
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.circulants import Circulants, find_causal_factor, find_spectrum
from toeplitz_mg.engine.vectors import VECTORS, Vectors
from toeplitz_mg.operators import CoupledOperator

# Additions to the matrix whose inverses are interpolated, over its diagonal.
ADDITIONS = np.array([0.0, 0.3, 2.0])

# It projects fields, (k, components, ...), to those by which the tractions may change, in place.
Projection = Callable[[Array], object]


class ShiftedInverses:
    """Approximate inverses of K + ν, of the matrix of steady rolling and additions ν.

    Their fields are added with weights that depend on the place: where an element slides, what is
    to be inverted is K + λ with a λ of its own. They are circulants (see `Circulants`), of K itself
    by its factors, and for large λ a multiple of the field itself.

    Parameters
    ----------
    circulants : Circulants
        How the circulants are multiplied with; or others that have the same methods.
    spectra : list of ndarray
        The eigenvalues of circulants that are near the components of K. The components are inverted
        each by itself: the coupling is weak, and inverted too, it saves no iteration.
    causal : list of ndarray
        The causal factors of the inverses of these (see `circulants.find_causal_factor`).
    diagonal : float
        That of K.
    additions : ndarray
        Those whose inverses are interpolated, over the diagonal of K, the first of which is zero.
    vectors : Vectors
        How much of a field is not zero, where ranks share it.

    Attributes
    ----------
    dtype : float32 or float64
        That of the fields.
    """

    def __init__(
        self,
        circulants: Any,
        spectra: list[Array],
        causal: list[Array],
        diagonal: float,
        additions: Array = ADDITIONS,
        vectors: Vectors = VECTORS,
    ) -> None:
        self._circulants, self.dtype, self.diagonal = circulants, circulants.dtype, diagonal
        self._additions, self._vectors = additions, vectors
        precision = np.result_type(self.dtype, np.complex64)
        self._causal = np.array(causal, precision)
        anticausal = [1.0 / (s * factor) for s, factor in zip(spectra, causal, strict=True)]
        self._anticausal = np.array(anticausal, precision)
        self._inverses = [
            np.array([1.0 / (s + nu) for s in spectra], precision)
            for nu in (diagonal * additions[1:]).tolist()
        ]

    @classmethod
    def of(
        cls, K: Any, dtype: DTypeLike, circulants: Any = Circulants, additions: Array = ADDITIONS
    ) -> "ShiftedInverses":
        """Return those of a ToeplitzOperator or a CoupledOperator of some components."""
        is_coupled = isinstance(K, CoupledOperator)
        blocks = [K.component(i) for i in range(len(K.blocks))] if is_coupled else [K]
        made = circulants(blocks[0].grid_shape, dtype)
        spectra = [find_spectrum(block, made.lengths) for block in blocks]
        causal = [find_causal_factor(1.0 / s, made.lengths) for s in spectra]
        return cls(made, spectra, causal, float(blocks[0].c.flat[0]), additions)

    def at(self, addition: Array) -> Callable[[Array, Projection], Array]:
        """Return the approximate inverse of K + an addition to the diagonal at each place.

        It takes a field, (components, ...), and the projection to those by which the tractions may
        change, to another field.
        """
        circulants, first, second = self._circulants, self._causal, self._anticausal
        stiffness = addition / self.diagonal
        weights, local = interpolate(stiffness, self.dtype, self._additions)
        within = (1.0 / np.sqrt(1.0 + stiffness)).astype(self.dtype)
        local /= self.diagonal
        used = [k for k in range(1, len(weights)) if self._vectors.count(weights[k])]
        weights = weights[[0, *used]]

        def invert(r: Array, project_each: Projection) -> Array:
            r = r.astype(self.dtype, copy=False)
            R = circulants.forward(r)
            # Without the half the sum of both orders would be twice the inverse of the circulant.
            halves = circulants.multiply([[(R, first)], [(R, second)]])
            whole = 0.5 * halves
            project_each(halves)
            halves *= within
            halves -= whole
            X, Y = circulants.forward(halves)
            sums = [[(X, second), (Y, first)], *([(R, self._inverses[k - 1])] for k in used)]
            return np.einsum("k...,kc...->c...", weights, circulants.multiply(sums)) + local * r

        return invert


def interpolate(
    addition: Array, dtype: DTypeLike, additions: Array = ADDITIONS
) -> tuple[Array, Array]:
    """Return the weights of the inverses, (k, ...), and of 1/k₀ in one for an addition over k₀.

    In x = 1/(k₀ + ν) the inverse of K + ν is x - x² (K - k₀) + ...: the first term is known, and
    what the others are over x² is interpolated. So it is exact where K is its diagonal k₀, and
    nearly so beyond the last ν.
    """
    x, nodes = (1.0 / (1.0 + given).astype(dtype) for given in (addition, additions))
    nodes = nodes.reshape(-1, *(1,) * x.ndim)
    here, after = nodes[:-1], nodes[1:]
    weights = np.empty((len(nodes), *x.shape), dtype)
    # How much of what is interpolated is of the nodes up to each: of the last ones, all of it.
    weights[-1] = 1.0
    share = np.multiply(x - after, 1.0 / (here - after), out=weights[:-1])
    np.minimum(np.maximum(share, 0.0, out=share), 1.0, out=share)
    weights[1:] -= weights[:-1].copy()
    weights *= x * x / nodes**2
    return weights, x - (nodes.ravel() @ weights.reshape(len(nodes), -1)).reshape(x.shape)
