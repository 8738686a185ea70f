"""Operators that multiply: Toeplitz matrices of one or several axes, and matrices made of them."""

from toeplitz_mg.operators.base import GridOperator, apply_to_rows
from toeplitz_mg.operators.composed import BlockDiagonal, DiagonalisedOperator, DiagonallyScaled
from toeplitz_mg.operators.coupled import CoupledOperator
from toeplitz_mg.operators.hankel import HankelOperator
from toeplitz_mg.operators.masked import MaskedOperator
from toeplitz_mg.operators.rectangular import NormalMatrix, RectangularToeplitz
from toeplitz_mg.operators.sums import ToeplitzSum
from toeplitz_mg.operators.toeplitz import ToeplitzOperator

__all__ = [
    "BlockDiagonal",
    "CoupledOperator",
    "DiagonalisedOperator",
    "DiagonallyScaled",
    "GridOperator",
    "HankelOperator",
    "MaskedOperator",
    "NormalMatrix",
    "RectangularToeplitz",
    "ToeplitzOperator",
    "ToeplitzSum",
    "apply_to_rows",
]
