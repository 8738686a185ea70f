"""The work for a system is in proportion to the unknowns, of whatever class its matrix is."""

import numpy as np
import pytest

import toeplitz_mg as tmg
from comparisons.systems.symbols import COLUMNS, HERMITIAN, INDEFINITE, NONSYMMETRIC, column
from tests.budgets import assert_within_budget
from tests.systems import autoregressive, averaged, of_symbol, random, residual

EPS = 2.0**-52


def of_lags(f, more=()):
    """Return the first column of the matrix, of any size, with these lags, and more at some."""

    def of_size(n):
        c = f(np.arange(float(n)))
        for lag, value in more:
            c[lag] += value
        return c

    return of_size


PROCESSES = {
    "0.99^k": of_lags(lambda k: 0.99**k),
    "(-0.9)^k": of_lags(lambda k: (-0.9) ** k),
    "0.9^k + 0.99^k/2": of_lags(lambda k: 0.9**k + 0.5 * 0.99**k),
    "Matérn 3/2": of_lags(lambda k: (1.0 + k / 30.0) * np.exp(-k / 30.0)),
    "Matérn 5/2": of_lags(lambda k: (1.0 + k / 6.0 + (k / 6.0) ** 2 / 3.0) * np.exp(-k / 6.0)),
    "damped cosine": of_lags(lambda k: 0.995**k * np.cos(0.3 * k), [(0, 0.1)]),
    "autoregressive, order 2": autoregressive(0.5, -0.7),
    "autoregressive, order 3": autoregressive(0.8, 0.3 + 0.4j, 0.3 - 0.4j),
    "moving average, order 2": averaged(2),
    "moving average, order 60": averaged(60),
    "a lag alone": of_lags(lambda k: 0.5**k, [(365, 0.05)]),
    "two lags alone": of_lags(lambda k: 0.5**k, [(12, 0.1), (13, 0.05)]),
    "every second lag": of_lags(lambda k: np.exp(-k / 1000.0) * (k % 2 == 0)),
}
GAUSSIANS = {
    f"Gaussian, {length} wide, + {nugget}": of_lags(
        lambda k, length=length: np.exp(-((k / length) ** 2)), [(0, nugget)]
    )
    for length, nugget in ((3.0, 1e-6), (3.0, 1e-9), (10.66, 2.6e-8), (40.0, 1e-6))
}
BENT = {  # Symbols that are smooth but at one place inside: poles, zeros, and kinks.
    "log": lambda t, place: 5.0 - np.log(abs(np.cos(t) - np.cos(place)) + 1e-12),
    "power": lambda t, place: (abs(np.cos(t) - np.cos(place)) + 1e-12) ** -0.4,
    "root": lambda t, place: abs(t - place) ** 0.5,
    "kink": lambda t, place: 0.05 + abs(t - place),
}
BENT = {
    f"{name} at {place}": of_symbol(lambda t, f=f, place=place: f(t, place))
    for name, f in BENT.items()
    for place in (0.5, 2.5)
}
TOO_ILL = "θ⁴", "(2 - 2 cos θ)²"  # The condition number is above 1e12.


def of_modulated_noise(n):
    """Hermitian and indefinite."""
    return HERMITIAN["fGn, modulated"](n)[0] - 3.0 * np.eye(1, n)[0]


def of_complex_diagonal(n):
    """A + 2i I, for a Hermitian A: its numerical range is far from zero."""
    lags = np.exp(0.3j * np.arange(n)) / (1.0 + np.arange(n)) ** 2
    return lags + 2.0j * np.eye(1, n)[0], lags.conj()


KINDS = {
    "definite matrices": {k: c for k, c in COLUMNS.items() if k not in TOO_ILL} | BENT,
    "Gaussian covariances": GAUSSIANS,
    "covariances of processes": PROCESSES,
    "indefinite matrices": INDEFINITE | {"fGn, modulated - 3": of_modulated_noise},
    "nonsymmetric matrices": NONSYMMETRIC | {"complex diagonal": of_complex_diagonal},
    "Hermitian matrices": HERMITIAN,
}
ALL = [(kind, name) for kind, systems in KINDS.items() for name in systems]
HARD = "wide Gaussian", "sinc", "1/(1 + k²/100)", "nonuniform Fourier"
VERY_LONG = "|θ|", "2 - 2 cos θ", "contact", "contact - 0.3", "0.99^k", "Matérn 5/2", "a lag alone"


