"""The libraries whose arrays are tested: array-api-strict, JAX, and those of a GPU where one is."""

from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec

import numpy as np
import pytest


def has_gpu(name):
    """Whether there is a GPU for a library that is used on one."""
    if find_spec(name) is None:
        return False
    with suppress(Exception):  # CuPy raises errors of its own where CUDA is not there.
        library = import_module(name)
        if name == "torch":
            return library.cuda.is_available()
        return library.cuda.runtime.getDeviceCount() > 0
    return False


ON_GPU = [pytest.param(name, marks=pytest.mark.slow) for name in ("cupy", "torch") if has_gpu(name)]
LIBRARIES = ["array_api_strict", pytest.param("jax.numpy", marks=pytest.mark.slow), *ON_GPU]


def to_numpy(array):
    """Return an array of NumPy's with the numbers of one of another library."""
    assert not isinstance(array, np.ndarray)
    if hasattr(array, "get"):  # of CuPy
        return array.get()
    return np.from_dlpack(array.cpu() if hasattr(array, "cpu") else array)


def record_numbers(monkeypatch, array):
    """Return the shapes of all arrays of a class that are taken to the host as a number.

    That is by `float`, `bool` and the like alone: array-api-strict has no other way then.
    """
    looked = []
    for name in ("__float__", "__bool__", "__int__", "__index__", "__complex__"):
        method = getattr(array, name)
        monkeypatch.setattr(array, name, lambda x, m=method: looked.append(x.shape) or m(x))
    for name in ("__array__", "__buffer__"):
        monkeypatch.delattr(array, name, raising=False)
    return looked


def load_library(name):
    """Return a library, which makes arrays in double precision, on a GPU if it has one."""
    if name == "jax.numpy":
        pytest.importorskip("jax").config.update("jax_enable_x64", True)
    library = pytest.importorskip(name)
    if name == "torch":
        library.set_default_device("cuda")
    return library
