"""Other packages that solve contact problems on a half-space, as they are meant to be called.

Each is given a punch and a tolerance of its own measure, and returns its tractions, iterations,
products with the influence matrix, and the CPU seconds of set-up, its matrix too, and solve.
They are optional: `aspher` (BSD) and `tamaas` (AGPL) on PyPI.
"""

from collections.abc import Callable
from time import process_time
from typing import Any

import numpy as np

from comparisons.systems.punch import NU, G
from toeplitz_mg._typing import Array

Solution = tuple[Array, int, float, float]

FAR = 1e3  # Gap of the elements that are not to touch.
STICK = 1e12  # Friction bound of the elements that are not to slip.
E_STAR = 2.0 * G / (1.0 - NU)


def aspher(punch: Any, tolerance: float) -> Solution:
    """Solve by its FFT operator and its |q| preconditioner by FFT.

    The coupled seconds are those of making a `FrictionSolver`, and of a whole step of it, which
    also looks at what slips; the step in which it is pressed down is left out.
    """
    import aspher as package

    mask = punch.mask
    N = _square(mask)
    gap = np.where(mask, 0.0, FAR).ravel()
    if punch.kind == "normal":
        start = process_time()
        solver = package.ContactSolver(grid_size=N, backend="fft", domain_size=2.0, E_star=E_STAR)
        result = solver.solve(gap, p_nominal=1.0, tol=tolerance, precond="fourier-fft")
        seconds = process_time() - start
        p = np.asarray(result.pressure).ravel()
        mean = solver.matvec(p).ravel()[mask.ravel()].mean()
        return p[mask.ravel()] / mean, result.iterations, result.matvec_count, seconds
    if punch.kind == "tangential":
        raise NotImplementedError("it has no tangential problem without coupling")
    start = process_time()
    solver = package.FrictionSolver(
        grid_size=N,
        domain_size=2.0,
        E_star=E_STAR,
        nu=NU,
        model=package.TrescaFriction(STICK),
    )
    made = process_time() - start
    solver.set_gap(gap.reshape(N, N).T)  # Its x is along the rows.
    solver.step(p_bar=1.0)
    start = process_time()
    result = solver.step(delta_t=(1.0, 0.0), tol_tangential=tolerance)
    seconds = made + process_time() - start
    fields = (np.asarray(q).reshape(N, N).T[mask] for q in (result.qx, result.qy))
    return np.concatenate(list(fields)), result.tangential_iters, float("nan"), seconds


def tamaas(punch: Any, tolerance: float) -> Solution:
    """Solve the normal problem by Polonsky and Keer's method, which has no preconditioner.

    The error that it stops by is infinite where the face is flat, so that it would never stop. The
    number of iterations is the smallest that gives the residual asked for.
    """
    import tamaas as package

    if punch.kind != "normal":
        raise NotImplementedError("it has no bonded contact")
    mask = punch.mask
    N = _square(mask)
    package.set_log_level(package.LogLevel.error)
    package.initialize(1)
    surface = np.where(mask, 0.0, -FAR)

    def solution(iterations: int) -> tuple[Array, float, float]:
        start = process_time()
        model = package.ModelFactory.createModel(package.model_type.basic_2d, [2.0, 2.0], [N, N])
        # These are set before the operator is made, or it is that of another material.
        model.E, model.nu = E_STAR * (1.0 - NU**2), NU
        package.ModelFactory.registerNonPeriodic(model, "dcfft")
        solver = package.PolonskyKeerRey(model, surface, tolerance)
        solver.setIntegralOperator("dcfft")
        solver.max_iter = iterations
        solver.solve(1.0)
        seconds = process_time() - start
        model.operators["dcfft"](model.traction, model.displacement)
        u = np.asarray(model.displacement)[mask]
        error = np.linalg.norm(u - u.mean()) / np.linalg.norm(u)
        return np.asarray(model.traction)[mask] / u.mean(), float(error), seconds

    few, enough = 0, 8
    while solution(enough)[1] > tolerance:
        few, enough = enough, 2 * enough
    while enough - few > 1:
        middle = (few + enough) // 2
        few, enough = (few, middle) if solution(middle)[1] <= tolerance else (middle, enough)
    x, _, seconds = solution(enough)
    return x, enough, float("nan"), seconds


def _square(mask: Array) -> int:
    if mask.shape[0] != mask.shape[1]:
        raise NotImplementedError("its grids are square")
    return int(mask.shape[0])


PEERS: dict[str, Callable[[Any, float], Solution]] = {"aspher": aspher, "tamaas": tamaas}
