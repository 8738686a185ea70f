"""A contact problem by this package, `aspher`, `tamaas` and `ContactMechanics`, equally accurate.

Each is asked for the loosest tolerance, in half decades, whose answer violates the conditions of
contact by no more than the target, measured with one matrix for all: by the natural residual
a₀ |p - max(0, p - w/a₀)|, of the gap w under load, the largest over the largest interference, and
likewise in friction, with Coulomb's bound, over the shift. (`tamaas` gets the fewest iterations.)
Times are CPU seconds of set-up and solution, in processes of their own with one thread. Packages
that are not installed are left out: ``pip install --group peers``, ``--group compiled-peers``.
"""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from importlib.util import find_spec
from math import nan
from statistics import median
from time import process_time
from typing import Any, NamedTuple

import numpy as np

from comparisons.harness import report
from comparisons.harness.inside import Grid
from comparisons.harness.processes import prepare, row_or_note
from comparisons.harness.report import Row
from comparisons.systems.conditions import coulomb_residual
from comparisons.theory.pressed import rough_gap
from comparisons.theory.solved import MU, A, C
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import (
    ContactResult,
    ContactWarning,
    Material,
    friction,
    normal_contact,
    surfaces,
)

TARGET = 1e-8  # Violation of the conditions of contact that is allowed.
SECONDS = 300.0  # Time after which a method is given up on a problem.
REPEATS = 3  # Solves of which the median time counts.
OURS = "toeplitz-mg"
FORMATS = {"problem": "", "N": "", "method": "", "iterations": "d", "products": ".0f"}
FORMATS |= {"cpu_s": ".3f", "violation": ".1e", "traction_error": ".1e", "asked": ".3g", "note": ""}
REPEATED = "rough, repeated, "  # Problems on surfaces that repeat start with this.


@dataclass(frozen=True)
class Problem:
    """A contact on [-1, 1]² with E* = 1; a sphere of radius 1 unless it is rough."""

    name: str
    N: int
    force: float = 4.0 / 3.0 * A**3
    is_rough: bool = False
    nu: float = 0.0
    shift: float = 0.0  # Along x, with friction; zero where the bodies are pressed only.
    periodic: bool = False  # Whether the surfaces repeat along both axes.

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
        sphere = surfaces.sphere((self.N, self.N), (self.h, self.h), radius=1.0)
        return rough_gap(self.N) if self.is_rough else sphere

    @property
    def grid(self) -> Grid:
        """The elements."""
        return Grid.of((self.N, self.N), (self.h, self.h), self.material, None, self.periodic)

    @cached_property
    def matrix(self) -> Any:
        """The matrix of the displacements by the tractions."""
        if self.shift:
            return self.grid.tangential()
        A, unit = self.grid.scaled_normal()
        return unit * A

    def violation(self, q: Array, bound: Array | None) -> float:
        """Return how far tractions, in friction with a bound, violate the conditions of contact."""
        u = (self.matrix @ q.reshape(-1)).reshape(q.shape)
        a0 = self.grid.diagonal(self.matrix)
        if bound is not None:
            slip = u - np.reshape([self.shift, 0.0], (2, 1, 1))
            return coulomb_residual(q, slip, bound, a0) / self.shift
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
        result = friction(bound=bound, element=element, shift=(problem.shift, 0.0), **arguments)
    seconds = process_time() - start
    return Answer(result.traction, bound, sum(result.iterations), result.products, seconds)


