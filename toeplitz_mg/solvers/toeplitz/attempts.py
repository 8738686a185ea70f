"""Iterations as methods of `solve_toeplitz`: they are given up where they converge too slowly."""

from collections.abc import Callable, Mapping
from math import inf
from typing import NamedTuple, Protocol

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.solvers.cg import cg_by_recurrence
from toeplitz_mg.solvers.gmres import gmres_by_recurrence


class Patience(NamedTuple):
    """How long an iteration is worth waiting for, before what follows is sooner there.

    That is an exact inverse, or Levinson's recursion.

    Attributes
    ----------
    most : int
        Most iterations.
    expected : dict
        ‖b - A x‖/‖b‖ that is to be reached after so many iterations.
    """

    most: int
    expected: Mapping[int, float]


BRIEF = Patience(16, {10: 1e-2})  # The inverse of a real matrix costs at most twice as much.
PATIENT = Patience(60, {10: 1e-2, 20: 1e-5})  # That of a complex one costs some 30.
# It converges sooner and sooner, and what follows takes n² steps. So many vectors take 240 MiB in
# 2^20 real unknowns.
OF_GMRES = Patience(30, {8: 0.5, 15: 1e-2, 20: 1e-5})
AT_LAST = Patience(100, {})  # What follows takes n³ steps, or there is nothing.
USEFUL = 1e-6  # ‖b - A x‖/‖b‖ at which rounding may have stopped it: the caller corrects that.

Attempt = Callable[[Array], tuple[Array, int]]
Solver = Callable[[Rows, float], tuple[Rows, int]]


class Form(Protocol):
    """A domain in which an iteration takes place."""

    def transform(self, X: Rows, /) -> Rows:
        """Return right-hand sides in that domain."""

    def transform_back(self, Y: Rows, /) -> Rows:
        """Return the solutions that those in that domain stand for."""


class _TooSlow(Exception):
    """An iteration converges too slowly."""


class _Watch:
    """The norms of the residuals of an iteration, and what is expected of them."""

    def __init__(self, patience: Patience) -> None:
        self.residuals: list[float] = []
        self._expected = patience.expected

    def __call__(self, iterate: object) -> None:
        """Look at the iteration after each step."""
        if self.reduction > self._expected.get(self.iterations, inf):
            raise _TooSlow

    @property
    def iterations(self) -> int:
        return max(len(self.residuals) - 1, 0)

    @property
    def reduction(self) -> float:
        """The last residual over the first."""
        return self.residuals[-1] / self.residuals[0] if self.iterations else 0.0

    def failure(self, name: str) -> np.linalg.LinAlgError:
        """Return the error that says how far the iteration has come."""
        return np.linalg.LinAlgError(
            f"{name} has reached {self.reduction:.1e} ‖b‖ in {self.iterations} iterations"
        )


def solve_by_cg(
    A: LinearOperator,
    M: LinearOperator | None,
    B: Rows,
    rtol: float,
    patience: Patience = BRIEF,
) -> tuple[Rows, int]:
    """Solve for each row of B by conjugate gradients, and return the most iterations of all.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where it converges too slowly for any of them.
    """

    def attempt(b: Array) -> tuple[Array, int]:
        watch = _Watch(patience)
        try:
            x, iterations, converged = cg_by_recurrence(
                A,
                b,
                M=M,
                rtol=rtol,
                maxiter=patience.most,
                residuals=watch.residuals,
                callback=watch,
            )
        except _TooSlow:
            raise watch.failure("cg") from None
        if not converged:
            raise watch.failure("cg")
        return x, iterations

    return _solve_rows(attempt, B)


def solve_by_gmres(
    A: LinearOperator,
    M: LinearOperator | None,
    B: Rows,
    rtol: float,
    patience: Patience = OF_GMRES,
) -> tuple[Rows, int]:
    """Solve for each row of B by GMRES, and return the most iterations of all.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where it converges too slowly for any of them.
    """

    def attempt(b: Array) -> tuple[Array, int]:
        watch = _Watch(patience)
        try:
            x, converged = gmres_by_recurrence(
                A,
                b,
                M=M,
                rtol=rtol,
                most=min(patience.most, len(b)),
                residuals=watch.residuals,
                callback=watch,
            )
        except _TooSlow:
            raise watch.failure("gmres") from None
        if not converged and not watch.reduction <= USEFUL:
            raise watch.failure("gmres")
        return x, watch.iterations

    return _solve_rows(attempt, B)


def within(form: Form, solve: Solver) -> Solver:
    """Return the solver for rows as they are, of one for rows in a domain."""

    def solve_within(B: Rows, rtol: float) -> tuple[Rows, int]:
        X, iterations = solve(form.transform(B), rtol)
        return form.transform_back(X), iterations

    return solve_within


def _solve_rows(attempt: Attempt, B: Rows) -> tuple[Rows, int]:
    X = np.empty_like(B)
    most = 0
    for x, b in zip(np.atleast_2d(X), np.atleast_2d(B), strict=True):
        x[:], iterations = attempt(b)
        most = max(most, iterations)
    return X, most
