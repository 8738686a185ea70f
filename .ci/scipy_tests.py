"""Run SciPy's own tests of its Toeplitz functions, `cg` and `gmres` with ours in their place.

They are those of the SciPy that is installed, and with them the tests of its other solvers. Run it
as ``python .ci/scipy_tests.py``: it prints what fails by its name, and fails where fewer pass than
did with this version of SciPy when the number was written here.
"""

import os
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
    "scipy.linalg.tests.test_matmul_toeplitz",
    "scipy.sparse.linalg._isolve.tests.test_iterative",
)
# Tests that pass with a version of SciPy. Not those that `docs/coming_from.md` tells of, and not
# `test_defective_precond_breakdown`, where rounding decides whether a zero is one exactly.
LEAST = {"1.17": 876, "1.18": 890}


class Counter:
    """A plugin that counts the tests that pass, and those that fail."""

    def __init__(self):
        self.passed, self.failed = 0, 0

    def pytest_runtest_logreport(self, report):
        """Count."""
        if report.when == "call" and report.passed:
            self.passed += not hasattr(report, "wasxfail")
        elif report.failed:
            self.failed += 1


def main():
    """Run them, and return the exit status."""
    version = ".".join(scipy.__version__.split(".")[:2])
    if version not in LEAST:
        print(f"how many pass with SciPy {version} is not known: LEAST has {', '.join(LEAST)}")
        return 0
    scipy.linalg.solve_toeplitz = tmg.solve_toeplitz
    scipy.linalg.matmul_toeplitz = tmg.matmul_toeplitz
    for name, ours in (("cg", tmg.cg), ("gmres", tmg.gmres)):
        capabilities[ours] = capabilities.get(getattr(_isolve, name))
        setattr(_isolve, name, ours)
        setattr(scipy.sparse.linalg, name, ours)
    plugin = Counter()
    # Not with the settings of this project, by which a warning is an error.
    options = ["-c", os.devnull, "-q", "-p", "no:cacheprovider", "--tb=no", "--pyargs", *FILES]
    pytest.main([*options, "-W", "ignore", *sys.argv[1:]], plugins=[plugin])
    total = plugin.passed + plugin.failed
    print(f"SciPy {version}: {plugin.passed} of {total} pass; at least {LEAST[version]} must")
    return int(plugin.passed < LEAST[version])


if __name__ == "__main__":
    sys.exit(main())
