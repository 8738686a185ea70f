"""Fast solvers for dense Toeplitz systems, as SciPy operators; contact and Gaussian processes."""

# Before all others, as they take the time in which Ctrl-C may come.
from toeplitz_mg import startup  # noqa: F401, I001
from importlib import import_module
from typing import TYPE_CHECKING, Any

from toeplitz_mg.operators import (
    CoupledOperator,
    HankelOperator,
    MaskedOperator,
    RectangularToeplitz,
    ToeplitzOperator,
    ToeplitzSum,
)
from toeplitz_mg.operators.matmul import matmul_toeplitz
from toeplitz_mg.engine.fourier import use_transforms
from toeplitz_mg.engine.work import ProductCount, count_products
from toeplitz_mg.preconditioners import (
    chan_preconditioner,
    componentwise,
    cosine_preconditioner,
    default_preconditioner,
    fft_preconditioner,
    fft_rsm_preconditioner,
    fft_sd_preconditioner,
    fsai_preconditioner,
    jacobi_preconditioner,
    select_preconditioner,
    sine_preconditioner,
    spectral_preconditioner,
    strang_preconditioner,
    tau_preconditioner,
)
from toeplitz_mg.solvers.toeplitz.solve import select_method, solve_toeplitz
from toeplitz_mg.solvers.determinant import toeplitz_logdet
from toeplitz_mg.solvers.reflection import reflection_coefficients
from toeplitz_mg.solvers.inverse import ToeplitzInverse, toeplitz_inverse
from toeplitz_mg.solvers.cg import cg
from toeplitz_mg.solvers.gmres import gmres
from toeplitz_mg.solvers.toeplitz.refinement import SolveInfo
from toeplitz_mg.solvers.richardson import richardson

if TYPE_CHECKING:
    from toeplitz_mg import contact, covariances, fractional, halfspace
    from toeplitz_mg.gaussian import NormalFit, ToeplitzNormal
    from toeplitz_mg.multigrid_cycle import (
        Interpolation,
        Multigrid,
        galerkin,
        linear_interpolation,
        modulated_interpolation,
        multigrid,
        piecewise_constant,
        rediscretised,
    )
    from toeplitz_mg.solvers.blocks import block_toeplitz_logdet, solve_block_toeplitz
    from toeplitz_mg.solvers.least_squares import (
        LeastSquaresInfo,
        RightPreconditioned,
        toeplitz_lstsq,
    )

__all__ = [
    "CoupledOperator",
    "HankelOperator",
    "Interpolation",
    "LeastSquaresInfo",
    "MaskedOperator",
    "Multigrid",
    "NormalFit",
    "ProductCount",
    "RectangularToeplitz",
    "RightPreconditioned",
    "SolveInfo",
    "ToeplitzInverse",
    "ToeplitzNormal",
    "ToeplitzOperator",
    "ToeplitzSum",
    "block_toeplitz_logdet",
    "cg",
    "chan_preconditioner",
    "componentwise",
    "contact",
    "cosine_preconditioner",
    "count_products",
    "covariances",
    "default_preconditioner",
    "fft_preconditioner",
    "fft_rsm_preconditioner",
    "fft_sd_preconditioner",
    "fractional",
    "fsai_preconditioner",
    "galerkin",
    "gmres",
    "halfspace",
    "jacobi_preconditioner",
    "linear_interpolation",
    "matmul_toeplitz",
    "modulated_interpolation",
    "multigrid",
    "piecewise_constant",
    "rediscretised",
    "reflection_coefficients",
    "richardson",
    "select_method",
    "select_preconditioner",
    "sine_preconditioner",
    "solve_block_toeplitz",
    "solve_toeplitz",
    "spectral_preconditioner",
    "strang_preconditioner",
    "tau_preconditioner",
    "toeplitz_inverse",
    "toeplitz_logdet",
    "toeplitz_lstsq",
    "use_transforms",
]
__version__ = "0.1.0"

# Imported when they are used first, as importing them takes longer than solving a small system.
_PACKAGES = ("contact", "covariances", "fractional", "halfspace", "paper", "slabs")
_NAMES = {
    "gaussian": ("NormalFit", "ToeplitzNormal"),
    "multigrid_cycle": (
        "Interpolation",
        "Multigrid",
        "galerkin",
        "linear_interpolation",
        "modulated_interpolation",
        "multigrid",
        "piecewise_constant",
        "rediscretised",
    ),
    "solvers.blocks": ("block_toeplitz_logdet", "solve_block_toeplitz"),
    "solvers.least_squares": ("LeastSquaresInfo", "RightPreconditioned", "toeplitz_lstsq"),
}

if not TYPE_CHECKING:  # A type checker would take every name for one that is found here.

    def __getattr__(name: str) -> Any:
        if name in _PACKAGES:
            return import_module(f"{__name__}.{name}")
        for module, names in _NAMES.items():
            if name in names:
                return getattr(import_module(f"{__name__}.{module}"), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*__all__, *_PACKAGES, "__version__"})
