"""What pytest is to leave alone."""

from importlib.util import find_spec

# The examples of this package are run on one rank, where there is mpi4py.
collect_ignore_glob = [] if find_spec("mpi4py") else ["toeplitz_mg/slabs/*"]
