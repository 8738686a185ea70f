"""What cg, richardson and gmres have in common.

The history of residuals is that of the true ones; the answer scales with b, whatever the range of
its numbers; what is no system is refused.
"""

import numpy as np
import pytest
import scipy.sparse
from numpy.testing import assert_allclose
from scipy.sparse.linalg import LinearOperator, aslinearoperator

import toeplitz_mg as tmg

SOLVERS = [tmg.cg, tmg.richardson, tmg.gmres]
each = pytest.mark.parametrize("solver", SOLVERS)
MASKED = np.ma.masked_array(np.ones(3), [False, True, False])
NO_LISTS = (), np.zeros(3), True, {}
BAD = np.ma.masked_array(np.eye(3)), np.eye(3).astype(str), np.eye(3).astype(object)
A = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(200)))
M = tmg.fft_rsm_preconditioner(A)


def vector(is_complex=False):
    rng = np.random.default_rng(0)
    return rng.standard_normal(200) + 1j * is_complex * rng.standard_normal(200)


@each
@pytest.mark.parametrize("with_guess", [False, True])
@pytest.mark.parametrize("size", [1.0, 1e-200, 1e200])
def test_residuals_are_those_of_all_iterates(solver, with_guess, size):
    b = size * vector().real
    x0 = size * np.ones(200) if with_guess else None
    residuals = [1.0, 2.0]
    x, info = solver(A, b, x0, M=M, rtol=1e-10, residuals=residuals)
    assert info == 0
    first = b if x0 is None else b - A @ x0
    assert_allclose(residuals[0] / size, np.linalg.norm(first / size), rtol=1e-12)
    last = np.linalg.norm(b / size - A @ (x / size))
    # The last one is computed; it has rounding of its own.
    assert_allclose(residuals[-1] / size, last, atol=1e-13)
    assert residuals[-1] / size <= 1e-9 * np.linalg.norm(b / size)


@pytest.mark.parametrize("solver", [tmg.cg, tmg.richardson])
@pytest.mark.parametrize("is_complex", [False, True])
def test_one_entry_for_each_iterate(solver, is_complex):
    b = vector(is_complex) if is_complex else vector().real
    residuals, true = [], [np.linalg.norm(b)]

    def look(x):
        true.append(np.linalg.norm(b - A @ x))
        assert len(residuals) == len(true)

    _, info = solver(A, b, M=M, rtol=1e-8, residuals=residuals, callback=look)
    assert info == 0
    assert_allclose(residuals, true, atol=1e-12)
    _, info = solver(A, b, M=M, rtol=1e-8, residuals=residuals, maxiter=3)
    assert (info, len(residuals)) == (3, 4)


def test_the_history_of_an_iteration_in_less_precision():
    b, residuals, true = vector().real, [], [np.linalg.norm(vector().real)]
    history = {"residuals": residuals, "callback": lambda x: true.append(np.linalg.norm(b - A @ x))}
    _, info = tmg.cg(A, b, M=M, rtol=1e-10, inner=A.astype(np.float32), **history)
    assert info == 0
    # What is not computed may be wrong by 0.1 %, or by the rounding of float32.
    assert_allclose(residuals, true, rtol=0.05)


@each
def test_a_zero_right_hand_side_has_a_history_of_one(solver):
    residuals = [3.0]
    x, info = solver(A, np.zeros(200), np.ones(200), residuals=residuals)
    assert (info, residuals) == (0, [0.0])
    assert not x.any()


@each
def test_a_right_hand_side_in_the_memory_of_the_products(solver):
    """What makes products may give them out in the same memory each time, b too."""
    memory = np.empty(200)

    def multiply(x):
        memory[:] = A @ x
        return memory

    operator = LinearOperator(A.shape, matvec=multiply, dtype=float)
    exact = vector().real
    for guess in (None, np.ones(200)):
        x, info = solver(operator, operator @ exact, guess, M=M, rtol=1e-10)
        assert info == 0
        assert_allclose(x, exact, atol=1e-6)


@each
def test_a_guess_beyond_the_range_of_a_right_hand_side_in_single_precision(solver):
    """It is no reason to take the right-hand side for zero."""
    b = vector().real.astype(np.float32)
    x, info = solver(A, b, np.full(200, 1e42), M=M, rtol=1e-7)
    assert info > 0 or np.linalg.norm(b - A @ x) <= 1e-7 * np.linalg.norm(b)