@pytest.mark.filterwarnings("ignore:.*ill-conditioned")
@pytest.mark.parametrize(("kind", "name"), ALL)
def test_the_work_is_in_proportion_to_the_unknowns(kind, name):
    case = f"{name if name in HARD else kind}, rtol = 1e-8"
    units = []
    for n in (2048, 4099, 2**15, 2**17):
        if (n == 2**17 and name not in VERY_LONG) or (n > 10**4 and name == "|θ|³"):
            continue
        matrix, b = KINDS[kind][name](n), random(n)
        if kind == "Hermitian matrices":
            b = b + 1j * b[::-1]
        with tmg.count_products() as work:
            x, info = tmg.solve_toeplitz(matrix, b, rtol=1e-8, full_output=True)
        units.append(work.units(n))
        assert_within_budget(case, iterations=info.iterations, work_units=units[-1])
        lags = np.abs(np.concatenate(matrix) if isinstance(matrix, tuple) else matrix)
        unreachable = 20 * EPS * lags.sum() * np.linalg.norm(x) / np.linalg.norm(b)
        assert residual(matrix, x, b) <= 1.01e-8 + unreachable
    assert units[-1] <= 1.5 * max(units[:-1]) + 3.0


@pytest.mark.parametrize("n", [4096, 4099])
@pytest.mark.parametrize("name", ["0.9^k", "exp(-k/1000)", "contact", "fGn, H = 0.9"])
def test_the_choice_is_no_more_than_twice_the_work_of_the_best(name, n):
    c, b = column(name, n), np.ones(n)
    A = tmg.ToeplitzOperator(c)
    with tmg.count_products() as work:
        tmg.solve_toeplitz(c, b, rtol=1e-8)
    for preconditioner in (tmg.chan_preconditioner, tmg.cosine_preconditioner):
        with tmg.count_products() as other:
            _, info = tmg.cg(A, b, M=preconditioner(A), rtol=1e-8)
        assert info == 0
        # The choice sees the column alone: it embeds it, and checks the residual.
        assert work.units(n) <= 2 * (other.units(n) + 1.5)


def few_lags(n):
    """Symmetric, and such that GMRES takes many iterations."""
    c = np.zeros(n)
    c[:45] = random(45) * np.exp(-6.0 * np.arange(45) / 45.0)
    c[0] -= 0.5
    return c


@pytest.mark.parametrize(
    ("make", "n", "columns"),
    [
        (COLUMNS["contact"], 3000, 300),
        (few_lags, 4050, 8),
        (HERMITIAN["fGn, modulated"], 2048, 5),
        (of_modulated_noise, 2048, 5),
        (lambda n: tuple(random(2, n)), 2100, 200),
    ],
)
def test_one_of_many_columns_takes_less_work_than_one_alone(make, n, columns):
    units = []
    for k in (1, columns):
        B = random(n, k)
        with tmg.count_products() as work:
            X = tmg.solve_toeplitz(make(n), B)
        units.append(work.units(n) / k)
        assert residual(make(n), X, B) <= 1e-10
    assert units[1] < units[0]


@pytest.mark.parametrize("n", [2100, pytest.param(8300, marks=pytest.mark.slow)])
@pytest.mark.parametrize("factor", [1.0, 1.0 + 1.0j])
def test_coefficients_that_have_no_symbol_are_seen_before_any_iteration(n, factor):
    matrix, b = tuple(factor * random(2, n)), random(n)
    with tmg.count_products() as work:
        x, info = tmg.solve_toeplitz(matrix, b, rtol=1e-6, full_output=True)
    units = work.units(n) / info.iterations
    assert_within_budget("no symbol, a column and a correction", work_units=units)
    assert residual(matrix, x, b) <= 1e-6


