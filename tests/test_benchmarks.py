"""The benchmarks of asv run, so that a change of the package is a change of theirs."""

import inspect

import pytest

from benchmarks import bodies, systems

KINDS = ("time_", "peakmem_", "track_")  # By these beginnings asv knows a benchmark.
BENCHMARKS = [
    pytest.param(kind, name, parameters, id=f"{kind.__name__}.{name}-{parameters}")
    for module in (systems, bodies)
    for _, kind in inspect.getmembers(module, inspect.isclass)
    for name, _ in inspect.getmembers(kind, inspect.isfunction)
    if name.startswith(KINDS)
    for parameters in [(value,) for value in getattr(kind, "params", [])] or [()]
]


def test_there_are_a_dozen():
    assert len({(case.values[0], case.values[1]) for case in BENCHMARKS}) >= 12


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name", "parameters"), BENCHMARKS)
def test_runs(kind, name, parameters):
    benchmark = kind()
    benchmark.setup(*parameters)
    found = getattr(benchmark, name)(*parameters)
    assert (found is not None) == name.startswith("track_")
