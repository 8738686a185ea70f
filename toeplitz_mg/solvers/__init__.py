"""What finds x."""

from toeplitz_mg.solvers.inverse import ToeplitzInverse, toeplitz_inverse
from toeplitz_mg.solvers.richardson import richardson

__all__ = ["ToeplitzInverse", "richardson", "toeplitz_inverse"]
