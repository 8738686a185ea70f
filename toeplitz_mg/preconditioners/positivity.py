"""What makes a preconditioner positive definite, and the refusal where it is not.

Of eigenvalues the sign; of M̄ a certificate that costs nothing, and a search where that fails.
"""

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.linalg import eigvalsh_tridiagonal
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.work import levels_of
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator
from toeplitz_mg.operators.coefficients import check_precision

Lag = tuple[int, ...]

REACH = 5  # unit steps from an element to one that is called near
ROUNDING = 4.0  # error, in eps of the largest eigenvalue: 1 to 3.8 of transforms of up to 2^18
DENSE = 1024  # unknowns of which all eigenvalues are computed, in some tenths of a second


def precision(A: ToeplitzOperator | CoupledOperator, dtype: DTypeLike | None) -> np.dtype[Any]:
    """Return the precision of a preconditioner of A: `dtype`, or that of A.

    Raises ValueError where A, or its inverse, is nearly out of the range of float32: what overflows
    there, or is rounded to zero, would be seen nowhere.
    """
    result = check_precision(A.dtype if dtype is None else dtype)
    if result == np.float64:
        return result
    single = np.finfo(np.float32)
    low, high = float(single.tiny / single.eps), float(single.max * single.eps)
    blocks = A.blocks if isinstance(A, CoupledOperator) else ((A,),)
    for block in (row[i] for i, row in enumerate(blocks)):
        diagonal = 0.0 if block is None else abs(float(block.c.flat[0]))
        if diagonal and not low <= diagonal <= high:
            raise ValueError(
                f"the diagonal of A is {diagonal:.3g}, but for a preconditioner in float32 it must "
                f"be between {low:.1g} and {high:.1g}: scale A"
            )
    return result


def is_positive(spectrum: Array, dtype: Any) -> bool:
    """Whether all eigenvalues are positive, beyond the rounding of the largest."""
    return float(spectrum.min()) > rounding(spectrum, dtype)


def rounding(spectrum: Array, dtype: Any) -> float:
    """Return the error that eigenvalues may have from the transform that gave them."""
    return ROUNDING * float(np.finfo(dtype).eps) * float(np.abs(spectrum).max())


def require_condition(condition: float, dtype: Any, subject: str, advice: str) -> None:
    """Raise LinAlgError where rounding in this precision may make a matrix indefinite.

    The message: "`subject` has a condition number of 1e9, with which …: use `advice`", or float64.
    """
    if not ROUNDING * float(np.finfo(dtype).eps) * condition < 1.0:
        single = np.dtype(dtype) == np.float32
        raise np.linalg.LinAlgError(
            f"{subject} has a condition number of up to {condition:.1e}, with which rounding in "
            f"{np.dtype(dtype)} may make it indefinite: use {'float64' if single else advice}"
        )


def require_positive(spectrum: Array, dtype: Any, subject: str, advice: str) -> None:
    """Raise LinAlgError where an eigenvalue is not positive, beyond the rounding of the largest.

    The message: "`subject` -0.1, but needs all above 1e-15: use `advice`".
    """
    if not is_positive(spectrum, dtype):
        raise np.linalg.LinAlgError(
            f"{subject} {spectrum.min():.3g}, but needs all above "
            f"{rounding(spectrum, dtype):.2g}: use {advice}"
        )


def robust(grid_shape: tuple[int, ...]) -> str:
    """Name what is positive definite whenever A is, for the advice of an error."""
    if levels_of(grid_shape) == 1:
        return "spectral_preconditioner(A), which is positive definite whenever A is"
    return "chan_preconditioner(A), which is positive definite whenever A is"


def for_smooth_kernels(grid_shape: tuple[int, ...]) -> str:
    """Name what takes the fewest iterations for smooth kernels, for the advice of an error."""
    if levels_of(grid_shape) == 1:
        return "use spectral_preconditioner(A), on a mask sine_preconditioner(A)"
    return (
        "take cosine_preconditioner(A), on a mask sine_preconditioner(A), and where these are "
        f"refused use {robust(grid_shape)}"
    )


