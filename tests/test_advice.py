"""The advice of an error is one that helps: followed on the refused matrix, it leads to x."""

import re

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array, eye_array

import toeplitz_mg as tmg
from tests.cases import checkered
from tests.systems import PRECONDITIONERS, refuses


def line(n):
    """Matrices of one axis that some preconditioner refuses, positive definite or not."""
    k = np.arange(n)
    zero, one, two = (1.0 * (k == j) for j in range(3))
    return {
        "2 - 2 cos θ": (2.0 * zero - one, True),
        "2 + 2 cos θ": (2.0 * zero + one, True),
        "(2 - 2 cos θ)²": (6.0 * zero - 4.0 * one + two, True),
        "contact": (1.0 / (1.0 + k), True),
        "wide Matérn": ((1.0 + 4.0 * k / n) * np.exp(-4.0 * k / n), True),
        "narrow Gaussian": (np.exp(-(k**2) / 4.0), True),
        "plane wave": (np.cos(0.7 * k) + 1e-3 * zero, True),
        "indefinite": (zero + 0.9 * one, False),
        "negative": (-1.0 / (1.0 + k), False),
    }


def plane(shape):
    """The same of two axes."""
    i, j = np.indices(shape)
    zero, one = 1.0 * (i + j == 0), 1.0 * (i + j == 1)
    return {
        "Laplacian": (4.0 * zero - one, True),
        "contact": (1.0 / (1.0 + np.hypot(i, j)), True),
        "Gaussian": (np.exp(-(i**2 + j**2) / 4.0), True),
        "indefinite": (zero + 0.5 * one, False),
        "negative": (-1.0 / (1.0 + np.hypot(i, j)), False),
    }


def matrices():
    for grid, kernels in ((40, line(40)), (300, line(300)), ((12, 10), plane((12, 10)))):
        for name, (c, is_definite) in kernels.items():
            A = tmg.ToeplitzOperator(c)
            yield f"{name} {grid}", A, is_definite
            mask = checkered(*c.shape)
            if is_definite:  # That of the rest is not told by that of the whole.
                yield f"masked {name} {grid}", tmg.MaskedOperator(A, mask), True
            if c.size < 150:
                weak = tmg.ToeplitzOperator.from_lags(0.3 * A.lags)
                coupled = tmg.CoupledOperator([[A, weak], [weak, A]])
                yield f"coupled {name} {grid}", coupled, is_definite


def general():
    k = np.arange(60)
    yield "no symmetry", tmg.ToeplitzOperator(0.5**k, 0.3**k)
    yield "complex", tmg.ToeplitzOperator(0.5**k * np.exp(0.7j * k), 0.3**k)
    yield "Hermitian", tmg.ToeplitzOperator(0.5**k * np.exp(0.7j * k))
    A = tmg.ToeplitzOperator(0.5**k, 0.3**k)
    yield "coupled, no symmetry", tmg.CoupledOperator([[A, None], [None, A]])
    yield "masked, no symmetry", tmg.MaskedOperator(A, k % 4 > 0)
    skewed = tmg.ToeplitzOperator(np.r_[0.1, -1.0, 0.0 * k[2:]], np.r_[0.1, 1.2, 0.0 * k[2:]])
    yield "indefinite symmetric part", skewed
    yield "sum, indefinite symmetric part", skewed + diags_array(1e-3 * k)
    c = np.r_[2.0, np.exp(-0.1 * k[1:] + 0.7j * k[1:])]
    A = tmg.ToeplitzOperator(c, 0.3 * c**2)
    yield "complex sum", diags_array(1.0 + np.cos(k**2) ** 2) @ A


ALL = {f.__name__: f for f in (*PRECONDITIONERS, tmg.toeplitz_inverse)}


def refusal(make, A):
    """What a preconditioner says where it is refused, or None."""
    try:
        make(A)
    except (ValueError, TypeError) as error:  # LinAlgError is a ValueError.
        return str(error), "\n".join(getattr(error, "__notes__", ()))
    return None


def advised(message, called):
    """The functions that a message names, of which one that is called f is the one called."""
    names = re.findall(r"\b(\w+_preconditioner|multigrid)\(A\)", message)
    yield from (getattr(tmg, name) for name in names)
    for name in re.findall(r"componentwise\((\w+)\)\(A\)", message):
        yield tmg.componentwise(called if name == "f" else getattr(tmg, name))


def follow(make, A, depth=3):
    """Follow the advice: "made" where it leads to a preconditioner, or its last words."""
    refused = refusal(make, A)
    if refused is None:
        return {"made"}
    message, _ = refused
    further = list(advised(message, make))
    if not further or depth == 0:
        return {message}
    return set().union(*(follow(other, A, depth - 1) for other in further))


