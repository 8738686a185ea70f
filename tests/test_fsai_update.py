"""Theorems of the sparse approximate inverse of an area that has changed."""

import pickle
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import eigh

import toeplitz_mg as tmg
from tests.cases import contact
from tests.test_fsai import areas, direct_below, half_space, iterations, matern, operator
from toeplitz_mg.preconditioners.fsai import aggregates as fsai_aggregates
from toeplitz_mg.preconditioners.fsai import build as fsai_levels
from toeplitz_mg.preconditioners.fsai import update as fsai_update
from toeplitz_mg.preconditioners.fsai.build import rows_of_G
from toeplitz_mg.preconditioners.fsai.levels import Patched
from toeplitz_mg.preconditioners.fsai.preconditioner import fsai_preconditioner
from toeplitz_mg.preconditioners.fsai.stencil import block_loads


@contextmanager
def kept(part):
    """Loads that differ by this part of them are left as they were."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fsai_update, "KEPT", part)
        yield


@settings(deadline=None, max_examples=40)
@given(
    st.sampled_from([(300,), (21, 26)]),
    st.floats(0.0, 1.0),
    st.floats(0.0, 0.3),
    st.integers(0, 999),
)
def test_an_update_that_keeps_nothing_is_what_a_new_one_is(shape, density, change, seed):
    rng = np.random.default_rng(seed)
    mask, flipped = rng.random(shape) < density, rng.random(shape) < change
    mask.flat[0] = True
    other = mask ^ flipped
    other.flat[1] = True
    full = tmg.ToeplitzOperator(contact(*shape))
    with direct_below(4), kept(0.0):
        first = fsai_preconditioner(tmg.MaskedOperator(full, mask))
        before = first @ np.eye(first.shape[0])
        updated = first.updated(other)
        fresh = fsai_preconditioner(tmg.MaskedOperator(full, other))
        back = updated.updated(mask)
    assert updated.sizes == fresh.sizes
    expected = fresh @ np.eye(fresh.shape[0])
    scale = abs(before).max()
    assert_allclose(updated @ np.eye(fresh.shape[0]), expected, atol=1e-12 * scale)
    assert_array_equal(updated.mask, other)
    assert_allclose(back @ np.eye(first.shape[0]), before, atol=1e-12 * scale)
    assert_array_equal(first @ np.eye(first.shape[0]), before)  # it has not changed


@settings(deadline=None, max_examples=20)
@given(
    st.sampled_from([(500,), (70, 20), (20, 70), (300, 1), (2, 250)]),
    st.floats(0.3, 1.0),
    st.integers(1, 8),
    st.integers(0, 999),
)
def test_updates_one_after_the_other_are_what_a_new_one_is(shape, density, size, seed):
    """Each in one place, large or small, at a border or not."""
    rng = np.random.default_rng(seed)
    mask = rng.random(shape) < density
    mask.flat[0] = True
    full = tmg.ToeplitzOperator(contact(*shape))
    with direct_below(4), kept(0.0):
        P = fsai_preconditioner(tmg.MaskedOperator(full, mask))
        table = P._stencil
        for _ in range(3):
            corner = [rng.integers(n) for n in shape]
            patch = tuple(slice(k, k + size) for k in corner)
            mask = mask.copy()
            mask[patch] = rng.random(mask[patch].shape) < rng.choice([0.0, 0.5, 1.0])
            mask.flat[0] = True
            P = P.updated(mask)
            assert P._stencil is table
            fresh = fsai_preconditioner(tmg.MaskedOperator(full, mask))
            assert P.sizes == fresh.sizes
            expected = fresh @ np.eye(fresh.shape[0])
            assert_allclose(P @ np.eye(P.shape[0]), expected, atol=1e-12 * abs(expected).max())


@settings(deadline=None, max_examples=40)
@given(
    st.sampled_from([(300,), (21, 26)]),
    st.floats(0.0, 1.0),
    st.floats(0.0, 0.1),
    st.integers(0, 999),
)
def test_an_update_is_nearly_what_a_new_one_is(shape, density, change, seed):
    """And positive definite, with loads kept on every level."""
    rng = np.random.default_rng(seed)
    mask = rng.random(shape) < density
    mask.flat[:3] = True
    full = tmg.ToeplitzOperator(contact(*shape))
    with direct_below(4):
        P = fsai_preconditioner(tmg.MaskedOperator(full, mask))
        for _ in range(3):
            mask = mask ^ (rng.random(shape) < change)
            mask.flat[:3] = True
            P = P.updated(mask)
        fresh = fsai_preconditioner(tmg.MaskedOperator(full, mask))
    updated, new = (Q @ np.eye(Q.shape[0]) for Q in (P, fresh))
    assert_allclose(updated, updated.T, rtol=0, atol=1e-13 * abs(updated).max())
    ratios = eigh(updated, new, eigvals_only=True)
    assert ratios[0] > 0.6
    assert ratios[-1] < 1.6


@pytest.mark.parametrize(
    "area", ["rough 5 %", "rough 60 %", "random 50 %", "checkerboard", "circle"]
)
def test_an_update_takes_the_iterations_of_a_new_one(area):
    """At most one more, after five updates too."""
    n = 128
    full, mask = half_space(n), areas(n)[area]
    P, rng = fsai_preconditioner(operator(full, mask)), np.random.default_rng(0)
    for _ in range(5):
        mask = mask ^ (rng.random(mask.shape) < 0.01)
        P = P.updated(mask)
        A = operator(full, mask)
        b = rng.standard_normal(A.shape[0])
        assert iterations(A, P, b) <= iterations(A, fsai_preconditioner(A), b) + 1


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_an_updated_operator_is_one_like_the_others(dtype):
    n = 64
    full, mask = half_space(n), areas(n)["random 50 %"]
    new = mask.copy()
    new[20:24, 30:36] ^= True
    P = fsai_preconditioner(operator(full, mask), dtype=dtype).updated(new)
    assert P.dtype == dtype
    X = np.random.default_rng(0).standard_normal((P.shape[0], 3)).astype(dtype)
    columns = np.stack([P @ x for x in X.T], axis=1)
    assert columns.dtype == dtype
    assert_allclose(P @ X, columns, rtol=0, atol=1e-5 * abs(columns).max())
    x = X[:, 0].copy()
    assert P.apply(x, x) is x
    assert_array_equal(x, columns[:, 0])
    assert_array_equal(pickle.loads(pickle.dumps(P)) @ X[:, 0], columns[:, 0])


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@example((40, 50), 0.09375, 3, 1)  # a load that is the same, and a diagonal that is not
@given(
    st.sampled_from([(2000,), (40, 50)]),
    st.floats(0.005, 0.1),
    st.integers(1, 4),
    st.integers(0, 999),
)
def test_islands_appear_and_vanish(shape, density, count, seed):
    """Whole aggregates, with none beside them."""
    rng = np.random.default_rng(seed)
    mask = rng.random(shape) < density
    mask.flat[:8] = True
    full = tmg.ToeplitzOperator(contact(*shape))
    with direct_below(4), kept(0.0):
        P = fsai_preconditioner(tmg.MaskedOperator(full, mask))
        for _ in range(4):
            mask = mask.copy()
            mask.flat[rng.integers(3, mask.size, 2 * count)] = True
            mask.flat[rng.choice(np.flatnonzero(mask)[3:], count)] = False
            P = P.updated(mask)
            A = tmg.MaskedOperator(full, mask)
            fresh = fsai_preconditioner(A)
            x = rng.standard_normal(A.shape[0])
            assert_allclose(P @ x, fresh @ x, rtol=0, atol=1e-11 * abs(fresh @ x).max())


def test_an_island_vanishes_that_nothing_sees():
    n = 416
    full, (i, j) = half_space(n), np.indices((n, n))
    mask = (i % 16 < 4) & (j % 16 < 4)  # 676 aggregates
    P = fsai_preconditioner(operator(full, mask))
    mask[32:36, 48:52] = False
    A = operator(full, mask)
    b = np.ones(A.shape[0])
    assert iterations(A, P.updated(mask), b) == iterations(A, fsai_preconditioner(A), b)


def test_an_updated_operator_in_threads():
    n = 128
    full, mask = half_space(n), areas(n)["rough 30 %"]
    new = mask.copy()
    new[40:44, 50:60] ^= True
    P = fsai_preconditioner(operator(full, mask)).updated(new)
    X = np.random.default_rng(0).standard_normal((16, P.shape[0]))
    expected = [P @ x for x in X]
    with ThreadPoolExecutor(4) as pool:
        assert_array_equal(list(pool.map(lambda x: P @ x, X)), expected)


@pytest.mark.parametrize(("nu", "length"), [(0.5, 4.0), (1.5, 2.5)])
def test_updates_with_more_neighbours_are_what_a_new_one_is(nu, length):
    """Of 24 and of 40, which have no table of rows."""
    n, rng = 48, np.random.default_rng(0)
    full, mask = matern(n, nu, length), rng.random((n, n)) < 0.6
    with direct_below(20), kept(0.0):
        P = fsai_preconditioner(operator(full, mask))
        for k in range(6):
            mask = mask.copy()
            mask[7 * k : 7 * k + 4, 20:25] = k % 3 == 0
            P = P.updated(mask)
            assert isinstance(P._level, Patched)
            fresh = fsai_preconditioner(operator(full, mask))
            x = rng.standard_normal(P.shape[0])
            assert_allclose(P @ x, fresh @ x, rtol=0, atol=1e-11 * abs(fresh @ x).max())


@pytest.mark.parametrize("full", [half_space(64), matern(64, 0.5, 4.0)], ids=["table", "none"])
def test_a_chain_of_updates_does_not_grow(full):
    """Of what has gone, or has been computed again, only a part is kept."""
    rng = np.random.default_rng(0)
    mask = rng.random((64, 64)) < 0.5
    with direct_below(20):
        P = fsai_preconditioner(operator(full, mask))
        patched = 0
        for _ in range(60):
            mask = mask.copy()
            mask[20:28, 20:28] = rng.random((8, 8)) < 0.5
            P = P.updated(mask)
            level = P._level
            patched += isinstance(level, Patched)
            while isinstance(level, Patched):
                most = 1.4 * level.cells.count
                assert level.length <= most
                assert len(level.lines) <= most
                assert level.cells.finest or level.rows.rows.shape[1] <= most
                level = level.coarse
    assert patched > 50


def test_an_area_of_which_little_is_left_costs_little():
    P = fsai_preconditioner(tmg.ToeplitzOperator(half_space(128)))
    mask = np.zeros((128, 128), bool)
    mask[:50, :50] = True
    fresh = fsai_preconditioner(operator(half_space(128), mask))
    assert P.updated(mask).points <= 1.5 * fresh.points


@pytest.fixture
def solved(monkeypatch):
    """The number of small systems that are solved, and of blocks whose loads are computed."""
    numbers = Counter()

    def counting_rows(near, c, d):
        numbers["systems"] += c.shape[1]
        return rows_of_G(near, c, d)

    def counting_loads(grid, rows, index, w):
        numbers["blocks"] += w.shape[1]
        return block_loads(grid, rows, index, w)

    monkeypatch.setattr(fsai_levels, "rows_of_G", counting_rows)
    monkeypatch.setattr(fsai_aggregates, "block_loads", counting_loads)
    return numbers


def test_an_update_solves_no_system_again_that_has_not_changed(solved):
    n = 256
    mask = areas(n)["circle"]
    P = fsai_preconditioner(operator(half_space(n), mask))
    first = dict(solved)
    solved.clear()
    mask = mask.copy()
    mask[100:126, 100:126] = False  # 1 % of the cells
    P.updated(mask)
    assert solved["systems"] <= 0.1 * first["systems"]
    solved.clear()
    P.updated(P.mask)
    assert not solved


def test_an_update_costs_in_proportion_to_what_has_changed(solved):
    n = 256
    mask = areas(n)["random 50 %"]
    P = fsai_preconditioner(operator(half_space(n), mask))
    first = dict(solved)
    for size, share in ((4, 0.03), (16, 0.06), (64, 0.25)):  # of 256 squared
        solved.clear()
        changed = mask.copy()
        changed[100 : 100 + size, 100 : 100 + size] ^= True
        P.updated(changed)
        assert 0 < solved["systems"] <= share * first["systems"]
        assert 0 < solved["blocks"] <= share * first["blocks"]


def test_each_of_a_chain_of_updates_costs_what_the_first_does(solved):
    """Whatever has changed before it, as only what it changes is computed."""
    n = 256
    mask, rng = areas(n)["random 50 %"], np.random.default_rng(0)
    P = fsai_preconditioner(operator(half_space(n), mask))
    systems = []
    for k in range(8):
        mask = mask.copy()
        mask[16 * k : 16 * k + 16, 100:116] ^= rng.random((16, 16)) < 0.5
        solved.clear()
        P = P.updated(mask)
        assert isinstance(P._level, Patched)
        systems.append(solved["systems"])
    assert max(systems) <= 1.5 * np.median(systems)


def test_an_update_back_to_the_first_mask_is_the_first():
    n = 128
    full, mask = half_space(n), areas(n)["random 50 %"]
    P = fsai_preconditioner(operator(full, mask))
    Q = P
    for k in range(3):
        other = mask.copy()
        other[40 : 50 + k, 20:30] ^= True
        Q = Q.updated(other)
    assert Q.updated(mask)._level is P._level


def test_updates_check_the_mask():
    P = fsai_preconditioner(tmg.ToeplitzOperator(contact(8, 8)))
    with pytest.raises(ValueError, match=r"mask has shape \(8,\)"):
        P.updated(np.ones(8, bool))
    with pytest.raises(ValueError, match="nowhere true"):
        P.updated(np.zeros((8, 8), bool))
    with pytest.raises(TypeError, match="must be of booleans"):
        P.updated(np.ones((8, 8)))
