"""The refusal of a multigrid cycle that is not positive definite."""

import numpy as np

from toeplitz_mg.multigrid_cycle.cycle import Multigrid
from toeplitz_mg.multigrid_cycle.interpolation import AreaWeighted
from toeplitz_mg.operators.positivity import ritz_values

STEPS = 12  # Steps of Lanczos's method with a cycle that is in doubt: a cycle and a product each.
# Smallest Ritz value of a cycle and its matrix that is accepted: that of a good cycle is above 0.4.
LEAST = 0.05
# Largest relative skewness of a cycle that is accepted, in units of the root of eps: CG bears that.
SKEW = 0.1


def require_definite(M: Multigrid, is_galerkin: bool) -> None:
    """Raise LinAlgError where a symmetric cycle is found not to be positive definite.

    With the coarse cycle B and K = I - S A, a cycle is

        A⁻¹ - Kᵛ A⁻¹ Kᵛᵀ + Kᵛ P B Pᵀ Kᵛᵀ,

    which is definite for certain where S converges and B is definite. So is a coarse V-cycle, by
    induction, and a W-cycle 2 B - B A B if B A has no eigenvalue above 2, as where all coarse
    matrices are R A P. Where a smoother may diverge, the coarse grid may make up for that: the
    cycle itself is examined.
    """
    inner = M.levels[:-1]
    diverging = [k for k, level in enumerate(inner) if not level.converges]
    if diverging:
        steps = max(1, min(M.pre, M.post))
        cycle = M if M.pre == M.post else Multigrid(M.levels, steps, steps, M.gamma)
        smallest = float(ritz_values(M.levels[0].A, cycle, STEPS)[0])
        what = ""
        if not smallest > LEAST:
            what = f"not positive definite: its product with A has the eigenvalue {smallest:.3g}"
        elif not (skew := _skewness(cycle)) <= SKEW * np.sqrt(np.finfo(M.dtype).eps):
            what = f"not symmetric, by {skew:.1e}, which is rounding that has grown"
        if what:
            k = diverging[0]
            level = inner[k]
            error = np.linalg.LinAlgError(
                f"the cycle is {what}, as {level.smoother!r} diverges as a smoother. Of the "
                "eigenvalues of its product with the matrix it needs all below 2: use "
                "default_preconditioner(A) with cg"
            )
            error.add_note(f"This was the matrix of level {k} of multigrid, {level.A!r}.")
            raise error
    by = [t for level in inner if level.transfer for t in level.transfer.by_axis]
    is_nested = is_galerkin and not any(isinstance(t, AreaWeighted) for t in by)
    if M.gamma % 2 == 0 and not is_nested:
        for k in range(1, len(inner)):
            cycle = Multigrid(M.levels[k:], M.pre, M.post, M.gamma)
            largest = float(ritz_values(cycle.levels[0].A, cycle, STEPS)[-1])
            if not largest < 2.0:
                raise np.linalg.LinAlgError(
                    f"the cycle on level {k} of multigrid has the eigenvalue {largest:.3g} with "
                    f"its matrix, which gamma = {M.gamma} needs below 2: use gamma=1"
                )


def _skewness(M: Multigrid) -> float:
    """Return |uᵀ M v - vᵀ M u| of two random vectors, relative to the sizes of u and M v."""
    u, v = np.random.default_rng(0).standard_normal((2, M.shape[0])).astype(M.dtype)
    Mu, Mv = M @ u, M @ v
    return float(abs(u @ Mv - v @ Mu) / (np.linalg.norm(u) * np.linalg.norm(Mv)))
