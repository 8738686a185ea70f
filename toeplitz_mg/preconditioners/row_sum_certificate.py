"""Whether M̄ is positive definite: a certificate that costs nothing, and a search otherwise."""

from itertools import product
from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.positivity import ritz_values

Lag = tuple[int, ...]  # The lag, or the index of a coefficient, along each axis.

REACH = 5  # Most unit steps from an element to one that is called near.
DENSE = 1024  # Most unknowns for which all eigenvalues are computed, in some tenths of a second.
STEPS = 40  # Steps of Lanczos's method with larger matrices: two work units each.


def is_certainly_positive(M: ToeplitzOperator, mask: Mask | None, gamma: float) -> bool:
    """Whether M with its row sums changed to γ is certainly positive definite.

    It is γ I plus the Laplacian of a graph that joins the elements i and i + k with the weight
    -m_k. So it is positive definite

    - where no m_k is positive off the diagonal;
    - where the Laplacian of the positive m_k is below γ I;
    - and also for a positive m_k of a near element, if the weights of unit steps outweigh it:
      (x_i - x_{i+k})² ≤ |k| Σ (differences along a path of unit steps)², and each step lies on
      k_a such paths, a being its axis. The path must be active where its ends are.
    """
    lags = M.lags.copy()
    centre = tuple(n - 1 for n in M.grid_shape)
    steps = np.identity(lags.ndim, dtype=int)
    weights = np.array(
        [0.0 if n == 1 else -lags[_at(centre, e)] for e, n in zip(steps, M.grid_shape, strict=True)]
    )
    lags[centre] = 0.0
    for k in _near(M.grid_shape):
        m = lags[_at(centre, k)]
        if m > 0.0 and (mask is None or _is_path_active(mask, k)):
            weights -= m * np.abs(k).sum() * np.abs(k)
            lags[_at(centre, k)] = lags[_at(centre, tuple(-j for j in k))] = 0.0
    return bool((weights >= 0.0).all()) and _laplacian_of_positive(lags, M.grid_shape) < gamma


def _at(centre: Lag, k: Any) -> Lag:
    return tuple(c + int(j) for c, j in zip(centre, k, strict=True))


def _near(grid_shape: tuple[int, ...]) -> list[Lag]:
    """Return one of each pair of near lags k and -k; unit steps are not among them."""
    reach = [min(REACH, n - 1) for n in grid_shape]
    lags = product(*(range(-r, r + 1) for r in reach))
    return [k for k in lags if k > (0,) * len(k) and 2 <= sum(map(abs, k)) <= REACH]


def _is_path_active(mask: Mask, k: Lag) -> bool:
    """Whether, of any two active elements at the lag k, those on the path between are active too.

    The path goes along the first axis, then along the next.
    """

    def shift(p: Lag) -> Array:
        window = [
            slice(max(0, -j) + q, n - max(0, j) + q)
            for j, q, n in zip(k, p, mask.shape, strict=True)
        ]
        return mask[tuple(window)]

    ends = shift((0,) * len(k)) & shift(k)
    point = [0] * len(k)
    for axis, steps in enumerate(k):
        for _ in range(abs(steps)):
            point[axis] += 1 if steps > 0 else -1
            if (ends & ~shift(tuple(point))).any():
                return False
    return True


def _laplacian_of_positive(lags: Array, grid_shape: tuple[int, ...]) -> float:
    """Bound the norm of the graph Laplacian of the positive coefficients.

    The pairs at one lag form paths, whose Laplacian has eigenvalues below 4, or, where the lag is
    half the grid or more, single edges, whose Laplacian has the eigenvalue 2.
    """
    positive = np.maximum(lags, 0.0)
    paths = positive[tuple(slice(n // 2, 2 * n - 1 - n // 2) for n in grid_shape)]
    # Each pair stands in M twice, as lag k and as lag -k.
    return float(positive.sum() + paths.sum())


def find_smallest_eigenvalue(A: LinearOperator, M_bar: LinearOperator) -> float:
    """Return the smallest eigenvalue of M̄, or, of a large one, an estimate of that of M̄ A.

    The estimate is too large, and may be positive where M̄ is indefinite. But all eigenvalues of
    M̄ A but a few lie near 1, so that a negative one, far from there, is soon found.
    """
    if M_bar.shape[0] <= DENSE:
        return float(np.linalg.eigvalsh(M_bar.toarray()).min())
    return float(ritz_values(A, M_bar, STEPS)[0])
