"""One contact problem, and how this package and its peers are called to solve it."""

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from time import process_time
from typing import Any, NamedTuple

import numpy as np

from comparisons.harness.inside import Grid
from comparisons.systems.conditions import clip
from comparisons.theory.pressed import rough_gap
from comparisons.theory.solved import MU, A
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import (
    ContactResult,
    ContactWarning,
    Material,
    friction,
    normal_contact,
    surfaces,
)


@dataclass(frozen=True)
class Problem:
    """A contact on [-1, 1]² with E* = 1; a sphere of radius 1 unless it is rough.

    Attributes
    ----------
    name : str
    N : int
    force : float
    is_rough : bool
    nu : float
    shift : float
        The shift along x, with friction; zero where the bodies are pressed only.
    periodic : bool
        Whether the surfaces repeat along both axes.
    """

    name: str
    N: int
    force: float = 4.0 / 3.0 * A**3
    is_rough: bool = False
    nu: float = 0.0
    shift: float = 0.0
    periodic: bool = False

    @property
    def h(self) -> float:
        """The side of an element."""
        return 2.0 / self.N

    @property
    def material(self) -> Material:
        """Both bodies, of E* = 1."""
        return Material.from_shear(1.0 - self.nu, self.nu)

    @cached_property
    def gap(self) -> Array:
        """The gap between the bodies before they touch."""
        h = self.h
        return (
            rough_gap(self.N)
            if self.is_rough
            else surfaces.sphere((self.N, self.N), (h, h), radius=1.0)
        )

    @property
    def grid(self) -> Grid:
        """The elements."""
        return Grid.of((self.N, self.N), (self.h, self.h), self.material, None, self.periodic)

    @cached_property
    def matrix(self) -> Any:
        """The matrix of the displacements by the tractions."""
        return self.grid.tangential() if self.shift else self.grid.normal()

    def violation(self, q: Array, bound: Array | None) -> float:
        """Return how far tractions, in friction with a bound, violate the conditions of contact."""
        u = (self.matrix @ q.reshape(-1)).reshape(q.shape)
        a0 = self.grid.diagonal(self.matrix)
        if bound is not None:
            slip = u - np.reshape([self.shift, 0.0], (2, 1, 1))
            return float(a0 * np.abs(q - clip(q - slip / a0, bound)).max() / self.shift)
        w = u + self.gap
        approach = float((q * w).sum() / q.sum())
        scale = approach - float(self.gap.min())
        return float(np.abs(np.minimum(w - approach, a0 * q)).max()) / scale


class Answer(NamedTuple):
    """Tractions, and the bound on them in friction, and what they cost."""

    traction: Array
    bound: Array | None
    iterations: int
    products: float
    seconds: float


def ours(problem: Problem, tolerance: float) -> Answer:
    """Solve by this package."""
    element = (problem.h, problem.h)
    arguments: Any = {"material": problem.material, "tolerance": tolerance}
    start = process_time()
    with warnings.catch_warnings():
        # Near full contact the edge of the grid is reached, and pressures are beyond the theory.
        warnings.simplefilter("ignore", ContactWarning)
        pressed = normal_contact(
            problem.gap, element, force=problem.force, periodic=problem.periodic, **arguments
        )
    result: ContactResult = pressed
    bound = None
    if problem.shift:
        bound = MU * pressed.pressure
        start = process_time()
        result = friction(bound, element, shift=(problem.shift, 0.0), **arguments)
    seconds = process_time() - start
    return Answer(result.traction, bound, sum(result.iterations), result.products, seconds)


def aspher(precond: str, problem: Problem, tolerance: float) -> Answer:
    """Solve by the FFT solver of `aspher`, on one grid."""
    import aspher as package

    N = problem.N
    start = process_time()
    backend = "periodic" if problem.periodic else "fft"
    solver = package.ContactSolver(grid_size=N, backend=backend, domain_size=2.0, E_star=1.0)
    result = solver.solve(problem.gap.ravel(), problem.force / 4.0, tol=tolerance, precond=precond)
    seconds = process_time() - start
    p = np.asarray(result.pressure).reshape(N, N)
    return Answer(p, None, result.iterations, result.matvec_count, seconds)


