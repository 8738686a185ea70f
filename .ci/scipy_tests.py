"""Run SciPy's own tests of `solve_toeplitz`, `cg` and `gmres` with ours in their place.

They are those of the SciPy that is installed. ``python .ci/scipy_tests.py`` prints what fails by
its name, and fails where fewer pass than of this version did when the number was written here.
"""

import sys

import pytest
import scipy
import scipy.linalg
import scipy.sparse.linalg
from scipy.sparse.linalg import _isolve

import toeplitz_mg as tmg

try:  # Which arrays a function takes, as its tests ask since SciPy 1.18.
    from scipy._lib._array_api import xp_capabilities_table as capabilities
except ImportError:
    capabilities = {}

FILES = (
    "scipy.linalg.tests.test_solve_toeplitz",
    "scipy.sparse.linalg._isolve.tests.test_iterative",
)
OURS = (tmg.cg, tmg.gmres)
LEAST = {"1.17": 810, "1.18": 792}  # Tests that pass with a version of SciPy.


class InTheirPlace:
    """A plugin that keeps the tests that call ours, and counts those that pass."""

    def __init__(self):
        self.passed, self.failed = 0, []

    def pytest_collection_modifyitems(self, items):
        """Leave out the tests of SciPy's other solvers."""
        items[:] = [item for item in items if self._is_of_ours(item)]

    def _is_of_ours(self, item):
        if "test_iterative" not in item.nodeid:
            return True
        values = getattr(item, "callspec", None)
        given = [] if values is None else list(values.params.values())
        given += [getattr(value, "solver", None) for value in given]
        if any(value is ours for value in given for ours in OURS):
            return True
        return not any(callable(value) for value in given) and "gmres" in item.nodeid.lower()

    def pytest_runtest_logreport(self, report):
        """Count."""
        if report.when == "call" and report.passed:
            self.passed += not hasattr(report, "wasxfail")
        elif report.failed:
            self.failed.append(report.nodeid)


def main():
    """Run them, and return the exit status."""
    version = ".".join(scipy.__version__.split(".")[:2])
    if version not in LEAST:
        print(f"how many pass with SciPy {version} is not known: LEAST has {', '.join(LEAST)}")
        return 0
    scipy.linalg.solve_toeplitz = tmg.solve_toeplitz
    for name, ours in (("cg", tmg.cg), ("gmres", tmg.gmres)):
        capabilities[ours] = capabilities.get(getattr(_isolve, name))
        setattr(_isolve, name, ours)
        setattr(scipy.sparse.linalg, name, ours)
    plugin = InTheirPlace()
    options = ["-q", "-p", "no:cacheprovider", "--tb=no", "--no-header", "--pyargs", *FILES]
    pytest.main([*options, "-W", "ignore", *sys.argv[1:]], plugins=[plugin])
    total = plugin.passed + len(plugin.failed)
    print(f"SciPy {version}: {plugin.passed} of {total} pass; at least {LEAST[version]} must")
    return int(plugin.passed < LEAST[version])


if __name__ == "__main__":
    sys.exit(main())
