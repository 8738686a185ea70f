"""All cases of this folder, on 1 to 4 ranks."""

import pytest

from tests.slabs.ranks import run_on_ranks, with_ranks

slow = pytest.mark.slow
each_number_of_ranks = pytest.mark.parametrize(
    "ranks",
    [pytest.param(1, marks=slow), 2, pytest.param(3, marks=slow), pytest.param(4, marks=slow)],
)


@with_ranks
@each_number_of_ranks
@pytest.mark.parametrize(
    "cases",
    [
        "rows",
        "products",
        "solves",
        "saving",
        *(
            pytest.param(x, marks=slow)
            for x in ("lines", "fsai", "gathering", "pressing", "sliding", "rolling", "windows")
        ),
    ],
)
def test_on_ranks(cases, ranks):
    status, printed = run_on_ranks(ranks, "-m", "tests.slabs", cases)
    assert status == 0, printed
    assert f"{cases}.test_" in printed


@slow
@with_ranks
@pytest.mark.parametrize("ranks", [1, 2, 3, 4])
def test_arrays_of_other_libraries(ranks):
    pytest.importorskip("array_api_strict")
    pytest.importorskip("jax")
    status, printed = run_on_ranks(ranks, "-m", "tests.slabs", "arrays")
    assert status == 0, printed
    assert "arrays.test_" in printed
