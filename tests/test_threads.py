"""Threads: whatever number `scipy.fft.set_workers` says, all results have the same bits."""

import os
import subprocess
import sys
import threading
import time
from itertools import pairwise

import numpy as np
import pytest
import scipy.fft
import scipy.sparse

import toeplitz_mg as tmg
from tests.cases import CASES, contact
from tests.test_fsai_coupled import tangential
from toeplitz_mg import halfspace
from toeplitz_mg.contact import Material, normal_contact, surfaces
from toeplitz_mg.engine import backends, threads
from toeplitz_mg.engine.backends import chosen_backends
from toeplitz_mg.engine.fourstep import FourStep
from toeplitz_mg.engine.panels import Panels
from toeplitz_mg.engine.vectors import ALONE, REDUCED
from toeplitz_mg.preconditioners.fsai import levels

WORKERS = 1, 2, 3
STEEL = Material(E=210000.0, nu=0.28)
LARGE = 8 * threads.WORTH_THREADS  # Numbers of a loop that all threads share.


SMALL = {"WORTH_THREADS": 16, "PIECE": 16, "BATCH": 64, "CHUNK": 32, "BLOCK": 16, "BLAS_BLOCKS": 2}
SMALL |= {"WHOLE_BYTES": 1024, "PANEL_BYTES": 1024, "BLOCK_BYTES": 1024, "NARROW": 1}
SMALL |= {"SHARED": 64, "AT_ONCE": 16}


@pytest.fixture
def eager(monkeypatch):
    """Share what is small, in small pieces, so that every loop is shared that can be."""
    for name, module in list(sys.modules.items()):
        if name.startswith("toeplitz_mg."):
            for constant in SMALL.keys() & vars(module).keys():
                # In `line` a block is an aggregate.
                if (name.rpartition(".")[2], constant) != ("line", "BLOCK"):
                    monkeypatch.setattr(module, constant, SMALL[constant])


def assert_same_bits(compute, message=""):
    """Compute arrays with each number of threads, and compare them to the last bit."""
    results = []
    for workers in WORKERS:
        with scipy.fft.set_workers(workers):
            results.append(compute())
    for a, b in pairwise(results):
        np.testing.assert_array_equal(a, b, err_msg=message, strict=True)


@pytest.mark.slow
@pytest.mark.usefixtures("eager")
@pytest.mark.parametrize(("dtype", "step"), [(np.float64, 1), (np.float32, 8)])
def test_every_operator_has_the_same_bits(dtype, step):
    """Its set-up, its products with one vector and with several."""
    rng = np.random.default_rng(0)
    for case in CASES[::step]:
        x, X = (rng.standard_normal((len(case.dense), k)).astype(dtype) for k in (1, 5))

        def multiply(case=case, x=x, X=X):
            A = case.operator(dtype)
            return np.hstack([A @ x, A @ X])

        assert_same_bits(multiply, str(case))


@pytest.mark.parametrize("n", [2**17, 150001])
def test_long_products_have_the_same_bits(n):
    k = np.arange(n)
    real, hermitian = 1.0 / (1.0 + k), np.exp(1j * k) / (1.0 + k) ** 2
    x = np.random.default_rng(0).standard_normal(n)

    def multiply():
        A, H = tmg.ToeplitzOperator(real), tmg.ToeplitzOperator(hermitian)
        operators = A, H, A.astype(np.float32), tmg.spectral_preconditioner(A)
        others = tmg.fsai_preconditioner(A), tmg.fft_preconditioner(A), tmg.chan_preconditioner(A)
        return np.stack([M @ x for M in operators + others])

    assert_same_bits(multiply)


def test_pieces_of_a_transform_may_begin_anywhere():
    """Its twiddle factors are made one from the other, from the last anchor on."""
    plan = Panels(FourStep(512, 300, np.complex128, height=2))
    x = np.random.default_rng(0).standard_normal(plan.length)
    assert_same_bits(lambda: plan.spectrum(x, None, 0.25).copy())


@pytest.mark.parametrize("shape", [(2**17,), pytest.param((400, 700), marks=pytest.mark.slow)])
@pytest.mark.parametrize("choose", [tmg.default_preconditioner, tmg.fsai_preconditioner])
def test_cg_has_the_same_bits(shape, choose):
    c = contact(*shape)
    mask = np.random.default_rng(0).random(shape) < 0.7
    for A in (tmg.ToeplitzOperator(c), tmg.MaskedOperator(tmg.ToeplitzOperator(c), mask)):
        b = np.random.default_rng(1).standard_normal(A.shape[0])

        def solve(A=A, b=b):
            x, info = tmg.cg(A, b, M=choose(A), rtol=1e-10)
            assert info == 0
            return x

        assert_same_bits(solve)


