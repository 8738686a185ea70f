"""The same contact problem by this package, `aspher` and `tamaas`, equally accurate.

Each is asked for the loosest tolerance, in half decades, whose answer violates the conditions of
contact by no more than the target, measured with one matrix for all: by the natural residual
a₀ |p - max(0, p - w/a₀)|, of the gap w under load, the largest over the largest interference, and
likewise in friction, with Coulomb's bound, over the shift. (`tamaas` gets the fewest iterations.)
Times are CPU seconds of set-up and solution, in processes of their own with one thread.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from importlib.util import find_spec
from statistics import median
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from comparisons.measuring import in_a_fresh_process
from comparisons.report import Row
from toeplitz_mg.contact import friction, normal_contact, surfaces
from toeplitz_mg.contact.coulomb import bounded
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.stick_slip import diagonal
from toeplitz_mg.operators import apply_to_rows

Array = NDArray[Any]

TARGET = 1e-8  # violation of the conditions
SECONDS = 300.0  # after which a method is given up
REPEATED = 3  # times, of which the median counts
A, C, MU = 0.6, 0.4, 0.3


def rough_gap(N: int) -> Array:
    """A rough surface on [-1, 1]², with wavelengths from 0.5 to 1/32, or to four elements."""
    h = 2.0 / N
    shortest = max(2.0 / 64, 4.0 * h)
    return surfaces.rough((N, N), (h, h), rms=0.01, longest=0.5, shortest=shortest, seed=1)


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
        Along x, with friction; zero where it is pressed only.
    """

    name: str
    N: int
    force: float = 4.0 / 3.0 * A**3
    is_rough: bool = False
    nu: float = 0.0
    shift: float = 0.0

    @property
    def h(self) -> float:
        """The side of an element."""
        return 2.0 / self.N

    @property
    def material(self) -> tuple[float, float]:
        """G and nu."""
        return 1.0 - self.nu, self.nu

    @cached_property
    def gap(self) -> Array:
        """Between the bodies before they touch."""
        h = self.h
        return (
            rough_gap(self.N)
            if self.is_rough
            else surfaces.sphere((self.N, self.N), (h, h), radius=1.0)
        )

    @cached_property
    def matrix(self) -> Any:
        """The displacements by the tractions."""
        grid = Grid.of((self.N, self.N), (self.h, self.h), self.material, None)
        return grid.tangential() if self.shift else grid.normal()

    def violation(self, q: Array, bound: Array | None) -> float:
        """Of the conditions of contact, by tractions and by the bound on them in friction."""
        u = np.asarray(apply_to_rows(self.matrix, q.reshape(-1))).reshape(q.shape)
        a0 = diagonal(self.matrix)
        if bound is not None:
            slip = u - np.reshape([self.shift, 0.0], (2, 1, 1))
            return float(a0 * np.abs(q - bounded(q - slip / a0, bound)).max() / self.shift)
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
    """This package."""
    element = (problem.h, problem.h)
    arguments: Any = {"material": problem.material, "tolerance": tolerance}
    start = process_time()
    pressed = normal_contact(problem.gap, element, force=problem.force, **arguments)
    result, bound = pressed, None
    if problem.shift:
        bound = MU * pressed.traction
        start = process_time()
        result = friction(bound, element, shift=(problem.shift, 0.0), **arguments)
    seconds = process_time() - start
    return Answer(result.traction, bound, sum(result.iterations), result.products, seconds)


def aspher(precond: str, problem: Problem, tolerance: float) -> Answer:
    """Its solver by FFT, of one grid."""
    import aspher as package

    if problem.shift:
        raise NotImplementedError("see the other")
    N = problem.N
    start = process_time()
    solver = package.ContactSolver(grid_size=N, backend="fft", domain_size=2.0, E_star=1.0)
    result = solver.solve(problem.gap.ravel(), problem.force / 4.0, tol=tolerance, precond=precond)
    seconds = process_time() - start
    p = np.asarray(result.pressure).reshape(N, N)
    return Answer(p, None, result.iterations, result.matvec_count, seconds)


def aspher_nested(problem: Problem, tolerance: float) -> Answer:
    """Its fastest, with the first guess from coarser grids."""
    import aspher as package

    if problem.shift:
        return _aspher_friction(problem, tolerance)
    N = problem.N
    coarsest = N // 2 ** max(0, int(math.log2(N / 64)))
    start = process_time()
    result = package.solve_nested(
        N,
        problem.gap.ravel(),
        problem.force / 4.0,
        domain_size=2.0,
        E_star=1.0,
        coarsest=coarsest,
        tol=tolerance,
        backend="fft",
    )
    seconds = process_time() - start
    p = np.asarray(result.pressure).reshape(N, N)
    return Answer(p, None, result.iterations, result.matvec_count, seconds)


