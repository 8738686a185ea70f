"""Preconditioners and cycles: what is built is symmetric positive definite."""

import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.random import Generator
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from comparisons.harness.measuring import full_of
from comparisons.reliability.trials import FAILED, REFUSED, RIGHT, Outcome
from comparisons.systems.random_matrices import log_uniform, random_column, random_grid, random_mask
from toeplitz_mg import halfspace

EPS = float(np.finfo(np.float64).eps)
MOST = 256  # Most unknowns: the eigenvalues of the dense matrix are computed.
DOUBT = 1e10  # Condition number from which rounding decides, in double precision.
NEVER_REFUSE = ("spectral_preconditioner", "jacobi_preconditioner", "default_preconditioner")

Build = Callable[[LinearOperator], LinearOperator]


def preconditioner(rng: Generator) -> Outcome:
    """Try any preconditioner of any matrix that it takes: positive definite, or refused."""
    dtype = np.float32 if rng.random() < 0.2 else np.float64
    A = _draw_coupled(rng, dtype) if rng.random() < 0.15 else _draw_matrix(rng, dtype)
    name, build = _choose(rng, A)
    family = f"{name}, {np.dtype(dtype)}"
    eigenvalues = np.linalg.eigvalsh(A.toarray().astype(np.float64))
    full = full_of(A)
    # The rounding of a part of the matrix is that of the whole.
    of_all = np.linalg.eigvalsh(full.toarray().astype(np.float64))
    doubtful = of_all[0] <= of_all[-1] * (1 / DOUBT if dtype == np.float64 else 1e-4)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("error", "the smoother .* multigrid")
            M = build(A)
    except (np.linalg.LinAlgError, UserWarning) as error:
        broken = name in NEVER_REFUSE and not doubtful
        return Outcome(family, FAILED if broken else REFUSED, f"{_name(A)}: {error}")
    matrix = np.asarray(M @ np.eye(A.shape[0], dtype=dtype), dtype=np.float64)
    where = f"{_name(A)}, eigenvalues of A {eigenvalues[0]:.1e} … {eigenvalues[-1]:.1e}"
    if not np.isfinite(matrix).all():
        return Outcome(family, FAILED, f"{where}: not finite")
    size = np.abs(matrix).max()
    lopsided = np.abs(matrix - matrix.T).max() / size
    if lopsided > (1e-4 if dtype == np.float32 else 1e-8):
        return Outcome(family, FAILED, f"{where}: not symmetric by {lopsided:.0e}")
    values = np.linalg.eigvalsh((matrix + matrix.T) / 2.0)
    # Below zero by no more than the rounding of these eigenvalues is positive.
    if values[0] <= -10.0 * EPS * len(values) * values[-1] or values[-1] <= 0.0:
        if eigenvalues[0] <= EPS * len(values) * eigenvalues[-1]:
            return Outcome(family, RIGHT, "A is not positive definite")
        return Outcome(family, FAILED, f"{where}, of M {values[0]:.1e} … {values[-1]:.1e}")
    return Outcome(family, RIGHT)


def _draw_matrix(rng: Generator, dtype: Any) -> tmg.ToeplitzOperator | tmg.MaskedOperator:
    axes = int(rng.choice([1, 1, 2, 2, 3]))
    shape = random_grid(rng, int(log_uniform(rng, 1, MOST)), axes)
    _, c = random_column(rng, shape)
    c = c / np.abs(c).max() if dtype == np.float32 else c
    A = tmg.ToeplitzOperator(c.astype(dtype))
    return tmg.MaskedOperator(A, random_mask(rng, shape)) if rng.random() < 0.4 else A


def _draw_coupled(rng: Generator, dtype: Any) -> tmg.CoupledOperator | tmg.MaskedOperator:
    """Return the matrix of the tangential components of a half-space."""
    n1, n2 = shape = random_grid(rng, int(log_uniform(rng, 1, MOST / 2)), 2)
    element = (1.0, log_uniform(rng, 0.1, 10.0))
    material = halfspace.Material.from_shear(1.0, float(rng.uniform(0.0, 0.5)))
    A = halfspace.influence_matrix("xy", (n1, n2), element, material).astype(dtype)
    return tmg.MaskedOperator(A, random_mask(rng, shape)) if rng.random() < 0.5 else A


def _choose(rng: Generator, A: LinearOperator) -> tuple[str, Build]:
    """Return the name of a preconditioner that takes such a matrix, and what builds it."""
    full = full_of(A)
    builders: list[Build] = [
        *(tmg.fft_preconditioner, tmg.fft_rsm_preconditioner, tmg.chan_preconditioner),
        *(tmg.strang_preconditioner, tmg.cosine_preconditioner, tmg.sine_preconditioner),
        tmg.default_preconditioner,
    ]
    if isinstance(full, tmg.CoupledOperator):
        builders += [tmg.fsai_preconditioner, tmg.componentwise(tmg.multigrid)]
    else:
        axes = sum(n > 1 for n in full.grid_shape)
        if axes <= 2:
            builders.append(tmg.fsai_preconditioner)
        if axes <= 1:
            builders += [tmg.spectral_preconditioner] * 2
        if rng.random() < 0.5:
            return "multigrid", _draw_cycle(rng)
        if rng.random() < 0.1:
            gamma = log_uniform(rng, 1e-25, 1.0)
            return "fft_rsm_preconditioner", partial(tmg.fft_rsm_preconditioner, gamma=gamma)
    build = builders[rng.integers(len(builders))]
    return getattr(build, "__name__", "componentwise(multigrid)"), build


def _draw_cycle(rng: Generator) -> Build:
    steps = int(rng.choice([1, 1, 2]))
    smoothers: list[Build] = [tmg.fft_rsm_preconditioner, tmg.jacobi_preconditioner]
    smoothers += [tmg.cosine_preconditioner, tmg.sine_preconditioner]
    choice = rng.integers(len(smoothers) + 2)
    others = tmg.linear_interpolation, tmg.modulated_interpolation
    interpolations = [tmg.piecewise_constant, tmg.piecewise_constant, *others]
    options: dict[str, Any] = {"pre": steps, "post": steps, "gamma": int(rng.choice([1, 1, 2]))}
    options["coarsest"] = int(rng.choice([1, 4, 16]))
    options["interpolation"] = interpolations[rng.integers(len(interpolations))]
    if choice < len(smoothers):
        options["smoother"] = smoothers[choice]
    return partial(tmg.multigrid, **options)


def _name(A: LinearOperator) -> str:
    return f"{type(A).__name__} {A.grid_shape}, N = {A.shape[0]}"