@each
@pytest.mark.parametrize(
    ("dtype", "size"), [("d", 1e307), ("d", 1e-300), ("f", 1e-60), ("f", 1e39)]
)
def test_a_solution_is_a_good_first_guess_of_any_size(solver, dtype, size):
    b, B = np.full(200, size), A.astype(dtype)
    x, info = solver(B, b, M=M, rtol=1e-5)
    assert info == 0
    residuals = []
    _, info = solver(B, b, x, M=M, rtol=1e-4, residuals=residuals)
    assert info == 0
    assert len(residuals) == 1
    assert 0.0 < residuals[0] / size <= 1e-4 * np.sqrt(200)


@pytest.mark.parametrize("size", [1e-250, 1e-160, 1e160, 1e250])
def test_conjugate_gradients_take_preconditioners_of_any_size(size):
    D, b = np.diag(np.geomspace(0.1, 10.0, 50)), np.random.default_rng(0).standard_normal(50)
    histories = [[], []]
    for scale, residuals in zip((1.0, size), histories, strict=True):
        assert tmg.cg(D, b, M=scale * np.eye(50), rtol=1e-9, residuals=residuals)[1] == 0
    assert_allclose(histories[1][:20], histories[0][:20], rtol=1e-6)


@pytest.mark.parametrize("solver", [tmg.cg, tmg.richardson])
def test_a_guess_far_above_the_right_hand_side(solver):
    b = np.array([0.0, 1e-300, 1e-300, 0.0, 0.0])
    x, _ = solver(np.diag([0.0, 1.0, 1.0, 1.0, 1.0]), b, np.array([1e300, 0.0, 0.0, 0.0, 0.0]))
    assert_allclose(x[1:], b[1:], rtol=1e-5)
    # What overflows is told by `info`, without a warning.
    assert solver(100.0 * np.eye(5), 3.0 * np.ones(5), np.full(5, 1e307), maxiter=3)[1] != 0


@each
@pytest.mark.parametrize("size", [1e-200, 1e-3, 1.0, 1e3, 1e200])
def test_an_absolute_tolerance_is_of_the_size_of_the_right_hand_side(solver, size):
    b, residuals = size * vector().real, []
    atol = 1e-6 * size * np.linalg.norm(vector().real)
    x, info = solver(A, b, M=M, rtol=0.0, atol=atol, residuals=residuals)
    assert info == 0
    assert np.linalg.norm((b - A @ x) / size) <= 1.001 * atol / size
    # And it stops at once.
    assert residuals[-1] <= atol < residuals[-2]


