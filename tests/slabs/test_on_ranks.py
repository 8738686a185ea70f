"""All cases of this folder, on 1 to 4 ranks."""

import pytest

from tests.slabs.ranks import run_on_ranks, with_ranks

slow = pytest.mark.slow
QUICK = ["rows", "products", "solves", "saving"]
CASES = [*QUICK, "areas", "lines", "fsai", "gathering", "pressing", "sliding", "rolling", "windows"]
INSIDE = ["tests.inside.slabs_exchange", "tests.inside.slabs_grid"]


@with_ranks
def test_quick_cases_on_two_ranks():
    """In one start of Python: to import takes longer than most of them."""
    status, printed = run_on_ranks(2, "-m", "tests.slabs", *QUICK)
    assert status == 0, printed
    for cases in QUICK:
        assert f"{cases}.test_" in printed


@slow
@with_ranks
@pytest.mark.parametrize("ranks", [1, 2, 3, 4])
@pytest.mark.parametrize("cases", [*CASES, *INSIDE])
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
