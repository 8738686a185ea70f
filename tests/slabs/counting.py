"""The communicator of the tests, where there is mpi4py."""

import pytest

MPI = pytest.importorskip("mpi4py.MPI")

from comparisons.harness.counting import CountingCommunicator  # noqa: E402

__all__ = ["MPI", "CountingCommunicator"]
