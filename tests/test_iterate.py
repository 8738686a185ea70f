"""What all iterations have in common: the history of the residuals."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg

SOLVERS = [tmg.cg, tmg.richardson, tmg.gmres]
A = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(200)))
M = tmg.fft_rsm_preconditioner(A)


def vector(is_complex=False):
    rng = np.random.default_rng(0)
    return rng.standard_normal(200) + 1j * is_complex * rng.standard_normal(200)


@pytest.mark.parametrize("solver", SOLVERS)
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
    _, info = tmg.cg(
        A,
        b,
        M=M,
        rtol=1e-10,
        inner=A.astype(np.float32),
        residuals=residuals,
        callback=lambda x: true.append(np.linalg.norm(b - A @ x)),
    )
    assert info == 0
    # What is not computed may be wrong by 0.1 %, or by the rounding of float32.
    assert_allclose(residuals, true, rtol=0.05)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_zero_right_hand_side_has_a_history_of_one(solver):
    residuals = [3.0]
    x, info = solver(A, np.zeros(200), np.ones(200), residuals=residuals)
    assert (info, residuals) == (0, [0.0])
    assert not x.any()


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("residuals", [(), np.zeros(3), True, {}])
def test_only_a_list_is_filled(solver, residuals):
    with pytest.raises(TypeError, match=r"residuals is .*, but must be a list"):
        solver(A, vector().real, residuals=residuals)


@pytest.mark.parametrize("solver", SOLVERS)
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


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_guess_beyond_the_range_of_a_right_hand_side_in_single_precision(solver):
    """It is no reason to take the right-hand side for zero."""
    b = vector().real.astype(np.float32)
    x, info = solver(A, b, np.full(200, 1e42), M=M, rtol=1e-7)
    assert info > 0 or np.linalg.norm(b - A @ x) <= 1e-7 * np.linalg.norm(b)


@pytest.mark.parametrize("solver", SOLVERS)
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


def test_a_preconditioner_of_subnormal_numbers_has_few_digits():
    x, info = tmg.cg(np.diag(np.arange(1.0, 6.0)), 3.0 * np.ones(5), M=1e-309 * np.eye(5))
    assert info == 0 or np.isfinite(x).all()


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("size", [1e-200, 1e-3, 1.0, 1e3, 1e200])
def test_an_absolute_tolerance_is_of_the_size_of_the_right_hand_side(solver, size):
    b, residuals = size * vector().real, []
    atol = 1e-6 * size * np.linalg.norm(vector().real)
    x, info = solver(A, b, M=M, rtol=0.0, atol=atol, residuals=residuals)
    assert info == 0
    assert np.linalg.norm((b - A @ x) / size) <= 1.001 * atol / size
    # And it stops at once.
    assert residuals[-1] <= atol < residuals[-2]


@pytest.mark.parametrize("solver", SOLVERS)
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
    with np.errstate(over="ignore", invalid="ignore"):
        x, info = solver(
            B.astype(dtype),
            b.astype(dtype),
            (exact * (1.0 - small)).astype(dtype),
            rtol=0.1,
            residuals=residuals,
        )
    assert info == 0
    assert len(residuals) == 1  # It is good enough.
    assert_allclose(residuals[0] / largest, np.linalg.norm(B @ small), rtol=1e-3)
    assert_allclose(x / largest, 1.0 - small, rtol=1e-6)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_first_guess_is_improved_wherever_the_right_hand_side_is_far_below_it(solver):
    rng = np.random.default_rng(0)
    entries, residuals = rng.uniform(0.5, 1.0, 40), []
    M = np.diag(rng.uniform(0.9, 1.0, 40) / entries)
    b, guess = 1e-100 * rng.standard_normal(40), 1e100 * rng.standard_normal(40)
    x, _ = solver(np.diag(entries), b, guess, M=M, rtol=1e-6, maxiter=60, residuals=residuals)
    assert_allclose(residuals[0] / 1e100, np.linalg.norm(entries * guess / 1e100))
    assert residuals[-1] <= 1e-10 * residuals[0]
    assert np.linalg.norm(entries * x / 1e100) <= 1e-10 * residuals[0] / 1e100


@pytest.mark.parametrize("solver", SOLVERS)
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


@pytest.mark.parametrize("solver", SOLVERS)
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