@pytest.mark.usefixtures("eager")
@pytest.mark.parametrize("shape", [(10, 40), (4, 3, 33)])
def test_the_set_up_of_a_grid_and_sums_by_its_rows_have_the_same_bits(shape):
    c = 0.5 ** np.indices(shape).sum(axis=0)
    lags = np.random.default_rng(2).standard_normal([2 * n - 1 for n in shape])
    mask = np.random.default_rng(0).random(shape) < 0.7

    def solve():
        full, general = tmg.ToeplitzOperator(c), tmg.ToeplitzOperator.from_lags(lags)
        found = [general @ np.ones(general.shape[0])]
        for A in (full, tmg.MaskedOperator(full, mask)):
            x, info = tmg.cg(A, np.ones(A.shape[0]), rtol=1e-8)
            assert info == 0
            found.append(x)
        return np.concatenate(found)

    assert_same_bits(solve)


@pytest.mark.usefixtures("eager")
@pytest.mark.parametrize("neighbours", [None, 24])
@pytest.mark.parametrize("shape", [(40, 50), (2000,)])
def test_the_set_up_of_fsai_has_the_same_bits(shape, neighbours):
    """Of rows from the table of patterns, and of rows by themselves, on all levels."""
    rng = np.random.default_rng(0)
    A = tmg.MaskedOperator(tmg.ToeplitzOperator(contact(*shape)), rng.random(shape) < 0.7)
    b = rng.standard_normal(A.shape[0])
    assert_same_bits(lambda: tmg.fsai_preconditioner(A, neighbours=neighbours) @ b)


@pytest.mark.usefixtures("eager")
def test_the_set_up_of_fsai_of_components_has_the_same_bits():
    A = tangential((30, 25))
    b = np.random.default_rng(0).standard_normal(A.shape[0])
    assert_same_bits(lambda: tmg.fsai_preconditioner(A) @ b)


@pytest.mark.parametrize("size", [4096, 2**17, 2**18 + 5])
@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.complex128])
def test_vectors_have_the_same_bits(size, dtype):
    rng = np.random.default_rng(0)
    X = (
        (rng.standard_normal((3, size)) + 1j * rng.standard_normal((3, size))).astype(
            dtype, casting="unsafe"
        )
        if np.dtype(dtype).kind == "c"
        else rng.standard_normal((3, size)).astype(dtype)
    )
    weights = np.arange(3.0)

    def combine():
        y = ALONE.aypx(0.3, X[0], ALONE.axpy(0.7, X[1], X[2].copy()))
        numbers = [ALONE.dot(X[0], y), ALONE.norm(y), *ALONE.dots(X, y)]
        return np.concatenate([y, ALONE.combine(weights, X), numbers])

    assert_same_bits(combine)


@pytest.mark.parametrize("size", [1e-200, 1e-150, 1e-30, 1.0, 1e30, 1e150, 1e200])
def test_the_norm_of_a_long_vector_neither_over_nor_underflows(size):
    x = np.random.default_rng(0).standard_normal(threads.WORTH_THREADS)
    np.testing.assert_allclose(ALONE.norm(size * x), size * np.linalg.norm(x), rtol=1e-12)
    for bad in (np.inf, np.nan):
        x[7] = bad
        np.testing.assert_equal(ALONE.norm(x), bad)


@pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")
@pytest.mark.parametrize("is_eager", [True, False])
def test_contact_has_the_same_bits(is_eager, request):
    shape = (400, 350)
    if is_eager:
        request.getfixturevalue("eager")
        shape = (70, 60)
    gap = surfaces.rough(shape, (0.1, 0.1), rms=0.002, seed=1)

    def solve():
        found = normal_contact(gap, (0.1, 0.1), material=STEEL, approach=0.003)
        return np.stack([found.traction, found.gap, found.displacement])

    assert_same_bits(solve)


def test_coefficients_have_the_same_bits():
    x, y = halfspace.offsets((500, 300), (0.5, 0.2))
    assert_same_bits(lambda: halfspace.influence_xx(x, y, (0.5, 0.2), G=1.0, nu=0.3))


