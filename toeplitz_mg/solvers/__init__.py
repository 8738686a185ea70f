"""What finds x."""

from toeplitz_mg.solvers.richardson import richardson

__all__ = ["richardson"]
