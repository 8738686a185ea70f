"""solve_toeplitz: what SciPy takes, what SciPy returns, and no wrong answer without an error."""

import warnings
from fractions import Fraction

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from comparisons.systems.symbols import (
    COLUMNS,
    HERMITIAN,
    INDEFINITE,
    NONSYMMETRIC,
    column,
    fourier,
)
from toeplitz_mg.preconditioners.circulant import smooth_eigenvalues
from toeplitz_mg.solvers import machine
from toeplitz_mg.solvers.attempts import BRIEF, OF_GMRES, solve_by_cg, solve_by_gmres
from toeplitz_mg.solvers.choice import ACCEPTED, UNSTABLE, methods
from toeplitz_mg.solvers.cosine_cg import MOST_ITERATIONS
from toeplitz_mg.solvers.cosine_form import is_smooth
from toeplitz_mg.solvers.crossovers import STEPS_OF_CG, levinson_is_fastest
from toeplitz_mg.solvers.refinement import ILL_CONDITIONED, MOST, ROUGH
from toeplitz_mg.solvers.system import PANELS, ToeplitzSystem


def random(*shape):
    """Numbers that depend on the shape alone, and not on which tests a process has run before."""
    return np.random.default_rng([3, *shape]).standard_normal(shape)


KERNEL = 1 / (1.0 + np.arange(3000))
FORMS = {
    "list": ([4.0, 2.0, 1.0], [1.0, 2.0, 3.0]),
    "integers": ([4, 2, 1], [1, 2, 3]),
    "one": ([4.0], [2.0]),
    "float32": (np.float32([4, 2, 1]), np.float32([1, 2, 3])),
    "column": ([4.0, 2.0, 1.0], [[1.0], [2.0], [3.0]]),
    "columns": ([4.0, 2.0, 1.0], random(3, 5)),
    "no columns": ([4.0, 2.0, 1.0], np.zeros((3, 0))),
    "pair": (([4.0, 2.0, 1.0], [9.0, 2.0, 1.0]), [1.0, 2.0, 3.0]),
    "not symmetric": (([4.0, 2.0, 1.0], [9.0, 3.0, 0.5]), [1.0, 2.0, 3.0]),
    "Hermitian": ([4.0, 2.0j, 1.0], [1.0, 2.0, 3.0]),
    "complex": (([4.0j, 2.0, 1.0], [0.0, 1.0j, 0.5]), [1.0, 2.0j, 3.0]),
    "complex b": ([4.0, 2.0, 1.0], [1.0, 2.0j, 3.0]),
    "batch of c": ([[4.0, 2.0, 1.0], [3.0, 1.0, 0.0]], random(3, 5)),
    "batch of b": ([4.0, 2.0, 1.0], random(2, 3, 5)),
    "batch of both": (random(2, 1, 3) + 5 * np.eye(1, 3), random(4, 3, 2)),
    "large": (KERNEL, random(3000)),
    "large, float32": (np.float32(KERNEL), np.float32(random(3000))),
    "large, columns": (KERNEL, random(3000, 3)),
    "large, complex b": (KERNEL, random(3000) + 1j * random(3000)),
    "large, column": (KERNEL, random(3000, 1)),
    "large, not symmetric": ((KERNEL, KERNEL**2), random(3000)),
    "large, Hermitian": (np.where(np.arange(1500) > 0, 1j, 1.0) * KERNEL[:1500], random(1500)),
    "zero": (KERNEL, np.zeros(3000)),
    "a zero column": (KERNEL, random(3000, 3) * [1.0, 0.0, 1.0]),
    "huge and tiny": (1e-250 * KERNEL, 1e-200 * random(3000)),
    "columns huge and tiny": (KERNEL[:40], random(40, 3) * [1e-200, 1.0, 1e200]),
}


def solve_by_scipy(c_or_cr, b):
    """SciPy's answer; before version 1.17, which takes batches, one by one of a batch."""
    solve = scipy.linalg.solve_toeplitz
    is_batch = not isinstance(c_or_cr, tuple) and (np.ndim(c_or_cr) > 1 or np.ndim(b) > 2)
    if is_batch and tuple(map(int, scipy.__version__.split(".")[:2])) < (1, 17):
        return np.vectorize(solve, signature="(n),(n,k)->(n,k)")(c_or_cr, b)
    return solve(c_or_cr, b)


@pytest.mark.parametrize("form", FORMS)
def test_takes_and_returns_what_scipy_does(form):
    c_or_cr, b = FORMS[form]
    expected = solve_by_scipy(c_or_cr, b)
    x = tmg.solve_toeplitz(c_or_cr, b)
    assert x.shape == expected.shape
    assert x.dtype == expected.dtype
    # Each column is as large as it is.
    scale = abs(expected).max(axis=-1 if x.ndim == 1 else -2, keepdims=True, initial=0.0)
    assert (abs(x - expected) <= 1e-9 * scale).all()
    y, info = tmg.solve_toeplitz(c_or_cr, b, True, full_output=True)
    assert_allclose(y, x, rtol=1e-9)
    assert info.residual <= 1e-12


@pytest.mark.parametrize("columns", [1, 2, 3, 40])
@pytest.mark.parametrize("n", [1, 2, 150, 700, 2500])
@pytest.mark.parametrize("name", COLUMNS)
def test_the_backward_error_is_that_of_a_direct_method(name, n, columns):
    c = np.array([2.0, 0.5])[:n] if n < 3 else column(name, n)
    A = scipy.linalg.toeplitz(c)
    b = A @ random(n, columns)
    x, info = tmg.solve_toeplitz(c, b, full_output=True)
    residual = np.linalg.norm(b - A @ x, axis=0)
    scale = np.linalg.norm(A) * np.linalg.norm(x, axis=0)
    size = np.linalg.norm(b, axis=0)
    assert (residual <= np.maximum(1e-13 * scale, 1e-12 * size)).all()  # Here rtol is 1e-12.
    assert info.residual == pytest.approx((residual / size).max(), abs=1e-13)
    assert info.iterations <= MOST_ITERATIONS