@pytest.mark.parametrize("shape", [(0, 7), (40, 7), (40, 1000), (2, 0)])
def test_blocks_of_a_sparse_matrix_multiply_as_it_does(shape, monkeypatch):
    """Of rows that reach a few columns, all, or none; also where there are no rows."""
    monkeypatch.setattr(levels, "WORTH_THREADS", 16)
    monkeypatch.setattr(levels, "BLOCK", 6)
    rng = np.random.default_rng(0)
    for width in (2, 1000):
        near = np.abs(np.arange(shape[0])[:, None] - np.arange(shape[1])) <= width
        dense = np.where(near & (rng.random(shape) < 0.5), rng.standard_normal(shape), 0.0)
        matrix = scipy.sparse.csr_array(dense)
        blocks = levels.Blocks([matrix[rows] for rows in levels.cut_rows(shape[0], 4)])
        x, y = rng.standard_normal((shape[1], 3)), rng.standard_normal((shape[0], 3))
        product, transposed = np.full_like(y, np.nan), np.full_like(x, np.nan)
        blocks.multiply(x, product)
        blocks.multiply_transposed(y, transposed)
        np.testing.assert_array_equal(blocks.toarray(), dense)
        np.testing.assert_allclose(product, dense @ x, rtol=0, atol=1e-10)
        np.testing.assert_allclose(transposed, dense.T @ y, rtol=0, atol=1e-10)
        blocks.multiply(x, product, add=True)
        np.testing.assert_allclose(product, 2.0 * (dense @ x), rtol=0, atol=1e-10)


# The loop itself ----------------------------------------------------------------------------


@pytest.mark.parametrize("workers", WORKERS)
@pytest.mark.parametrize("points", [1, threads.WORTH_THREADS, LARGE])
@pytest.mark.parametrize("count", [0, 1, 2, 3, 100])
def test_each_part_is_done_once(count, points, workers):
    done = []
    with scipy.fft.set_workers(workers):
        threads.share(done.extend, count, points)
        assert scipy.fft.get_workers() == workers
    assert sorted(done) == list(range(count))


@pytest.mark.parametrize("workers", WORKERS)
@pytest.mark.parametrize("points", [1, threads.WORTH_THREADS, LARGE])
@pytest.mark.parametrize("length", [0, 1, 7, 8, 9, 100])
def test_each_slice_is_done_once_and_none_is_empty(length, points, workers):
    done = []
    with scipy.fft.set_workers(workers):
        threads.share_slices(done.append, length, 8, points)
    assert all(0 < part.stop - part.start <= 8 for part in done)
    assert sorted(k for part in done for k in range(part.start, part.stop)) == list(range(length))


def test_each_thread_has_enough_to_do():
    """More of them would wait for the interpreter's lock."""
    seen, met = set(), threading.Barrier(4, timeout=30)

    def work(parts):
        seen.add(threading.get_ident())
        met.wait()  # Four threads have one part each.

    def work_slowly(parts):
        seen.add(threading.get_ident())
        time.sleep(1e-3)

    with scipy.fft.set_workers(16):
        for do, count in ((work, 4), (work_slowly, 100)):
            seen.clear()
            threads.share(do, count, 4 * threads.WORTH_THREADS - 1)
            assert len(seen) <= 4


def test_a_thread_that_does_a_part_is_one():
    """What it does is not shared again, neither by us nor by SciPy."""
    seen = []

    def work(parts):
        here = threading.get_ident()
        within = []
        threads.share(lambda _: within.append(threading.get_ident()), 8, LARGE)
        seen.append((scipy.fft.get_workers(), set(within) == {here}))

    with scipy.fft.set_workers(3):
        threads.share(work, 12, LARGE)
        assert set(seen) == {(1, True)}
        seen.clear()
        threads.share(lambda _: seen.append(scipy.fft.get_workers()), 12, 1)
        assert seen == [1]  # A small one is not shared, and neither are its transforms.
        threads.share(lambda _: seen.append(scipy.fft.get_workers()), 1, LARGE)
        assert seen == [1, 3]  # The only part is, as it may be.


def test_threads_treat_overflow_as_the_caller_does():
    huge = np.full(threads.WORTH_THREADS, 1e300)
    with scipy.fft.set_workers(3):
        for how, raises in (("ignore", False), ("raise", True)):
            with np.errstate(over=how):
                if raises:
                    with pytest.raises(FloatingPointError):
                        threads.share_rows(lambda part: huge[part] * huge[part], huge)
                else:
                    threads.share_rows(lambda part: huge[part] * huge[part], huge)


