"""Preconditioners: each file has one idea and one public function."""

from toeplitz_mg.operators.lifting import componentwise
from toeplitz_mg.preconditioners.circulant import chan_preconditioner, strang_preconditioner
from toeplitz_mg.preconditioners.default import default_preconditioner, select_preconditioner
from toeplitz_mg.preconditioners.deflation import fft_sd_preconditioner
from toeplitz_mg.preconditioners.fft import fft_preconditioner
from toeplitz_mg.preconditioners.fsai.preconditioner import fsai_preconditioner
from toeplitz_mg.preconditioners.jacobi import jacobi_preconditioner
from toeplitz_mg.preconditioners.row_sum import fft_rsm_preconditioner
from toeplitz_mg.preconditioners.spectral import spectral_preconditioner
from toeplitz_mg.preconditioners.tau import tau_preconditioner
from toeplitz_mg.preconditioners.trigonometric import (
    cosine_preconditioner,
    sine_preconditioner,
)

__all__ = [
    "chan_preconditioner",
    "componentwise",
    "cosine_preconditioner",
    "default_preconditioner",
    "fft_preconditioner",
    "fft_rsm_preconditioner",
    "fft_sd_preconditioner",
    "fsai_preconditioner",
    "jacobi_preconditioner",
    "select_preconditioner",
    "sine_preconditioner",
    "spectral_preconditioner",
    "strang_preconditioner",
    "tau_preconditioner",
]
