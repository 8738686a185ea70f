"""Some fifty jobs as users have them, by public names alone, the same for every revision.

`JOBS` lists them. This file is loaded by its path, beside the package of the revision that is
measured: it imports NumPy, SciPy and the package, and nothing of `comparisons`.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg

import toeplitz_mg as tmg
from toeplitz_mg import contact, halfspace

CONTACT = 3e-6  # The tolerance where contact is solved, by default, to 1e-8.
MOST_NUMBERS = 10_000  # Numbers of an answer that are compared.
STEEL = contact.Material.from_shear(1.0, 0.25)  # In units of its shear modulus.
Run = Callable[[], Any]
Prepare = Callable[[], Run]


class Job(NamedTuple):
    """What is timed: what `prepare` returns, which returns the answer."""

    family: str
    name: str
    prepare: Prepare
    tolerance: float = 1e-8  # Largest difference of two answers, over the largest number in them.
    peer: Prepare | None = None  # The same by SciPy, whose time is then the one to compare with.
    limit: float = 1.3  # Largest ratio of the times of two revisions.
    is_first: bool = False  # Whether the first call in a process is timed, or later ones.


def thin(x: Any) -> Any:
    """Return every so many numbers of an array, so that they are not too many to send."""
    x = np.ravel(x)
    return x[:: -(-x.size // MOST_NUMBERS)]


# Lines ----------------------------------------------------------------------------------------


def after(first: float, f: Callable[[Any], Any], n: int) -> Any:
    """Return a number, and a function at 1, …, n - 1."""
    return np.concatenate([[first], f(np.arange(1.0, n))])


def fractional_noise(n: int) -> Any:
    """Return the covariance of fractional Gaussian noise with a Hurst exponent of 0.9."""
    k = np.arange(2.0, n)
    # The second difference of k^1.8 / 2, without cancellation.
    s, d = 0.5 * np.log1p(-(k**-2)), np.arctanh(1.0 / k)
    far = k**1.8 * (np.expm1(1.8 * s) * np.cosh(1.8 * d) + 2.0 * np.sinh(0.9 * d) ** 2)
    return np.concatenate([[1.0, 2.0**0.8 - 1.0], far])


def fractional_diffusion(n: int) -> Any:
    """Return the column and the row of a fractional derivative of order 1.5, from both sides."""
    c, r = tmg.fractional.grunwald_coefficients(1.5, n)
    left, right = 0.7 * c + 0.3 * r, 0.7 * r + 0.3 * c
    left[0] = right[0] = c[0] + 1e-3
    return left, right


LINES: dict[str, Callable[[int], Any]] = {
    "contact": lambda n: halfspace.line_contact_coefficients(
        n, 1.0, G=1.0, nu=0.28, reference=4.0 * n
    ),
    "fractional noise": fractional_noise,
    "0.9^k": lambda n: 0.9 ** np.arange(n),
    "Matérn": partial(after, 1.0 + 1e-8, lambda k: (1.0 + k / 30.0) * np.exp(-k / 30.0)),
    "Gaussian with a nugget": partial(after, 1.0 + 1e-4, lambda k: np.exp(-((k / 14.0) ** 2))),
    "zero of order 1.5": partial(tmg.fractional.riesz_coefficients, 1.5),
    "zero of order 2": partial(after, np.pi**2 / 3.0, lambda k: 2.0 * (-1.0) ** k / k**2),
    "nonsymmetric": fractional_diffusion,
    "Hermitian": partial(after, 2.0, lambda k: 0.5 * np.exp(0.5j * k) * (1.0 + k) ** -1.5),
    "plane wave in noise": partial(after, 2.0, lambda k: 0.1 * np.exp(0.9j * k)),
    # The Fourier coefficients of |2 sin θ/2| - 0.4.
    "indefinite": lambda n: tmg.fractional.riesz_coefficients(1.0, n) - 0.4 * (np.arange(n) == 0),
}
matern = LINES["Matérn"]


def right_sides(n: int, columns: int) -> Any:
    """Return random right-hand sides."""
    return np.random.default_rng(0).standard_normal((n, columns) if columns > 1 else n)


def solve_line(solver: Callable[..., Any], name: str, n: int, columns: int) -> Run:
    """Prepare a solution by `solve_toeplitz`, ours or SciPy's."""
    c, b = LINES[name](n), right_sides(n, columns)
    return lambda: thin(solver(c, b))