@each
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_first_guess_whose_product_overflows_on_the_way(solver, dtype):
    """Half of a row of ones, and half of minus ones: the sum of the former is not finite."""
    n, largest = 64, 0.8 * float(np.finfo(dtype).max)
    B = np.eye(n)
    B[0] = np.repeat([1.0, -1.0], n // 2)
    small = np.random.default_rng(0).uniform(0.0, 1e-3, n) * (np.arange(n) > 0)
    exact = np.full(n, largest)
    b = exact * (np.arange(n) > 0)  # That is B times it.
    residuals = []
    system = (numbers.astype(dtype) for numbers in (B, b, exact * (1.0 - small)))
    with np.errstate(over="ignore", invalid="ignore"):
        x, info = solver(*system, rtol=0.1, residuals=residuals)
    assert info == 0
    assert len(residuals) == 1  # It is good enough.
    assert_allclose(residuals[0] / largest, np.linalg.norm(B @ small), rtol=1e-3)
    assert_allclose(x / largest, 1.0 - small, rtol=1e-6)


@each
def test_a_first_guess_is_improved_wherever_the_right_hand_side_is_far_below_it(solver):
    rng = np.random.default_rng(0)
    entries, residuals = rng.uniform(0.5, 1.0, 40), []
    M = np.diag(rng.uniform(0.9, 1.0, 40) / entries)
    b, guess = 1e-100 * rng.standard_normal(40), 1e100 * rng.standard_normal(40)
    x, _ = solver(np.diag(entries), b, guess, M=M, rtol=1e-6, maxiter=60, residuals=residuals)
    assert_allclose(residuals[0] / 1e100, np.linalg.norm(entries * guess / 1e100))
    assert residuals[-1] <= 1e-10 * residuals[0]
    assert np.linalg.norm(entries * x / 1e100) <= 1e-10 * residuals[0] / 1e100


@each
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_first_guess_that_solves_a_system_of_tiny_numbers(solver, dtype):
    """The sum of half of a row is not finite, and the right-hand side is of size 1."""
    n, limits = 1024, np.finfo(dtype)
    B = 4.0 * limits.tiny * np.eye(n, dtype=dtype)
    B[0] = np.repeat([1.0, -1.0], n // 2)
    exact = np.full(n, 2.0 ** (limits.maxexp - 1), dtype)  # Powers of two, without any rounding.
    b = 4.0 * limits.tiny * exact * (np.arange(n) > 0)
    with np.errstate(over="ignore", invalid="ignore"):
        x, info = solver(B, b, exact, rtol=1e-5)
    assert info == 0
    assert np.array_equal(x, exact)


@each
@pytest.mark.parametrize(
    ("dtype", "of_b", "of_x0"), [(np.float64, 1e-200, 1e200), (np.float32, 1e-20, 1e20)]
)
def test_a_guess_beside_which_b_underflows_is_no_solution(solver, dtype, of_b, of_x0):
    """Nothing of it is worth keeping: the answer is that without a guess."""
    D = tmg.ToeplitzOperator(np.eye(1, 5)[0].astype(dtype) * 3 + np.eye(1, 5, 1)[0].astype(dtype))
    b, residuals = np.full(5, of_b, dtype), []
    x0, M = np.full(5, of_x0, dtype), (np.eye(5) / 4).astype(dtype)
    x, info = solver(D, b, x0, M=M, rtol=1e-4, residuals=residuals)
    assert info == 0
    exact = np.linalg.solve(D.toarray().astype(np.float64), np.ones(5))
    assert_allclose(x.astype(np.float64) / of_b, exact, rtol=1e-3)
    assert_allclose(residuals[0] / of_b, np.sqrt(5.0), rtol=1e-5)


@each
def test_a_guess_may_be_the_product_of_m_and_b(solver):
    b = vector().real
    for N, guess in ((M, M @ b), (None, b)):
        found = []
        for x0 in ("Mb", guess):
            residuals = []
            x, _ = solver(A, b, x0, M=N, maxiter=2, residuals=residuals)
            found.append([*x, *residuals])
        assert np.array_equal(*found)
        assert_allclose(residuals[0], np.linalg.norm(b - A @ guess))


# What each takes and refuses -------------------------------------------------------------------


@each
def test_takes_what_scipy_takes(solver):
    dense, b = np.diag([2.0, 3.0, 4.0]), [1, 2, 3]
    for matrix in (dense, scipy.sparse.csr_array(dense), aslinearoperator(dense)):
        for rhs in (b, np.array(b)[:, None]):
            x, info = solver(matrix, rhs, M=np.diag([0.5, 0.3, 0.2]), rtol=1e-12)
            assert info == 0
            assert_allclose(x, [0.5, 2 / 3, 0.75])
    for tolerance in ("atol", "rtol"):  # Any guess meets it.
        x, info = solver(np.eye(2), b[:2], [3.0, 4.0], **{tolerance: np.inf})
        assert (info, *x) == (0, 3.0, 4.0)
    without_dtype = LinearOperator((2, 2), lambda x: x)
    without_dtype.dtype = None  # As that of SciPy's unit matrix is.
    for operators in ((without_dtype, None), (np.eye(2), without_dtype)):
        assert_allclose(solver(operators[0], [1.0, 2.0], M=operators[1])[0], [1.0, 2.0])
    z, info = solver(np.eye(2), [1.0, 2.0], M=np.diag([1.0 + 0j, 1.0]), rtol=1e-12)
    assert info == 0
    assert_allclose(z, [1.0, 2.0])


@each
@pytest.mark.parametrize(
    ("dtype", "power"),
    [
        *(("d", power) for power in (-900, -400, 400, 1000)),
        *(("f", p) for p in (-100, -70, 70, 110)),
    ],
)
@pytest.mark.parametrize("with_guess", [False, True])
def test_a_power_of_two_scales_every_iterate_and_changes_no_digit(solver, dtype, power, with_guess):
    """Squares of these numbers are 0 or inf in their precision."""
    B = tmg.ToeplitzOperator((0.5 ** np.arange(50)).astype(dtype))
    b, x0 = np.random.default_rng(0).standard_normal((2, 50)).astype(dtype)
    options = {"M": tmg.fft_rsm_preconditioner(B), "rtol": 1e-9 if dtype == "d" else 1e-4}
    options |= {"restart": 4} if solver is tmg.gmres else {}
    ours, scaled = [], []
    for scale, history in ((1.0, ours), (2.0**power, scaled)):
        guess, residuals, iterates = scale * x0 if with_guess else None, [], []
        if solver is not tmg.gmres:
            options["callback"] = lambda x, i=iterates: i.append(x.copy())
        x, info = solver(B, scale * b, guess, residuals=residuals, **options)
        assert info == 0
        assert x.dtype == dtype
        history += [v / scale for v in (*residuals, *np.ravel([*iterates, x]))]
    if (dtype, power) == ("f", -100):  # The smallest terms are below all numbers.
        assert_allclose(scaled[-50:], ours[-50:], atol=1e-3)
    else:
        assert ours == scaled


@each
@pytest.mark.parametrize(("of_A", "of_b"), [(1e-300, 1e10), (1e200, 1e-200), (1.0, 5e-324)])
def test_a_solution_out_of_range_has_not_converged(solver, of_A, of_b):
    """It would be inf or 0, or a number with the digits of 5e-324."""
    B = tmg.ToeplitzOperator(of_A * 0.5 ** np.arange(10))
    b = of_b * np.linspace(1.0, 2.0, 10)
    _, info = solver(B, b, M=tmg.chan_preconditioner(B), maxiter=50)
    assert info > 0


@each
@pytest.mark.parametrize("complex_part", [1.0, 1.0 + 1.0j])
def test_the_largest_numbers_there_are(solver, complex_part):
    """The absolute value of the complex one overflows."""
    b = 1.5e308 * complex_part * np.array([1.0, 0.5])
    x, info = solver(np.diag([1.0, 0.75]), b, rtol=1e-12, maxiter=100)
    assert info == 0
    assert_allclose(x / 1e308, b / 1e308 / [1.0, 0.75])


@pytest.mark.filterwarnings("ignore:invalid value encountered in matmul:RuntimeWarning")
@each
@pytest.mark.parametrize("bad", [np.inf, -np.inf, np.nan])
@pytest.mark.parametrize("with_guess", [False, True])
def test_stops_where_a_matrix_is_not_finite(solver, bad, with_guess):
    good, spoilt = np.eye(50), np.eye(50)
    spoilt[3, 4] = spoilt[4, 3] = bad
    guess = 0.5 * np.ones(50) if with_guess else None
    for name in ("A", "M", "inner") if solver is tmg.cg else ("A", "M"):
        residuals, matrices = [], {"A": good} | {name: spoilt}
        _, info = solver(b=np.ones(50), x0=guess, residuals=residuals, **matrices)
        assert info == 1
        assert len(residuals) <= 2


@each
def test_the_first_guess_is_not_changed_and_may_be_the_solution(solver):
    x0 = np.ones(200)
    solver(A, vector().real, x0, M=M)
    assert (x0 == 1).all()
    x, info = solver(A, A @ x0, x0, M=M, maxiter=1)
    assert info == 0
    assert np.array_equal(x, x0)


@each
@pytest.mark.parametrize(
    ("arguments", "error", "match"),
    [
        ({"b": np.ones((3, 2))}, ValueError, r"b has .* but A has \(3, 3\): take one column"),
        ({"x0": np.ones(4)}, ValueError, r"x0 has shape \(4,\)"),
        ({"b": [1.0, np.nan, 0.0]}, ValueError, "b has entries that are not finite"),
        ({"rtol": -1e-8}, ValueError, "rtol is -1e-08, but must be a number that is not negative"),
        ({"rtol": np.nan}, ValueError, "rtol is nan"),
        ({"rtol": "a"}, ValueError, "rtol is 'a', but must be a number that is not negative"),
        ({"rtol": [1.0]}, TypeError, "rtol is .*, but must be a real number"),
        ({"atol": None}, ValueError, "atol is None, but must be a number that is not negative"),
        ({"x0": "mb"}, ValueError, "x0 is 'mb', but must be a vector, or 'Mb'"),
        ({"x0": "Mb", "M": np.full((3, 3), 1e308)}, ValueError, "M @ b has entries that"),
        ({"maxiter": 0}, ValueError, "maxiter is 0, but must be at least 1"),
        ({"maxiter": 1.5}, TypeError, "maxiter is 1.5, but must be an integer"),
        ({"M": np.eye(2)}, ValueError, r"M has shape \(2, 2\), but A has \(3, 3\)"),
        ({"A": np.ones((3, 2))}, ValueError, "must be square"),
        *(({"residuals": r}, TypeError, "residuals is .*, but must be a list") for r in NO_LISTS),
        ({"callback": 3}, TypeError, "callback is 3, but must be a function, or None"),
        ({"b": MASKED}, TypeError, "is a masked array, but must have a value in each"),
        ({"x0": MASKED}, TypeError, "is a masked array, but must have a value in each"),
        *(({name: m}, TypeError, f"{name} (is a masked|has dtype)") for name in "AM" for m in BAD),
        *(({"b": v}, TypeError, "b (has dtype|is 'abc')") for v in ("abc", ["1"] * 3, [None] * 3)),
    ],
)
def test_refuses_bad_arguments(solver, arguments, error, match):
    with pytest.raises(error, match=match):
        solver(**{"A": np.eye(3), "b": np.ones(3)} | arguments)


@pytest.mark.parametrize("solver", [tmg.cg, tmg.gmres])
def test_inner_products_are_in_double_precision_at_most(solver):
    with pytest.raises(TypeError, match="must have float32 or float64"):
        solver(np.eye(3), np.ones(3, np.longdouble))
