"""Memory that is used again is never that of an array that somebody still has."""

import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from itertools import count, cycle, pairwise

import numpy as np
import pytest
import scipy.fft
from numpy.testing import assert_allclose
from scipy.sparse.linalg import aslinearoperator

import toeplitz_mg as tmg
from tests.cases import CASES, aggregate, contact, dense_of_column, exponential
from toeplitz_mg.engine import passes, threads
from toeplitz_mg.engine.workspace import LARGE_PAGE, SMALL, _blocks, workspace
from toeplitz_mg.multigrid_cycle.cycle import Multigrid
from toeplitz_mg.multigrid_cycle.hierarchy import Level
from toeplitz_mg.multigrid_cycle.transfer import Transfer
from toeplitz_mg.preconditioners.direct import DenseInverse

SHAPE = (4, SMALL)  # of bytes: enough to be given out again

VIEWS = [
    lambda a: a,
    lambda a: a[1:],
    lambda a: a.T,
    lambda a: a.reshape(-1)[3:4],
    lambda a: a.view(np.complex128).real[:, 1:],
    lambda a: np.broadcast_to(a[0], a.shape),
    lambda a: np.lib.stride_tricks.as_strided(a, (2,), (1,)),
    memoryview,
    iter,
    lambda a: (x for x in a),
]


