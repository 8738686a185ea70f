"""What every operator of the package is multiplied with: arrays of numbers, and nothing else."""

import sys

import numpy as np
import pytest

import toeplitz_mg as tmg
from tests.cases import QUICK, contact

METHODS = ["dot", "matvec", "matmat", "rmatvec", "rmatmat", "__matmul__", "__mul__", "__rmatmul__"]


def operators_of_each_class():
    """One operator of each class, by its name."""
    given = (case.operator(np.float64) for case in QUICK)
    first = {type(A).__name__: A for A in given if A.shape[0] > 2}
    cycle = tmg.multigrid(tmg.ToeplitzOperator(contact(8)))
    deflation = tmg.fft_sd_preconditioner(tmg.ToeplitzOperator(contact(8)))
    others = (cycle.levels[-1].smoother, deflation.H)
    return first | {type(A).__name__: A for A in others}


OPERATORS = operators_of_each_class()
each_operator = pytest.mark.parametrize("A", OPERATORS.values(), ids=OPERATORS)


def products(A, x):
    """Every way to multiply an operator with a vector, or with a matrix of that one column."""
    for name in METHODS:
        method = getattr(A, name)
        yield lambda method=method, name=name: method(
            x[:, np.newaxis] if name.endswith("matmat") else x
        )


@each_operator
def test_what_is_no_number_is_refused(A):
    n = A.shape[0]
    for content in ("1.0", b"1", None, object()):
        for x in (np.array([content] * n), np.full(n, content, object)):
            for multiply in products(A, x):
                with pytest.raises(TypeError, match=r"x has dtype .*, but must be of numbers"):
                    multiply()
        with pytest.raises((TypeError, ValueError)):
            A @ content
    assert np.array_equal(A @ ([1] * n), A @ np.ones(n))  # Lists are vectors.


def test_a_product_of_few_unknowns_takes_few_calls():
    """SciPy's checks of a vector take some 40 calls, which is longer than the product."""
    A, x = tmg.ToeplitzOperator(0.5 ** np.arange(64)), np.ones(64)
    expected, calls = A @ x, []
    for multiply in (A.__matmul__, A.dot, A.matvec):
        sys.setprofile(lambda frame, event, _: calls.append(frame) if event == "call" else None)
        try:
            y = multiply(x)
        finally:
            sys.setprofile(None)
        assert np.array_equal(y, expected)
    assert len(calls) <= 3 * 10
