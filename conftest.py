"""What pytest is to leave alone, and what BLAS needs for it."""

import os
from importlib.util import find_spec

# It is read where NumPy is imported, after this file. OpenBLAS's kernels for an old processor crash
# in products of complex64, NumPy's own, where the cache is 1 MB, as it is of new processors.
if os.environ.get("OPENBLAS_CORETYPE") == "Prescott":
    os.environ.setdefault("OPENBLAS_L2_SIZE", "512")

# What imports mpi4py: the examples of the package are run on one rank.
ON_RANKS = ["toeplitz_mg/slabs/*", "comparisons/harness/counting.py"]
collect_ignore_glob = [] if find_spec("mpi4py") else ON_RANKS