def aspher(problem: Problem, tolerance: float, nested: bool = False) -> Answer:
    """Solve by `aspher`'s FFT solver, on one grid or with the first guess from coarser ones."""
    import aspher as package

    N, start = problem.N, process_time()
    options: Any = {"domain_size": 2.0, "E_star": 1.0}
    options["backend"] = "periodic" if problem.periodic else "fft"
    load: Any = problem.gap.ravel(), problem.force / 4.0
    if nested:
        options |= {"tol": tolerance, "coarsest": N // 2 ** max(0, int(math.log2(N / 64)))}
        result = package.solve_nested(N, *load, **options)
    else:
        solver = package.ContactSolver(grid_size=N, **options)
        result = solver.solve(*load, tol=tolerance, precond="fourier-fft")
    seconds = process_time() - start
    p = np.asarray(result.pressure).reshape(N, N)
    return Answer(p, None, result.iterations, result.matvec_count, seconds)


def aspher_friction(problem: Problem, tolerance: float) -> Answer:
    """Solve friction by `aspher`, which does not say how many products it made."""
    import aspher as package

    N = problem.N
    solver = package.FrictionSolver(
        grid_size=N, domain_size=2.0, E_star=1.0, nu=problem.nu, model=package.CoulombFriction(MU)
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
    "aspher, |q| by FFT": ("aspher", aspher),
    "aspher, nested": ("aspher", partial(aspher, nested=True)),
    "tamaas": ("tamaas", tamaas),
    "ContactMechanics": ("ContactMechanics", contact_mechanics),
}
FRICTION: dict[str, Method] = {  # The friction of `tamaas` couples slip with the normal gap.
    "toeplitz-mg": ("toeplitz_mg", ours),
    "aspher, friction": ("aspher", aspher_friction),
}


def loosest(method: Callable[..., Answer], problem: Problem) -> tuple[float, Answer]:
    """Return the loosest tolerance, in half decades, that is exact enough, and the answer."""
    for k in range(8, 27):
        answer = method(problem, 10.0 ** (-k / 2))
        if problem.violation(answer.traction, answer.bound) <= TARGET:
            return 10.0 ** (-k / 2), answer
    raise ArithmeticError("no tolerance is enough")


def fewest(method: Callable[..., Answer], problem: Problem) -> tuple[float, Answer]:
    """Return the fewest iterations that are exact enough, and the answer."""

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


def measure(method: Callable[..., Answer], problem: Problem) -> Row:
    """Find what is asked of a method, and measure it; in a process of its own."""
    asked, answer = (fewest if method is tamaas else loosest)(method, problem)
    argument: Any = int(asked) if method is tamaas else asked
    seconds = [method(problem, argument).seconds for _ in range(REPEATS)]
    reference = ours(problem, 1e-12).traction
    away = np.linalg.norm(answer.traction - reference) / np.linalg.norm(reference)
    row: Row = {"iterations": answer.iterations, "products": answer.products}
    row |= {"cpu_s": median(seconds), "traction_error": float(away), "asked": asked, "note": ""}
    return row | {"violation": problem.violation(answer.traction, answer.bound)}


def problems(N: int, larger: Sequence[int] = ()) -> list[Problem]:
    """Return the problems that methods are compared on, those that repeat on larger grids too."""
    shifts = {nu: MU * (A**2 - C**2) * (2.0 - nu) / (2.0 * (1.0 - nu)) for nu in (0.0, 0.28)}
    return [
        Problem("Hertz, sphere", N),
        Problem("rough, 2 %", N, 0.0123, is_rough=True),
        Problem("rough, 10 %", N, 0.06, is_rough=True),
        Problem("rough, 28 %", N, 0.2, is_rough=True),
        *(
            Problem(f"rough, nearly full, F = {force:g}", N // 2, force, is_rough=True)
            for force in (0.5, 1.0, 2.0, 4.0)
        ),
        *(
            Problem(f"{REPEATED}{share} %", n, force, is_rough=True, periodic=True)
            for n in (N, *larger)
            for share, force in ((2, 0.0123), (10, 0.06), (31, 0.2), (77, 0.7), (99, 1.6))
        ),
        *(
            Problem(f"Cattaneo and Mindlin, ν = {nu:g}", N, nu=nu, shift=shift)
            for nu, shift in shifts.items()
        ),
    ]


def run(
    table: report.Table,
    chosen: Sequence[Problem],
    normal: Mapping[str, Method] = NORMAL,
    friction: Mapping[str, Method] = FRICTION,
) -> None:
    """Measure every method that is installed on every problem that it is for."""
    for problem in chosen:
        for name, (package, method) in (friction if problem.shift else normal).items():
            if find_spec(package):
                row: Row = {"problem": problem.name, "N": problem.N, "method": name, "cpu_s": nan}
                table.add(row | row_or_note(partial(measure, method, problem), SECONDS))


def arrange_repeated(rows: Sequence[Row]) -> list[Row]:
    """Return the table of CPU times over that of the faster way of `aspher`, where both repeat."""
    table: dict[int, Row] = {}
    for (problem, N), own in report.group(rows, "problem", "N").items():
        seconds = {row["method"]: row["cpu_s"] for row in own if row.get("cpu_s", nan) > 0.0}
        theirs = [s for method, s in seconds.items() if method.startswith("aspher")]
        if problem.startswith(REPEATED) and theirs and OURS in seconds:
            line = table.setdefault(N, {"CPU over aspher's": f"{N}²"})
            line[problem.removeprefix(REPEATED)] = f"{seconds[OURS] / min(theirs):.2f}"
    return list(table.values())


@report.interruptible
def main(
    argv: Sequence[str] | None = None,
    normal: Mapping[str, Method] = NORMAL,
    friction: Mapping[str, Method] = FRICTION,
) -> None:
    """Run the comparison."""
    prepare("comparisons.theory.pressed")
    arguments = report.options(
        "peers", "A contact problem by this package and by others.", argv=argv
    )
    chosen = problems(64) if arguments.quick else problems(256, (512, 1024))
    title, path = f"Each as accurate as {TARGET:g} takes", arguments.output / "peers.csv"
    table = report.Table(title, path, FORMATS, {"problem": 34, "method": 22})
    run(table, chosen, normal, friction)


if __name__ == "__main__":
    main()