# Most iterations to 1e-8 for a random right-hand side, wherever the condition number is < 1e12.
@pytest.mark.parametrize("n", [1200, 2048, 4099, 2**14, 2**16])
@pytest.mark.parametrize("name", COLUMNS)
def test_the_choice_needs_few_iterations(name, n):
    order = {"|θ|³": 3, "θ⁴": 4, "(2 - 2 cos θ)²": 4}.get(name, 0)
    if n**order > 1e12:
        return
    c = column(name, n)
    A = tmg.ToeplitzOperator(c)
    b = random(1, n)
    method = next(methods(ToeplitzSystem(c, c, b)))
    # What CG does not suit, the recursion solves sooner than the inverse if it is short.
    direct = "scipy.linalg.solve_toeplitz" if n**2 <= STEPS_OF_CG else "toeplitz_inverse"
    assert method.name.startswith("cg") or method.name == direct
    with tmg.count_products() as work:
        x, iterations = method.solve(b, 1e-8)
    # Of a Gaussian as wide as the matrix, whose condition number is 10⁹, more: the recursion that
    # it is spared takes 2.5 to 5 times as long.
    assert iterations <= (16 if name == "wide Gaussian" else 12)
    assert work.units(n) <= 40
    unreachable = np.finfo(float).eps * abs(c).sum() * np.linalg.norm(x)
    assert np.linalg.norm(b[0] - A @ x[0]) <= 2e-8 * np.linalg.norm(b) + 20 * unreachable


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("|θ|", "cg in the DCT domain"),
        ("2 - 2 cos θ", "cg, sine_preconditioner"),
        ("contact", "cg, fsai_preconditioner"),
    ],
)
def test_beyond_short_lines_a_zero_of_the_symbol_is_for_the_cosines(name, expected):
    n = 2 * PANELS
    c, b = column(name, n), random(1, n)[0]
    x, info = tmg.solve_toeplitz(c, b, rtol=1e-8, full_output=True)
    assert info.method == expected
    assert np.linalg.norm(b - tmg.ToeplitzOperator(c) @ x) <= 1.1e-8 * np.linalg.norm(b)


@pytest.mark.parametrize("n", [1259, 4096, 4099])
@pytest.mark.parametrize("name", ["0.9^k", "exp(-k/1000)", "contact", "fGn, H = 0.9"])
def test_the_choice_is_no_more_than_twice_the_work_of_the_best(name, n, monkeypatch):
    monkeypatch.setenv(machine.VARIABLE, "1.0")  # So it is not measured among what is counted.
    c = column(name, n)
    A = tmg.ToeplitzOperator(c)
    b = np.ones(n)
    with tmg.count_products() as work:
        _, info = tmg.solve_toeplitz(c, b, rtol=1e-8, full_output=True)
    assert info.residual <= 1e-8
    for preconditioner in (tmg.chan_preconditioner, tmg.cosine_preconditioner):
        with tmg.count_products() as other:
            _, info = tmg.cg(A, b, M=preconditioner(A), rtol=1e-8)
        assert info == 0
        # The choice sees the column alone: it embeds it, and checks the residual.
        assert work.units(n) <= 2 * (other.units(n) + 1.5)


@pytest.mark.parametrize(("c", "b"), [(2.0, 3.0), (2.0, [3.0]), ([2.0], 3.0)])
def test_numbers_alone_are_no_system(c, b):
    with pytest.raises(ValueError, match="need the length of c"):
        tmg.solve_toeplitz(c, b)


def test_the_choice_is_visible():
    def method(c, b):
        # Rounding would decide whether the recurrence of CG gets to 1e-12.
        return tmg.solve_toeplitz(c, b, rtol=1e-8, full_output=True)[1].method

    n = 3000
    b = random(n)
    assert method(column("contact", 100), b[:100]) == "scipy.linalg.solve_toeplitz"
    for name in ("contact", "exp(-k/1000)", "θ²", "2 + 2 cos θ"):
        assert method(column(name, n), b) == "cg in the DCT domain"
    assert method(column("contact", n), random(n, 3)) == "cg in the DCT domain"
    assert method(column("contact", n), random(n, 300)) == "toeplitz_inverse"
    assert method(column("contact", 100), random(100, 300)) == "lu"
    for n_long, expected in (
        (70_000, "cg in the DCT domain"),
        (75_011, "cg, fsai_preconditioner"),  # A prime, and coefficients that decay slowly.
        (PANELS, "cg, fsai_preconditioner"),
    ):
        assert method(column("contact", n_long), random(n_long)) == expected
    for n_long, expected in ((75_011, "cg in the DCT domain"), (PANELS, "gmres, circulant")):
        assert method(0.9 ** np.arange(n_long), random(n_long)) == expected
    with pytest.warns(scipy.linalg.LinAlgWarning):
        assert method(column("θ⁴", n), b) == "cg in the DCT domain"
    assert method((KERNEL, KERNEL**2), b) == "gmres, circulant"
    assert method((KERNEL[:600], KERNEL[:600] ** 2), b[:600]) == "scipy.linalg.solve_toeplitz"
    assert method([0.0, 1.0], [1.0, 2.0]) == "lu"


LAG = np.arange(float(PANELS))
FEW_IN_CORNERS = {  # Each with the order of its process.
    "exponential": (0.99**LAG, 1),
    "alternating": ((-0.9) ** LAG, 1),
    "two exponentials": (0.9**LAG + 0.5 * 0.99**LAG, 2),
    "Matérn 3/2": ((1.0 + LAG / 30.0) * np.exp(-LAG / 30.0), 2),
    "moving average": (np.r_[1.3, 0.4, 0.3, np.zeros(PANELS - 3)], 2),
    "damped cosine": (0.995**LAG * np.cos(0.3 * LAG) + 0.1 * (LAG == 0), 2),
    "Matérn 5/2": ((1.0 + LAG / 9.0 + (LAG / 9.0) ** 2 / 3.0) * np.exp(-LAG / 9.0), 3),
}