def solves_by_gmres(A, M=None):
    n = A.shape[0]
    b = np.random.default_rng(0).standard_normal(n)
    x, info = tmg.gmres(A, b, M=M, rtol=1e-6, restart=n)
    return info == 0 and np.linalg.norm(b - A @ x) <= 1.001e-6 * np.linalg.norm(b)


@pytest.mark.parametrize(
    ("A", "is_definite"),
    [pytest.param(A, is_definite, id=name) for name, A, is_definite in matrices()],
)
def test_advice_leads_to_a_preconditioner_or_to_gmres(A, is_definite):
    for name, make in ALL.items():
        refused = refusal(make, A)
        if refused is None:
            continue
        ends = follow(make, A)
        if is_definite:
            # Where a function is advised, it leads on.
            assert "made" in ends or not list(advised(refused[0], make)), (name, ends)
        elif "made" not in ends and name != "toeplitz_inverse":
            assert any("gmres, which takes any matrix" in end for end in ends), name
        if is_definite:
            assert not any(end.endswith("gmres, which takes any matrix") for end in ends), name
    if not is_definite:
        assert solves_by_gmres(A)


@pytest.mark.parametrize("A", [pytest.param(A, id=name) for name, A in general()])
def test_advice_for_a_general_matrix_is_a_preconditioner_of_gmres(A):
    for make in ALL.values():
        refused = refusal(make, A)
        if refused is None:
            continue
        functions = list(advised(refused[0], make))
        assert functions, refused
        for function in functions:
            if refusal(function, A) is None:
                assert solves_by_gmres(A, function(A))
            else:
                assert "made" in follow(function, A)


@pytest.mark.parametrize(("base", "shift"), [(0.9, 0.06), (0.9, 0.5), (0.5, 0.7)])
def test_what_is_advised_for_an_indefinite_line_solves(base, shift):
    """There GMRES without M takes thousands of iterations."""
    c = base ** np.arange(300.0)
    c[0] -= shift
    A = tmg.ToeplitzOperator(c)
    refused, _ = refusal(tmg.default_preconditioner, A)
    assert "solve_toeplitz(A.c, b) for a whole line" in refused
    b = np.random.default_rng(0).standard_normal(300)
    assert np.linalg.norm(b - A @ tmg.solve_toeplitz(A.c, b)) <= 1e-10 * np.linalg.norm(b)


@pytest.mark.parametrize("shape", [(300,), (20, 20)], ids=str)
def test_no_preconditioner_is_advised_where_a_coefficient_is_as_large_as_the_diagonal(shape):
    r = np.sqrt(np.add.reduce(np.indices(shape) ** 2))
    A = tmg.ToeplitzOperator(np.exp(-r / 5.0)) - 0.9 * eye_array(r.size)
    for make in (tmg.fft_preconditioner, tmg.cosine_preconditioner):
        message, _ = refusal(make, A)
        assert not list(advised(message, make))
        assert "is not positive definite" in message
        assert "gmres" in message
        assert message.count("use ") == 1
    assert solves_by_gmres(A)


def test_a_negative_matrix_is_one_of_the_other_sign():
    """Fractional derivatives have that sign, mostly."""
    for name, A, _ in matrices():
        if "negative" not in name:
            continue
        for make in ALL.values():
            refused = refusal(make, A)
            if make is not tmg.toeplitz_inverse and "must" not in refused[0]:
                assert "if -A is positive definite solve -A x = -b" in refused[0]
    A = tmg.ToeplitzOperator(line(40)["contact"][0]) + diags_array(np.ones(40))
    refuses(np.linalg.LinAlgError, "solve -A x = -b", tmg.default_preconditioner, -1 * A)


def test_a_sum_that_is_not_understood_has_the_preconditioner_of_a_part():
    A = tmg.ToeplitzOperator(line(40)["contact"][0])
    C = tmg.CoupledOperator([[A, None], [None, A]])
    D = diags_array(np.linspace(0.0, 1.0, 80))
    with pytest.raises(TypeError, match=r"use cg or gmres with default_preconditioner\(C\)"):
        tmg.default_preconditioner(C + D)
    assert solves_by_gmres(C + D, tmg.default_preconditioner(C))


