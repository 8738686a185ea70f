"""Where grids are cut into the rows, and into the columns, of ranks."""

from collections.abc import Sequence
from math import prod

import numpy as np

from toeplitz_mg._typing import Array

UNITS = (64, 16, 4, 1)  # Rows that may stay together: the cells of FSAI grow fourfold a level.
SHARE = 16  # Units that a rank has at least, so that one more of them is not felt.

Turn = Sequence[tuple[int, int]]  # The first column of each rank, and the one behind its last.


def choose_unit(shape: tuple[int, ...], ranks: int) -> int:
    """Return how many rows stay together, so that all ranks have about as many."""
    of_line = () if prod(shape[1:]) > 1 else (line_width(shape[0]),)
    return next((k for k in (*of_line, *UNITS) if shape[0] >= SHARE * k * ranks), 1)


def line_width(n: int) -> int:
    """Return how many of n unknowns of one axis are a row, where they are taken as a matrix."""
    return 1 << n.bit_length() // 2


def balance(weights: Array, parts: int) -> Array:
    """Return where things are cut into parts of about the same weight, shape (parts + 1,).

    The weights are positive. No part is empty: there are as many things as parts, or more.
    """
    ends, k = np.cumsum([0, *weights]), np.arange(parts + 1)
    goals = ends[-1] * k / parts
    cuts = np.searchsorted((ends[1:] + ends[:-1]) / 2, goals)  # The nearest ends.
    return np.minimum(np.maximum.accumulate(cuts - k), len(weights) - parts) + k


def cuts_of(n: int, parts: int) -> Array:
    """Return where n things are cut into parts of about the same size, shape (parts + 1,)."""
    return np.array([n * k // parts for k in range(parts + 1)])
