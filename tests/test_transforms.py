"""Whose transforms are used makes no difference but for rounding, and can be chosen.

All laws of the operators are tested with MKL where it is installed: here is what is said of it.
"""

import pickle
import subprocess
import sys
import threading

import numpy as np
import pytest
import scipy.fft
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from tests.cases import exponential
from tests.systems import seeded

SHAPES = [(300,), (2000,), (9000,), (40_000,), (70_000,), (2**17,), (30, 40), (130, 120), (9, 8, 7)]


HAS_MKL = tmg.use_transforms() == "mkl"
needs_mkl = pytest.mark.skipif(not HAS_MKL, reason="MKL is not installed")


def test_a_choice_ends_with_its_block():
    before = tmg.use_transforms()
    with tmg.use_transforms("scipy"):
        assert tmg.use_transforms() == "scipy"
        with pytest.raises(ZeroDivisionError), tmg.use_transforms("scipy"):
            raise ZeroDivisionError
        assert tmg.use_transforms() == "scipy"
    assert tmg.use_transforms() == before


def test_any_other_name_is_refused():
    with pytest.raises(ValueError, match=r"name is 'fftw', but must be one of \('mkl', 'scipy'\)"):
        tmg.use_transforms("fftw")


def test_without_mkl_transforms_are_those_of_scipy_with_a_warning_that_says_so():
    if HAS_MKL:
        with tmg.use_transforms("mkl"):
            assert tmg.use_transforms() == "mkl"
        return
    with pytest.warns(UserWarning, match="MKL is not installed.*SciPy"):
        choice = tmg.use_transforms("mkl")
    with choice:
        assert tmg.use_transforms() == "scipy"


@pytest.mark.skipif(sys.platform != "linux", reason="the name of the file is that on Linux")
def test_a_broken_library_is_named_in_a_warning_and_none_is_loaded_before_a_transform(tmp_path):
    library = tmp_path / "lib" / "libmkl_rt.so.3"
    library.parent.mkdir()
    library.write_text("this is none")
    code = (
        f"import sys; sys.prefix = {str(tmp_path)!r}; import toeplitz_mg as tmg; print('imported', "
    )
    code += "flush=True, file=sys.stderr); print(tmg.use_transforms(), file=sys.stderr)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    before, after = said.stderr.split("imported")
    assert "MKL" not in before
    assert str(library) in after
    assert after.endswith("scipy\n")


def test_a_backend_of_scipy_comes_first():
    seen = []

    class Backend:
        __ua_domain__ = "numpy.scipy.fft"

        @staticmethod
        def __ua_function__(method, arguments, options):
            seen.append(method)
            return NotImplemented

    A = tmg.ToeplitzOperator(exponential(700))
    with scipy.fft.set_backend(Backend):
        assert tmg.use_transforms() == "scipy"
        y = A @ np.ones(700)
    assert seen
    assert_allclose(y, A @ np.ones(700), rtol=1e-13)


@needs_mkl
@pytest.mark.parametrize("dtype", ["f", "d", "F", "D"])
@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_operators_continue_what_others_have_begun(shape, dtype):
    """One that is made with the transforms of one library multiplies with those of another."""
    c = exponential(*shape).astype(dtype.lower())
    if dtype in "FD" and len(shape) == 1:
        c = (c * np.exp(0.3j * np.arange(len(c)))).astype(dtype)
    x = seeded(c.size).astype(dtype)
    operators, products = [], []
    for name in ("mkl", "scipy"):
        with tmg.use_transforms(name):
            operators.append(tmg.ToeplitzOperator(c))
            operators.append(pickle.loads(pickle.dumps(operators[-1])))
    for name in ("mkl", "scipy"):
        with tmg.use_transforms(name):
            products += [A @ x for A in operators]
    atol = 50 * np.finfo(dtype).eps * np.linalg.norm(products[0])
    for y in products:
        assert y.dtype == x.dtype
        assert_allclose(y, products[0], rtol=0, atol=atol)


@needs_mkl
@pytest.mark.parametrize("dtype", ["f", "d"])
@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_bits_depend_on_neither_memory_nor_batch_nor_threads(shape, dtype):
    A = tmg.ToeplitzOperator(exponential(*shape).astype(dtype))
    M, x = tmg.chan_preconditioner(A), seeded(A.shape[0]).astype(dtype)
    for B in (A, M):
        y = B @ x
        for offset in (1, 2, 3):
            moved = np.empty(x.size + offset, dtype)[offset:]
            moved[...] = x
            assert np.array_equal(B.apply(moved, out=moved), y)
        for rows in (2, 3, 9):
            assert all(np.array_equal(z, y) for z in B.apply(np.tile(x, (rows, 1))))
        with scipy.fft.set_workers(2):
            assert np.array_equal(B @ x, y)


@needs_mkl
def test_several_threads_multiply_at_once():
    A = tmg.ToeplitzOperator(exponential(5000))
    X = seeded(8, 5000)
    found, expected = np.empty_like(X), [A @ x for x in X]

    def work(k):
        for _ in range(50):
            found[k] = A @ X[k]

    threads = [threading.Thread(target=work, args=(k,)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert np.array_equal(found, expected)
