"""Start Python on several ranks of MPI, by the mpiexec of the same environment."""

import os
import signal
import subprocess
import sys
import sysconfig
from importlib.util import find_spec
from pathlib import Path

import pytest

MPIEXEC = Path(sysconfig.get_path("scripts")) / "mpiexec"
LIMIT = 60  # Seconds after which ranks are taken to wait for each other.
ROOT = Path(__file__).parent.parent.parent

with_ranks = pytest.mark.skipif(
    find_spec("mpi4py") is None or not MPIEXEC.exists(),
    reason="mpi4py, or the mpiexec of a wheel such as mpich, is not installed",
)


def run_on_ranks(ranks, *arguments, cwd=ROOT):
    """Run ``python -m mpi4py ...`` on so many ranks; return its exit status and what it printed."""
    python = [sys.executable, "-W", "error", "-m", "mpi4py"]
    command = [MPIEXEC, "-n", str(ranks), *python, *arguments]
    process = subprocess.Popen(
        command,
        cwd=cwd,
        env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,  # So that what it has started can be ended with it.
    )
    try:
        printed, _ = process.communicate(timeout=LIMIT)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        pytest.fail(f"{ranks} ranks have not ended after {LIMIT} s:\n{process.communicate()[0]}")
    return process.returncode, printed


def refuses(comm, kind, text, work):
    """Assert that all ranks refuse to do this with the same error, with this text in it."""
    with pytest.raises(kind) as error:
        work()
    told = set(comm.allgather(str(error.value)))
    assert len(told) == 1
    assert text in told.pop()
