"""What is multiplied: Toeplitz matrices of one or several levels, and their restrictions."""

from toeplitz_mg.operators.convolution import DiagonalisedProduct
from toeplitz_mg.operators.coupled import CoupledOperator
from toeplitz_mg.operators.diagonalised import DiagonalisedOperator
from toeplitz_mg.operators.masked import MaskedOperator
from toeplitz_mg.operators.rows import RowsOperator, apply_to_rows, as_rows
from toeplitz_mg.operators.toeplitz import ToeplitzOperator
from toeplitz_mg.operators.work import ProductCount, count_products

__all__ = [
    "CoupledOperator",
    "DiagonalisedOperator",
    "DiagonalisedProduct",
    "MaskedOperator",
    "ProductCount",
    "RowsOperator",
    "ToeplitzOperator",
    "apply_to_rows",
    "as_rows",
    "count_products",
]
