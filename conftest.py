"""What pytest is to leave alone, and what BLAS needs for it."""

import os
from importlib.util import find_spec

# It is read where NumPy is imported, after this file. The kernels of another processor, which this
# variable asks OpenBLAS for, crash in NumPy's own products where its cache is larger than theirs.
if os.environ.get("OPENBLAS_CORETYPE"):
    os.environ.setdefault("OPENBLAS_L2_SIZE", "512")

# What imports mpi4py: the examples of the package are run on one rank.
ON_RANKS = ["toeplitz_mg/slabs/*", "comparisons/harness/counting.py"]
collect_ignore_glob = [] if find_spec("mpi4py") else ON_RANKS


def pytest_addoption(parser):
    """Know the setting of a plugin that the group `test-core` is without."""
    if not find_spec("pytest_timeout"):
        parser.addini("timeout", "seconds after which a test fails")
