"""What finds x."""

from toeplitz_mg.solvers.cg import cg
from toeplitz_mg.solvers.inverse import ToeplitzInverse, toeplitz_inverse
from toeplitz_mg.solvers.richardson import richardson
from toeplitz_mg.solvers.solve import SolveInfo, solve_toeplitz

__all__ = ["SolveInfo", "ToeplitzInverse", "cg", "richardson", "solve_toeplitz", "toeplitz_inverse"]