def random(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


@pytest.fixture
def of_any_content(monkeypatch):
    """Every workspace is one that is used again, and full of NaN when it is given out."""

    def poisoned(shape, dtype):
        array = workspace(shape, dtype, small=-1)
        array.view(np.uint8).fill(0xFF)  # of every dtype NaN
        return array

    for name, other in list(sys.modules.items()):
        if name.startswith("toeplitz_mg.") and getattr(other, "workspace", None) is workspace:
            monkeypatch.setattr(other, "workspace", poisoned)


# The mechanism ------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [SMALL + 1, 2**20, 2**22 + 5])
def test_what_nobody_has_any_more_is_used_again(size):
    first = workspace((size,), np.uint8)
    where = first.ctypes.data
    assert first.size == size
    assert size < 2**20 or where % LARGE_PAGE == 0
    del first
    assert workspace((-(-size // 4),), np.float32).ctypes.data == where


@pytest.mark.parametrize("view", VIEWS)
def test_what_somebody_has_is_not_given_out(view):
    array = workspace(SHAPE, np.uint8)
    where = array.ctypes.data
    kept = view(array)
    del array
    assert workspace(SHAPE, np.uint8).ctypes.data != where
    assert kept is not None
    del kept
    assert where in [a.ctypes.data for a in [workspace(SHAPE, np.uint8) for _ in range(2)]]


def test_what_another_thread_or_a_waiting_generator_has_is_not_given_out():
    def waiting():
        memory = workspace(SHAPE, np.uint8)
        yield memory.ctypes.data
        yield memory

    generator = waiting()
    where = next(generator)
    assert workspace(SHAPE, np.uint8).ctypes.data != where
    with ThreadPoolExecutor(1) as pool:
        array = pool.submit(workspace, SHAPE, np.uint8).result()
        again = pool.submit(workspace, SHAPE, np.uint8).result()
    assert not np.shares_memory(array, again)


def test_an_interrupt_within_does_no_harm():
    """In each line of it: what it gives out afterwards nobody else has."""
    held, interrupted = [workspace(SHAPE, np.uint8)], 0
    before = sys.gettrace()
    for k in range(12):
        lines = count()

        def interrupt(frame, event, _, k=k, lines=lines):
            if frame.f_code is not workspace.__code__:
                return None
            if event == "line" and next(lines) == k:
                raise KeyboardInterrupt
            return interrupt

        for _ in range(2):  # where it takes new memory, and where it finds some
            sys.settrace(interrupt)
            try:
                held.append(workspace(SHAPE, np.uint8))
            except KeyboardInterrupt:
                interrupted += 1
            finally:
                sys.settrace(before)
        held.append(workspace(SHAPE, np.uint8))
        held.pop(0)
    assert interrupted > 8
    assert len({a.ctypes.data for a in held}) == len(held)


# Products that are interrupted --------------------------------------------------------------


@pytest.mark.parametrize("shape", [(2**17,), (512, 256)])
def test_a_product_after_an_interrupted_one_is_right(shape, monkeypatch):
    """A part of the first product that goes on writes in the midst of the second."""
    monkeypatch.setattr(threads, "WORTH_THREADS", 2**17)
    monkeypatch.setattr(passes, "WHOLE_BYTES", 0)
    A = tmg.ToeplitzOperator(exponential(*shape))
    x, wrong = random(A.shape[0]), np.full(A.shape[0], 1e3)
    here, fft, do = threading.current_thread(), scipy.fft.fft, threads.do_task
    calls = []
    monkeypatch.setattr(scipy.fft, "fft", lambda *a, **k: calls.append(0) or fft(*a, **k))
    expected = A @ x
    midst = len(calls) * 2 // 3
    begun, go_on, ended = threading.Event(), threading.Event(), threading.Event()
    interrupted = []

    def transform(*args, **kwargs):
        if threading.current_thread() is not here:
            begun.set()
            assert go_on.wait(60.0)
        elif not interrupted:
            assert begun.wait(60.0)
            interrupted.append(True)
            raise KeyboardInterrupt
        else:
            calls.append(0)
            if len(calls) == midst:
                go_on.set()
                assert ended.wait(60.0)
        return fft(*args, **kwargs)

    def do_and_say_so(*task):
        try:
            do(*task)
        finally:
            ended.set()

    monkeypatch.setattr(scipy.fft, "fft", transform)
    monkeypatch.setattr(threads, "do_task", do_and_say_so)
    monkeypatch.setattr(
        threads, "wait_for_all", lambda others: None
    )  # as where an interrupt hits it
    with scipy.fft.set_workers(2), pytest.raises(KeyboardInterrupt):
        A @ wrong
    calls.clear()
    assert_allclose(A @ x, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    assert ended.is_set()


class Stop(BaseException):
    """What a part of the work raises."""


@pytest.mark.parametrize("raising", ["here", "there", "in both", "while waiting"])
def test_all_parts_have_ended_when_one_has_raised(raising, monkeypatch):
    here, begun, back = threading.current_thread(), threading.Event(), threading.Event()
    ended = []

    def work(part):
        if threading.current_thread() is here:
            assert begun.wait(60.0)
            if raising in ("here", "in both"):
                raise Stop
        else:
            begun.set()
            back.wait(0.1)  # not before the caller is back, if it does not wait
            ended.append(part)
            if raising in ("there", "in both"):
                raise Stop

    def interrupted(futures, wait=threads.wait):
        monkeypatch.setattr(threads, "wait", wait)
        raise Stop

    if raising == "while waiting":
        monkeypatch.setattr(threads, "wait", interrupted)
    with scipy.fft.set_workers(2), pytest.raises(Stop):
        threads.share(work, 2, threads.WORTH_THREADS)
    # Either thread may take either part.
    assert ended in ([range(1)], [range(1, 2)])
    back.set()


# Operators within operators -----------------------------------------------------------------


@pytest.mark.usefixtures("of_any_content")
def test_no_operator_uses_what_was_in_the_memory():
    for case in CASES:
        A, dense = case.operator(np.float64), case.dense
        X = random(A.shape[1], 2)
        assert_allclose(
            A @ X, dense @ X, rtol=0, atol=1e-11 * np.abs(dense).max() * len(X), err_msg=str(case)
        )


def two_grids(A, S, pre, post):
    """The cycle of two grids with the smoother S, whatever it is of A."""
    transfer, H = Transfer.of(A), tmg.galerkin(A)
    return Multigrid((Level(A, S, transfer), Level(H, DenseInverse(H), None)), pre, post, 1)


def dense_two_grids(A, S, pre, post):
    """Its matrix, by the propagation of the error."""
    eye, P = np.eye(len(A)), aggregate(len(A))
    coarse = P @ np.linalg.inv(P.T @ A @ P) @ P.T
    smooth = eye - S @ A
    power = np.linalg.matrix_power
    E = power(smooth, post) @ (eye - coarse @ A) @ power(smooth, pre)
    return (eye - E) @ np.linalg.inv(A)


@pytest.mark.usefixtures("of_any_content")
def test_nested_cycles_are_their_dense_definition():
    """With each operator as the smoother of a cycle that is the smoother of a cycle."""
    steps = cycle([(1, 1), (2, 0), (0, 2)])
    tried = 0
    for case in CASES:
        S = case.dense
        if len(S) % 2 or len(S) == 2 or np.iscomplexobj(S):
            continue
        size, (pre, post) = np.linalg.norm(S, 2), next(steps)
        A = tmg.ToeplitzOperator(exponential(len(S)))
        dense = dense_of_column(A.c)
        within = two_grids(A, case.operator(np.float64) * (1.0 / size), 1, 1)
        M = two_grids(A, within, pre, post) @ np.eye(len(S))
        expected = dense_two_grids(dense, dense_two_grids(dense, S / size, 1, 1), pre, post)
        atol = 1e-9 * np.abs(expected).max()
        assert_allclose(M, expected, rtol=0, atol=atol, err_msg=f"{case}, V({pre},{post})")
        tried += 1
    assert tried > 100


@pytest.mark.usefixtures("of_any_content")
@pytest.mark.parametrize("name", ["multigrid", "fft_rsm_preconditioner", "fsai_preconditioner"])
@pytest.mark.parametrize("shape", [(64,), (300,), (20, 20)])
def test_a_smoother_that_is_a_cycle_is_the_matrix_it_is_by_itself(shape, name):
    """The same numbers from a smoother that keeps nothing, as its matrix was computed before."""
    A = tmg.ToeplitzOperator(contact(*shape))

    def inner(A):
        return tmg.multigrid(A, smoother=getattr(tmg, name), coarsest=16)

    def kept(A):
        return aslinearoperator(inner(A) @ np.eye(A.shape[0]))

    x = random(A.shape[0])
    y = tmg.multigrid(A, smoother=inner, coarsest=16) @ x
    expected = tmg.multigrid(A, smoother=kept, coarsest=16) @ x
    assert_allclose(y, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_an_operator_may_be_called_by_its_callers():
    """By the callback of an iteration, and by an operator of the user within a cycle."""
    n = 5000
    A = tmg.ToeplitzOperator(contact(n))
    b, other = random(2, n)
    M = tmg.multigrid(A)
    expected, _ = tmg.cg(A, b, M=M, rtol=1e-8)
    product = M @ (A @ other)

    def again(x):
        assert np.array_equal(M @ (A @ other), product)

    x, info = tmg.cg(A, b, M=M, rtol=1e-8, callback=again)
    assert info == 0
    assert np.array_equal(x, expected)


# Memory -------------------------------------------------------------------------------------


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("shape", [(2**17,), (512, 150)])
def test_products_again_and_again_take_no_more_memory(shape, workers, monkeypatch):
    monkeypatch.setattr(threads, "WORTH_THREADS", 2**17)
    monkeypatch.setattr(passes, "WHOLE_BYTES", 0)
    A = tmg.ToeplitzOperator(contact(*shape))
    mask = random(*shape) < 0.5
    x = np.ones(A.shape[0])
    operators = [A, tmg.MaskedOperator(A, mask), tmg.multigrid(A), tmg.fft_rsm_preconditioner(A)]
    with scipy.fft.set_workers(workers):
        counts = []
        for _ in range(3):
            for M in operators:
                M @ x[: M.shape[0]]
            counts.append({length: len(some) for length, some in _blocks.by_length.items()})
    assert all(a == b for a, b in pairwise(counts))
