"""Sizes at which one method for Toeplitz systems becomes faster than another, in one table.

They are numbers of unknowns unless stated otherwise. `python -m comparisons.drop_in` measures both
sides of them. The table in `methods` says which method is used, and why.
"""

SHORT = 512  # Most unknowns for which n² compiled steps are as fast as transforms.
CORRECTED = 256  # Most unknowns for which correcting the result of Levinson's recursion is cheap.
# Fewest unknowns for Trench's recursion with complex numbers or several columns. Above its square,
# n² steps of Levinson's recursion per column take longer than the set-up of the inverse.
RECURSIVE = 1024
# Fewest unknowns for Trench's recursion with one real column, and for GMRES; most for Levinson's
# recursion instead of the superfast Schur algorithm.
GENERAL = 2048
LARGEST_DENSE = 4096  # Most unknowns for an LU factorisation, which takes 128 MiB.
LARGEST_RECURSIVE = 20_000  # Most unknowns for n² steps after other methods have failed.
PANELS = 2**16  # Fewest unknowns for which products in panels are faster than whole transforms.
LOW_RANK = 4096  # Fewest unknowns for which a low-rank inverse saves more than it costs.

FEW = 2  # Most right-hand sides for which an inverse is not worth its set-up.
COSINE_LIMIT = 80_000  # Most columns² n for which CG in the DCT domain is faster than the inverse.
ITERATION = 64  # Trench's recursion for this many unknowns takes as long as a GMRES iteration.

# Most diagonals of a band besides the main one, for LAPACK and for products; twice as many for a
# triangular matrix, which needs no factors.
FEW_DIAGONALS = 32
LARGEST_BAND = 2 * LARGEST_DENSE**2  # Most numbers in the diagonals of a band: 256 MiB.

# Most unknowns of systems solved by one joint recursion; above 100 SciPy is as fast for each.
LARGEST_AT_ONCE = 64