@pytest.mark.parametrize("part", ["even", "odd"])
def test_a_right_hand_side_of_one_part_is_solved_as_soon_as_any(part):
    """The other part is rounding, whose scalars would keep CG from converging."""
    r = np.arange(4900.0) / 6.0
    c = (1.0 + r + r * r / 3.0) * np.exp(-r)
    c[0] += 1e-8
    b = random(4900)
    own = b + b[::-1] if part == "even" else b - b[::-1]
    of_both, of_one = (tmg.solve_toeplitz(c, v, full_output=True)[1] for v in (b, own))
    assert of_one.iterations <= of_both.iterations + 1


def with_zeros(n):
    """Regular matrices, for n = 8 k, with a symbol that is zero at one of n samples, or nearly."""
    k = np.arange(n)
    decay, step = np.where(k > 0, 0.9**k, 0.0), (k == 1).astype(float)
    odd = np.where(k % 2 == 1, 1.0 / np.maximum(k, 1), 0.0)
    sample = 0.19 / abs(1.0 - 0.9 * np.exp(2j * np.pi * (n // 7) / n)) ** 2
    shifted = 0.9**k - sample * (k == 0)
    two, waves = np.roll(step, 1), step + np.roll(step, 2)
    return {
        "1 - z": ((k == 0) - step, 0.0 * k),
        "skew-symmetric": (decay, -decay),
        "skew-symmetric, odd 1/k": (odd, -odd),
        "odd 1/k": (odd, odd),
        "central differences": (step, -step),
        "Hermitian, i (z - 1/z)": (1j * step, -1j * step),
        "-2 cos 2θ": (-two, -two),
        "cos θ + cos 3θ": (waves, waves),
        "0.9^|k| less a sample": (shifted, shifted),
    }


@pytest.mark.parametrize("shift", [0.0, 1e-14, 1e-9])
@pytest.mark.parametrize("n", [2056, 6000])
@pytest.mark.parametrize("name", with_zeros(8))
def test_a_symbol_that_is_zero_at_a_sample_is_that_of_a_regular_matrix(name, n, shift):
    c, r = with_zeros(n)[name]
    c = c + shift * np.eye(1, n)[0]
    for b in (np.ones(n), random(n), random(n, 3)):
        x, info = tmg.solve_toeplitz((c, r), b, full_output=True)
        assert_within_budget("a symbol that is zero at a sample", iterations=info.iterations)
        assert residual((c, r), x, b) <= 1e-10


@pytest.mark.parametrize("n", [2048, 5000])
@pytest.mark.parametrize("kind", ["permutation", "random", "symmetric", "chirp"])
def test_a_circulant_is_its_own_inverse_whatever_its_numbers(kind, n):
    k = np.arange(n)
    c = {
        "permutation": 1.0 * (k == n // 3),
        "random": random(n),
        "symmetric": random(n) + np.roll(random(n)[::-1], 1),
        "chirp": np.exp(1j * np.pi * k**2 / n),  # Each eigenvalue has the same size.
    }[kind]
    b = random(n)
    x, info = tmg.solve_toeplitz((c, np.r_[c[0], c[:0:-1]]), b, full_output=True)
    assert info.iterations <= 2
    sizes = np.abs(np.fft.fft(c))
    exact = np.fft.ifft(np.fft.fft(b) / np.fft.fft(c))
    assert np.linalg.norm(x - exact) <= 1e-13 * sizes.max() / sizes.min() * np.linalg.norm(exact)


def test_a_matrix_that_is_nearly_a_circulant_is_solved_where_it_has_no_symbol():
    n = 6000
    c = np.exp(1j * np.pi * np.arange(n) ** 2 / n) * 0.9999 ** np.arange(n)
    matrix = c, np.r_[c[0], 0.9 * c[:0:-1]]
    x, info = tmg.solve_toeplitz(matrix, random(n), full_output=True)
    assert_within_budget("a chirp that decays", iterations=info.iterations)
    assert residual(matrix, x, random(n)) <= 1e-10
