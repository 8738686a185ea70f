"""CG in the domain of the DCT: the product, the block and the inverse are what they say."""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose
from scipy import fft

import toeplitz_mg as tmg
from comparisons.systems.symbols import column
from toeplitz_mg.solvers import cosine_inverse, cosine_low_rank
from toeplitz_mg.solvers.cosine_cg import CosineSolver
from toeplitz_mg.solvers.cosine_form import CosineForm, choose_points, has_ended
from toeplitz_mg.solvers.cosine_inverse import ApproximateInverse, find_peak, group
from toeplitz_mg.solvers.cosine_low_rank import LowRankInverse, has_low_rank

# Lengths that are fast, even and odd, and slow, even and odd.
LENGTHS = [256, 315, 1000, 269, 262, 1021]
NAMES = ["contact", "fGn, H = 0.9", "|θ|", "θ²", "2 + 2 cos θ", "exp(-k/1000)"]


def random(*shape):
    return np.random.default_rng([7, *shape]).standard_normal(shape)


def transform(m):
    return fft.dct(np.eye(m), axis=0, norm="ortho")


@pytest.mark.parametrize("n", LENGTHS)
def test_the_products_are_those_of_the_matrix(n):
    c = random(n)
    form, A, X = CosineForm(c), scipy.linalg.toeplitz(c), random(3, n)
    scale = abs(A).sum(axis=0).max()
    assert_allclose(form.multiply(X), X @ A, atol=1e-13 * scale)
    assert_allclose(form.multiply(X[0]), A @ X[0], atol=1e-13 * scale)
    assert_allclose(form.transform_back(form.transform(X)), X, atol=1e-13)
    Z = form.transform(X)
    Y = np.empty_like(Z)
    form.multiply_transformed(Z, Y)
    assert_allclose(form.transform_back(Y), X @ A, atol=1e-13 * scale)


def transformed(form):
    """C A Cᵀ, of the long matrix where the length is slow."""
    C, lags = transform(form.m), fft.dct(form.samples, 1)[: form.m] / (2 * form.m)
    return C @ scipy.linalg.toeplitz(lags) @ C.T


