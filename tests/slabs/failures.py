"""A program on several ranks in which something goes wrong on one of them, for `test_failures`."""

import os
import signal
import sys

import numpy as np

from toeplitz_mg import slabs


def main():
    from mpi4py import MPI

    slab, what = slabs.Slab(MPI.COMM_WORLD, (64, 64)), sys.argv[1]
    x, y = slab.offsets((1.0, 1.0))
    A = slabs.ToeplitzOperator(1.0 / (1.0 + np.hypot(x, y)), slab)
    for k in range(3):
        if k == 1 and slab.comm.rank == slab.comm.size - 1:
            if what == "raises":
                raise RuntimeError("one rank has a bug")
            if what == "dies":
                os.kill(os.getpid(), signal.SIGKILL)
        A @ np.ones(A.shape[0])
    print("done", flush=True)


if __name__ == "__main__":
    main()