def line(name: str, n: int, columns: int = 1, limit: float = 1.3) -> Job:
    """Return the job of one system; SciPy is its peer where it is small."""
    own, peer = (
        partial(solve_line, solver, name, n, columns)
        for solver in (tmg.solve_toeplitz, scipy.linalg.solve_toeplitz)
    )
    title = f"{name}, n = {n}" + (f", {columns} columns" if columns > 1 else "")
    return Job("lines", title, own, peer=peer if n <= 256 else None, limit=limit)


def batch(systems: int, n: int) -> Run:
    """Prepare frames of linear prediction: autocorrelations of pieces of noise."""
    rng = np.random.default_rng(0)
    power = np.abs(np.fft.rfft(rng.standard_normal((systems, 4 * n)))) ** 2
    c, b = np.fft.irfft(power)[:, :n].copy(), rng.standard_normal((systems, n, 1))
    return lambda: thin(tmg.solve_toeplitz(c, b))


# Grids, inverses, processes -------------------------------------------------------------------


def disc(n: int) -> Any:
    """Return a disc that nearly touches the edges of a square."""
    return np.hypot(*contact.surfaces.centres((n, n), (1.0, 1.0))) < 0.49 * n


def solve_by_cg(
    make: Callable[[], Any], preconditioner: Callable[..., Any] = tmg.default_preconditioner
) -> Run:
    """Prepare a solution by `cg`; the set-up of its preconditioner is timed too."""
    A = make()
    b = right_sides(A.shape[0], 1)
    return lambda: thin(tmg.cg(A, b, M=preconditioner(A), rtol=1e-10)[0])


def on_a_disc(n: int) -> Any:
    """Return the matrix of a round punch."""
    x, y = halfspace.offsets((n, n), (1.0, 1.0))
    c = halfspace.influence_zz(x, y, (1.0, 1.0), G=1.0, nu=0.28)
    return tmg.MaskedOperator(tmg.ToeplitzOperator(c), disc(n))


def covariance(n: int, axes: int, scale: float) -> Any:
    """Return the matrix of an exponential covariance on a square or a cube."""
    r = np.sqrt(sum(k**2 for k in np.indices((n,) * axes)))
    return tmg.ToeplitzOperator(np.exp(-r / scale))


def on_a_random_mask(n: int) -> Any:
    """Return the matrix of a covariance on a grid with 30 % missing."""
    mask = np.random.default_rng(1).random((n, n)) < 0.7
    return tmg.MaskedOperator(covariance(n, 2, 10.0), mask)


def of_two_components(n: int) -> Any:
    """Return the matrix of tangential tractions on a disc."""
    x, y = halfspace.all_offsets((n, n), (1.0, 1.0))
    xx, xy, yy = (
        tmg.ToeplitzOperator.from_lags(influence(x, y, (1.0, 1.0), G=1.0, nu=0.28))
        for influence in (halfspace.influence_xx, halfspace.influence_xy, halfspace.influence_yy)
    )
    return tmg.MaskedOperator(tmg.CoupledOperator([[xx, xy], [xy, yy]]), disc(n))


def paper(n: int) -> Run:
    """Prepare test 1 of the paper by V(0,1) cycles."""
    problem = contact.problems.test1(n)

    def solve() -> Any:
        M = tmg.multigrid(problem.A, pre=0)
        return thin(tmg.richardson(problem.A, problem.b, M=M, rtol=1e-8)[0])

    return solve


