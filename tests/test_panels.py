"""Transforms in four steps, of few panels and blocks or of many, against their definition."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from toeplitz_mg.engine import fourstep
from toeplitz_mg.engine.fourstep import FourStep
from toeplitz_mg.engine.panels import Panels

# Rows and columns, width of a panel and height of a block; even and odd, whole blocks or not.
PLANS = [(6, 8, 3, 4), (8, 6, 8, 8), (8, 5, 2, 3), (7, 9, 4, 2), (2, 7, 7, 1), (90, 6, 4, 1)]


def plan(rows, columns, width, height):
    return Panels(FourStep(rows, columns, np.complex128, width=width, height=height))


def fourier(length, shift):
    """The matrix of the transform at the frequencies k + s."""
    k = np.arange(length)
    return np.exp(-2j * np.pi * np.outer(k + shift, k) / length)


def close(x, y):
    assert_allclose(x, y, rtol=0, atol=1e-10)


@pytest.mark.parametrize("sizes", PLANS)
@pytest.mark.parametrize("shift", [0.0, 0.25, 0.5, -0.5])
def test_a_spectrum_is_the_transform_and_its_parts_are_the_vector(sizes, shift):
    panels = plan(*sizes)
    x, y = np.random.default_rng(0).standard_normal((2, panels.length))
    F = fourier(panels.length, shift)
    spectrum = panels.spectrum(x, y, shift).copy()
    close(panels.in_order(spectrum), F @ (x + 1j * y))
    for part, expected in zip(panels.parts(spectrum, shift), (x, y), strict=True):
        close(part, expected)
    close(panels.in_order(panels.spectrum(x, None, shift)), F @ x)


@pytest.mark.parametrize("sizes", [sizes for sizes in PLANS if sizes[0] * sizes[1] % 2 == 0])
def test_sums_are_those_of_cosines_and_sines(sizes):
    panels = plan(*sizes)
    L = panels.length
    a, angles = np.random.default_rng(0).standard_normal(L + 1), np.arange(L + 1) * np.pi / L
    angles = np.outer(np.arange(L + 1), angles)
    twice = np.where(np.arange(L + 1) % L == 0, 1.0, 2.0)
    close(panels.cosine_sums(a), np.cos(angles) @ (twice * a))
    a[[0, -1]] = 0.0
    close(panels.sine_sums(a), 2.0 * np.sin(angles) @ a)


@pytest.mark.parametrize("sizes", PLANS)
@pytest.mark.parametrize("is_complex", [False, True])
@pytest.mark.parametrize("shifts", [(0.0,), (0.5, 0.0), (0.25, 0.5, 0.0), (0.5, 0.25, -0.5, 0.0)])
def test_products_in_turn_are_those_of_the_matrices(sizes, is_complex, shifts):
    panels = plan(*sizes)
    L, rng = panels.length, np.random.default_rng(0)
    x, factors, expected = rng.standard_normal((2, L)), [], None
    if is_complex:
        x = x + 1j * rng.standard_normal((2, L))
    expected = x
    for shift in shifts:
        first = rng.standard_normal((2, L)) / np.sqrt(L)
        F = fourier(L, shift)
        expected = (F.conj().T @ ((F @ (first[0] + 1j * first[1]))[:, None] * (F @ expected.T))).T
        expected = expected / L
        factors.append((shift, panels.eigenvalues(panels.spectrum(*first, shift))))
    out = np.empty_like(x)
    panels.multiply_in_turn(x, factors, out)
    close(out, expected if is_complex else expected.real)


@pytest.mark.parametrize("sizes", PLANS)
@pytest.mark.parametrize("missing", [0, 1, 6, 13])
def test_products_with_vectors_that_are_shorter(sizes, missing):
    """They are extended by zeros, and what comes out is cut."""
    panels = plan(*sizes)
    L, rng = panels.length, np.random.default_rng(0)
    n, first = L - missing, rng.standard_normal((3, L))
    if n < 1:
        return
    matrices, eigenvalues = [], []
    for shift, column in zip((0.25, 0.0, 0.5), first, strict=True):
        F = fourier(L, shift)
        matrices.append((F.conj().T @ ((F @ column)[:, None] * F) / L)[:n, :n])
        eigenvalues.append(panels.eigenvalues(panels.spectrum(column, None, shift)))
    x, y = rng.standard_normal((2, 2, n))
    out = np.empty_like(x)
    panels.multiply_real(x, eigenvalues[0], out)
    close(out, (x @ matrices[0].T).real)
    z, out = x + 1j * y, np.empty((2, n), np.complex128)
    panels.multiply_complex(z, tuple(eigenvalues[1:]), out)
    close(out, z @ (matrices[1] + matrices[2]).T)


def test_the_rounding_does_not_grow_with_the_number_of_blocks():
    """Factors that are made one from the other are made anew before they have lost a digit."""
    rows = 2**14
    long = FourStep(rows, 4, np.complex128, width=4, height=1)
    errors = [
        np.abs(
            twiddles
            - np.exp(-2j * np.pi * (np.arange(4) * (part.start + 0.25) % (4 * rows)) / (4 * rows))
        ).max()
        for part, twiddles in long._blocks(range(rows), 0.25)
    ]
    assert max(errors) <= (fourstep.ANCHOR + 8) * np.finfo(float).eps
    assert fourstep.ANCHOR <= 256


@pytest.mark.parametrize("start", [1, fourstep.ANCHOR - 1, fourstep.ANCHOR, fourstep.ANCHOR + 7])
def test_a_block_has_the_same_bits_whichever_is_the_first_of_a_thread(start):
    whole = FourStep(90, 6, np.complex128, width=4, height=1)
    expected = [twiddles.copy() for _, twiddles in whole._blocks(range(90), 0.25)]
    found = [twiddles.copy() for _, twiddles in whole._blocks(range(start, 90), 0.25)]
    assert np.array_equal(found, expected[start:])
