"""What comparisons take from inside the package: names that may move, and so stand in one place.

`files` and `print_any_character` write and print; a `Grid` has the matrices of surfaces that
repeat, of which `halfspace` has none; the Schur algorithm and Levinson's recursion are rivals of a
likelihood, and eigenvalues of `smooth_column` are zero where the campaign wants them to be.
"""

from toeplitz_mg.cli import files as files
from toeplitz_mg.cli.report import print_any_character as print_any_character
from toeplitz_mg.columns.gohberg_semencul import GohbergSemencul as GohbergSemencul
from toeplitz_mg.columns.schur import schur_column as schur_column
from toeplitz_mg.contact.grid import Grid as Grid
from toeplitz_mg.preconditioners.circulant import smooth_column as smooth_column
from toeplitz_mg.solvers.reflection import levinson_column as levinson_column
