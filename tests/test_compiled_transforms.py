"""Transforms that SciPy has compiled, or its public functions where these have changed."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import fft

from toeplitz_mg.solvers import compiled_transforms as module
from toeplitz_mg.solvers.compiled_transforms import PUBLIC, transforms


@pytest.fixture
def forget():
    """Have the transforms looked for anew, in the test and after it."""
    transforms.cache_clear()
    yield
    transforms.cache_clear()


def changed(kind):
    """Return what the private module may have become."""

    class Module:
        def dct(self, X, *arguments):
            return X if kind == "another result" else X[()]["no such transform"]

        dst = r2c = c2r = dct

    return object() if kind == "another name" else Module()


@pytest.mark.parametrize("kind", ["another name", "another result", "another signature"])
def test_whatever_scipy_has_the_public_functions_are_there(kind, monkeypatch, forget):
    monkeypatch.setattr(module, "import_module", lambda name: changed(kind))
    assert transforms() is PUBLIC


@pytest.mark.parametrize("found", [transforms(), PUBLIC])
@pytest.mark.parametrize("shape", [(9,), (3, 8), (2, 1021)])
def test_the_transforms_are_those_of_their_names(found, shape):
    X = np.random.default_rng(3).standard_normal(shape)
    m, out = shape[-1], np.empty(shape)
    for of_rows, public in ((found.dct, fft.dct), (found.dst, fft.dst)):
        for kind in (2, 3):
            of_rows(X, out, kind)
            assert_allclose(out, public(X, kind, norm="ortho"), atol=1e-12)
        Y = X.copy()
        of_rows(Y, Y, 2)
        of_rows(Y, Y, 3)
        assert_allclose(Y, X, atol=1e-12)
    assert_allclose(found.rfft(X), fft.rfft(X), atol=1e-11)
    assert_allclose(found.irfft(found.rfft(X), m), X, atol=1e-12)