@pytest.mark.parametrize("name", FEW_IN_CORNERS)
def test_a_long_process_of_low_order_takes_that_many_iterations_and_one(name):
    c, order = FEW_IN_CORNERS[name]
    b = random(PANELS)
    x, info = tmg.solve_toeplitz(c, b, rtol=1e-7, full_output=True)
    assert info.method == "gmres, circulant"
    assert info.iterations <= order + 1
    assert np.linalg.norm(scipy.linalg.matmul_toeplitz(c, x) - b) <= 1.01e-7 * np.linalg.norm(b)


@pytest.mark.parametrize("lags", [{365: 0.05}, {5000: 0.1}, {12: 0.1, 13: 0.05}])
def test_a_lag_that_stands_alone_makes_a_long_process_one_of_high_order(lags):
    c = 0.5**LAG
    c[list(lags)] += list(lags.values())
    b = random(PANELS)
    x, info = tmg.solve_toeplitz(c, b, rtol=1e-7, full_output=True)
    assert info.method != "gmres, circulant"
    assert np.linalg.norm(scipy.linalg.matmul_toeplitz(c, x) - b) <= 1.01e-7 * np.linalg.norm(b)


@pytest.mark.parametrize("n", [1024, 4096, 4097])
def test_the_even_and_the_odd_part_save_a_quarter_of_the_iterations(n):
    c = column("contact", n) / column("contact", n)[0]
    c[0] -= 0.3
    b = random(n)
    x, info = tmg.solve_toeplitz(c, b, rtol=1e-8, full_output=True)
    assert info.method == "gmres, circulant of both signs"
    assert info.iterations <= 9  # On vectors as they are it takes 11.
    assert np.linalg.norm(scipy.linalg.matmul_toeplitz(c, x) - b) <= 1.01e-8 * np.linalg.norm(b)


def test_several_columns_are_left_to_a_recursion_where_each_would_take_many_iterations():
    lag = np.arange(45)
    c = np.zeros(4050)
    c[:45] = random(45) * np.exp(-6.0 * lag / 45.0)
    c[0] -= 0.5
    for columns, expected in ((1, "gmres"), (8, "trench")):
        _, info = tmg.solve_toeplitz(c, random(4050, columns), full_output=True)
        assert info.method.startswith(expected)


@pytest.mark.parametrize("part", ["even", "odd"])
def test_a_right_hand_side_of_one_part_is_solved_as_soon_as_any(part):
    """The other part is rounding, whose scalars would keep CG from converging."""
    r = np.arange(4900.0) / 6.0
    c = (1.0 + r + r * r / 3.0) * np.exp(-r)
    c[0] += 1e-8
    b = random(4900)
    b = b + b[::-1] if part == "even" else b - b[::-1]
    _, info = tmg.solve_toeplitz(c, b, full_output=True)
    assert info.method == "cg in the DCT domain"
    assert info.iterations <= 4


def test_the_choice_is_for_caches_that_are_cold(monkeypatch):
    """Where both take as long for 512 unknowns alone, the recursion is sooner up to some 580."""
    monkeypatch.setenv("TOEPLITZ_MG_COSINE_OVER_LEVINSON", "1")
    assert levinson_is_fastest(560, 1)
    assert not levinson_is_fastest(640, 1)


@pytest.mark.parametrize("n", [4000, 2**17])
def test_a_symmetric_indefinite_system_is_solved_by_gmres(n):
    c = column("contact", n) * (-1.0) ** np.arange(n)
    c[0] *= 0.75
    b = random(n)
    assert np.linalg.eigvalsh(scipy.linalg.toeplitz(c[:400])).min() < 0
    x, info = tmg.solve_toeplitz(c, b, full_output=True)
    assert info.method == "gmres, circulant of both signs"
    assert np.linalg.norm(tmg.ToeplitzOperator(c) @ x - b) <= 1e-10 * np.linalg.norm(b)


@pytest.mark.parametrize("name", INDEFINITE)
@pytest.mark.parametrize("n", [2048, 3001, 2**15])
def test_shifted_systems_take_few_iterations(name, n):
    c, _ = INDEFINITE[name](n)
    b = random(n)
    x, info = tmg.solve_toeplitz(c, b, rtol=1e-8, full_output=True)
    assert info.method == "gmres, circulant of both signs"
    assert info.iterations <= 15
    assert np.linalg.norm(tmg.ToeplitzOperator(c) @ x - b) <= 1e-8 * np.linalg.norm(b)


