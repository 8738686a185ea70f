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

MOST_NUMBERS = 10_000  # Numbers of an answer that are compared.
STEEL = contact.Material.from_shear(1.0, 0.25)  # In units of its shear modulus.
Run = Callable[[], Any]
Prepare = Callable[[], Run]


class Job(NamedTuple):
    """What is timed.

    Attributes
    ----------
    family, name : str
    prepare : callable
        Without arguments; what it returns is timed, and returns the answer.
    tolerance : float
        The largest difference of two answers, over the largest number in them.
    peer : callable or None
        The same by SciPy, whose time is then the one to compare with.
    limit : float
        The largest ratio of the times of two revisions.
    is_first : bool
        Whether the first call in the process is timed. Of all others one call comes before.
    """

    family: str
    name: str
    prepare: Prepare
    tolerance: float = 1e-8
    peer: Prepare | None = None
    limit: float = 1.3
    is_first: bool = False


def thin(x: Any) -> Any:
    """Return every so many numbers of an array, so that they are not too many to send."""
    x = np.ravel(x)
    return x[:: -(-x.size // MOST_NUMBERS)]


# Lines ----------------------------------------------------------------------------------------


def lags(f: Callable[[Any], Any], n: int, nugget: float = 0.0) -> Any:
    """Return a function at 0, 1, …, with a nugget."""
    c = f(np.arange(n, dtype=float))
    c[0] += nugget
    return c


def contact_kernel(n: int) -> Any:
    """Return the coefficients of n strips that are pressed."""
    return halfspace.line_contact_coefficients(n, 1.0, G=1.0, nu=0.28, reference=4.0 * n)


def fractional_noise(n: int) -> Any:
    """Return the covariance of fractional Gaussian noise with a Hurst exponent of 0.9."""
    k = np.arange(2.0, n)
    # The second difference of k^1.8 / 2, without cancellation.
    s, d = 0.5 * np.log1p(-(k**-2)), np.arctanh(1.0 / k)
    far = k**1.8 * (np.expm1(1.8 * s) * np.cosh(1.8 * d) + 2.0 * np.sinh(0.9 * d) ** 2)
    return np.concatenate([[1.0, 2.0**0.8 - 1.0], far])


def geometric(n: int) -> Any:
    """Return 0.9^k."""
    return lags(lambda k: 0.9**k, n)


def matern(n: int) -> Any:
    """Return a covariance of the Matérn family, of order 3/2."""
    return lags(lambda k: (1.0 + k / 30.0) * np.exp(-k / 30.0), n, nugget=1e-8)


def gaussian(n: int) -> Any:
    """Return a Gaussian with a nugget."""
    return lags(lambda k: np.exp(-((k / 10.0) ** 2) / 2.0), n, nugget=1e-4)


def second_order_zero(n: int) -> Any:
    """Return the Fourier coefficients of θ²."""
    k = np.arange(1.0, n)
    return np.concatenate([[np.pi**2 / 3.0], 2.0 * (-1.0) ** k / k**2])


def fractional_diffusion(n: int) -> Any:
    """Return the column and the row of a fractional derivative of order 1.5, from both sides."""
    c, r = tmg.fractional.grunwald_coefficients(1.5, n)
    left, right = 0.7 * c + 0.3 * r, 0.7 * r + 0.3 * c
    left[0] = right[0] = c[0] + 1e-3
    return left, right


def spectral_peak(n: int) -> Any:
    """Return a Hermitian covariance with a long-range peak at one frequency."""
    k = np.arange(n)
    c = 0.5 * np.exp(0.5j * k) * (1.0 + k) ** -1.5
    c[0] = 2.0
    return c


def plane_wave(n: int) -> Any:
    """Return the covariance of a plane wave in noise."""
    c = 0.1 * np.exp(0.9j * np.arange(n))
    c[0] = 2.0
    return c


def indefinite(n: int) -> Any:
    """Return |2 sin θ/2| - 0.4, which has both signs."""
    c = tmg.fractional.riesz_coefficients(1.0, n)
    c[0] -= 0.4
    return c


def right_sides(n: int, columns: int) -> Any:
    """Return random right-hand sides."""
    return np.random.default_rng(0).standard_normal((n, columns) if columns > 1 else n)


def solve_line(solver: Callable[..., Any], coefficients: Any, n: int, columns: int = 1) -> Run:
    """Prepare a solution by `solve_toeplitz`, ours or SciPy's."""
    c, b = coefficients(n), right_sides(n, columns)
    return lambda: thin(solver(c, b))


def line(title: str, coefficients: Any, n: int, columns: int = 1, **options: Any) -> Job:
    """Return the job of one system; SciPy is its peer where it is small."""
    arguments = coefficients, n, columns
    own = partial(solve_line, tmg.solve_toeplitz, *arguments)
    peer = partial(solve_line, scipy.linalg.solve_toeplitz, *arguments) if n <= 256 else None
    name = f"{title}, n = {n}" + (f", {columns} columns" if columns > 1 else "")
    return Job("lines", name, own, peer=peer, **options)


def batch(systems: int, n: int) -> Run:
    """Prepare frames of linear prediction: autocorrelations of pieces of noise."""
    rng = np.random.default_rng(0)
    power = np.abs(np.fft.rfft(rng.standard_normal((systems, 4 * n)))) ** 2
    c, b = np.fft.irfft(power)[:, :n].copy(), rng.standard_normal((systems, n, 1))
    return lambda: thin(tmg.solve_toeplitz(c, b))


# Grids, inverses, processes -------------------------------------------------------------------


def half_space(n: int) -> Any:
    """Return the influence coefficients of n x n square elements."""
    x, y = halfspace.offsets((n, n), (1.0, 1.0))
    return halfspace.influence_zz(x, y, (1.0, 1.0), G=1.0, nu=0.28)


def disc(n: int) -> Any:
    """Return a disc that nearly touches the edges of a square."""
    return np.hypot(*contact.surfaces.centres((n, n), (1.0, 1.0))) < 0.49 * n


def solve_by_cg(make: Callable[[], Any]) -> Run:
    """Prepare `cg` with the default preconditioner, whose set-up is timed too."""
    A = make()
    b = right_sides(A.shape[0], 1)
    return lambda: thin(tmg.cg(A, b, M=tmg.default_preconditioner(A), rtol=1e-10)[0])


def on_a_disc(n: int) -> Any:
    """Return the matrix of a round punch."""
    return tmg.MaskedOperator(tmg.ToeplitzOperator(half_space(n)), disc(n))


def on_a_random_mask(n: int) -> Any:
    """Return the matrix of a covariance on a grid with 30 % missing."""
    r = np.hypot(*np.indices((n, n)))
    mask = np.random.default_rng(1).random((n, n)) < 0.7
    return tmg.MaskedOperator(tmg.ToeplitzOperator(np.exp(-r / 10.0)), mask)


def on_three_axes(n: int) -> Any:
    """Return the matrix of a covariance on a cube."""
    r = np.sqrt(sum(k**2 for k in np.indices((n, n, n))))
    return tmg.ToeplitzOperator(np.exp(-r / 3.0))


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


def multigrid_in_cg(n: int) -> Run:
    """Prepare a round punch by `cg` with V(1,1) cycles."""
    A = on_a_disc(n)
    b = np.ones(A.shape[0])
    return lambda: thin(tmg.cg(A, b, M=tmg.multigrid(A), rtol=1e-10)[0])


def inverse(n: int, columns: int) -> Run:
    """Prepare an inverse, and its product with many right-hand sides."""
    A, B = tmg.ToeplitzOperator(fractional_noise(n)), right_sides(n, columns)
    return lambda: thin(tmg.toeplitz_inverse(A) @ B)


def log_determinant(c: Any) -> Run:
    """Prepare a log-determinant."""
    return lambda: np.array([tmg.toeplitz_logdet(c)])


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


def press_sphere(n: int) -> Run:
    """Prepare Hertz's contact of a sphere."""
    h = 2.0 / n
    gap = contact.surfaces.sphere((n, n), (h, h), radius=1.0)
    return lambda: thin(contact.normal_contact(gap, (h, h), material=STEEL, force=0.2).pressure)


def rough_surface(n: int) -> Any:
    """Return the gap of a rough surface on n x n elements of size 2/n."""
    h = 2.0 / n
    return contact.surfaces.rough((n, n), (h, h), rms=0.01, longest=0.5, shortest=8 * h, seed=1)


def press_rough(n: int, share: int, periodic: bool = False) -> Run:
    """Prepare rough contact whose interference is that of so many per cent of the elements."""
    gap, h = rough_surface(n), 2.0 / n
    force = {2: 0.0105, 10: 0.065, 28: 0.22}[share]
    options: Any = {"material": STEEL, "force": force, "periodic": periodic}
    return lambda: thin(contact.normal_contact(gap, (h, h), **options).pressure)


def press_profile(n: int) -> Run:
    """Prepare the contact of a rough profile, in plane strain."""
    h = 2.0 / n
    gap = contact.surfaces.rough(n, h, rms=0.01, longest=0.5, shortest=8 * h, seed=1)
    options: Any = {"material": STEEL, "force": 0.1, "reference": 4.0}
    return lambda: thin(contact.normal_contact(gap, h, **options).pressure)


def press_unlike(n: int) -> Run:
    """Prepare a soft sphere that is pressed on a rigid plane, with friction."""
    h = 2.0 / n
    gap = contact.surfaces.sphere((n, n), (h, h), radius=1.0)
    bodies = contact.Material.from_shear(1.0, 0.2), contact.Material.from_shear(1e5, 0.2)
    options: Any = {"material": bodies, "mu": 0.3, "force": 0.2}

    def solve() -> Any:
        result = contact.frictional_contact(gap, (h, h), **options)
        return np.append(thin(result.normal.pressure), thin(result.tangential.traction))

    return solve


def shift(n: int, is_rough: bool) -> Run:
    """Prepare a shift by half of the force that friction carries."""
    h = 2.0 / n
    if is_rough:
        gap, force = rough_surface(n), 0.078
    else:
        gap, force = contact.surfaces.sphere((n, n), (h, h), radius=1.0), 0.2
    pressed = contact.normal_contact(gap, (h, h), material=STEEL, force=force)
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
    contact.rolling(other, size, material=STEEL, longitudinal=0.03)
    return lambda: thin(contact.rolling(g, element, material=STEEL, **motion).traction)


def rolling(n: int, *, by_force: bool = False, is_first: bool = False) -> Job:
    """Return a job of steady rolling."""
    # Nothing is kept of a grid that is not this one; the code is loaded all the same.
    prepare = partial(roll, n, by_force=by_force, before=9 if is_first or n > 25 else n)
    name = f"by {'a force' if by_force else 'creepages'}, {n}²"
    if n <= 25:
        name += f", {'first' if is_first else 'second'} call"
    return Job("rolling", name, prepare, 1e-6, is_first=is_first)


JOBS = (
    line("contact", contact_kernel, 100),
    line("0.9^k", geometric, 100, 30),
    line("fractional noise", fractional_noise, 256),
    line("plane wave in noise", plane_wave, 200),
    line("Gaussian with a nugget", gaussian, 256, 3),
    line("contact", contact_kernel, 512),
    line("contact", contact_kernel, 1000, 30),
    line("contact", contact_kernel, 2**14),
    line("contact", contact_kernel, 2**20),
    line("fractional noise", fractional_noise, 2048),
    line("fractional noise", fractional_noise, 100_003),
    line("Matérn", matern, 1500),
    line("Matérn", matern, 2**15),
    line("0.9^k", geometric, 700, 3),
    line("0.9^k", geometric, 2**17),
    line("Gaussian with a nugget", gaussian, 4096),
    line("zero of order 1.5", partial(tmg.fractional.riesz_coefficients, 1.5), 2**13, 3),
    line("zero of order 2", second_order_zero, 2048),
    line("zero of order 2", second_order_zero, 2**16),
    line("nonsymmetric", fractional_diffusion, 1000),
    line("nonsymmetric", fractional_diffusion, 2**15),
    line("Hermitian", spectral_peak, 2**14),
    line("Hermitian", spectral_peak, 100_000),
    line("plane wave in noise", plane_wave, 2048),
    line("plane wave in noise", plane_wave, 2**13),
    line("indefinite", indefinite, 600, limit=1.5),
    line("indefinite", indefinite, 4096, limit=1.5),
    Job("lines", "batch of 1000, n = 16", partial(batch, 1000, 16)),
    Job("cg", "disc, 256²", partial(solve_by_cg, partial(on_a_disc, 256))),
    Job("cg", "random mask, 128²", partial(solve_by_cg, partial(on_a_random_mask, 128))),
    Job("cg", "three axes, 32³", partial(solve_by_cg, partial(on_three_axes, 32))),
    Job("cg", "two components, 128²", partial(solve_by_cg, partial(of_two_components, 128))),
    Job("multigrid", "V(0,1), test 1, n = 262144", partial(paper, 2**18), 1e-6),
    Job("multigrid", "cg with V(1,1), disc, 128²", partial(multigrid_in_cg, 128)),
    Job("inverse", "with 30 columns, n = 8192", partial(inverse, 2**13, 30)),
    Job("inverse", "log-determinant, n = 512", lambda: log_determinant(matern(512)), 1e-10),
    Job("inverse", "log-determinant, n = 32768", lambda: log_determinant(matern(2**15)), 1e-10),
    Job("likelihood", "with one gap, n = 4096", partial(likelihood, 4096, 1)),
    Job("likelihood", "with 5 gaps, n = 2000", partial(likelihood, 2000, 5)),
    Job("contact", "Hertz, 256²", partial(press_sphere, 256), 1e-6),
    *(
        Job("contact", f"rough, {share} %, 256²", partial(press_rough, 256, share), 1e-6)
        for share in (2, 10, 28)
    ),
    Job("contact", "periodic, 10 %, 256²", partial(press_rough, 256, 10, True), 1e-6),
    Job("contact", "rough profile, n = 4096", partial(press_profile, 4096), 1e-6),
    Job("contact", "unlike bodies, 48²", partial(press_unlike, 48), 1e-4),
    Job("friction", "sphere, 256²", partial(shift, 256, False), 1e-6),
    Job("friction", "rough, 10 %, 128²", partial(shift, 128, True), 1e-6),
    *(rolling(n, is_first=is_first) for n in (11, 25) for is_first in (True, False)),
    rolling(11, by_force=True),
    *(rolling(n, by_force=by_force) for n in (64, 256, 512) for by_force in (False, True)),
)
