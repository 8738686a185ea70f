"""A first guess from the pressures under other loads.

Near the edge of a contact the pressures rise as the root of the distance from it, and the gap
opens as its power 3/2. So p² where the bodies touch, and minus the power 2/3 of the gap elsewhere,
are one field that is nearly linear in the distance, and in the load: extrapolated, it says where
the edge will be. Pressures themselves know nothing of elements that do not touch yet.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.vectors import Vectors

# Pressure over the mean one that is usual near the edge of a contact: how fast the gap opens there.
EDGE = 0.5


class Known(NamedTuple):
    """Pressures under a load, in the units of the search, and the gap that they leave."""

    load: float  # Force or approach.
    p: Array
    gap: Array


def predict(known: Sequence[Known], load: float, vectors: Vectors) -> Array | None:
    """Return pressures under another load, or None where those that are known say nothing.

    Parameters
    ----------
    known : sequence of Known
        The last two loads count. With one of them, its pressures are returned.
    load : float
    vectors : Vectors
        The sums of fields.
    """
    last = known[-1]
    if not vectors.count(last.p):
        return None
    before = next((k for k in reversed(known[:-1]) if k.load != last.load), None)
    if before is None or not vectors.count(before.p):
        return last.p
    edge = EDGE * vectors.sum(last.p) / vectors.count(last.p)
    now, then = (_straighten(k, edge) for k in (last, before))
    part = (load - last.load) / (last.load - before.load)
    p: Array = np.sqrt(np.maximum(now + part * (now - then), 0.0))
    return p if vectors.count(p) else None


def _straighten(known: Known, edge: float) -> Array:
    """Return a field that is linear in the distance from the edge of the contact."""
    # Where there is no material the gap is infinite, and nothing is to be extrapolated.
    gap = np.where(known.gap < np.inf, np.maximum(known.gap, 0.0), 0.0)
    opening = np.cbrt(edge**2 * gap) ** 2
    return np.where(known.p > 0.0, known.p**2, -opening)