@pytest.mark.parametrize("n", LENGTHS)
def test_the_entries_are_those_of_the_transformed_matrix(n):
    form = CosineForm(column("contact", n))
    B = transformed(form)
    numbers = np.array([0, 1, 5, 40, n // 3, n // 2 - 1])
    frequencies = 2 * numbers + [[0], [1]]
    found = form.entries(choose_points(form.m, frequencies))
    for entries, own in zip(found, frequencies, strict=True):
        assert_allclose(entries, B[np.ix_(own, own)], atol=1e-12 * abs(B).max())
    # Even and odd frequencies, and so the even and the odd part of a vector, do not mix.
    assert_allclose(B[::2, 1::2], 0.0, atol=1e-12 * abs(B).max())


@pytest.mark.parametrize("m", [256, 315, 4096, 4375])
@pytest.mark.parametrize(("are_alone", "peak"), [(True, 0), (False, 0), (False, 9), (False, 100)])
def test_groups_are_of_all_pairs_or_of_the_lowest(m, are_alone, peak):
    groups = group(m, are_alone, peak)
    k, pairs = len(groups.starts), m // 2
    assert groups.are_alone == are_alone
    assert (groups.widths > 0).all()
    assert (groups.widths[: groups.alone] == 1).all()
    assert np.array_equal(groups.starts[1:], np.cumsum(groups.widths)[:-1])
    assert groups.widths.sum() == (groups.alone if are_alone else pairs)
    if peak:  # The groups on both sides of it are of one pair.
        beside = groups.starts.searchsorted(peak)
        assert (groups.widths[beside - 1 : beside + 1] == 1).all()
    even, odd = groups.points.frequencies
    assert np.array_equal(odd, even + 1)
    assert (groups.starts <= even // 2).all()
    assert (even // 2 < groups.starts + groups.widths).all()
    x, values = random(m), random(2 * k)
    if not are_alone:  # The sum over groups is the transpose of what spreads their values.
        spread = groups.spread(values)
        assert_allclose(groups.sum(x) @ values, x[: 2 * pairs] @ spread, rtol=1e-12)


def of_symbol(f, n):
    """The first column of the matrix whose symbol is this function of θ."""
    return fft.dct(f(np.pi / (8 * n) * np.arange(8 * n + 1)), 1)[:n] / (16 * n)


# Symbols that are smooth but at one place inside: poles, zeros, and kinks.
BENT = {
    "log": lambda theta, place: 5.0 - np.log(abs(np.cos(theta) - np.cos(place)) + 1e-12),
    "power": lambda theta, place: (abs(np.cos(theta) - np.cos(place)) + 1e-12) ** -0.4,
    "root": lambda theta, place: abs(theta - place) ** 0.5,
    "kink": lambda theta, place: 0.05 + abs(theta - place),
}


@pytest.mark.parametrize("n", [4096, 4375, 16384])
@pytest.mark.parametrize("name", BENT)
@pytest.mark.parametrize("place", [0.5, 1.0, 2.5])
def test_where_the_symbol_bends_groups_are_narrow(n, name, place):
    c, b = of_symbol(lambda theta: BENT[name](theta, place), n), random(n)
    form = CosineForm(c)
    assert abs(find_peak(form.samples) - place / np.pi * form.m / 2) <= 2.0
    size = float(2.0 * abs(c).sum())
    x, iterations = CosineSolver(form, size).solve(b, 1e-8)
    assert iterations <= 7
    assert np.linalg.norm(form.multiply(x) - b) <= 1e-7 * np.linalg.norm(b)


@pytest.mark.parametrize("n", [4096, 4375, 65536])
@pytest.mark.parametrize("name", [*NAMES, "|θ|^1.5", "|θ|³", "θ⁴ + 1", "1/(1 + k²/100)"])
def test_a_symbol_that_is_smooth_inside_has_no_peak(n, name):
    # Of a Gaussian the tail is steep enough to be taken for one.
    form = CosineForm(column(name, n))
    assert find_peak(form.samples) == 0


def dense(M, m):
    rows = np.empty((m, m))
    M.apply(np.eye(m), out=rows)
    return rows


@pytest.mark.parametrize("n", LENGTHS)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("long", [0, 10**6])
def test_the_approximate_inverse_is_positive_definite(name, n, long, monkeypatch):
    monkeypatch.setattr(cosine_inverse, "LONG", long)
    form = CosineForm(column(name, n))
    M = dense(ApproximateInverse(form.alternated() if form.has_zero_at_end else form), form.m)
    assert_allclose(M, M.T, rtol=1e-9, atol=1e-12 * abs(M).max())
    assert np.linalg.eigvalsh(M).min() > 0.0


@pytest.mark.parametrize("n", LENGTHS)
def test_of_the_lowest_alone_the_inverse_is_that_of_a_block(n):
    form = CosineForm(column("contact", n))
    M, B = dense(ApproximateInverse(form), form.m), transformed(form)
    lowest = 2 * cosine_inverse.ALONE
    assert_allclose(M[:lowest, :lowest] @ B[:lowest, :lowest], np.eye(lowest), atol=1e-9)
    assert np.count_nonzero(M - np.diag(np.diag(M))) <= lowest**2 / 2


@pytest.mark.parametrize("n", LENGTHS)
@pytest.mark.parametrize("name", ["contact", "|θ|"])
def test_the_groups_have_the_inverse_of_a_diagonal_and_their_couplings(name, n, monkeypatch):
    monkeypatch.setattr(cosine_inverse, "LONG", 0)
    form = CosineForm(column(name, n))
    M = ApproximateInverse(form)
    groups, D = group(form.m, False, find_peak(form.samples)), np.diag(1.0 / M.diagonal)
    end = 2 * (form.m // 2)
    K = np.zeros_like(D)
    for parity, B in enumerate(form.entries(groups.points)):
        own = groups.points.frequencies[parity]
        N = B - np.diag(D[own, own])  # C A Cᵀ - D, at a frequency of each group
        P = np.repeat(np.eye(len(N)), groups.widths, axis=0)
        K[parity:end:2, parity:end:2] = P @ N @ P.T
    assert_allclose(dense(M, form.m) @ (D + K), np.eye(form.m), atol=1e-8)


@pytest.mark.parametrize("n", LENGTHS)
@pytest.mark.parametrize("name", NAMES)
def test_a_system_is_solved_in_few_iterations(name, n):
    c, B = column(name, n), random(2, n)
    A = tmg.ToeplitzOperator(c)
    solver = CosineSolver(CosineForm(c), float(abs(A.lags).sum()))
    X, iterations = solver.solve(B, 1e-8)
    assert iterations <= 8
    assert np.linalg.norm(A.apply(X) - B) <= 1e-7 * np.linalg.norm(B)
    x, of_one = solver.solve(B[0], 1e-8)
    assert of_one <= iterations
    assert_allclose(x, X[0], atol=1e-5 * abs(x).max())


@pytest.mark.parametrize("n", [600, 4096])
@pytest.mark.parametrize("ratio", [0.5, -0.7, 0.9])
def test_of_lags_that_decay_in_proportion_a_few_iterations_are_all(n, ratio):
    # C A Cᵀ differs from the symbol by a matrix of rank two, one of each parity, and so do, of 600
    # unknowns, the couplings to the lowest frequencies.
    c, b = ratio ** np.arange(n), random(n)
    x, iterations = CosineSolver(CosineForm(c), float(2.0 * abs(c).sum())).solve(b, 1e-12)
    assert iterations <= 3
    assert np.linalg.norm(scipy.linalg.toeplitz(c) @ x - b) <= 1e-11 * np.linalg.norm(b)


@pytest.mark.parametrize("name", ["|θ|^1.5", "|θ|³", "θ²", "(2 - 2 cos θ)²", "contact"])
def test_iterations_do_not_grow_where_all_frequencies_are_in_groups(name):
    for n in (4096, 8192, 16384, 32768):
        c, b = column(name, n), random(n)
        size = float(2.0 * abs(c).sum())
        x, iterations = CosineSolver(CosineForm(c), size).solve(b, 1e-12)
        assert iterations <= 7
        residual = np.linalg.norm(tmg.ToeplitzOperator(c).apply(x) - b)
        assert residual <= 1e-11 * np.linalg.norm(b) + 1e-15 * size * np.linalg.norm(x)


def test_lags_that_are_zero_at_the_end_by_chance_have_not_ended():
    c = np.exp(-np.arange(600) / 1000.0)
    assert not has_ended(c)
    c[1::2] = 0.0
    assert c[-1] == 0.0
    assert not has_ended(c)
    c[-2] = 0.0
    assert has_ended(c)


@pytest.mark.parametrize("n", LENGTHS)
@pytest.mark.parametrize("parity", [0, 1])
def test_rows_are_those_of_the_transformed_matrix(n, parity):
    form = CosineForm(column("contact", n))
    frequencies = np.array([0, 2, n // 3 // 2 * 2, (n - 2) // 2 * 2]) + parity
    expected = transformed(form)[frequencies]
    expected[np.arange(4), frequencies] = 0.0
    found = form.rows(frequencies)
    assert_allclose(found, expected[:, parity::2], atol=1e-12 * abs(expected).max())


def autoregressive(roots, n):
    """Covariances of the process whose polynomial has these roots, inside the unit circle."""
    z = np.exp(1j * np.pi / (8 * n) * np.arange(8 * n + 1))
    power = abs(np.prod([z, *(1.0 - root * z for root in roots)], axis=0)) ** -2.0
    return of_symbol(lambda theta: power, n)


def averaged(order, n):
    """Covariances of a moving average of so many more values than one."""
    weights = np.random.default_rng(order).standard_normal(order + 1)
    weights[0] = 2.0 * order + 3.0  # So its roots are far from the circle.
    return np.append(np.correlate(weights, weights, "full")[order:], np.zeros(n - order - 1))


@pytest.mark.parametrize("n", [315, 1000, 4096, 4375])
@pytest.mark.parametrize("roots", [[], [0.5], [0.5, -0.7], [0.8, 0.3 + 0.4j, 0.3 - 0.4j]])
def test_of_an_autoregressive_process_the_rank_is_its_order(n, roots):
    c = autoregressive(roots, n)
    form = CosineForm(c)
    M = LowRankInverse(form)
    assert M.ranks == 2 * (len(roots),)
    if n <= 1000:
        inverse = np.linalg.inv(transformed(form))
        assert_allclose(dense(M, n), inverse, atol=1e-6 * abs(inverse).max())
    assert has_low_rank(form) == (n >= cosine_low_rank.LONG)
    if has_low_rank(form):
        x, iterations = CosineSolver(form, float(2.0 * abs(c).sum())).solve(random(n), 1e-12)
        assert iterations <= 2
        assert np.linalg.norm(form.multiply(x) - random(n)) <= 1e-11 * np.linalg.norm(random(n))


@pytest.mark.parametrize("n", [315, 1000, 4375])
@pytest.mark.parametrize("order", [1, 2, 5])
def test_of_a_moving_average_the_rank_is_its_order_at_most(n, order):
    c = averaged(order, n)
    form = CosineForm(c)
    M = LowRankInverse(form)
    assert max(M.ranks) <= order
    if n <= 1000:
        rows = dense(M, n)
        assert_allclose(rows, rows.T, atol=1e-12 * abs(rows).max())
        assert np.linalg.eigvalsh(rows).min() > 0.0


@pytest.mark.parametrize("name", ["Matérn 3/2", "Gaussian"])
def test_with_few_columns_few_iterations_are_left(name):
    for n in (4096, 4375, 16384, 65536):
        c, B = column(name, n), random(3, n)
        form = CosineForm(c)
        assert max(LowRankInverse(form).ranks) <= cosine_low_rank.MOST
        X, iterations = CosineSolver(form, float(2.0 * abs(c).sum())).solve(B, 1e-8)
        assert iterations <= 4  # With the lowest frequencies alone a Gaussian takes 10.
        assert np.linalg.norm(form.multiply(X) - B) <= 1e-7 * np.linalg.norm(B)


@pytest.mark.parametrize(
    ("length", "nugget"), [(3.0, 1e-6), (3.0, 1e-9), (10.0, 1e-6), (10.66, 2.6e-8), (40.0, 1e-6)]
)
def test_pivots_as_small_as_rounding_leave_it_positive_definite(length, nugget):
    """Of K at the columns chosen the entries alone have lost its inverse (see `_eliminate`)."""
    n = 4096
    c = np.exp(-((np.arange(n) / length) ** 2))
    c[0] += nugget
    form = CosineForm(c)
    M = LowRankInverse(form)
    assert min(M.ranks) >= 5
    b = random(n)
    x, iterations = CosineSolver(form, float(2.0 * abs(c).sum())).solve(b, 1e-8)
    assert iterations <= 4  # With the lowest frequencies alone it takes up to 17.
    rounding = 1e-15 * abs(c).sum() * np.linalg.norm(x)
    assert np.linalg.norm(form.multiply(x) - b) <= 1e-7 * np.linalg.norm(b) + rounding


def test_many_coefficients_have_no_low_rank_and_are_solved_for_all_the_same():
    n = 4096
    c, b = averaged(60, n), random(n)
    form = CosineForm(c)
    assert has_low_rank(form)
    with pytest.raises(np.linalg.LinAlgError, match="low rank"):
        LowRankInverse(form)
    x, _ = CosineSolver(form, float(2.0 * abs(c).sum())).solve(b, 1e-8)
    assert np.linalg.norm(form.multiply(x) - b) <= 1e-7 * np.linalg.norm(b)


def test_a_zero_on_the_grid_leaves_the_block_of_the_lowest_frequencies():
    n = 4096
    zero = np.cos(20.0 * np.pi / n)
    c = np.append([2.0 + 4.0 * zero**2, -4.0 * zero, 1.0], np.zeros(n - 3)) / 2.0
    with pytest.raises(np.linalg.LinAlgError, match="sample"):
        LowRankInverse(CosineForm(c))
    b = scipy.linalg.matmul_toeplitz(c, random(n))
    x, _ = CosineSolver(CosineForm(c), float(2.0 * abs(c).sum())).solve(b, 1e-8)
    assert np.linalg.norm(scipy.linalg.matmul_toeplitz(c, x) - b) <= 1e-7 * np.linalg.norm(b)


def test_a_low_rank_is_for_coefficients_that_end_and_a_vector_as_long_as_the_transform():
    n = 4096
    assert has_low_rank(CosineForm(column("0.9^k", n)))
    for c in (column("0.9^k", 4099), column("contact", n), column("2 - 2 cos θ", n)):
        assert not has_low_rank(CosineForm(c))


@pytest.mark.parametrize("n", [256, 269])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_part_that_the_right_hand_side_has_not_stays_zero(n, sign):
    c, b = column("contact", n), random(n)
    b = b + sign * b[::-1]
    x, _ = CosineSolver(CosineForm(c), float(abs(c).sum())).solve(b, 1e-10)
    assert_allclose(x, sign * x[::-1], atol=1e-12 * abs(x).max())
    assert_allclose(scipy.linalg.toeplitz(c) @ x, b, atol=1e-8)
    zero, iterations = CosineSolver(CosineForm(c), 1.0).solve(0.0 * b, 1e-10)
    assert iterations == 0
    assert not zero.any()


def test_what_is_not_positive_definite_is_refused():
    n = 512
    for c in (column("sinc", n), np.cos(np.arange(n)), -column("contact", n)):
        with pytest.raises(np.linalg.LinAlgError):
            CosineSolver(CosineForm(c), 1.0).solve(np.ones(n), 1e-8)
    # Their samples are positive all the same.
    for c in ([1.0, 0.2, -0.4], [1.0, 0.3, -0.3], [1.0, 0.2, 0.0, 0.6]):
        form = CosineForm(np.append(c, np.zeros(8 - len(c))))
        with pytest.raises(np.linalg.LinAlgError, match="approximate inverse"):
            LowRankInverse(form)