def inverse(n: int, columns: int) -> Run:
    """Prepare an inverse, and its product with many right-hand sides."""
    A, B = tmg.ToeplitzOperator(fractional_noise(n)), right_sides(n, columns)
    return lambda: thin(tmg.toeplitz_inverse(A) @ B)


def log_determinant(n: int) -> Run:
    """Prepare a log-determinant."""
    return partial(lambda c: np.array([tmg.toeplitz_logdet(c)]), matern(n))


def likelihood(n: int, gaps: int) -> Run:
    """Prepare a likelihood with its gradient, of a series with so many gaps."""
    y = tmg.ToeplitzNormal(matern(n)).rvs(random_state=0)
    observed = np.full(n, True)
    for k in range(gaps):
        first = (2 * k + 1) * n // (2 * gaps + 1)
        observed[first : first + n // (20 * gaps)] = False

    def evaluate() -> Any:
        value, by_c, _ = tmg.ToeplitzNormal(matern(n)).logpdf_and_grad(y, observed)
        return np.append(value, np.sum(by_c * matern(n)))

    return evaluate


# Contact --------------------------------------------------------------------------------------


def sphere(n: int) -> Any:
    """Return the gap of a sphere of radius 1 on n x n elements of size 2/n."""
    return contact.surfaces.sphere((n, n), (2.0 / n, 2.0 / n), radius=1.0)


def rough(n: int, axes: int = 2) -> Any:
    """Return the gap of a rough surface on elements of size 2/n, or of a profile."""
    element: Any = (2.0 / n,) * axes
    waves = {"longest": 0.5, "shortest": 16.0 / n}
    return contact.surfaces.rough((n,) * axes, element, rms=0.01, seed=1, **waves)


def press(surface: Callable[[int], Any], n: int, **options: Any) -> Run:
    """Prepare the contact of a surface under a force."""
    gap = surface(n)
    element = (2.0 / n,) * gap.ndim
    return lambda: thin(contact.normal_contact(gap, element, material=STEEL, **options).pressure)


def pressed(name: str, *surface: Any, **options: Any) -> Job:
    """Return a job of normal contact."""
    return Job("contact", name, partial(press, *surface, **options), CONTACT)


def press_unlike(n: int) -> Run:
    """Prepare a soft sphere that is pressed on a rigid plane, with friction."""
    gap, h = sphere(n), 2.0 / n
    bodies = contact.Material.from_shear(1.0, 0.2), contact.Material.from_shear(1e5, 0.2)
    options: Any = {"material": bodies, "mu": 0.3, "force": 0.2}

    def solve() -> Any:
        result = contact.frictional_contact(gap, (h, h), **options)
        return np.append(thin(result.normal.pressure), thin(result.tangential.traction))

    return solve


def shift(surface: Callable[[int], Any], n: int, force: float) -> Run:
    """Prepare a shift by half of the force that friction carries."""
    element = (2.0 / n, 2.0 / n)
    pressed = contact.normal_contact(surface(n), element, material=STEEL, force=force)
    half = (0.15 * force, 0.0)
    return lambda: thin(contact.friction(pressed, mu=0.3, force=half).traction)


def hertzian_bound(n: int) -> Any:
    """Return the traction bound of a sphere on n x n elements, and their size."""
    h = 2.0 / n
    r = np.hypot(*contact.surfaces.centres((n, n), (h, h)))
    return 0.1 * np.sqrt(np.maximum(0.0, 1.0 - (r / 0.8) ** 2)), (h, h)


def roll(n: int, *, by_force: bool, before: int) -> Run:
    """Prepare steady rolling, after another case on so many elements a side.

    By creepages with spin, or by a force of 0.36 of the largest.
    """
    g, element = hertzian_bound(n)
    motion: dict[str, Any] = {"longitudinal": 0.02, "lateral": 0.04, "spin": -0.1}
    if by_force:
        most = float(g.sum()) * element[0] * element[1]
        motion = {"force": (0.3 * most, 0.2 * most)}
    other, size = hertzian_bound(before)
    contact.rolling(bound=other, element=size, material=STEEL, longitudinal=0.03)
    return lambda: thin(
        contact.rolling(bound=g, element=element, material=STEEL, **motion).traction
    )


def rolling(n: int, *, by_force: bool = False, is_first: bool = False) -> Job:
    """Return a job of steady rolling."""
    # Nothing is kept of a grid that is not this one; the code is loaded all the same.
    prepare = partial(roll, n, by_force=by_force, before=9 if is_first or n > 25 else n)
    name = f"by {'a force' if by_force else 'creepages'}, {n}²"
    if n <= 25:
        name += f", {'first' if is_first else 'second'} call"
    return Job("rolling", name, prepare, CONTACT, is_first=is_first)


SIZES: dict[str, tuple[int, ...]] = {
    "contact": (100, 512, 2**14, 2**20),
    "fractional noise": (256, 2048, 100_003),
    "Matérn": (1500, 2**15),
    "zero of order 2": (2048, 2**16),
    "nonsymmetric": (1000, 2**15),
    "Hermitian": (2**14, 100_000),
    "plane wave in noise": (200, 2048, 2**13),
}
JOBS = (
    *(line(name, n) for name, sizes in SIZES.items() for n in sizes),
    line("0.9^k", 100, 30),
    line("Gaussian with a nugget", 256, 3),
    line("contact", 1000, 30),
    line("0.9^k", 700, 3),
    line("0.9^k", 2**17),
    line("Gaussian with a nugget", 4096),
    line("zero of order 1.5", 2**13, 3),
    line("indefinite", 600, limit=1.5),
    line("indefinite", 4096, limit=1.5),
    Job("lines", "batch of 1000, n = 16", partial(batch, 1000, 16)),
    Job("cg", "disc, 256²", partial(solve_by_cg, partial(on_a_disc, 256))),
    Job("cg", "random mask, 128²", partial(solve_by_cg, partial(on_a_random_mask, 128))),
    Job("cg", "three axes, 32³", partial(solve_by_cg, partial(covariance, 32, 3, 3.0))),
    Job("cg", "two components, 128²", partial(solve_by_cg, partial(of_two_components, 128))),
    Job("multigrid", "V(0,1), test 1, n = 262144", partial(paper, 2**18), 1e-6),
    Job(
        "multigrid",
        "cg with V(1,1), disc, 128²",
        partial(solve_by_cg, partial(on_a_disc, 128), tmg.multigrid),
    ),
    Job("inverse", "with 30 columns, n = 8192", partial(inverse, 2**13, 30)),
    Job("inverse", "log-determinant, n = 512", partial(log_determinant, 512), 1e-10),
    Job("inverse", "log-determinant, n = 32768", partial(log_determinant, 2**15), 1e-10),
    Job("likelihood", "with one gap, n = 4096", partial(likelihood, 4096, 1)),
    Job("likelihood", "with 5 gaps, n = 2000", partial(likelihood, 2000, 5)),
    pressed("Hertz, 256²", sphere, 256, force=0.2),
    pressed("rough, 2 %, 256²", rough, 256, force=0.0105),
    pressed("rough, 10 %, 256²", rough, 256, force=0.065),
    pressed("rough, 28 %, 256²", rough, 256, force=0.22),
    pressed("periodic, 10 %, 256²", rough, 256, force=0.065, periodic=True),
    pressed("rough profile, n = 4096", partial(rough, axes=1), 4096, force=0.1, reference=4.0),
    Job("contact", "unlike bodies, 48²", partial(press_unlike, 48), 1e-4),
    Job("friction", "sphere, 256²", partial(shift, sphere, 256, 0.2), CONTACT),
    Job("friction", "rough, 10 %, 128²", partial(shift, rough, 128, 0.065), CONTACT),
    *(rolling(n, is_first=is_first) for n in (11, 25) for is_first in (True, False)),
    rolling(11, by_force=True),
    *(rolling(n, by_force=by_force) for n in (64, 256, 512) for by_force in (False, True)),
)
