"""Threads: whatever number `scipy.fft.set_workers` says, all results have the same bits.

The examples are so large that threads share what can be shared.
"""

import os
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
import scipy.fft

import toeplitz_mg as tmg
from tests.cases import contact, coupled, half_space_kernel, lags_of
from tests.systems import PRECONDITIONERS, seeded
from toeplitz_mg import halfspace
from toeplitz_mg.contact import Material, normal_contact, surfaces

WORKERS = 1, 2, 3
STEEL = Material(E=210000.0, nu=0.28)


def assert_same_bits(compute, message=""):
    """Compute arrays with each number of threads, and compare them to the last bit."""
    results = []
    for workers in WORKERS:
        with scipy.fft.set_workers(workers):
            results.append(compute())
    for a, b in pairwise(results):
        np.testing.assert_array_equal(a, b, err_msg=message, strict=True)


OF_LINES = tmg.spectral_preconditioner, tmg.toeplitz_inverse
each_shape = pytest.mark.parametrize("shape", [(600001,), (900, 700)], ids=str)


@pytest.mark.parametrize("shape", [pytest.param((600001,), marks=pytest.mark.slow), (900, 700)])
def test_products_have_the_same_bits(shape):
    """Of all kinds of matrices; of one vector, and of several."""
    c = contact(*shape)
    mask = seeded(*shape) < 0.5
    x, X = seeded(c.size), seeded(c.size, 2, seed=1)

    def multiply():
        A = tmg.ToeplitzOperator(c)
        phases = np.exp(0.3j * np.add.outer(*(np.arange(1 - n, n) for n in (*shape, 1)[:2])))
        complex_one = tmg.ToeplitzOperator.from_lags(lags_of(c) * phases.reshape(lags_of(c).shape))
        masked = tmg.MaskedOperator(A, mask)
        found = [A @ x, (A @ X).ravel(), A.astype(np.float32) @ x]
        found += [masked @ x[mask.ravel()], complex_one @ x]
        return np.concatenate(found)

    assert_same_bits(multiply)


@pytest.mark.slow
@each_shape
@pytest.mark.parametrize("make", [*PRECONDITIONERS, tmg.toeplitz_inverse], ids=lambda f: f.__name__)
def test_preconditioners_have_the_same_bits(make, shape):
    """Their set-up, and their products, on a mask too."""
    if make in OF_LINES and len(shape) > 1:
        return
    c = contact(*shape) if len(shape) > 1 else (1.0 + np.arange(*shape)) ** -1.5
    c.flat[0] *= 2.0  # So that each of them exists.
    mask = seeded(*shape) < 0.5
    for is_masked in (False, True)[: 1 + (make is not tmg.toeplitz_inverse)]:

        def apply(is_masked=is_masked):
            A = tmg.ToeplitzOperator(c)
            A = tmg.MaskedOperator(A, mask) if is_masked else A
            return make(A) @ seeded(A.shape[0], seed=1)

        assert_same_bits(apply, f"masked: {is_masked}")


@pytest.mark.slow
@pytest.mark.parametrize("components", [1, 2])
def test_the_set_up_of_fsai_has_the_same_bits(components):
    """Of rows by themselves and of components together, on all levels."""
    shape, neighbours = ((400, 300), 24) if components == 1 else ((200, 150), None)
    A = tmg.ToeplitzOperator(contact(*shape))
    if components == 2:
        A = coupled(half_space_kernel(2, *shape))(np.float64)
    A = tmg.MaskedOperator(A, seeded(*shape) < 0.5)
    b = seeded(A.shape[0], seed=1)
    assert_same_bits(lambda: tmg.fsai_preconditioner(A, neighbours=neighbours) @ b)


@pytest.mark.slow
@each_shape
@pytest.mark.parametrize("choose", [tmg.default_preconditioner, lambda A: None], ids=["M", "none"])
def test_cg_has_the_same_bits(shape, choose):
    c = contact(*shape)
    c.flat[0] *= 2.0
    mask = seeded(*shape) < 0.5
    for A in (tmg.ToeplitzOperator(c), tmg.MaskedOperator(tmg.ToeplitzOperator(c), mask)):
        b = seeded(A.shape[0], seed=1)
        assert_same_bits(lambda A=A, b=b: tmg.cg(A, b, M=choose(A), rtol=1e-4, maxiter=9)[0])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")
def test_contact_has_the_same_bits():
    gap = surfaces.rough((400, 350), (0.1, 0.1), rms=0.002, seed=1)

    def solve():
        found = normal_contact(gap, (0.1, 0.1), material=STEEL, approach=0.003)
        return np.stack([found.traction, found.gap, found.displacement])

    assert_same_bits(solve)


def test_coefficients_have_the_same_bits():
    x, y = halfspace.offsets((500, 300), (0.5, 0.2))
    assert_same_bits(lambda: halfspace.influence_xx(x, y, (0.5, 0.2), G=1.0, nu=0.3))


@pytest.mark.slow
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