def with_zeros(n):
    """Regular matrices, for n = 8 k, with a symbol that is zero at one of n samples, or nearly."""
    k = np.arange(n)
    decay, step = np.where(k > 0, 0.9**k, 0.0), (k == 1).astype(float)
    odd = np.where(k % 2 == 1, 1.0 / np.maximum(k, 1), 0.0)
    shifted = 0.9**k - np.eye(1, n)[0] * smooth_eigenvalues(tmg.ToeplitzOperator(0.9**k))[n // 7]
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
@pytest.mark.parametrize("n", [2056, 6000, 8208])
@pytest.mark.parametrize("name", with_zeros(8))
def test_a_symbol_that_is_zero_at_a_sample_is_that_of_a_regular_matrix(name, n, shift):
    c, r = with_zeros(n)[name]
    c = c + shift * np.eye(1, n)[0]
    r = np.append(c[:1], r[1:])
    for b in (np.ones(n), random(n), random(n, 3)):
        x, info = tmg.solve_toeplitz((c, r), b, full_output=True)
        by_gmres = info.method.startswith("gmres, circulant") or b.ndim > 1
        assert info.method == "substitution" if name == "1 - z" else by_gmres
        assert info.iterations <= 40
        residual = np.linalg.norm(b - scipy.linalg.matmul_toeplitz((c, r), x))
        assert residual <= 1e-10 * np.linalg.norm(b)


@pytest.mark.parametrize("name", NONSYMMETRIC)
@pytest.mark.parametrize("n", [2**12, 10007, 2**16])
def test_systems_that_are_not_symmetric_take_ten_iterations(name, n):
    c, r = NONSYMMETRIC[name](n)
    b = random(n)
    x, info = tmg.solve_toeplitz((c, r), b, rtol=1e-8, full_output=True)
    assert info.method.startswith("gmres")
    assert info.iterations <= 10
    assert np.linalg.norm(tmg.ToeplitzOperator(c, r) @ x - b) <= 1e-8 * np.linalg.norm(b)


@pytest.mark.parametrize("name", HERMITIAN)
@pytest.mark.parametrize("n", [2048, 3001])
def test_hermitian_systems_are_solved_by_cg(name, n):
    c, _ = HERMITIAN[name](n)
    b = random(n) + 1j * random(n)[::-1]
    with tmg.count_products() as work:
        x, info = tmg.solve_toeplitz(c, b, rtol=1e-8, full_output=True)
    assert info.method.startswith("cg")
    # Where the eigenvalues are alike a preconditioner saves none, or few, and there may be more
    # iterations, but the work is not: the inverse takes 42 units.
    of_alike = ("cg", "cg in single precision, circulant")
    assert info.method in of_alike or info.iterations <= 16
    assert work.units(n) <= 36.0
    assert np.linalg.norm(tmg.ToeplitzOperator(c) @ x - b) <= 1e-8 * np.linalg.norm(b)


@pytest.mark.parametrize("sizes", [1e-50, 1.0, 1e50])
def test_cycles_in_single_precision_end_in_double(sizes):
    n = 2048
    c, _ = HERMITIAN["nonuniform Fourier"](n)
    B = (random(n, 2) + 1j * random(n, 2)[::-1]) * [sizes, 0.0]
    X, info = tmg.solve_toeplitz(c, B, full_output=True)
    assert info.method == "cg in single precision, circulant"
    R = tmg.ToeplitzOperator(c) @ X - B
    assert np.linalg.norm(R) <= 1e-12 * np.linalg.norm(B)
    assert not X[:, 1].any()


@pytest.mark.parametrize("n", [60, 300, 3000])
@pytest.mark.parametrize("size", [1e-200, 1.0, 1e200])
def test_a_part_that_is_rounding_counts_by_the_whole(n, size):
    """The imaginary part of what inverse transforms give must not decide how good x is."""
    k = np.arange(n)
    c = np.exp(-((k / 8.0) ** 2)) + 1e-11 * (k == 0)
    A = tmg.ToeplitzOperator(c)
    b = A @ np.ones(n)
    x, info = tmg.solve_toeplitz(c, size * (b + 1e-17j * (-1.0) ** k), full_output=True)
    assert info.residual <= 1e-10
    assert np.linalg.norm(b - A @ x.real / size) <= 1e-10 * np.linalg.norm(b)


@pytest.mark.parametrize("n", [20, 300, 3000])
@pytest.mark.parametrize(("real", "imag"), [(1e-200, 0.0), (0.0, 1e-200), (1e-300, 1e300), (0, 0)])
def test_both_parts_of_a_right_hand_side_may_have_any_size(n, real, imag):
    c = 1.0 / (1.0 + np.arange(n))
    u, v = np.random.default_rng(0).standard_normal((2, n))
    x, info = tmg.solve_toeplitz(c, real * u + 1j * imag * v, full_output=True)
    for part, size, w in ((x.real, real, u), (x.imag, imag, v)):
        alone = tmg.solve_toeplitz(c, size * w)
        assert_allclose(part, alone, rtol=0.0, atol=1e-10 * np.abs(alone).max())
    assert info.residual <= 1e-12


def test_complex_systems_of_many_columns_and_indefinite_ones_are_solved():
    n = 2048
    c, _ = HERMITIAN["fGn, modulated"](n)
    B = random(n, 5) * (1.0 - 2.0j)
    X, info = tmg.solve_toeplitz(c, B, full_output=True)
    assert info.method == "toeplitz_inverse"
    assert np.linalg.norm(tmg.ToeplitzOperator(c) @ X - B) <= 1e-10 * np.linalg.norm(B)
    c = c - 3.0 * np.eye(1, n)[0]
    x, info = tmg.solve_toeplitz(c, B[:, 0], full_output=True)
    assert info.method == "gmres, circulant of both signs"
    assert np.linalg.norm(tmg.ToeplitzOperator(c) @ x - B[:, 0]) <= 1e-10 * np.linalg.norm(B[:, 0])


@pytest.mark.parametrize("columns", [1, 200])
def test_coefficients_that_have_no_symbol_are_seen_before_any_iteration(columns):
    n = 2100
    c, r = random(2, n)
    B = random(n, columns)
    with tmg.count_products() as work:
        X, info = tmg.solve_toeplitz((c, r), B, rtol=1e-6, full_output=True)
    assert info.method == "trench"
    # T. Chan's eigenvalues, the set-ups of A and of its inverse; of each column and solve the
    # product of the inverse and the residual, in transforms of up to twice the length.
    assert work.units(n) <= 4.0 + 4.0 * columns * info.iterations
    assert np.linalg.norm(tmg.ToeplitzOperator(c, r) @ X - B) <= 1e-6 * np.linalg.norm(B)


@pytest.mark.parametrize(
    ("n", "is_symmetric"),
    [(60, False), (60, True), (200, False), (200, True), (300, False), (300, True), (2000, False)],
)
def test_an_answer_without_a_symbol_is_that_of_scipy_unless_a_residual_is_asked_for(
    n, is_symmetric
):
    """Levinson's recursion loses some digits there, and to correct that takes as long again."""
    seen, accepted = 0, ACCEPTED if n <= 256 else UNSTABLE
    for seed in range(4):
        c, r, b = np.random.default_rng([seed, n]).standard_normal((3, n))
        if is_symmetric:
            c[0], r = 0.5 * c[0], c
        recursive = scipy.linalg.solve_toeplitz((c, r), b)
        size = np.abs(c).sum() + np.abs(r[1:]).sum()
        error = np.linalg.norm(b - scipy.linalg.matmul_toeplitz((c, r), recursive))
        error /= size * np.linalg.norm(recursive) + np.linalg.norm(b)
        x, info = tmg.solve_toeplitz((c, r), b, full_output=True)
        assert info.backward_error <= accepted
        rough = ILL_CONDITIONED if n <= 256 else ROUGH
        if error < accepted / 2 and info.residual <= rough / 2:
            assert_allclose(x, recursive, rtol=1e-14)
            assert info.iterations == 1
            seen += 1
        _, info = tmg.solve_toeplitz((c, r), b, rtol=1e-12, full_output=True)
        assert info.residual <= 1e-12
    assert seen


def test_a_recursion_that_loses_digits_is_told_or_corrected():
    """Its backward error is in proportion to ε over the least leading block, here the first."""
    rng, outcomes = np.random.default_rng(3), set()
    for pivot in 10.0 ** -np.arange(3.0, 10.0):
        c, r, b = rng.standard_normal((3, 300))
        c[0] = pivot
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            _, info = tmg.solve_toeplitz((c, r), b, full_output=True)
        assert info.backward_error <= UNSTABLE
        is_doubtful = info.residual > ILL_CONDITIONED
        assert [warning.category for warning in told] == is_doubtful * [scipy.linalg.LinAlgWarning]
        outcomes.add(info.iterations > 1)
    assert outcomes == {False, True}


@pytest.mark.parametrize(("n", "seed"), [(200, 5088), (256, 1899), (1000, 38)])
def test_well_conditioned_random_matrices_are_not_warned_of(n, seed):
    """A small one is corrected where its residual would be; the condition numbers are below 1e5."""
    c, r, b = np.random.default_rng(seed).standard_normal((3, n))
    _, info = tmg.solve_toeplitz((c, r), b, full_output=True)
    assert info.residual <= ILL_CONDITIONED
    assert info.backward_error <= UNSTABLE


@pytest.mark.parametrize("n", [5, 100, 316, 1023])
def test_a_leading_block_that_is_nearly_singular_takes_few_recursions(n):
    for seed in range(3):
        c, r, b = np.random.default_rng(seed).standard_normal((3, n))
        c[0] = 1e-14
        _, info = tmg.solve_toeplitz((c, r), b, full_output=True)
        assert info.iterations <= 1 + MOST
        assert info.backward_error <= ACCEPTED


@pytest.mark.parametrize("n", [300, 1500, 4500])
def test_a_leading_block_that_is_singular_is_no_obstacle(n):
    """Levinson's recursion divides by zero there, and there is no symbol."""
    for c0 in (0.0, 1.0):
        c, r = random(2, n)
        c[0] = c0
        if c0 == 1.0:
            c[1] = r[1] = 1.0
        for row in (r, c, r * 1j):
            check_residual(c, row)


@pytest.mark.parametrize("n", [300, 1500, 4500])
def test_nor_is_every_second_leading_block(n):
    """Of these matrices each is singular that has an odd number of unknowns."""
    k = np.arange(n)
    odd = k % 2 * random(2, n)
    skew = np.cos(k**2) / (1.0 + k)
    skew[0] = 0.0
    for c, r in (odd, (odd[0], odd[0]), (skew, -skew), (1j * skew, -1j * skew)):
        check_residual(c, r)


def check_residual(c, r):
    """The solution for a random vector has the residual that is asked for."""
    b = random(len(c))
    x, info = tmg.solve_toeplitz((c, r), b, rtol=1e-10, full_output=True)
    residual = np.linalg.norm(b - scipy.linalg.matmul_toeplitz((c, r), x)) / np.linalg.norm(b)
    assert max(residual, info.residual) <= 2e-10


@pytest.mark.parametrize("n", [4, 300, 2100, pytest.param(40000, marks=pytest.mark.slow)])
def test_a_singular_system_is_an_error(n):
    for c in (np.zeros(n), np.ones(n), np.exp(-((np.arange(n) / (0.1 * n)) ** 2) / 2)):
        if n == 4 and 0 < c[1] < 1:
            continue  # It is not so singular.
        with pytest.raises(np.linalg.LinAlgError, match="A is singular"):
            tmg.solve_toeplitz(c, random(n))


def test_an_error_says_what_was_tried():
    with pytest.raises(np.linalg.LinAlgError, match=r"A is singular.*; .*lu fails: A is"):
        tmg.solve_toeplitz(([0.0, 0.0], [0.0, 1.0]), [1.0, 1.0])


def test_a_complex_matrix_of_any_size_may_have_an_imaginary_part_of_zero():
    for size in (1e-200, 1e200):
        for turn in (1.0 + 0.0j, 1.0j):
            c, b = size * turn * np.array([3.0, 1.0]), turn * np.array([1.0, 3.0])
            assert_allclose(tmg.solve_toeplitz((c, c), b) * size, [0.0, 1.0], atol=1e-15)


@pytest.mark.parametrize("systems", [1, 100])
@pytest.mark.parametrize("power", [-40, 0, 40])
def test_a_solution_that_is_so_large_that_its_residual_is_rounding_is_none(systems, power):
    """Of the matrix of ones but for rounding ‖A‖ ‖x‖ is over ‖b‖/ε: the residual tells nothing."""
    c = np.ones((systems, 2))
    c[:, 1] -= 2.0**-53
    with pytest.raises(np.linalg.LinAlgError, match="A is singular"):
        tmg.solve_toeplitz(2.0**power * c, np.tile([[1.0], [-1.0]], (systems, 1, 1)))


def test_a_residual_that_is_small_by_chance_is_not_believed():
    """Rounding of A x is larger than its difference to b, as measured in float64: 3e-16 ‖b‖."""
    c, r = [0.7769513306110662, -58526404924396.21, -1.0285366648357602e-12], [0.0] * 3
    r[1:] = -83930371413307.45, 0.0031347323222615238
    b = [-8.15073034368816e-05, -9.456447495685684e-10, -885356591.2550571]
    with pytest.warns(scipy.linalg.LinAlgWarning, match="A is ill-conditioned"):
        x, info = tmg.solve_toeplitz((c, r), b, full_output=True)
    A = [[Fraction(a) for a in row] for row in scipy.linalg.toeplitz(c, r).tolist()]
    exact = [
        float(Fraction(right) - sum(a * Fraction(y) for a, y in zip(row, x.tolist(), strict=True)))
        for row, right in zip(A, b, strict=True)
    ]
    assert 1e-4 <= np.linalg.norm(exact) / np.linalg.norm(b) <= info.residual <= 0.1


def test_an_ill_conditioned_system_is_solved_with_a_warning():
    """Any direct method in float64 leaves a residual of 1e-4 to 1e-2, for θ⁴ and n = 4096."""
    c = column("θ⁴", 4096)
    with pytest.warns(scipy.linalg.LinAlgWarning, match="A is ill-conditioned"):
        _, info = tmg.solve_toeplitz(c, random(4096), full_output=True)
    assert info.residual <= 1e-2
    assert info.backward_error <= 1e-14


def test_refuses_bad_arguments():
    solve = tmg.solve_toeplitz
    for c, b in (
        ([1.0, 0.0], [1.0, 2.0, 3.0]),
        (([1.0, 0.0], [1.0]), [1.0, 2.0]),
        (1.0, [1.0]),
        ([1.0], 1.0),
    ):
        with pytest.raises(ValueError, match=r"shape|dimension|array"):
            solve(c, b)
    for n in (2, 3000):
        for bad in (np.nan, np.inf):
            c, b = np.zeros(n), np.ones(n)
            c[0], c[1] = 1.0, bad
            with pytest.raises(ValueError, match=r"finite|infs or NaNs"):
                solve(c, b)
            with pytest.raises(ValueError, match=r"finite|infs or NaNs"):
                solve(b, c)
    for parts in (([1.0],), ([1.0], [1.0], [1.0])):
        with pytest.raises(ValueError, match=r"c_or_cr is a tuple of [13], but must be \(c, r\)"):
            solve(parts, [1.0])
    with pytest.raises(TypeError, match="b is None, but must be of numbers"):
        solve([1.0], None)
    with pytest.raises(TypeError, match="c has dtype"):
        solve(["a"], [1.0])
    masked = np.ma.masked_array([2.0, 1.0], [False, True])
    for c, b in ((masked, [1.0, 2.0]), (([2.0, 1.0], masked), [1.0, 2.0]), ([2.0, 1.0], masked)):
        with pytest.raises(TypeError, match=r"[crb] is a masked array, but must have a value"):
            solve(c, b)
    for b in ("ab", ["1", "2"]):
        with pytest.raises(TypeError, match=r"b (has dtype|is 'ab')"):
            solve([2.0, 1.0], b)
    with pytest.raises(ValueError, match="batch has shape"):
        solve([1.0], np.zeros((0, 1, 1)))
    for rtol in (0.0, -1.0, 1.0, np.inf, np.nan):
        with pytest.raises(ValueError, match="rtol is"):
            solve([1.0], [1.0], rtol=rtol)


def rational(n, p, q):
    """Symbol |p(z)|²/|q(z)|² with poles and zeros at given radii."""
    theta = 2 * np.pi * np.arange(16 * n) / (16 * n)
    f = np.ones(16 * n)
    for radius, angle in p:
        f *= abs(1 - radius * np.exp(1j * (theta - angle))) ** 2
        f *= abs(1 - radius * np.exp(1j * (theta + angle))) ** 2
    for radius, angle in q:
        f /= abs(1 - radius * np.exp(1j * (theta - angle))) ** 2
        f /= abs(1 - radius * np.exp(1j * (theta + angle))) ** 2
    return np.fft.ifft(f).real[:n]


def fisher_hartwig(n, at_zero, at_pi):
    """Symbol |1 - z|^2α |1 + z|^2β, with zeros or (integrable) poles."""
    return fourier(
        lambda t: (
            np.maximum(2 * np.sin(t / 2), 0.05 / n) ** at_zero
            * np.maximum(2 * np.cos(t / 2), 0.05 / n) ** at_pi
        ),
        n,
    )


def covariance(n, length, power, nugget):
    k = np.arange(n)
    return np.exp(-((k / length) ** power)) + nugget * (k == 0)


radii_and_angles = st.lists(
    st.tuples(st.floats(0.0, 0.98), st.floats(0.0, np.pi)), min_size=0, max_size=3
)
families = st.integers(1, 2000).flatmap(
    lambda n: st.one_of(
        st.builds(rational, st.just(n), radii_and_angles, radii_and_angles),
        st.builds(fisher_hartwig, st.just(n), st.floats(-0.9, 3.0), st.floats(-0.9, 3.0)),
        st.builds(
            covariance,
            st.just(n),
            st.floats(0.1, 500.0),
            st.floats(0.3, 2.0),
            st.floats(0.0, 1.0).map(lambda t: t**8),
        ),
    )
)


@settings(deadline=None, max_examples=100)
@given(families, st.sampled_from([1, 2, 5]), st.booleans(), st.integers(0, 99))
def test_against_cholesky(c, columns, rough, seed):
    """The error is within the condition number, or it is refused, or there is a warning."""
    n = len(c)
    A = scipy.linalg.toeplitz(c)
    try:
        factor = scipy.linalg.cho_factor(A, lower=True)
        reciprocal, _ = scipy.linalg.lapack.dpocon(factor[0], np.linalg.norm(A, 1), uplo="L")
        condition = 1 / max(reciprocal, 1e-300)
    except np.linalg.LinAlgError:
        factor, condition = None, np.inf
    b = np.random.default_rng(seed).standard_normal((n, columns)) if rough else np.ones((n, 1))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
            x = tmg.solve_toeplitz(c, b)
    except np.linalg.LinAlgError:
        assert condition > 1e13
        return
    if condition < 1e13:
        expected = scipy.linalg.cho_solve(factor, b)
        error = np.linalg.norm(x - expected, axis=0) / np.linalg.norm(expected, axis=0)
        residual = np.linalg.norm(b - A @ x, axis=0)
        rounding = np.abs(c).sum() * np.linalg.norm(x, axis=0)
        assert np.all(residual <= 1.1e-12 * np.linalg.norm(b, axis=0) + 1e-14 * rounding)
        # The condition number is an estimate, which may be less than it is.
        assert error.max() <= 5e-12 * condition


def test_a_negative_definite_system_is_as_good_as_its_negative():
    n = 5000
    c, b = column("contact", n), random(n)
    x, info = tmg.solve_toeplitz(-c, b, full_output=True)
    assert info.method == "cg in the DCT domain"
    assert np.array_equal(x, -tmg.solve_toeplitz(c, b))


def test_a_loose_tolerance_is_no_reason_to_warn():
    n = 3000
    b = random(n)
    _, info = tmg.solve_toeplitz(column("contact", n), b, rtol=1e-4, full_output=True)
    assert 1e-8 < info.residual <= 1e-4


def test_the_better_of_two_methods_is_taken():
    """Levinson's recursion loses four digits here, LU none."""
    rng = np.random.default_rng(95)
    c = np.r_[1e-15, np.round(3 * rng.standard_normal(4))]
    r = np.r_[1e-15, np.round(3 * rng.standard_normal(4))]
    b = rng.standard_normal(5)
    _, info = tmg.solve_toeplitz((c, r), b, full_output=True)
    assert info.backward_error <= 1e-15


def test_not_finite_in_not_finite_out():
    for n in (5, 3000):
        for position in (0, 1):
            c_and_b = [column("contact", n), random(n)]
            c_and_b[position][1] = np.nan
            assert np.isnan(tmg.solve_toeplitz(*c_and_b, check_finite=False)).all()
            with pytest.raises(ValueError, match=r"finite|infs or NaNs"):
                tmg.solve_toeplitz(*c_and_b)
        c = np.r_[column("contact", n - 1), np.nan]
        assert np.isnan(tmg.solve_toeplitz(c, np.zeros(n), check_finite=False)).all()


def test_batches_are_their_systems():
    c, b = random(7, 4, 9), random(7, 4, 9, 2)
    c[..., 0] += 20
    X = tmg.solve_toeplitz(c, b)
    for k in np.ndindex(7, 4):
        assert_allclose(X[k], tmg.solve_toeplitz(c[k], b[k]), rtol=1e-14)


# Levinson's recursion loses 9 to 13 digits here, where the second leading block is nearly singular.
HARD = np.array([1e-13, 1.0, 0.5])
RIGHT = np.random.default_rng(1).standard_normal(3)
SIZES = [-300, -200, -165, -150, -139, -60, 0, 60, 139, 150, 165, 200, 300]


@pytest.mark.parametrize("of_b", SIZES)
@pytest.mark.parametrize("of_A", [-290, -200, -165, -100, -20, 0, 20, 100, 165, 200, 290])
def test_an_answer_is_right_whatever_the_sizes_or_there_is_none(of_A, of_b):
    exact = np.linalg.solve(scipy.linalg.toeplitz(HARD), RIGHT)
    c, b = 10.0**of_A * HARD, 10.0**of_b * RIGHT
    if not -305 < of_b - of_A < 305:
        with pytest.raises(np.linalg.LinAlgError, match="must be within the range of float64"):
            tmg.solve_toeplitz(c, b)
        return
    assert_allclose(tmg.solve_toeplitz(c, b) / 10.0 ** (of_b - of_A), exact, rtol=1e-9)
    # All at once, with one of a size whose squares are zero, and one of zeros.
    others = np.stack([b, 0.0 * b, 1e-165 * RIGHT], axis=1)
    if -305 < -165 - of_A < 305:
        x = tmg.solve_toeplitz(c, others)
        assert_allclose(x[:, 0] / 10.0 ** (of_b - of_A), exact, rtol=1e-9)
        assert_allclose(x[:, 2] / 10.0 ** (-165 - of_A), exact, rtol=1e-9)
        assert not x[:, 1].any()


def test_errors_of_columns_in_proportion_do_not_cancel():
    """Their sums with weights may; once the weights were 1, √2, √3, 2, …"""
    exact = np.linalg.solve(scipy.linalg.toeplitz(HARD), RIGHT)
    for factors in (
        [2.0, 0.0, 0.0, -1.0],
        [1.0, -1.0],
        [2.0, -1.0],
        [0.0, 2.0] + 5 * [0.0] + [-1.0],
    ):
        x = tmg.solve_toeplitz(HARD, np.outer(RIGHT, factors))
        assert_allclose(x, np.outer(exact, factors), rtol=1e-9)


@pytest.mark.parametrize("n", [1, 2, 300, 3000])
@pytest.mark.parametrize(("of_c", "of_b"), [(-300, 10), (200, -200), (-160, 160), (300, -10)])
@pytest.mark.parametrize("full_output", [False, True])
def test_a_solution_out_of_range_is_an_error(n, of_c, of_b, full_output):
    c = 10.0**of_c * 0.5 ** np.arange(n)
    b = 10.0**of_b * (1.0 + 0.25 * np.cos(np.arange(n)))  # So that no solution is small by chance.
    for rhs in (b, b[:, None], b * (1.0 + 2.0j), np.stack([b, b])[..., None]):
        with pytest.raises(np.linalg.LinAlgError, match=r"is of size 1e[-+][34]\d\d, but must be"):
            tmg.solve_toeplitz(c, rhs, full_output=full_output)


def test_subnormal_numbers_are_solved_for_where_no_digit_is_lost():
    b = np.array([3.0, -1.0, 2.0]) * 2.0**-1060
    assert np.array_equal(tmg.solve_toeplitz([4.0, 0.0, 0.0], b), b / 4.0)
    assert np.array_equal(tmg.solve_toeplitz([0.25, 0.0, 0.0], b), b * 4.0)
    with pytest.raises(np.linalg.LinAlgError, match="must be within the range of float64"):
        tmg.solve_toeplitz([3.0, 1.0, 0.0], b)
    # What is lost of a small part of a number is no part of its digits.
    z = np.array([1.0 + 1e-320j, 2.0, 3.0])
    assert_allclose(tmg.solve_toeplitz([3.0, 1.0, 0.0], z).real, [5 / 21, 2 / 7, 19 / 21])
    # Nor is a small entry beside a large one.
    x = tmg.solve_toeplitz([3.0, 0.0, 0.0], [3.0, 1e-320, 0.0])
    assert_allclose(x, [1.0, 0.0, 0.0], atol=1e-300)


@pytest.mark.parametrize("columns", [1, 2, 3, 8, 64, 1000])
@pytest.mark.parametrize("ratio", [0.2, 1.0, 5.0])
def test_the_choice_has_one_crossover(columns, ratio, monkeypatch):
    """Up to some n Levinson's recursion, with n² operations a column, is faster; then never."""
    monkeypatch.setenv(machine.VARIABLE, str(ratio))
    # Lengths with slow transforms have a crossover of their own.
    for smooth in (True, False):
        sizes = [n for n in range(1, 4000) if is_smooth(n) is smooth]
        faster = [levinson_is_fastest(n, columns) for n in sizes]
        assert faster == sorted(faster, reverse=True)
        assert not faster[-1]


@pytest.mark.parametrize("c", [tmg.ToeplitzOperator([2.0, 1.0]), scipy.sparse.eye_array(2)])
def test_a_matrix_is_no_column(c):
    with pytest.raises(TypeError, match="but must be an array: of a ToeplitzOperator"):
        tmg.solve_toeplitz(c, np.ones(2))


# Circulants -------------------------------------------------------------------------------------


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
    r = np.r_[c[0], c[:0:-1]]
    b = random(n)
    x, info = tmg.solve_toeplitz((c, r), b, full_output=True)
    assert info.method == "gmres, T. Chan's circulant"
    assert info.iterations <= 2
    x_exact = np.fft.ifft(np.fft.fft(b) / np.fft.fft(c))
    sizes = np.abs(np.fft.fft(c))
    condition = sizes.max() / sizes.min()
    assert np.linalg.norm(x - x_exact) <= 1e-13 * condition * np.linalg.norm(x_exact)


def test_chan_is_tried_where_there_is_no_other_way():
    n = 6000
    k = np.arange(n)
    c = np.exp(1j * np.pi * k**2 / n) * 0.9999**k
    r = np.r_[c[0], 0.9 * c[:0:-1]]
    x = tmg.solve_toeplitz((c, r), random(n))
    residual = scipy.linalg.matmul_toeplitz((c, r), x) - random(n)
    assert np.linalg.norm(residual) <= 1e-10 * np.linalg.norm(random(n))


# What is told -----------------------------------------------------------------------------------


def test_iterations_of_gmres_are_told():
    n = 2048
    c, r = 1.0 / (1.0 + np.arange(n)), 1.0 / (1.0 + np.arange(n)) ** 2
    _, info = tmg.solve_toeplitz((c, r), np.ones(n), rtol=1e-8, full_output=True)
    assert info.method == "gmres, circulant"
    assert info.iterations >= 2


@pytest.mark.parametrize(
    ("solve", "name", "patience"),
    [(solve_by_cg, "cg", BRIEF), (solve_by_gmres, "gmres", OF_GMRES)],
)
def test_an_iteration_that_converges_too_slowly_is_given_up_and_says_when(solve, name, patience):
    n = 2000
    A = tmg.ToeplitzOperator([2.0, -1.0] + (n - 2) * [0.0])
    one = tmg.ToeplitzOperator(np.eye(1, n)[0])
    b = np.random.default_rng(0).standard_normal(n)
    with pytest.raises(np.linalg.LinAlgError, match=rf"{name} has reached \d.* in \d+ it") as error:
        solve(A, one, b, 1e-10)
    assert int(str(error.value).split()[-2]) in patience.expected


def test_an_error_tells_of_the_methods_only_where_some_are_for_fewer_unknowns():
    for n, is_told in ((4, False), (5000, True)):
        with pytest.raises(np.linalg.LinAlgError, match="A is singular") as error:
            tmg.solve_toeplitz(np.ones(n), np.arange(float(n)))
        assert ("none of the methods for more than 4096 unknowns" in str(error.value)) is is_told


@pytest.mark.parametrize("n", [5, 300, 3001])
@pytest.mark.parametrize("kind", [float, complex])
def test_the_first_number_of_the_row_is_ignored(n, kind):
    """Whatever it is, where nobody looks whether numbers are finite."""
    c, r = 0.5 ** np.arange(n).astype(kind), 0.3 ** np.arange(n).astype(kind)
    wanted = tmg.solve_toeplitz((c, r), np.ones(n))
    r[0] = np.nan
    found = tmg.solve_toeplitz((c, r), np.ones(n), check_finite=False)
    np.testing.assert_allclose(found, wanted, rtol=1e-10)


@pytest.mark.parametrize("n", [1, 2, 30, 256, 257, 600])
def test_both_parts_of_a_right_hand_side_are_those_alone(n):
    """A real matrix is one of complex numbers too; small ones are solved as such."""
    rng = np.random.default_rng(0)
    symmetric = 0.5 ** np.arange(n)
    b = rng.standard_normal(n) + 1e-9j * rng.standard_normal(n)
    c, r = rng.standard_normal((2, n))
    c[0] = r[0] = 2.0 * (np.abs(c).sum() + np.abs(r).sum())
    for matrix in (symmetric, (c, r)):
        x = tmg.solve_toeplitz(matrix, b)
        assert x.dtype == np.complex128
        assert_allclose(x.real, tmg.solve_toeplitz(matrix, b.real), rtol=1e-9)
        assert_allclose(x.imag, tmg.solve_toeplitz(matrix, b.imag), rtol=1e-9)
        assert np.array_equal(tmg.solve_toeplitz(matrix, b[:, np.newaxis])[:, 0], x)
