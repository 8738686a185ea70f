"""Run all cases of files of this folder on this rank.

``mpiexec -n 3 python -m mpi4py -m tests.slabs products areas`` calls each ``test_...(comm)`` of
`products.py` and `areas.py`, also of a module that is named whole. Where one fails, all ranks are
ended.
"""

import sys
import time
import traceback
from importlib import import_module

from tests.slabs.counting import MPI, CountingCommunicator


def main():
    comm = CountingCommunicator(MPI.COMM_WORLD)
    for name in sys.argv[1:]:
        module = import_module(name if "." in name else f"tests.slabs.{name}")
        for case, test in list(vars(module).items()):
            if case.startswith("test_"):
                run(f"{name}.{case}", test, comm)


def run(name, test, comm):
    comm.reset()
    start = time.perf_counter()
    try:
        test(comm)
    except BaseException:
        print(f"{name} fails on rank {comm.rank} of {comm.size}", flush=True)
        traceback.print_exc()
        sys.stderr.flush()
        time.sleep(0.5)  # For other ranks that fail too.
        comm.Abort(1)
    if comm.rank == 0:
        print(f"{name} {time.perf_counter() - start:.1f} s", flush=True)


if __name__ == "__main__":
    main()
