"""Anderson's acceleration: the fixed point of a map, from a few fields and their images."""

import numpy as np

from toeplitz_mg._typing import Array

DEPTH = 2  # Differences of pairs that are combined: more of them save nothing, or lead astray.


Pairs = list[tuple[Array, Array]]


def extend(pairs: Pairs, x: Array, y: Array) -> Pairs:
    """Return the pairs that are combined, of which a field and its image are the last."""
    return [*pairs, (x, y)][-DEPTH - 1 :]


def accelerate(pairs: Pairs) -> Array:
    """Return a field near the fixed point of a map, by Anderson's method.

    Of the affine combinations of the pairs it is y of the one in which y - x is least. Where that
    is negative, or y of the last pair is zero, it is this y: fields are pressures, or bounds.

    Parameters
    ----------
    pairs : list of (ndarray, ndarray)
        Fields x, and what the map makes of them, y; the last is the one to go on from.
    """
    _, image = pairs[-1]
    if len(pairs) == 1:
        return image
    steps = [y - x for x, y in pairs]
    differences = [(steps[-1] - step).ravel() for step in steps[:-1]]
    weights, *_ = np.linalg.lstsq(np.stack(differences, axis=1), steps[-1].ravel(), rcond=None)
    mixed = image.copy()
    for weight, (_, earlier) in zip(weights, pairs[:-1], strict=True):
        mixed -= weight * (image - earlier)
    return np.where((image > 0.0) & (mixed > 0.0), mixed, image)
