"""The multigrid cycle as a linear operator."""

from dataclasses import replace
from functools import partial
from math import prod

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.multigrid_cycle.border import Border
from toeplitz_mg.multigrid_cycle.hierarchy import Level
from toeplitz_mg.operators import algebra
from toeplitz_mg.operators.base import GridOperator, apply_to_rows, grid_of, work_of
from toeplitz_mg.operators.composed import DiagonallyScaled


class Multigrid(GridOperator):
    """One multigrid cycle from a zero guess, an approximate inverse of ``levels[0].A``.

    Made by `multigrid`, which has the documentation and an example, or from your own levels.

    Parameters
    ----------
    levels : tuple of Level
        From the finest to the coarsest; their borders are made here.
    pre, post : int
        Smoothing steps before and after the coarse-grid correction.
    gamma : int
        Number of coarse cycles in a cycle: 1 for V, 2 for W.

    Attributes
    ----------
    levels : tuple of Level
        The given levels, with their borders.
    pre, post, gamma : int
        The parameters.

    See Also
    --------
    multigrid : builds the levels and the cycle.
    """

    def __init__(self, levels: tuple[Level, ...], pre: int, post: int, gamma: int) -> None:
        A = levels[0].A
        super().__init__(A.dtype, grid_of(A), _work(levels, pre, post, gamma), A.shape[0])
        self.pre = pre
        self.post = post
        self.gamma = gamma
        # Build from the coarsest level up, because a border needs the cycle of the next coarser
        # one.
        self.levels = levels[-1:]
        for level in reversed(levels[:-1]):
            assert level.transfer is not None
            solve = partial(self._solve, self.levels)
            border = Border.of(level.A, level.transfer, solve)
            self.levels = (replace(level, border=border), *self.levels)

    def apply(self, B: Array, out: Array | None = None) -> Array:
        """Multiply each row of `B` (see `GridOperator.apply`)."""
        dtype = np.result_type(B, self.dtype)
        X = np.empty(B.shape, dtype) if out is None else out
        shape = B.shape if B.ndim == 1 else (-1, B.shape[-1])
        rows = B.reshape(shape)
        if X is B or B.dtype != dtype:
            rows = workspace(rows.shape, dtype)
            rows[...] = B.reshape(shape)
        self._cycle(self.levels, rows, X.reshape(shape))
        return X

    def _cycle(self, levels: tuple[Level, ...], b: Array, x: Array) -> None:
        """Write one cycle from a zero guess to x: smooth, correct on the coarse grid, smooth."""
        A, S = levels[0].A, levels[0].smoother
        is_coarsest = levels[0].transfer is None
        pre = _steps_on_coarsest(levels[0], self.pre + self.post) if is_coarsest else self.pre
        r = workspace(b.shape, b.dtype)
        if pre:
            apply_to_rows(S, b, x)
            for _ in range(pre - 1):
                _residual(A, x, b, r)
                x += apply_to_rows(S, r, r)
            if is_coarsest:
                return
            _residual(A, x, b, r)
            self._correct(levels, r, r)
            x += r
        else:
            self._correct(levels, b, x)
        for _ in range(self.post):
            _residual(A, x, b, r)
            x += apply_to_rows(S, r, r)

    def _correct(self, levels: tuple[Level, ...], r: Array, x: Array) -> None:
        """Write the coarse-grid correction for the residual r to x, which may be r."""
        transfer, border = levels[0].transfer, levels[0].border
        assert transfer is not None
        e = self._solve(levels[1:], transfer.restrict(r))
        if border is None:
            transfer.interpolate(e, x)
            return
        e, left = border.correct(e, r)
        transfer.interpolate(e, x)
        border.add(left, x)

    def _solve(self, levels: tuple[Level, ...], r: Array) -> Array:
        """Solve on a coarse grid by gamma cycles."""
        e = workspace(r.shape, r.dtype)
        self._cycle(levels, r, e)
        if not levels[0].is_exact:
            for _ in range(self.gamma - 1):
                again = workspace(r.shape, r.dtype)
                correction = workspace(r.shape, r.dtype)
                _residual(levels[0].A, e, r, again)
                self._cycle(levels, again, correction)
                e += correction
        return e

    @property
    def is_hermitian(self) -> bool | None:
        """Whether the cycle is symmetric; None if a smoother does not tell."""
        smoothers = [algebra.is_hermitian(level.smoother) for level in self.levels]
        if self.pre != self.post or False in smoothers:
            return False
        return None if None in smoothers else True

    @property
    def is_definite(self) -> bool:
        """Whether the cycle is symmetric positive definite by construction, as `cg` requires.

        With K = I - S A, v smoothing steps before and after, and the coarse cycle B it is

            A⁻¹ - Kᵛ A⁻¹ Kᵛᵀ + Kᵛ P B Pᵀ Kᵛᵀ.

        This is definite if S is symmetric and converges and B is definite; by induction a coarse
        V-cycle is. A W-cycle 2 B - B A B is too if B A has no eigenvalue above 2, as with
        `galerkin`, whose matrices are hardly ever below R A P.
        """
        is_nested = self.gamma % 2 == 1 or all(level.is_galerkin for level in self.levels)
        return (
            bool(self.is_hermitian) and is_nested and all(level.converges for level in self.levels)
        )

    def _adjoint(self) -> "Multigrid":
        if self.is_hermitian:
            return self
        # The adjoint smooths in the reverse order with the adjoint smoother.
        levels = tuple(replace(level, smoother=level.smoother.H) for level in self.levels)
        return Multigrid(levels, self.post, self.pre, self.gamma)

    def __repr__(self) -> str:
        kind = {1: "V", 2: "W"}.get(self.gamma, f"{self.gamma}-fold ")
        sizes = [str(level.A.shape[0]) for level in self.levels]
        if len(sizes) > 4:
            sizes = [*sizes[:3], "...", sizes[-1]]
        smoother = self.levels[0].smoother
        if isinstance(smoother, DiagonallyScaled):
            smoother = smoother.M
        end = " (dense)" if self.levels[-1].is_exact else ""
        return (
            f"<Multigrid {kind}({self.pre},{self.post}) {type(smoother).__name__}  "
            f"{' > '.join(sizes)}{end}  {self.work:.1f} work units>"
        )


def _work(levels: tuple[Level, ...], pre: int, post: int, gamma: int) -> float:
    """Return the work of one cycle, in products on the whole finest grid."""
    # Count on each level the smoothing steps; a residual before each step except the first from a
    # zero guess; one residual for the coarse grid, unless the guess is zero; and the residuals
    # between the cycles of a W-cycle.
    points, cycles = 0.0, 1
    for k, level in enumerate(levels):
        again = cycles - cycles // gamma if k and not level.is_exact else 0
        steps, residuals = pre + post, pre + post
        if level.transfer is None:
            steps = _steps_on_coarsest(level, steps)
            residuals = steps - 1
        work = cycles * steps * work_of(level.smoother)
        work += (cycles * residuals + again) * work_of(level.A)
        points += work * prod(grid_of(level.A))
        cycles *= gamma
    return points / prod(grid_of(levels[0].A))


def _steps_on_coarsest(level: Level, steps: int) -> int:
    return 1 if level.is_exact else steps


def _residual(A: LinearOperator, x: Array, b: Array, r: Array) -> None:
    """Write b - A x to r."""
    apply_to_rows(A, x, r)
    np.subtract(b, r, out=r)
