"""default_preconditioner: which it takes, and that CG needs few iterations with what it takes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import toeplitz_mg as tmg
from comparisons import masks
from comparisons.symbols import COLUMNS, column
from tests.cases import contact, coupled, coupled_kernel, exponential
from tests.test_fsai_coupled import tangential
from toeplitz_mg.contact.problems import test3
from toeplitz_mg.preconditioners.default import COMPACT, fragmentation


def taken(A, **options):
    return repr(tmg.default_preconditioner(A, **options))


def iterations(A, **options):
    steps = []
    b = np.random.default_rng(0).standard_normal(A.shape[0])
    M = tmg.default_preconditioner(A, **options)
    _, info = tmg.cg(A, b, M=M, rtol=1e-8, maxiter=40, callback=steps.append)
    assert info == 0
    return len(steps)


def test_one_level():
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


@pytest.mark.filterwarnings("ignore:.*A is ill-conditioned")
@pytest.mark.parametrize("name", COLUMNS)
def test_solve_toeplitz_takes_the_same(name):
    c = column(name, 3000)
    _, info = tmg.solve_toeplitz(c, np.ones(3000), full_output=True)
    by_cg, _, preconditioner = info.method.partition(", ")
    if by_cg == "cg":
        A = tmg.ToeplitzOperator(c)
        assert taken(A) == repr(getattr(tmg, preconditioner)(A))
    else:  # it is as good as the inverse that the default preconditioner is then
        assert info.method in ("toeplitz_inverse", "scipy.linalg.solve_toeplitz")


def test_two_levels_of_slow_lengths():
    A = tmg.ToeplitzOperator(contact(131, 131))
    assert "SparseInverse" in taken(A)
    assert iterations(A) <= 9
    assert "cosine" in taken(tmg.ToeplitzOperator(contact(132, 132)))
    assert "cosine" in taken(tmg.ToeplitzOperator(contact(67, 67)))  # it is small
    assert "cosine" in taken(tmg.ToeplitzOperator(exponential(131, 131)))  # smooth


def test_blobs():
    mask = masks.circle(64)
    x, y = tmg.halfspace.lags((64, 64), (1.0, 20.0))
    stretched = tmg.halfspace.influence_zz(x, y, (1.0, 20.0), G=1.0, nu=0.28)
    A = tmg.MaskedOperator(tmg.ToeplitzOperator(stretched), mask)
    assert "SparseInverse" in taken(A)
    assert iterations(A) <= 10
    two = tmg.MaskedOperator(coupled(coupled_kernel(2, 64, 64))(np.float64), mask)
    assert taken(two).count("SparseInverse") == 2


@pytest.mark.parametrize("area", masks.FRAGMENTED)
def test_two_levels(area):
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
        assert "SparseInverse" in taken(A)
    assert iterations(A) <= 14
    assert iterations(A, dtype=np.float32) <= 14


def test_what_is_refused_is_followed_by_the_next(caplog):
    smooth = np.exp(-(np.indices((48, 48)) ** 2).sum(axis=0) / 50.0)
    smooth[0, 0] += 1e-3
    A = tmg.MaskedOperator(tmg.ToeplitzOperator(smooth), masks.checkerboard(48))
    with pytest.raises(np.linalg.LinAlgError):
        tmg.fsai_preconditioner(A)
    caplog.set_level("INFO")
    assert "sine" in taken(A)
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


def test_three_levels_and_coupled_components():
    A = tmg.ToeplitzOperator(exponential(12, 9, 10))
    assert "cosine" in taken(A)
    mask = np.indices((12, 9, 10)).sum(axis=0) % 3 > 0
    assert "sine" in taken(tmg.MaskedOperator(A, mask))
    B = coupled(coupled_kernel(2, 12, 12))(np.float64)
    assert taken(B).count("cosine") == 2
    half = np.arange(144).reshape(12, 12) % 2 == 0
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
    with pytest.raises(np.linalg.LinAlgError, match="use cg without M"):
        tmg.default_preconditioner(tmg.ToeplitzOperator([[1.0, 2.0], [2.0, 3.0]]))
    with pytest.raises(TypeError, match="must be a ToeplitzOperator"):
        tmg.default_preconditioner(tmg.cosine_preconditioner(A))