def _aspher_friction(problem: Problem, tolerance: float) -> Answer:
    import aspher as package

    N = problem.N
    solver = package.FrictionSolver(
        grid_size=N,
        domain_size=2.0,
        E_star=1.0,
        nu=problem.nu,
        model=package.CoulombFriction(MU),
    )
    solver.set_gap(problem.gap.T)  # its x is along the rows
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
    """Polonsky and Keer's method, which has no preconditioner: two products in an iteration."""
    import tamaas as package

    if problem.shift:
        raise NotImplementedError("its friction couples slip with the normal gap")
    package.set_log_level(package.LogLevel.error)
    package.initialize(1)
    start = process_time()
    N = problem.N
    model = package.ModelFactory.createModel(package.model_type.basic_2d, [2.0, 2.0], [N, N])
    # Before the operator is made, or it is that of another material.
    model.E, model.nu = 1.0, 0.0
    package.ModelFactory.registerNonPeriodic(model, "dcfft")
    solver = package.PolonskyKeerRey(model, -problem.gap, 1e-16)
    solver.setIntegralOperator("dcfft")
    solver.max_iter = iterations
    solver.solve(problem.force / 4.0)
    seconds = process_time() - start
    return Answer(np.array(model.traction), None, iterations, 2.0 * iterations, seconds)


METHODS: dict[str, tuple[str, Callable[..., Answer]]] = {
    "toeplitz-mg": ("toeplitz_mg", ours),
    "aspher, |q| by FFT": ("aspher", partial(aspher, "fourier-fft")),
    "aspher, |q| by stencil": ("aspher", partial(aspher, "fourier")),
    "aspher, nested": ("aspher", aspher_nested),
    "tamaas": ("tamaas", tamaas),
}


def loosest(method: Callable[..., Answer], problem: Problem) -> tuple[float, Answer]:
    """The loosest tolerance, in half decades, that is exact enough."""
    for k in range(8, 27):
        answer = method(problem, 10.0 ** (-k / 2))
        if problem.violation(answer.traction, answer.bound) <= TARGET:
            return 10.0 ** (-k / 2), answer
    raise ArithmeticError("no tolerance is enough")


def fewest(method: Callable[..., Answer], problem: Problem) -> tuple[float, Answer]:
    """The fewest iterations that are exact enough."""

    def exact(iterations: int) -> bool:
        answer = method(problem, iterations)
        return problem.violation(answer.traction, answer.bound) <= TARGET

    few, enough = 0, 16
    while not exact(enough):
        few, enough = enough, 2 * enough
    while enough - few > 1:
        middle = (few + enough) // 2
        few, enough = (few, middle) if exact(middle) else (middle, enough)
    return enough, method(problem, enough)


def measure(name: str, problem: Problem) -> Row:
    """Find what is asked of a method, and measure it; in a process of its own."""
    _, method = METHODS[name]
    asked, answer = (fewest if method is tamaas else loosest)(method, problem)
    argument: Any = int(asked) if method is tamaas else asked
    seconds = [method(problem, argument).seconds for _ in range(REPEATED)]
    reference = ours(problem, 1e-12).traction
    away = np.linalg.norm(answer.traction - reference) / np.linalg.norm(reference)
    return {
        "iterations": answer.iterations,
        "products": answer.products,
        "cpu_s": median(seconds),
        "violation": problem.violation(answer.traction, answer.bound),
        "traction_error": float(away),
        "asked": asked,
        "note": "",
    }


def problems(N: int) -> list[Problem]:
    """What is compared."""
    shifts = {nu: MU * (A**2 - C**2) * (2.0 - nu) / (2.0 * (1.0 - nu)) for nu in (0.0, 0.28)}
    return [
        Problem("Hertz, sphere", N),
        Problem("rough, 2 %", N, 0.0123, is_rough=True),
        Problem("rough, 28 %", N, 0.2, is_rough=True),
        *(
            Problem(f"Cattaneo and Mindlin, ν = {nu:g}", N, nu=nu, shift=shift)
            for nu, shift in shifts.items()
        ),
    ]


def run(*, quick: bool) -> list[Row]:
    """Measure every method that is installed on every problem."""
    installed = [name for name, (package, _) in METHODS.items() if find_spec(package)]
    jobs = [(problem, name) for problem in problems(64 if quick else 256) for name in installed]
    rows: list[Row] = []
    for problem, name in tqdm(jobs, unit="run"):
        row: Row = {"problem": f"{problem.name}, {problem.N}²", "method": name}
        try:
            row |= in_a_fresh_process(partial(measure, name, problem), SECONDS)
        except TimeoutError:
            row |= {"cpu_s": math.nan, "note": f"over {SECONDS:.0f} s"}
        except ArithmeticError as error:
            if "NotImplementedError" in str(error):
                continue
            row |= {"cpu_s": math.nan, "note": str(error)[:80]}
        rows.append(row)
    return rows


def readable(row: Row) -> Row:
    """Return a row as it is printed."""
    formats = {"iterations": "d", "products": ".0f", "cpu_s": ".3f", "violation": ".1e"}
    formats |= {"traction_error": ".1e", "asked": ".1e"}
    cells = {k: format(row[k], spec) if k in row else "" for k, spec in formats.items()}
    return {"method": row["method"], **cells, "note": row["note"]}
