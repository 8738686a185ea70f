"""The sparse approximate inverse of two coupled components makes up for their coupling.

It is nearer to the inverse than those of the components, which are what a weak coupling is left to.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import toeplitz_mg as tmg
from tests.budgets import assert_within_budget
from tests.test_fsai import (
    AREAS,
    ASPECTS,
    DENSITIES,
    SEEDS,
    both_iterations,
    half_space,
    some_cells,
    spectrum,
    tangential,
)
from toeplitz_mg import fsai_preconditioner

by_component = tmg.componentwise(fsai_preconditioner)


# Positive definite, and near the inverse -------------------------------------------------------


@pytest.mark.slow
@settings(deadline=None, max_examples=12)
@given(
    DENSITIES,
    ASPECTS.filter(lambda aspect: 0.0 < aspect < 10.0),
    st.floats(0.2, 5.0),
    st.floats(0.36, 0.5),
    SEEDS,
)
def test_half_space_matrices_are_never_refused(density, aspect, ratio, nu, seed):
    """Any grid, and masks of each component."""
    mask = some_cells(density, aspect, seed, components=2)
    A = tmg.MaskedOperator(tangential(mask.shape[1:], nu, ratio), mask)
    eigenvalues = spectrum(A, fsai_preconditioner(A))
    assert eigenvalues[0] > 0.1
    assert eigenvalues[-1] < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(("area", "n"), [("full", 26), ("random, 50 %", 37)])
def test_its_eigenvalues_are_nearer_to_one_than_those_by_component(area, n, dtype):
    A = tmg.MaskedOperator(tangential((n, n)), AREAS[area](n))
    P = fsai_preconditioner(tmg.MaskedOperator(tangential((n, n), dtype=dtype), A.mask))
    assert P.dtype == dtype
    dense = P @ np.eye(A.shape[0])
    dense = (dense + dense.T) / 2.0
    assert np.linalg.eigvalsh(dense)[0] > 0.0
    half = np.linalg.cholesky(A.toarray())
    new, old = np.linalg.eigvalsh(half.T @ dense @ half), spectrum(A, by_component(A))
    assert new[-1] / new[0] < 0.9 * old[-1] / old[0]
    assert new[-1] / new[0] < 2.0


# Iterations -----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1.0, 4.0, 0.25])
@pytest.mark.parametrize("nu", [0.0, 0.28, 0.4, 0.5])
@pytest.mark.parametrize(
    "area",
    ["full", "circle", "rough, 30 %", "random, 50 %", "stripes", "stripes across", "checkerboard"],
)
def test_iterations_do_not_depend_on_the_area_or_the_material(area, nu, ratio):
    A = tmg.MaskedOperator(tangential((128, 128), nu, ratio), AREAS[area](128))
    count = max(both_iterations(A))
    assert_within_budget("FSAI of coupled components, any area", iterations=count)


@pytest.mark.parametrize(
    "shape", [pytest.param((256, 256), marks=pytest.mark.slow), (211, 97), (400, 30)], ids=str
)
@pytest.mark.parametrize("density", [0.5, 1.0])
def test_iterations_do_not_depend_on_the_grid(shape, density):
    mask = np.random.default_rng(0).random(shape) < density
    A = tmg.MaskedOperator(tangential(shape), mask)
    found, of_each = both_iterations(A), both_iterations(A, by_component(A))
    assert_within_budget("FSAI of coupled components, any grid", iterations=max(found))
    assert found[0] < of_each[0]
    assert found[1] < of_each[1]


# Which, and what fails -------------------------------------------------------------------------


def is_joint(P):
    """Whether what acts in one component is seen in the other."""
    x = np.random.default_rng(0).standard_normal(P.shape[0])
    x[len(x) // 2 :] = 0.0
    return bool((P @ x)[len(x) // 2 :].any())


def test_a_weak_coupling_or_one_of_another_kind_is_left_out():
    assert is_joint(fsai_preconditioner(tangential((12, 12), 0.4)))
    assert not is_joint(fsai_preconditioner(tangential((12, 12), 0.25)))
    xx = tmg.ToeplitzOperator(half_space(12))
    even = tmg.ToeplitzOperator(0.3 * half_space(12))
    for others in (None, even):
        A = tmg.CoupledOperator([[xx, others], [others, xx]])
        assert not is_joint(fsai_preconditioner(A))
    assert not is_joint(fsai_preconditioner(tangential((1, 12))))


def coupled_by(share, c, between=None):
    """Two components of the lags c, with a coupling that is odd in both axes, so large a share."""
    k = np.sign(np.arange(len(c)) - len(c) // 2)
    odd = np.outer(k, k) * share * (c if between is None else between)
    own, other = (tmg.ToeplitzOperator.from_lags(lags) for lags in (c, odd))
    return tmg.CoupledOperator([[own, other], [other, own]])


def test_a_coupling_of_another_size_is_left_out():
    """Stronger than any of a half-space, or of components that need more neighbours."""
    A = tangential((40, 40))
    (xx, xy), (_, yy) = A.blocks
    strong = tmg.ToeplitzOperator.from_lags(1.5 * xy.lags)
    A = tmg.CoupledOperator([[xx, strong], [strong, yy]])
    assert not is_joint(fsai_preconditioner(A))
    r = np.hypot(*np.ogrid[-39:40, -39:40]) / 1.2
    A = coupled_by(0.25, (1.0 + r) * np.exp(-r), np.exp(-r))
    assert not is_joint(fsai_preconditioner(A))


def test_a_component_that_is_refused_by_itself_is_so_with_another():
    r = np.hypot(*np.ogrid[-39:40, -39:40]) / 30
    for c in (np.exp(-(r**2)), np.exp(-r)):
        with pytest.raises(np.linalg.LinAlgError, match=r"be positive|too smooth"):
            fsai_preconditioner(coupled_by(0.3, c))