def surely_positive(M: ToeplitzOperator, mask: Array | None, gamma: float) -> bool:
    """Whether M with its row sums changed to γ is certainly positive definite.

    It is γ I plus the Laplacian of a graph that joins the elements i and i + k with the weight
    -m_k. So it is positive definite

    - where no m_k is positive off the diagonal;
    - where the Laplacian of the positive m_k is below γ I;
    - and also for a positive m_k of a near element, if the weights of unit steps outweigh it:
      (x_i - x_{i+k})² ≤ |k| Σ (differences along a path of unit steps)², and each step lies on
      k_a such paths, a being its axis. The path must be in contact where its ends are.
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
        if m > 0.0 and (mask is None or _path_in_contact(mask, k)):
            weights -= m * np.abs(k).sum() * np.abs(k)
            lags[_at(centre, k)] = lags[_at(centre, tuple(-j for j in k))] = 0.0
    return bool((weights >= 0.0).all()) and _laplacian_of_positive(lags, M.grid_shape) < gamma


def _at(centre: Lag, k: Any) -> Lag:
    return tuple(c + int(j) for c, j in zip(centre, k, strict=True))


def _near(grid_shape: tuple[int, ...]) -> list[Lag]:
    """One of each pair of near lags k and -k; unit steps are not among them."""
    reach = [min(REACH, n - 1) for n in grid_shape]
    lags = product(*(range(-r, r + 1) for r in reach))
    return [k for k in lags if k > (0,) * len(k) and 2 <= sum(map(abs, k)) <= REACH]


def _path_in_contact(mask: Array, k: Lag) -> bool:
    """Whether, of any two elements in contact at the lag k, those on the path between are too.

    The path goes along the first axis, then along the next.
    """

    def shifted(p: Lag) -> Array:
        window = [
            slice(max(0, -j) + q, n - max(0, j) + q)
            for j, q, n in zip(k, p, mask.shape, strict=True)
        ]
        return np.asarray(mask[tuple(window)])

    ends = shifted((0,) * len(k)) & shifted(k)
    point = [0] * len(k)
    for axis, steps in enumerate(k):
        for _ in range(abs(steps)):
            point[axis] += 1 if steps > 0 else -1
            if (ends & ~shifted(tuple(point))).any():
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


def smallest_eigenvalue(A: LinearOperator, M_bar: LinearOperator) -> float:
    """Return the smallest eigenvalue of M̄, or, of a large one, an estimate of that of M̄ A.

    The estimate is too large, and may be positive where M̄ is indefinite.
    """
    if M_bar.shape[0] <= DENSE:
        return float(np.linalg.eigvalsh(M_bar.toarray()).min())
    return smallest_ritz_value(A, M_bar)


def smallest_ritz_value(A: LinearOperator, M_bar: LinearOperator, steps: int = 40) -> float:
    """Estimate the smallest eigenvalue of M̄ A, by Lanczos's method in the inner product of A.

    All but a few eigenvalues lie near 1, so that a negative one far from there is soon found; it
    shows that M̄ is indefinite.
    """
    return float(ritz_values(A, M_bar, steps)[0])


def ritz_values(A: LinearOperator, M: LinearOperator, steps: int) -> Array:
    """Return estimates of eigenvalues of M A, ascending: none is beyond the outermost of those.

    By so many steps of Lanczos's method in the inner product of A, in which M A is self-adjoint if
    M is symmetric: a product with each is a step. The first vector has a part of each size, a
    constant and a random one. NaN where they are out of range.
    """
    rng = np.random.default_rng(0)
    q = (1.0 + rng.standard_normal(A.shape[0])).astype(A.dtype)
    q_old = np.zeros(A.shape[0], A.dtype)
    diagonal: list[float] = []
    off_diagonal: list[float] = []
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(min(steps, A.shape[0])):
            p = A @ q
            norm = float(np.sqrt(max(q @ p, 0.0)))
            if diagonal:
                if norm <= np.finfo(A.dtype).eps * abs(diagonal[0]):
                    break  # the Krylov space is exhausted
                off_diagonal.append(norm)
            q, p = q / norm, p / norm
            w = M @ p
            diagonal.append(float(w @ p))
            q, q_old = w - diagonal[-1] * q - (norm if off_diagonal else 0.0) * q_old, q
    if not np.isfinite(diagonal + off_diagonal).all():
        return np.array([np.nan])
    return np.asarray(eigvalsh_tridiagonal(np.array(diagonal), np.array(off_diagonal)))
