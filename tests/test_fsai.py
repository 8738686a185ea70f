"""The sparse approximate inverse is positive definite, and as good on any area, or is refused."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import toeplitz_mg as tmg
from comparisons.systems import masks
from tests.budgets import assert_within_budget
from tests.cases import contact, exponential
from tests.systems import count_iterations, preconditioners, refuses
from toeplitz_mg import fsai_preconditioner
from toeplitz_mg.halfspace import (
    Material,
    influence_matrix,
    influence_xx,
    influence_yy,
    influence_zz,
    offsets,
)
from toeplitz_mg.paper.problems import test3

slow = pytest.mark.slow
MANY = 650  # Unknowns of which not all are solved for directly.


def half_space(n, ratio=1.0, kernel=influence_zz, nu=0.28):
    element = (2 / n, 2 / n * ratio)
    return kernel(*offsets((n, n), element), element, G=1.0, nu=nu)


def tangential(shape, nu=0.5, ratio=1.0, dtype=np.float64):
    """The matrix of tangential tractions, of two components."""
    return influence_matrix("xy", shape, (1.0, ratio), Material.from_shear(1.0, nu)).astype(dtype)


AREAS = masks.FRAGMENTED | {
    "random, 5 %": partial(masks.random, 0.05),
    "stripes across": lambda n: masks.FRAGMENTED["stripes"](n).T,
    "diagonal": lambda n: np.eye(n, dtype=bool),
}


def operator(c, mask):
    return tmg.MaskedOperator(tmg.ToeplitzOperator(c), mask)


def iterations(A, P, b):
    return count_iterations(tmg.cg, A, b, M=P, maxiter=100)


def both_iterations(A, P=None):
    """For a constant and for a random right-hand side."""
    P = P or fsai_preconditioner(A)
    n = A.shape[0]
    return (
        iterations(A, P, np.ones(n)),
        iterations(A, P, np.random.default_rng(0).standard_normal(n)),
    )


# Positive definite, or refused ----------------------------------------------------------------


def spectrum(A, P):
    """The eigenvalues of P A, for a symmetric P."""
    dense = P @ np.eye(A.shape[0])
    assert_allclose(dense, dense.T, rtol=0, atol=1e-12 * abs(dense).max())
    half = np.linalg.cholesky(A.toarray())
    return np.linalg.eigvalsh(half.T @ dense @ half)


def some_cells(density, aspect, seed, components=1):
    """A mask with as many unknowns as `MANY`, some for each component."""
    cells = MANY / density / components
    n = max(1, round((cells * aspect) ** 0.5))
    shape = components, n, int(np.ceil(cells / n))
    mask = np.zeros(shape, bool)
    mask.flat[np.random.default_rng(seed).permutation(mask.size)[:MANY]] = True
    return mask


DENSITIES, ASPECTS = st.floats(0.05, 1.0), st.sampled_from([0.0, 0.01, 0.2, 1.0, 3.0, 700.0])
SEEDS = st.integers(0, 999)


@settings(deadline=None, max_examples=12)
@given(DENSITIES, ASPECTS, st.floats(0.2, 5.0), SEEDS)
def test_half_space_matrices_are_never_refused(density, aspect, ratio, seed):
    """Any grid and mask: positive definite, and near the inverse."""
    (mask,) = some_cells(density, aspect, seed)
    element = (1.0, ratio)
    A = operator(influence_zz(*offsets(mask.shape, element), element, G=1.0, nu=0.28), mask)
    eigenvalues = spectrum(A, fsai_preconditioner(A))
    assert eigenvalues[0] > 0.1
    assert eigenvalues[-1] < 3.0


@settings(deadline=None, max_examples=12)
@given(DENSITIES, ASPECTS, st.floats(0.1, 50.0), st.floats(0.3, 2.0), st.booleans(), SEEDS)
def test_what_is_built_is_positive_definite_or_refused(
    density, aspect, length, power, is_given, seed
):
    """Covariances of any smoothness; those of a power above 1 become too smooth for it."""
    (mask,) = some_cells(density, aspect, seed)
    r = np.sqrt(sum(k.astype(float) ** 2 for k in np.indices(mask.shape)))
    A = operator(np.exp(-((r / length) ** power)), mask)
    try:
        P = fsai_preconditioner(A, neighbours=12 if is_given else None) @ np.eye(MANY)
    except np.linalg.LinAlgError:
        return
    assert np.linalg.eigvalsh((P + P.T) / 2)[0] > 0.0


def test_what_it_is_not_for_and_what_to_use_instead():
    k = np.arange(2000.0)
    with pytest.raises(np.linalg.LinAlgError, match=r"-.* must be positive.*use spectral_precond"):
        fsai_preconditioner(tmg.ToeplitzOperator(np.exp(-((k / 30) ** 2))))
    r = np.hypot(*np.ogrid[:40, :40]) / 30
    for c in (np.exp(-(r**2)), np.cos(9 * r), -np.exp(-r)):
        with pytest.raises(np.linalg.LinAlgError, match=r"must be positive.*use chan_precond"):
            fsai_preconditioner(tmg.ToeplitzOperator(c))
    with pytest.raises(ValueError, match=r"3 x 4 x 5.* must have one axis or two"):
        fsai_preconditioner(tmg.ToeplitzOperator(exponential(3, 4, 5)))
    c = np.zeros((3, 3))
    c[1, 1], c[0, 0], c[2, 2] = 4.0, 1.0, 1.0
    with pytest.raises(ValueError, match="must be symmetric along each axis"):
        fsai_preconditioner(tmg.ToeplitzOperator.from_lags(c))
    refuses(TypeError, "must be a ToeplitzOperator", fsai_preconditioner, np.eye(4))


# Iterations -----------------------------------------------------------------------------------


@pytest.mark.parametrize("area", AREAS)
@pytest.mark.parametrize("n", [128, pytest.param(256, marks=slow)])
def test_iterations_do_not_depend_on_the_area(n, area):
    found = both_iterations(operator(half_space(n), AREAS[area](n)))
    assert_within_budget("FSAI, any area", iterations=max(found))


@slow
@pytest.mark.parametrize("ratio", [1.0, 4.0, 0.25])
@pytest.mark.parametrize("nu", [0.0, 0.28, 0.5])
@pytest.mark.parametrize("kernel", [influence_zz, influence_xx, influence_yy])
def test_iterations_do_not_depend_on_the_kernel(kernel, nu, ratio):
    c = half_space(128, ratio, kernel, nu)
    for area in ("rough, 30 %", "random, 50 %", "stripes", "stripes across", "full"):
        found = both_iterations(operator(c, AREAS[area](128)))
        assert_within_budget("FSAI, any kernel of a half-space", iterations=max(found))


@pytest.mark.parametrize("shape", [(256, 64), (211, 97), (3, 2000), (1, 5000), (5000, 1)], ids=str)
def test_iterations_do_not_depend_on_the_grid(shape):
    mask = np.random.default_rng(0).random(shape) < 0.5
    found = both_iterations(operator(contact(*shape), mask))
    assert_within_budget("FSAI, any grid", iterations=max(found))


def test_iterations_on_a_line():
    n = 2**16
    problem = test3(n).A
    random = np.random.default_rng(1).random(n) < 0.5
    for mask in (problem.mask, masks.islands(625, n), random, np.ones(n, bool)):
        found = both_iterations(tmg.MaskedOperator(problem.full, mask))
        assert_within_budget("FSAI, any area of a line", iterations=max(found))


# An operator like the others ------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(40, 40), (3000,)], ids=str)
def test_float32(shape):
    mask = np.random.default_rng(0).random(shape) < 0.7
    A = operator(contact(*shape), mask)
    P, single = fsai_preconditioner(A), fsai_preconditioner(A, dtype=np.float32)
    b = np.random.default_rng(1).standard_normal(A.shape[0])
    expected = P @ b
    assert single.dtype == np.float32
    assert (single @ b.astype(np.float32)).dtype == np.float32
    assert (single @ b).dtype == np.float64
    assert_allclose(single @ b, expected, atol=1e-5 * abs(expected).max())
    assert iterations(A, single, b) <= iterations(A, P, b) + 1
    A32 = operator(contact(*shape).astype(np.float32), mask)
    assert fsai_preconditioner(A32).dtype == np.float32


def some_of(n, density):
    return np.random.default_rng(0).random((n, n)) < density


MATRICES = {  # The last is cut where threads share the work, with a last block that is not whole.
    "a mask": lambda scale=1.0: operator(scale * half_space(64), some_of(64, 0.7)),
    "components": lambda scale=1.0: tmg.MaskedOperator(
        tmg.CoupledOperator(
            [[scale * block for block in row] for row in tangential((40, 40)).blocks]
        ),
        some_of(40, 0.9),
    ),
    "a line": lambda scale=1.0: tmg.ToeplitzOperator(scale * contact(3 * 2**14 + 5)),
    "few unknowns": lambda scale=1.0: operator(scale * half_space(20), some_of(20, 0.7)),
}


@pytest.mark.parametrize("name", MATRICES)
def test_rows_columns_places_to_write_copies_and_threads(name):
    A = MATRICES[name]()
    P, X = fsai_preconditioner(A), np.random.default_rng(1).standard_normal((5, A.shape[0]))
    assert P.H is P
    assert P.T is P
    each = [P @ x for x in X]
    with ThreadPoolExecutor(4) as pool:
        assert_array_equal(list(pool.map(lambda x: P @ x, X)), each)
    assert_array_equal(pickle.loads(pickle.dumps(P)) @ X[0], each[0])
    near = {"rtol": 0, "atol": 1e-12 * np.abs(each).max()}
    assert_allclose(P @ X.T, np.transpose(each), **near)
    assert_allclose(P.apply(X), each, **near)
    x = X[0].copy()
    assert P.apply(x, x) is x
    assert_array_equal(x, each[0])
    assert P.apply(X, X) is X
    assert_allclose(X, each, **near)


@pytest.mark.parametrize("scale", [1e-290, 1e-250, 1e-160, 1e-30, 1e200])
@pytest.mark.parametrize("name", MATRICES)
def test_any_scale(name, scale):
    A, scaled = MATRICES[name](), MATRICES[name](scale)
    b = np.random.default_rng(0).standard_normal(A.shape[0])
    expected = fsai_preconditioner(A) @ b
    y = scale * (fsai_preconditioner(scaled) @ b)
    assert_allclose(y, expected, rtol=0, atol=1e-10 * abs(expected).max())


def work_units(A, unknowns):
    with tmg.count_products() as work:
        A @ np.ones(A.shape[0])
    assert work.products == 1
    return work.units(unknowns)


def test_its_representation_and_its_work():
    A, n = operator(half_space(128), AREAS["full"](128)), 128**2
    P = fsai_preconditioner(A)
    assert "16384 > 1024 > 64 (direct) of a grid of 128 x 128" in repr(P)
    assert 0.0 < work_units(P, n) < 0.3 * work_units(A, n)
    both = fsai_preconditioner(tangential((128, 128)))
    assert work_units(both, n) < 3.0 * work_units(P, n)


# Kernels that do not decay as slowly as those of a half-space ---------------------------------


def refusal(A):
    """Return P and None, or None and why there is none."""
    try:
        return fsai_preconditioner(A), None
    except np.linalg.LinAlgError as error:
        return None, str(error)


def matern(shape, nu, length, nugget=0.0, ratio=1.0):
    k = np.indices(shape).T * ([1.0, ratio][: len(shape)])
    r = np.sqrt(2 * nu) * np.linalg.norm(k, axis=-1).T / length
    c = np.exp(-r) * {0.5: 1.0, 1.5: 1.0 + r, 2.5: 1.0 + r + r**2 / 3}[nu]
    c.flat[0] += nugget
    return c


def assert_few_iterations_or_refused(A, may_be_refused):
    """Assert that iterations are few, or that it is said that the kernel is too smooth."""
    P, why = refusal(A)
    if P:
        count = max(both_iterations(A, P))
        assert_within_budget("FSAI, covariances that it takes", iterations=count)
    else:
        assert may_be_refused
        assert "too smooth a kernel for it" in why
        if len(A.grid_shape) == 1:
            assert "use spectral_preconditioner(A), or on a mask sine_preconditioner" in why
        else:
            assert "on a mask sine_preconditioner(A)" in why


SMOOTH = {0.5: 5.0, 1.5: 3.0, 2.5: 2.0}  # Lengths that some number of neighbours is enough for.


@pytest.mark.parametrize("nugget", [0.0, pytest.param(0.01, marks=slow)])
@pytest.mark.parametrize(
    "length",
    [1.0, 2.0, *(pytest.param(length, marks=slow) for length in (3.0, 5.0, 8.0, 15.0)), 40.0],
)
@pytest.mark.parametrize("nu", [0.5, 1.5, 2.5])
def test_a_covariance_takes_few_iterations_or_is_refused(nu, length, nugget):
    c = matern((96, 96), nu, length, nugget)
    for area in ("random, 50 %", "rough, 30 %", "full"):
        assert_few_iterations_or_refused(operator(c, AREAS[area](96)), length > SMOOTH[nu])


@slow
@pytest.mark.parametrize("nugget", [0.0, 0.01, 0.1, 1.0])
@pytest.mark.parametrize("length", [2.0, 3.0, 4.0, 5.0, 8.0])
@pytest.mark.parametrize("nu", [0.5, 1.5, 2.5])
def test_a_covariance_takes_few_iterations_where_few_cells_are_in_contact(nu, length, nugget):
    c = matern((128, 128), nu, length, nugget)
    for density in (0.05, 0.1, 0.2):
        A = operator(c, np.random.default_rng(3).random((128, 128)) < density)
        assert_few_iterations_or_refused(A, length > SMOOTH[nu])


@pytest.mark.parametrize("ratio", [3.0, pytest.param(10.0, marks=slow)])
@pytest.mark.parametrize("length", [2.0, pytest.param(5.0, marks=slow), 10.0])
def test_a_covariance_takes_few_iterations_on_long_cells(length, ratio):
    for nu in (0.5, 1.5):
        c = matern((128, 128), nu, length, ratio=ratio)
        for density in (0.1, 0.5):
            A = operator(c, np.random.default_rng(3).random((128, 128)) < density)
            assert_few_iterations_or_refused(A, length > 5.0)


@pytest.mark.parametrize("area", ["random, 50 %", "rough, 30 %", "full"])
def test_a_covariance_with_a_large_nugget_takes_few_iterations(area):
    """It shows in E only, whose blocks are not in full contact."""
    r = np.hypot(*np.ogrid[:96, :96])
    for c in (np.exp(-(r**2) / 8.0), matern((96, 96), 2.5, 3.0), 1.0 / (1.0 + (r / 5.0) ** 2) ** 2):
        c[0, 0] += 1.0
        count = max(both_iterations(operator(c, AREAS[area](96))))
        assert_within_budget("FSAI, covariances with a large nugget", iterations=count)


@pytest.mark.parametrize(
    "length", [10.0, *(pytest.param(k, marks=slow) for k in (5.0, 15.0, 20.0, 30.0, 60.0)), 200.0]
)
def test_a_covariance_on_pieces_of_a_line(length):
    n, rng = 2**13, np.random.default_rng(0)
    for nu in (0.5, 1.5, 2.5):
        c = matern((n,), nu, length)
        for mask in (rng.random(n) < 0.5, rng.random(n) < 0.1, masks.islands(n // 12, n)):
            assert_few_iterations_or_refused(operator(c, mask), length > 20.0)


@pytest.mark.parametrize("ratio", [100.0, 0.01, 150.0, 200.0, 1000.0, 1 / 150, 0.001])
def test_long_elements(ratio):
    """They take more neighbours, from 1:150 on, and not many more iterations."""
    A = operator(half_space(128, ratio), AREAS["rough, 30 %"](128))
    assert_within_budget("FSAI, very long elements", iterations=max(both_iterations(A)))


def test_more_neighbours_bring_p_nearer_to_the_inverse():
    mask = np.random.default_rng(0).random((40, 40)) < 0.5
    A = operator(matern((40, 40), 1.5, 3.0), mask)
    conditions = []
    for neighbours in (12, 24, 40, 71):
        eigenvalues = spectrum(A, fsai_preconditioner(A, neighbours=neighbours))
        conditions.append(eigenvalues[-1] / eigenvalues[0])
    assert conditions[0] > 2.0 * conditions[1]
    assert conditions[1] > 1.2 * conditions[2]
    assert conditions[2] > conditions[3]


def test_what_is_solved_for_directly_is_not_refused():
    mask = np.zeros((60, 60), bool)
    mask[:20, :20] = True
    full = tmg.ToeplitzOperator(matern((60, 60), 1.5, 20.0, nugget=0.01))
    A = tmg.MaskedOperator(full, mask)
    P = fsai_preconditioner(A)
    assert_allclose(P @ A.toarray(), np.eye(400), atol=1e-9)
    refuses(np.linalg.LinAlgError, "too smooth a kernel", fsai_preconditioner, full)


@pytest.mark.parametrize("scale", [1e39, 1e34, 1e-34, 1e-39])
@pytest.mark.parametrize("preconditioner", preconditioners("fsai sine chan fft default"))
def test_what_float32_has_no_room_for_is_refused(preconditioner, scale):
    A = operator(scale * contact(30, 30), np.random.default_rng(0).random((30, 30)) < 0.9)
    for B in (A, MATRICES["components"](scale)):
        with pytest.raises(ValueError, match=r"diagonal of A is .*must be between .*scale A"):
            preconditioner(B, dtype=np.float32)
        assert np.isfinite(preconditioner(B) @ np.ones(B.shape[0])).all()
    b = np.ones(A.shape[0])
    P = preconditioner(A)
    assert_allclose(scale * (P @ b), preconditioner(operator(contact(30, 30), A.mask)) @ b)


def test_the_number_of_neighbours_may_be_given():
    A = operator(matern((80, 80), 0.5, 10.0), AREAS["random, 50 %"](80))
    refuses(np.linalg.LinAlgError, "too smooth", fsai_preconditioner, A)
    taken = [max(both_iterations(A, fsai_preconditioner(A, neighbours=k))) for k in (12, 24, 40)]
    assert taken == sorted(taken, reverse=True)
    assert taken[-1] < 0.7 * taken[0]
    A = operator(half_space(64), AREAS["rough, 60 %"](64))
    count = max(both_iterations(A, fsai_preconditioner(A, neighbours=5)))
    assert_within_budget("FSAI with 5 neighbours", iterations=count)
    for k, rule in ((0, "at least 1"), (101, "at most 100"), (10**30, "at most 100")):
        with pytest.raises(ValueError, match=f"neighbours is {k}, but must be {rule}"):
            fsai_preconditioner(A, neighbours=k)
