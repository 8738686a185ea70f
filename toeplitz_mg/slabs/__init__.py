"""Grids cut into slabs of rows, one for each rank of MPI: the package's names for a cluster."""

from toeplitz_mg.slabs.slab import Slab

__all__ = ["Slab"]
