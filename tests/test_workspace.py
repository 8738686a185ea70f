"""An operator uses memory again, but nothing of what was in it, and nobody else's."""

import threading
import time
import tracemalloc
from itertools import cycle

import numpy as np
import pytest
import scipy.fft
from numpy.testing import assert_allclose
from scipy.sparse.linalg import aslinearoperator

import toeplitz_mg as tmg
from tests.cases import QUICK, aggregate, contact, dense_of_column, exponential
from tests.systems import preconditioners, seeded


def operators(A):
    """Operators whose products need memory of their own."""
    mask = seeded(*A.grid_shape) < 0.8
    for B in (A, tmg.MaskedOperator(A, mask)):
        yield B
        names = "fft_rsm fft_sd cosine chan" + " fsai" * (len(A.grid_shape) < 3)
        yield from (f(B) for f in (tmg.multigrid, *preconditioners(names)))
    if len(A.grid_shape) == 1:
        yield tmg.spectral_preconditioner(A)
        yield tmg.toeplitz_inverse(A)


@pytest.mark.parametrize("shape", [(9001,), (2**16 + 1,), (101, 97), (500, 307), (24, 20, 23)])
def test_no_operator_uses_what_was_in_the_memory(shape):
    """A product with NaN leaves some in all of it."""
    c = contact(*shape) if len(shape) < 3 else exponential(*shape)
    c.flat[0] *= 2.0
    A = tmg.ToeplitzOperator(c)
    coupled = tmg.CoupledOperator([[A, None], [A, A]])
    for M in (*operators(A), coupled):
        x = seeded(M.shape[1])
        before = M @ x
        assert not np.isfinite(M @ np.full(M.shape[1], np.nan)).all()
        assert np.array_equal(M @ x, before)


# Operators within operators -----------------------------------------------------------------


def dense_two_grids(A, S, pre, post):
    """The cycle of two grids, by the propagation of the error."""
    eye, P = np.eye(len(A)), aggregate(len(A))
    coarse = P @ np.linalg.inv(P.T @ A @ P) @ P.T
    smooth = eye - S @ A
    power = np.linalg.matrix_power
    E = power(smooth, post) @ (eye - coarse @ A) @ power(smooth, pre)
    return (eye - E) @ np.linalg.inv(A)


def test_nested_cycles_are_their_dense_definition():
    """With operators of all kinds as the smoother of a cycle that is the smoother of a cycle."""
    steps = cycle([(1, 1), (2, 0), (0, 2)])
    tried = 0
    for case in QUICK:
        S, n = case.dense, len(case.dense)
        if n % 2 or n < 6 or np.iscomplexobj(S) or not case.positive:
            continue
        pre, post = next(steps)
        A = tmg.ToeplitzOperator(exponential(n))
        dense = dense_of_column(A.c)
        size = np.linalg.norm(S, 2) * np.linalg.norm(dense, 2)  # As a smoother it converges.

        smoother = case.operator(np.float64) * (1.0 / size)

        def within(A, smoother=smoother):
            return tmg.multigrid(A, smoother=lambda _: smoother, coarsest=A.shape[0] // 2)

        M = tmg.multigrid(A, smoother=within, pre=pre, post=post, coarsest=n // 2)
        expected = dense_two_grids(dense, dense_two_grids(dense, S / size, 1, 1), pre, post)
        atol = 1e-9 * np.abs(expected).max()
        found = M @ np.eye(n)
        assert_allclose(found, expected, rtol=0, atol=atol, err_msg=f"{case}, V({pre},{post})")
        tried += 1
    assert tried > 20


@pytest.mark.parametrize("name", ["multigrid", "fft_rsm_preconditioner", "fsai_preconditioner"])
@pytest.mark.parametrize("shape", [(64,), (300,), (20, 20)])
def test_a_smoother_that_is_a_cycle_is_the_matrix_it_is_by_itself(shape, name):
    """The same numbers from a smoother that keeps nothing, as its matrix was computed before."""
    A = tmg.ToeplitzOperator(contact(*shape))

    def inner(A):
        return tmg.multigrid(A, smoother=getattr(tmg, name), coarsest=16)

    def kept(A):
        return aslinearoperator(inner(A) @ np.eye(A.shape[0]))

    x = seeded(A.shape[0])
    y = tmg.multigrid(A, smoother=inner, coarsest=16) @ x
    expected = tmg.multigrid(A, smoother=kept, coarsest=16) @ x
    assert_allclose(y, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_an_operator_may_be_called_by_its_callers():
    """By the callback of an iteration, and by an operator of the user within a cycle."""
    n = 5000
    A = tmg.ToeplitzOperator(contact(n))
    b, other = seeded(2, n)
    M = tmg.multigrid(A)
    expected, _ = tmg.cg(A, b, M=M, rtol=1e-8)
    product = M @ (A @ other)

    def again(x):
        assert np.array_equal(M @ (A @ other), product)

    x, info = tmg.cg(A, b, M=M, rtol=1e-8, callback=again)
    assert info == 0
    assert np.array_equal(x, expected)


# Interrupts and memory ----------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(2**19,), (900, 700)])
@pytest.mark.parametrize("workers", [1, 2])
def test_a_product_after_an_interrupted_one_is_right(shape, workers):
    """Another thread, which is in the midst of a part of it, writes to no memory afterwards."""
    with tmg.use_transforms("scipy"):  # Its products take four transforms at least.
        A = tmg.ToeplitzOperator(contact(*shape))
    x, wrong = seeded(A.shape[0]), np.full(A.shape[0], 1e3)
    here = threading.current_thread()
    expected = A @ x

    class Interrupting:
        """Does as SciPy does, slowly in other threads, until it raises in this one."""

        __ua_domain__ = "numpy.scipy.fft"
        left = 0

        @classmethod
        def __ua_function__(cls, method, arguments, options):
            if threading.current_thread() is not here:
                time.sleep(0.02)
            else:
                cls.left -= 1
                if cls.left == 0:
                    raise KeyboardInterrupt
            return NotImplemented

    for call in (1, 2, 3, 4):
        Interrupting.left = call
        with scipy.fft.set_workers(workers):
            with scipy.fft.set_backend(Interrupting), pytest.raises(KeyboardInterrupt):
                A @ wrong
            assert_allclose(A @ x, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("shape", [(2**19,), (700, 600)])
def test_products_again_and_again_take_no_more_memory(shape, workers):
    A = tmg.ToeplitzOperator(contact(*shape))
    mask = seeded(*shape) < 0.5
    x = np.ones(A.shape[0])
    several = [A, tmg.MaskedOperator(A, mask), tmg.multigrid(A), tmg.fft_rsm_preconditioner(A)]
    with scipy.fft.set_workers(workers):
        held = []
        tracemalloc.start()
        try:
            for _ in range(4):
                for M in several:
                    M @ x[: M.shape[0]]
                held.append(tracemalloc.get_traced_memory()[0])
        finally:
            tracemalloc.stop()
    # Which thread does a part is open: each may take memory of its own the first time.
    assert held[-1] - held[-2] <= 0.1 * x.nbytes
