"""An approximate inverse of a symmetric Toeplitz matrix, in the domain of the DCT-II.

There the matrix is D + K: a diagonal D of samples of the symbol, and a matrix K whose entries
change slowly with both frequencies. Even numbers of these are coupled with even ones only, and odd
ones with odd ones. So K is nearly P N Pᵀ, where P puts frequencies into groups, and N is K at one
frequency of each. The lowest are a group each, as zeros and poles of the symbol are there; the
widths of the others grow in proportion to the frequency. Where a pole or a kink is inside, groups
are narrow around it too. The inverse of D + P N Pᵀ takes that of a small matrix,
N + (Pᵀ D⁻¹ P)⁻¹, which for the lowest alone is a block of C A Cᵀ itself.

References
----------
C. T. H. Baker, The Numerical Treatment of Integral Equations, Oxford (1977), for Nyström's method,
which has a smooth kernel from its values at a few points; W. W. Hager, Updating the inverse of a
matrix, SIAM Rev. 31 (1989), for the formula of Sherman, Morrison and Woodbury.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.preconditioners.positivity import is_positive
from toeplitz_mg.solvers.cosine_form import CosineForm, Points, choose_points

ALONE = 32  # Lowest pairs of frequencies that are groups alone, where there are no others.
LOWEST = 18, 22  # Where there are, the lowest pairs alone, and groups from there to the middle.
HIGHEST = 8, 10  # The same from the highest pairs on.
LOWEST_OF_FOUR = 6, 10  # The same where there is a pole or a kink inside,
OTHERS_OF_FOUR = 4, 8  # and on both of its sides and from the highest pairs on.
# Change of the slope of the symbol from one of `POINTS` to the next, over the symbol itself, from
# which on there is a pole or a kink: 5 - log |cos θ - cos 1| has 0.1 to 0.3, 0.05 + |θ - 1| 0.2.
# What is smooth but at θ = 0 has 0.018 at most, but for Gaussians, whose tail is steep.
BENT = 0.03
POINTS = 512
MARGIN = 16  # Part of all frequencies, from each end, where groups are narrow anyway.
LONG = 4096  # Fewest numbers where an iteration takes so long.
# Sample of the symbol next to the lowest frequencies, over the largest, below which rounding says
# how many iterations it takes: (2 - 2 cos θ)² has that from some 6000 unknowns on.
LEAST = 1e-7


class ApproximateInverse:
    """The inverse of D + P N Pᵀ for a `CosineForm`, in the domain of the transform.

    Where there is no other group, that of C A Cᵀ for the lowest frequencies, and of D for others.

    Attributes
    ----------
    diagonal : ndarray of shape (m,)
        The inverse of D.
    of_groups : ndarray of shape (2 k, 2 k)
        What the sums over groups, of each parity in turns, are multiplied by.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where it is not positive definite.
    """

    def __init__(self, form: CosineForm) -> None:
        are_alone = form.m < LONG or (form.has_ended and not form.has_zero)
        peak = 0 if are_alone else find_peak(form.samples)
        self._groups = groups = group(form.m, are_alone, peak)
        B = form.entries(groups.points)
        k = B.shape[-1]
        of_B = B.reshape(2, -1)[:, :: k + 1]
        D = _diagonal(form, of_B.T[: groups.alone].ravel())
        if not is_positive(D, np.float64):
            raise np.linalg.LinAlgError("a sample of the symbol is not positive")
        self.diagonal = np.reciprocal(D)
        if not groups.are_alone:
            sizes = groups.sum(self.diagonal)
            # B is N + (Pᵀ D⁻¹ P)⁻¹ now.
            of_B += (1.0 / sizes).reshape(k, 2).T - D[groups.points.frequencies]
        self.of_groups = np.zeros((2 * k, 2 * k))
        for parity in (0, 1):
            self.of_groups[parity::2, parity::2] = _invert(B[parity])
        if not groups.are_alone:
            self.of_groups /= sizes
            self.of_groups /= sizes[:, np.newaxis]
            self.of_groups.reshape(-1)[:: 2 * k + 1] -= 1.0 / sizes

    def apply(self, R: Rows, out: Rows) -> None:
        """Multiply rows by it."""
        d, groups = self.diagonal, self._groups
        np.multiply(R, d, out=out)
        if groups.are_alone:
            lowest = np.s_[..., : len(self.of_groups)]
            out[lowest] = R[lowest].dot(self.of_groups)
            return
        for z in out.reshape(-1, len(d)):
            correction = groups.spread(self.of_groups.dot(groups.sum(z)))
            end = len(correction)
            correction *= d[:end]
            z[:end] += correction


def _diagonal(form: CosineForm, lowest: Array) -> Array:
    """Return D, whose first entries are given: samples of the symbol at the other frequencies."""
    D = np.empty(form.m)
    D[: len(lowest)] = lowest
    others, f = D[len(lowest) :], form.samples[len(lowest) - 1 :]
    if form.has_ended and f[0] > LEAST * f.max():
        others[...] = f[1:-1]  # A differs from its symbol by a matrix of small rank only.
    else:
        # Lags that are cut off add (-1)^k times something smooth: a mean of neighbours has not.
        np.multiply(f[1:-1], 2.0, out=others)
        others += f[:-2]
        others += f[2:]
        others *= 0.25
    return D


class Groups(NamedTuple):
    """Groups of pairs of frequencies, of an even and of an odd number.

    The last even number of an odd length is in no pair, and in no group.
    """

    alone: int  # The lowest pairs, which are a group each.
    are_alone: bool  # Whether there are no others.
    starts: Array  # Shape (k,): the pairs that the groups begin with.
    widths: Array  # Shape (k,): how many pairs they have.
    points: Points  # Frequencies in the middle.

    def sum(self, x: Array) -> Array:
        """Return the sums of a vector over groups of all pairs, shape (2 k,)."""
        pairs = x[: len(x) // 2 * 2].reshape(-1, 2)
        return np.add.reduceat(pairs, self.starts).reshape(-1)

    def spread(self, values: Array) -> Array:
        """Return a vector that has the values of the groups, the transpose of `sum`."""
        return np.repeat(values.reshape(-1, 2), self.widths, axis=0).reshape(-1)


def find_peak(samples: Array) -> int:
    """Return the pair of frequencies where the symbol has a pole or a kink inside, or 0.

    Of several it is the one where the symbol bends most.
    """
    # Even steps do not see what lags that are cut off add, as that has one sign at even numbers.
    step = max(2, len(samples) // POINTS // 2 * 2)
    coarse = samples[::step]
    bends = _bends(coarse) - BENT * coarse[1:-1]
    margin = len(bends) // MARGIN
    start = margin + int(bends[margin : len(bends) - margin].argmax())
    # At the edge it is the foot of a peak in the margin.
    if not bends[start] > 0.0 or start in (margin, len(bends) - margin - 1):
        return 0
    near = samples[start * step : (start + 2) * step + 1 : 2]
    return start * step // 2 + 1 + int(_bends(near).argmax())


def _bends(f: Array) -> Array:
    """Return the changes of the slope, without their signs."""
    return np.abs(f[2:] - 2.0 * f[1:-1] + f[:-2])


@lru_cache(maxsize=64)
def group(m: int, are_alone: bool, peak: int = 0) -> Groups:
    """Return the groups for a transform of length m: the lowest alone, or those of all pairs.

    They are narrow around a pair that is the peak, if it is not 0.
    """
    pairs = m // 2
    if are_alone:
        edges = np.arange(min(ALONE, pairs) + 1)
    elif peak:
        below = _edges(0, peak, LOWEST_OF_FOUR, OTHERS_OF_FOUR)
        edges = np.append(below[:-1], _edges(peak, pairs, OTHERS_OF_FOUR, OTHERS_OF_FOUR))
    else:
        edges = _edges(0, pairs, LOWEST, HIGHEST)
    starts, ends, widths = edges[:-1], edges[1:], np.diff(edges)
    points = choose_points(m, (starts + ends - 1) // 2 * 2 + [[0], [1]])
    alone = int((np.append(widths, 2) > 1).argmax())
    return Groups(alone, are_alone, starts, widths, points)


def _edges(start: int, stop: int, first: tuple[int, int], last: tuple[int, int]) -> Array:
    """Return the edges of groups that are narrow at both ends, and wide in the middle."""
    middle = (start + stop) // 2
    below = start + _edges_of_half(middle - start, *first)
    above = stop - _edges_of_half(stop - middle, *last)
    return np.unique(np.append(below, above))


def _edges_of_half(half: int, alone: int, wider: int) -> Array:
    """Return the edges of groups from one end to the middle: the first alone, then wider ones."""
    alone = min(alone, half)
    others = np.geomspace(alone, half, wider + 1).round().astype(int)
    return np.concatenate([np.arange(alone), others])


def _invert(B: Array) -> Array:
    """Invert a symmetric positive definite matrix; raise LinAlgError where it is not."""
    factor, not_positive = dpotrf(B.T, overwrite_a=True)
    # Of `dpotri` OpenBLAS makes threads, which may wait for each other for a hundred milliseconds.
    inverse, singular = dtrtri(factor, overwrite_c=True)
    if not_positive or singular:
        raise np.linalg.LinAlgError("the matrix of the lowest frequencies is not positive definite")
    return inverse @ inverse.T
