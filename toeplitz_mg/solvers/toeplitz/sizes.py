"""Sizes at which one way to solve a Toeplitz system becomes faster than another, in one table.

They are numbers of unknowns where nothing else is said. `python -m comparisons.drop_in` measures
both sides of them. Which method is taken, and why, the table in `methods` says.
"""

SHORT = 512  # Up to it n² steps that are compiled take no longer than transforms: products too.
CORRECTED = 256  # Most for which the answer of Levinson's recursion is soon corrected.
# Fewest for Trench's recursion, of complex numbers or several columns; its square is how many steps
# of Levinson's recursion, n² a column, take longer than the set-up of the inverse.
RECURSIVE = 1024
# Fewest for Trench's recursion of one real column, and for GMRES; most for Levinson's recursion in
# the place of the superfast Schur algorithm.
GENERAL = 2048
LARGEST_DENSE = 4096  # Most of a matrix that LU factorises: of 128 MiB.
LARGEST_RECURSIVE = 20_000  # Most for which n² steps are taken after other methods have failed.
PANELS = 2**16  # Fewest for which products in panels are faster than by transforms at once.
LOW_RANK = 4096  # Fewest for which iterations that are saved take longer than columns of low rank.

FEW = 2  # Most right-hand sides for which an inverse is not worth its set-up.
COSINE_LIMIT = 80_000  # Most columns² n for which CG in the DCT domain is faster than the inverse.
ITERATION = 64  # Unknowns with which Trench's recursion takes as long as an iteration of GMRES.

# Most diagonals beside the main one of a band: for LAPACK, and for products; of a triangle twice as
# many, as it needs no factors.
FEW_DIAGONALS = 32
LARGEST_BAND = 2 * LARGEST_DENSE**2  # Most numbers of the diagonals of a band: 256 MiB.

# Of many systems that are solved by one recursion:
LARGEST_AT_ONCE = 64  # Above some 100 unknowns SciPy's recursion is as fast for each.
