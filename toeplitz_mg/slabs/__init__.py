"""Grids cut into slabs of rows, one for each MPI rank: the package's names for a cluster."""

from toeplitz_mg.slabs.contact import friction, normal_contact, rolling, rolling_steps
from toeplitz_mg.slabs.coupled import CoupledOperator
from toeplitz_mg.slabs.fft import fft_preconditioner
from toeplitz_mg.slabs.fsai import fsai_preconditioner
from toeplitz_mg.slabs.operators import MaskedOperator, ToeplitzOperator
from toeplitz_mg.slabs.slab import Slab
from toeplitz_mg.slabs.trigonometric import cosine_preconditioner, sine_preconditioner

__all__ = [
    "CoupledOperator",
    "MaskedOperator",
    "Slab",
    "ToeplitzOperator",
    "cosine_preconditioner",
    "fft_preconditioner",
    "friction",
    "fsai_preconditioner",
    "normal_contact",
    "rolling",
    "rolling_steps",
    "sine_preconditioner",
]
