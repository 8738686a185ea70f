"""Press a measured surface onto a flat one on as many ranks as there are; nobody has all of it."""

import os

import numpy as np
from mpi4py import MPI
from scipy.fft import set_workers

from toeplitz_mg import contact, slabs

gap = np.load("surface.npy", mmap_mode="r")  # Heights to be closed, mm: only mapped.
slab = slabs.Slab(MPI.COMM_WORLD, gap.shape)
steel = contact.Material(E=210000.0, nu=0.28)
with set_workers(int(os.environ.get("SLURM_CPUS_PER_TASK", "1"))):  # Cores of a rank.
    pressed = slabs.normal_contact(gap[slab.rows], slab, (1e-3, 1e-3), material=steel, force=10.0)
slab.save("pressure.npy", pressed.traction)
area = slab.sum(pressed.traction > 0.0) * 1e-6
if MPI.COMM_WORLD.rank == 0:
    print(f"{pressed.rigid:.6f} mm, {area:.6f} mm² in contact")