def aspher_nested(problem: Problem, tolerance: float) -> Answer:
    """Solve by the fastest of `aspher`, with the first guess from coarser grids."""
    import aspher as package

    N = problem.N
    options: Any = {"domain_size": 2.0, "E_star": 1.0, "tol": tolerance}
    options["backend"] = "periodic" if problem.periodic else "fft"
    options["coarsest"] = N // 2 ** max(0, int(math.log2(N / 64)))
    start = process_time()
    result = package.solve_nested(N, problem.gap.ravel(), problem.force / 4.0, **options)
    seconds = process_time() - start
    p = np.asarray(result.pressure).reshape(N, N)
    return Answer(p, None, result.iterations, result.matvec_count, seconds)


def aspher_friction(problem: Problem, tolerance: float) -> Answer:
    """Solve friction by `aspher`, which does not say how many products it made."""
    import aspher as package

    N = problem.N
    solver = package.FrictionSolver(
        grid_size=N,
        domain_size=2.0,
        E_star=1.0,
        nu=problem.nu,
        model=package.CoulombFriction(MU),
    )
    solver.set_gap(problem.gap.T)  # Its x is along the rows.
    solver.step(p_bar=problem.force / 4.0, tol_normal=1e-10)
    start = process_time()
    result = solver.step(delta_t=(problem.shift, 0.0), tol_tangential=tolerance)
    seconds = process_time() - start
    if not result.converged:
        raise ArithmeticError(f"{result.status_reason}, in {result.tangential_iters} iterations")
    q = np.stack([np.asarray(field).reshape(N, N).T for field in (result.qx, result.qy)])
    bound = MU * np.asarray(solver.pressure).reshape(N, N).T
    return Answer(q, bound, result.tangential_iters, math.nan, seconds)


def tamaas(problem: Problem, iterations: int) -> Answer:
    """Solve by `tamaas`: Polonsky and Keer's method, plain, two products in an iteration."""
    import tamaas as package

    N = problem.N
    package.set_log_level(package.LogLevel.error)
    package.initialize(1)
    start = process_time()
    model = package.ModelFactory.createModel(package.model_type.basic_2d, [2.0, 2.0], [N, N])
    # These are set before the operator is made, or it is that of another material.
    model.E, model.nu = 1.0, 0.0
    solver = package.PolonskyKeerRey(model, -problem.gap, 1e-16)
    if not problem.periodic:
        package.ModelFactory.registerNonPeriodic(model, "dcfft")
        solver.setIntegralOperator("dcfft")
    solver.max_iter = iterations
    solver.solve(problem.force / 4.0)
    seconds = process_time() - start
    return Answer(np.array(model.traction), None, iterations, 2.0 * iterations, seconds)


def contact_mechanics(problem: Problem, tolerance: float) -> Answer:
    """Solve by `ContactMechanics`: Polonsky and Keer's method."""
    from ContactMechanics import FreeFFTElasticHalfSpace, PeriodicFFTElasticHalfSpace, make_system
    from SurfaceTopography import Topography

    N, periodic = problem.N, problem.periodic
    start = process_time()
    half_space = PeriodicFFTElasticHalfSpace if periodic else FreeFFTElasticHalfSpace
    substrate = half_space((N, N), 1.0, (2.0, 2.0))
    surface = Topography(-problem.gap, (2.0, 2.0), periodic=periodic)
    system = make_system(interaction="hardwall", substrate=substrate, surface=surface)
    # Its tolerance is a length.
    allowed = tolerance * float(np.ptp(problem.gap))
    result = system.minimize_proxy(external_force=problem.force, pentol=allowed)
    seconds = process_time() - start
    p = np.asarray(substrate.force)[:N, :N] / problem.h**2
    return Answer(p, None, result.nit, math.nan, seconds)


# The package that it needs, and the function that calls it.
Method = tuple[str, Callable[..., Answer]]

NORMAL: dict[str, Method] = {
    "toeplitz-mg": ("toeplitz_mg", ours),
    "aspher, |q| by FFT": ("aspher", partial(aspher, "fourier-fft")),
    "aspher, |q| by stencil": ("aspher", partial(aspher, "fourier")),
    "aspher, nested": ("aspher", aspher_nested),
    "tamaas": ("tamaas", tamaas),
    "ContactMechanics": ("ContactMechanics", contact_mechanics),
}
FRICTION: dict[str, Method] = {  # The friction of `tamaas` couples slip with the normal gap.
    "toeplitz-mg": ("toeplitz_mg", ours),
    "aspher, friction": ("aspher", aspher_friction),
}