def test_threads_transform_by_the_backend_of_the_caller():
    """SciPy keeps it in the thread that sets it, and has no public name for handing it on."""
    assert chosen_backends() is not None
    by = set()

    class Backend:
        __ua_domain__ = "numpy.scipy.fft"

        @staticmethod
        def __ua_function__(method, arguments, options):
            by.add(threading.get_ident())
            return NotImplemented

    met = threading.Barrier(3, timeout=30)

    def work(_):
        met.wait()  # Each thread has a part.
        scipy.fft.fft(np.ones(4))

    with scipy.fft.set_workers(3), scipy.fft.set_backend(Backend):
        threads.share(work, 3, LARGE)
    assert len(by) == 3
    by.clear()
    with scipy.fft.set_workers(3):  # Neither do they keep it.
        threads.share(work, 3, LARGE)
    assert not by


def test_where_backends_cannot_be_handed_on_one_thread_does_all(monkeypatch):
    monkeypatch.setattr(backends, "uarray", None)
    here, done = set(), []

    def work(parts):
        here.add(threading.get_ident())
        done.extend(parts)

    with scipy.fft.set_workers(3):
        threads.share(work, 12, LARGE)
    assert here == {threading.get_ident()}
    assert done == list(range(12))


def test_no_part_is_left_to_a_thread_that_nobody_waits_for(monkeypatch):
    """What is queued for a thread that cannot be started, another takes: it is waited for."""
    start, failed, began = threading.Thread.start, [], threading.Event()

    def start_but_once(thread):
        if not failed:
            failed.append(thread)
            raise RuntimeError("can't start new thread")
        start(thread)

    monkeypatch.setattr(threading.Thread, "start", start_but_once)
    here, done = threading.get_ident(), []

    def work(parts):
        if threading.get_ident() == here:
            began.wait(30)  # The other thread has a part, and is slow.
        else:
            began.set()
            time.sleep(0.2)
        done.extend(parts)

    threads._threads.cache_clear()
    try:
        with scipy.fft.set_workers(3):
            threads.share(work, 3, LARGE)
    finally:
        threads._threads.cache_clear()
    assert failed
    assert sorted(done) == [0, 1, 2]


def test_loops_are_done_where_no_thread_can_be_started_any_more():
    """As in a thread that goes on when the main one has ended, and when Python ends."""
    script = """
import atexit, threading, time
import numpy as np, scipy.fft
from toeplitz_mg.engine import backends, threads
from toeplitz_mg.engine.backends import chosen_backends

def work():
    done = []
    with scipy.fft.set_workers(2):
        threads.share(done.extend, 10, threads.WORTH_THREADS)
    print(sorted(done) == list(range(10)))

def later():
    threading.main_thread().join()
    work()

atexit.register(work)
threading.Thread(target=later).start()
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert run.stdout.split() == ["True", "True"], run.stderr


def test_bits_of_transforms_in_single_precision():
    """Lines that are left over from those transformed together have other bits, in each thread.

    SciPy takes no more threads than the environment says where a process begins: here one.
    """
    script = """
import numpy as np, scipy.fft, toeplitz_mg as tmg

for shape in ((512, 512), (600, 601), (2048, 256)):
    i, j = np.ogrid[tuple(slice(1 - n, n) for n in shape)]
    lags = (1.0 + i**2.0 + j**2) ** -0.5
    for dtype in (np.float32, np.complex64):
        phases = np.exp(0.3j * (i + j)) if dtype == np.complex64 else 1.0
        A = tmg.ToeplitzOperator.from_lags((lags * phases).astype(dtype))
        x = np.random.default_rng(0).standard_normal(A.shape[0]).astype(dtype)
        for M in (A, tmg.chan_preconditioner(A)):
            found = set()
            for workers in (1, 2, 3):
                with scipy.fft.set_workers(workers):
                    found.add((M @ x).tobytes())
            print(len(found))
"""
    environment = {name: x for name, x in os.environ.items() if name != "OMP_NUM_THREADS"}
    command = [sys.executable, "-c", script]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    assert run.stdout.split() == 12 * ["1"], run.stderr


@pytest.mark.parametrize("place", [0, -1])
def test_extremes_are_no_numbers_where_one_is_none_in_any_part(place):
    x = np.zeros(2 * REDUCED)
    x[place] = np.nan
    for workers in (1, 2, 3):
        with scipy.fft.set_workers(workers):
            assert np.isnan([ALONE.min(x), ALONE.max(x), ALONE.peak(x)]).all()
