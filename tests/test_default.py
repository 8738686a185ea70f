"""default_preconditioner: which it takes, and that CG needs few iterations with what it takes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import toeplitz_mg as tmg
from comparisons.preconditioners.default_choice import GOAL, ROUNDING
from comparisons.systems import masks
from comparisons.systems.symbols import COLUMNS, column
from tests.cases import contact, coupled, coupled_kernel, exponential
from tests.test_fsai_coupled import tangential
from toeplitz_mg.paper.problems import test3
from toeplitz_mg.preconditioners.choice import COMPACT, DIRECT
from toeplitz_mg.preconditioners.direct import DenseInverse
from toeplitz_mg.preconditioners.traits import fragmentation
from toeplitz_mg.preconditioners.trial import better_than_none
from toeplitz_mg.solvers.choice import methods
from toeplitz_mg.solvers.system import ToeplitzSystem


def taken(A, **options):
    return repr(tmg.default_preconditioner(A, **options))


def iterations(A, **options):
    steps = []
    b = np.random.default_rng(0).standard_normal(A.shape[0])
    M = tmg.default_preconditioner(A, **options)
    _, info = tmg.cg(A, b, M=M, rtol=1e-8, maxiter=40, callback=steps.append)
    assert info == 0
    return len(steps)


def test_one_axis():
    assert "Gohberg" in taken(tmg.ToeplitzOperator(column("contact", 900)))
    assert "SparseInverse" in taken(tmg.ToeplitzOperator(column("contact", 2**14)))
    assert "Gohberg" in taken(tmg.ToeplitzOperator(column("0.9^k", 2**14)))
    assert "sine transform" in taken(tmg.ToeplitzOperator(column("2 - 2 cos θ", 900)))
    assert "cosine transform" in taken(tmg.ToeplitzOperator(column("2 + 2 cos θ", 900)))
    for shape in ((2**14, 1), (1, 2**14, 1)):
        assert "SparseInverse" in taken(
            tmg.ToeplitzOperator(column("contact", 2**14).reshape(shape))
        )
        assert "Gohberg" in taken(tmg.ToeplitzOperator(column("0.9^k", 2**14).reshape(shape)))
    assert "SparseInverse" in taken(test3(1024).A)
    for A in (tmg.ToeplitzOperator(column("θ²", 900)), test3(2048).A):
        assert iterations(A) <= 12


def test_a_covariance_as_wide_as_the_matrix_is_not_factorised():
    for n in (1000, 4000, 2**16):
        A = tmg.ToeplitzOperator(np.exp(-np.arange(float(n)) / n))
        assert "cosine" in taken(A)
        assert iterations(A) <= 6


@pytest.mark.parametrize("name", COLUMNS)
def test_solve_toeplitz_takes_the_same_after_what_it_has_for_itself(name):
    """CG in the domain of the DCT, and GMRES on both parts, are no preconditioners."""
    c = column(name, 3000)
    names = [method.name for method in methods(ToeplitzSystem(c, c, np.ones(3000)))]
    while names[0] in ("cg in the DCT domain", "gmres, circulant"):
        del names[0]
    by_cg, _, preconditioner = names[0].partition(", ")
    if by_cg == "cg":
        A = tmg.ToeplitzOperator(c)
        assert taken(A) == repr(getattr(tmg, preconditioner)(A))
    else:  # Its inverse is as good as what the default preconditioner then is.
        assert names[0] == "toeplitz_inverse"


def test_two_axes_of_slow_lengths():
    A = tmg.ToeplitzOperator(contact(131, 131))
    assert "SparseInverse" in taken(A)
    assert iterations(A) <= 9
    assert "cosine" in taken(tmg.ToeplitzOperator(contact(132, 132)))
    assert "cosine" in taken(tmg.ToeplitzOperator(contact(67, 67)))  # It is small.
    assert "cosine" in taken(tmg.ToeplitzOperator(exponential(131, 131)))  # It is smooth.


def test_blobs():
    mask = masks.circle(64)
    x, y = tmg.halfspace.offsets((64, 64), (1.0, 20.0))
    stretched = tmg.halfspace.influence_zz(x, y, (1.0, 20.0), G=1.0, nu=0.28)
    A = tmg.MaskedOperator(tmg.ToeplitzOperator(stretched), mask)
    assert "SparseInverse" in taken(A)
    assert iterations(A) <= 10
    two = tmg.MaskedOperator(coupled(coupled_kernel(2, 64, 64))(np.float64), mask)
    assert taken(two).count("SparseInverse") == 2


@pytest.mark.parametrize("area", masks.FRAGMENTED)
def test_two_axes(area):
    mask = masks.FRAGMENTED[area](96)
    A = tmg.MaskedOperator(tmg.ToeplitzOperator(contact(96, 96)), mask)
    if area == "full":
        assert "cosine" in taken(A)
        assert "cosine" in taken(A.full)
    elif area == "circle":
        assert fragmentation(mask) < COMPACT
        assert "sine transform" in taken(A)
        assert "SparseInverse" in taken(A, solves=10)
    else:
        assert fragmentation(mask) > COMPACT
        assert ("DenseInverse" if A.shape[0] <= DIRECT else "SparseInverse") in taken(A)
    assert iterations(A) <= 14
    assert iterations(A, dtype=np.float32) <= 14


def test_what_is_refused_is_followed_by_the_next(caplog):
    smooth = np.exp(-(np.indices((48, 48)) ** 2).sum(axis=0) / 50.0)
    smooth[0, 0] += 1e-3
    A = tmg.MaskedOperator(tmg.ToeplitzOperator(smooth), masks.checkerboard(48))
    with pytest.raises(np.linalg.LinAlgError):
        tmg.fsai_preconditioner(A)
    caplog.set_level("INFO")
    assert "SparseInverse" not in taken(A)
    assert "fsai_preconditioner is refused" in caplog.text


def test_a_covariance_that_is_too_smooth_for_fsai():
    distance = np.hypot(*np.ogrid[:64, :64])
    full = tmg.ToeplitzOperator(np.exp(-distance / 10.0))
    A = tmg.MaskedOperator(full, masks.rough(0.3, 64))
    with pytest.raises(np.linalg.LinAlgError, match="on a mask sine_preconditioner"):
        tmg.fsai_preconditioner(A)
    assert "SparseInverse" in taken(A)
    assert "SparseInverse" in taken(A, solves=10)
    assert iterations(A, solves=10) < iterations(A) <= 30
    b = np.random.default_rng(0).standard_normal(A.shape[0])
    _, info = tmg.cg(A, b, M=tmg.sine_preconditioner(A), rtol=1e-8, maxiter=60)
    assert info > 0
    assert "cosine" in taken(full)
    assert iterations(full) <= 20
    shorter = tmg.ToeplitzOperator(np.exp(-distance / 5.0))
    assert "SparseInverse" in taken(tmg.MaskedOperator(shorter, A.mask))


def test_three_axes_and_coupled_components():
    A = tmg.ToeplitzOperator(exponential(12, 9, 10))
    assert "cosine" in taken(A)
    mask = np.indices((12, 9, 10)).sum(axis=0) % 3 > 0
    assert "sine" in taken(tmg.MaskedOperator(A, mask))
    B = coupled(coupled_kernel(2, 40, 40))(np.float64)
    assert taken(B).count("cosine") == 2
    half = np.arange(1600).reshape(40, 40) % 2 == 0
    assert taken(tmg.MaskedOperator(B, half)).count("SparseInverse") == 2
    assert iterations(B) <= 14


def test_strongly_coupled_components_are_treated_together_on_a_mask():
    n = 64
    mask = masks.rough(0.3, n)
    for nu, parts, most in ((0.28, 2, 10), (0.5, 1, 10)):
        A = tangential((n, n), nu)
        assert taken(A).count("cosine") == 2
        A = tmg.MaskedOperator(A, np.stack([mask, mask]))
        assert taken(A).count("SparseInverse") == parts
        assert iterations(A) <= most


def small(shape):
    A = tmg.ToeplitzOperator(exponential(*shape))
    return A, tmg.MaskedOperator(A, np.indices(shape).sum(axis=0) % 3 > 0)


FEW = [
    *small((600,)),
    *small((20, 30)),
    *small((8, 7, 9)),
    coupled(coupled_kernel(2, 15, 20))(np.float64),
    tmg.MaskedOperator(coupled(coupled_kernel(2, 30, 30))(np.float64), masks.rough(0.3, 30)),
]


@pytest.mark.parametrize("A", FEW, ids=repr)
def test_few_unknowns_are_solved_for_directly(A):
    assert A.shape[0] <= DIRECT
    x = np.random.default_rng(0).standard_normal(A.shape[0])
    for dtype, error in ((np.float64, 1e-10), (np.float32, 1e-3)):
        M = tmg.default_preconditioner(A, dtype=dtype)
        assert "DenseInverse" in repr(M)
        assert M.dtype == dtype
        assert np.linalg.norm(M @ (A @ x) - x) <= error * np.linalg.norm(x)


def test_few_unknowns_and_less_precision_than_the_condition_needs():
    """A factor in float32 of a matrix with the condition 1e9 would be no inverse at all."""
    c = np.exp(-((np.arange(300) / 20.0) ** 2))
    c[0] += 1e-8
    A = tmg.ToeplitzOperator(c)
    assert "DenseInverse" in taken(A)
    assert "DenseInverse" not in taken(A, dtype=np.float32)
    singular = tmg.ToeplitzOperator(np.ones(300))
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite, or nearly singular"):
        tmg.default_preconditioner(singular)


def both(A, M, most):
    """Iterations for a constant and a random right-hand side, at most so many."""
    counts = []
    for b in (np.ones(A.shape[0]), np.random.default_rng(1).standard_normal(A.shape[0])):
        steps = []
        tmg.cg(A, b, M=M, rtol=1e-8, maxiter=most, callback=steps.append)
        counts.append(len(steps))
    return counts


def smooth(nugget):
    """A Gaussian covariance nearly as wide as its grid: of few large eigenvalues."""
    c = np.exp(-(np.indices((40, 40)) ** 2).sum(axis=0) / 1800.0)
    c[0, 0] += nugget
    return c


def spike(shape, *lags):
    """Coefficients at isolated lags, with a diagonal that dominates."""
    c = np.zeros(shape)
    for lag in lags:
        c[lag] = -1.0
    c.flat[0] = 1.1 * 2 ** len(shape) * len(lags)
    return c


@pytest.mark.parametrize(
    "c",
    [
        smooth(1e-2),
        smooth(1e-4),
        spike((1000,), 900),
        spike((1300,), 51, 999),
        spike((30, 40), (29, 39), (17, 0)),
        spike((10, 12, 9), (9, 0, 0), (0, 5, 8)),
    ],
    ids=["smooth, 1e-2", "smooth, 1e-4", "a lag", "lags", "lags of two axes", "of three"],
)
@pytest.mark.parametrize("share", [1.0, 0.8])
def test_it_is_not_worse_than_none(c, share):
    full = tmg.ToeplitzOperator(c)
    mask = np.random.default_rng(2).random(c.shape) <= share
    A = full if mask.all() else tmg.MaskedOperator(full, mask)
    none = both(A, None, 300)
    ours = both(A, tmg.default_preconditioner(A), 300)
    for own, other in zip(ours, none, strict=True):
        assert own <= max(GOAL * other, other + ROUNDING)


def test_a_trial_takes_none_where_nothing_is_better():
    A = tmg.ToeplitzOperator(spike((30, 40), (29, 39)))
    none = tmg.jacobi_preconditioner(A)
    worse = tmg.cosine_preconditioner(tmg.ToeplitzOperator(exponential(30, 40)))
    inverse = DenseInverse(A)
    assert better_than_none(A, none, []) is none
    assert better_than_none(A, none, [worse]) is none
    assert better_than_none(A, none, [worse, inverse]) is inverse
    indefinite = tmg.ToeplitzOperator(-A.c)
    with pytest.raises(np.linalg.LinAlgError, match="A is not positive definite"):
        better_than_none(indefinite, none, [])


@pytest.mark.parametrize("ratio", [0.01, 0.25, 1.0, 4.0, 100.0])
@pytest.mark.parametrize("nu", [0.0, 0.5])
def test_half_space_kernels_take_no_trial(ratio, nu):
    """Their set-up has no products: what they take follows from their coefficients."""
    element = (1.0, ratio)
    x, y = tmg.halfspace.offsets((32, 40), element)
    for influence in (tmg.halfspace.influence_zz, tmg.halfspace.influence_xx):
        full = tmg.ToeplitzOperator(influence(x, y, element, G=1.0, nu=nu))
        for mask in (masks.rough(0.6, 40)[:32], np.ones((32, 40), dtype=bool)):
            A = tmg.MaskedOperator(full, mask)
            assert A.shape[0] > DIRECT
            assert not tmg.select_preconditioner(A).needs_trial
            with tmg.count_products() as work:
                tmg.default_preconditioner(A)
            assert work.units(full.shape[0]) <= 1.0


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 40), st.integers(1, 40), st.floats(0.0, 1.0), st.integers(0, 99))
def test_any_mask(n1, n2, density, seed):
    rng = np.random.default_rng(seed)
    mask = rng.random((n1, n2)) < density
    mask.flat[rng.integers(mask.size)] = True
    A = tmg.MaskedOperator(tmg.ToeplitzOperator(contact(n1, n2)), mask)
    assert iterations(A) <= 16
    if A.shape[0] <= 200:
        M = tmg.default_preconditioner(A) @ np.eye(A.shape[0])
        assert np.linalg.eigvalsh((M + M.T) / 2).min() > 0.0


def test_what_it_refuses():
    A = tmg.ToeplitzOperator([2.0, 1.0])
    with pytest.raises(ValueError, match="solves is 0, but must be at least 1"):
        tmg.default_preconditioner(A, solves=0)
    with pytest.raises(TypeError, match=r"solves is 1\.5, but must be an integer"):
        tmg.default_preconditioner(A, solves=1.5)
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        tmg.default_preconditioner(tmg.ToeplitzOperator([[1.0, 2.0], [2.0, 3.0]]))
    with pytest.raises(np.linalg.LinAlgError, match="or gmres, which takes any matrix, or cg"):
        tmg.default_preconditioner(tmg.ToeplitzOperator(np.eye(1, 900).reshape(30, 30) - 2.0))
    with pytest.raises(TypeError, match="must be a ToeplitzOperator"):
        tmg.default_preconditioner(tmg.cosine_preconditioner(A))
    with pytest.raises(ValueError, match="solves is 0, but must be at least 1"):
        tmg.select_preconditioner(A, solves=0)
    with pytest.raises(TypeError, match="must be a ToeplitzOperator"):
        tmg.select_preconditioner(tmg.cosine_preconditioner(A))


# Complex matrices -----------------------------------------------------------------------------


def complex_iterations(A, M):
    """Iterations of cg to 1e-8, for a random right-hand side."""
    rng = np.random.default_rng(0)
    n = A.shape[0]
    iterates = []
    _, info = tmg.cg(
        A,
        rng.standard_normal(n) + 1j * rng.standard_normal(n),
        M=M,
        rtol=1e-8,
        maxiter=400,
        callback=lambda x: iterates.append(None),
    )
    assert info == 0
    return len(iterates)


def plane_waves(n):
    k = np.arange(n)
    c = 10.0 * np.exp(0.3j * k) + 5.0 * np.exp(1.1j * k) + np.exp(-2j * k)
    return tmg.ToeplitzOperator(c + (k == 0))


@pytest.mark.parametrize("n", [1000, 4096])
def test_of_a_complex_line_it_is_the_inverse_whatever_the_symbol(n):
    k = np.arange(n)
    for A in (plane_waves(n), tmg.ToeplitzOperator(0.99**k * np.exp(0.7j * k) + 0.01 * (k == 0))):
        M = tmg.default_preconditioner(A)
        assert M.dtype == np.complex128
        assert complex_iterations(A, M) <= 8


@pytest.mark.parametrize("masked", [False, True])
def test_of_a_complex_grid_it_is_better_than_none(masked):
    """Two damped plane waves on a grid: neither is even."""
    k1, k2 = np.meshgrid(np.arange(-59, 60), np.arange(-39, 40), indexing="ij")
    size = np.exp(-np.hypot(k1, k2) / 3.0)
    lags = size * (np.exp(1j * (0.3 * k1 + 0.1 * k2)) + 0.5 * np.exp(1j * (0.8 * k2 - k1)))
    A = tmg.ToeplitzOperator.from_lags((lags + np.flip(lags).conj()) / 2)
    if masked:
        A = tmg.MaskedOperator(A, np.random.default_rng(1).random(A.grid_shape) < 0.9)
    M = tmg.default_preconditioner(A)
    assert "chan_preconditioner" in repr(tmg.select_preconditioner(A))
    assert complex_iterations(A, M) <= 0.7 * complex_iterations(A, None)


def test_complex_matrices_that_are_not_positive_definite_are_refused():
    c = np.r_[1.0, 0.9j, np.full(998, 0.01j)]
    for n in (10, 1000):
        with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
            tmg.default_preconditioner(tmg.ToeplitzOperator(c[:n]))


@pytest.mark.parametrize("size", [1e-200, 1e200])
def test_the_choice_does_not_depend_on_the_size(size):
    c = 1.0 / (1.0 + np.arange(3000))
    kinds = [type(tmg.default_preconditioner(tmg.ToeplitzOperator(s * c))) for s in (1.0, size)]
    assert kinds[0] is kinds[1]
