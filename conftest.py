"""What pytest is to leave alone."""

from importlib.util import find_spec

# What imports mpi4py: the examples of the package are run on one rank.
ON_RANKS = ["toeplitz_mg/slabs/*", "comparisons/harness/counting.py"]
collect_ignore_glob = [] if find_spec("mpi4py") else ON_RANKS