def test_the_inverse_of_a_sum_is_that_of_cg():
    A = tmg.ToeplitzOperator(line(40)["contact"][0]) + diags_array(np.linspace(0.0, 1.0, 40))
    with pytest.raises(TypeError, match=r"use cg with default_preconditioner\(A\), or gmres"):
        tmg.toeplitz_inverse(A)
    assert solves_by_gmres(A, tmg.default_preconditioner(A))


@pytest.mark.parametrize("make", [tmg.strang_preconditioner, tmg.fft_preconditioner])
def test_what_is_certainly_indefinite_is_sent_to_what_needs_no_preconditioner(make):
    # The leading 2 x 2 block has the determinant 0.01 - 1.
    A = tmg.ToeplitzOperator(np.r_[0.1, -1.0, np.zeros(18)])
    assert refusal(make, A)[0].endswith("use solve_toeplitz(A.c, b), or gmres without M")
    b = np.arange(20.0)
    assert np.allclose(A @ tmg.solve_toeplitz(A.c, b), b)
    c = np.zeros((4, 5))
    c[0, 0], c[1, 0] = 0.1, -1.0
    assert refusal(make, tmg.ToeplitzOperator(c))[0].endswith("use gmres without M")
    # That of this one is positive: whether A is definite is not told by it.
    refused = refusal(make, tmg.ToeplitzOperator(np.r_[1.0, -0.9, np.zeros(18)]))[0]
    assert "certainly" not in refused


def test_what_stands_for_a_sum_may_be_indefinite_and_is_said_to():
    A = tmg.ToeplitzOperator(np.r_[1.0, 5.0, np.zeros(18)])
    S = A + diags_array(np.tile([0.0, 1e4], 10))
    assert np.linalg.eigvalsh(S.toarray()).min() > 0.9
    for make in (tmg.chan_preconditioner, tmg.spectral_preconditioner, tmg.tau_preconditioner):
        refused = refusal(make, S)[0]
        assert "here A is the Toeplitz matrix that stands for a sum" in refused
        assert refused.endswith("then use cg without M, and else gmres")
        assert refusal(make, diags_array(np.linspace(1.0, 2.0, 20)) @ A)[0].endswith(
            "then use gmres without M"
        )


def test_complex_matrices_are_named_as_they_are_and_sent_to_what_solves_them():
    A = tmg.ToeplitzOperator(np.r_[1.0, 0.9j, np.zeros(18)])
    refuses(ValueError, "or gmres without M if A is indefinite", tmg.cosine_preconditioner, A)
    # What stands for it is Hermitian, and of that it is told how to solve it, but not alone.
    S = dict(general())["complex sum"]
    for make in (tmg.cosine_preconditioner, tmg.tau_preconditioner, tmg.fsai_preconditioner):
        refuses(ValueError, "or gmres if A stands for a sum that is", make, S)
    c = 3.0 ** -np.arange(9.0)
    A = tmg.ToeplitzOperator(c, 1j * c)
    for make in (tmg.tau_preconditioner, tmg.cosine_preconditioner):
        refuses(ValueError, "general, complex128>, but must be real", make, A)


def test_a_sparse_matrix_is_told_how_its_coefficients_are_had():
    A = csr_array(np.eye(4) + np.eye(4, k=1) + np.eye(4, k=-1))
    with pytest.raises(TypeError) as refused:
        tmg.ToeplitzOperator(A)
    (advice,) = re.findall(r"A\[.*\(\)", str(refused.value))
    column = eval(advice, {"A": A})
    assert np.array_equal(tmg.ToeplitzOperator(column).toarray(), A.toarray())


def test_an_inverse_whose_first_entry_is_zero_is_sent_to_what_needs_none():
    c, r, b = np.r_[0.0, 1.0, np.zeros(8)], np.r_[0.0, 2.0, np.zeros(8)], np.arange(10.0)
    with pytest.raises(np.linalg.LinAlgError, match=r"solve_toeplitz\(\(c, r\), b\)"):
        tmg.toeplitz_inverse(tmg.ToeplitzOperator(c, r))
    x = tmg.solve_toeplitz((c, r), b)
    assert np.allclose(tmg.ToeplitzOperator(c, r) @ x, b)


def test_a_refused_mean_of_a_sum_is_said_to_be_one():
    lags = np.pad(np.array([[1.0, 0.0, 0.5], [0.0, 9.0, 0.0], [0.5, 0.0, 0.2]]), ((4, 4), (5, 5)))
    S = diags_array(np.linspace(1.0, 2.0, 42)) @ tmg.ToeplitzOperator.from_lags(lags)
    with pytest.raises(ValueError, match="symmetric along each axis") as refused:
        tmg.fsai_preconditioner(S)
    assert repr(S) in refused.value.__notes__[0]
