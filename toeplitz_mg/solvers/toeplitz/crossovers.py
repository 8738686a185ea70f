"""Where one way to solve a Toeplitz system becomes faster than another, by its size alone.

`python -m comparisons.drop_in` times what is chosen on both sides of these for symmetric matrices,
with ``--columns`` for several right-hand sides.
"""

from toeplitz_mg.solvers.toeplitz.cosine_form import fast_length

FEW = 2  # Most columns for which the inverse is not worth its set-up.
# Fewest unknowns where GMRES, and Trench's recursion in calls of BLAS, are faster than Levinson's.
GENERAL = 2048
RECURSIVE = 1024  # The same for Trench's and two of Levinson's.
ITERATION = 64  # Unknowns where Trench's recursion takes as long as one iteration of GMRES.
FEWEST = 4  # Iterations that GMRES takes at least.
SHORT = 256  # Most unknowns where nothing that takes transforms is faster than Levinson's.
EQUAL = 512  # Unknowns where Levinson's recursion and CG in the DCT domain take as long.
STEPS_OF_CG = 6_000_000  # Steps of Levinson's recursion, n² a column, for other set-ups of CG.
STEPS_OF_INVERSE = 3_000_000  # The same for the inverse.
FSAI = 2**16  # Fewest unknowns where FSAI is faster, of a slow length and slow decay.
COSINE_LIMIT = 80_000  # Most columns² n where CG in the DCT domain is faster than the inverse.


def lu_is_faster_than_levinson(n: int, columns: int) -> bool:
    """Whether a dense factor is faster: its set-up is of n³ steps, but each column is free."""
    return columns >= 4 + n // 32


def trench_is_faster_than_levinson(n: int, columns: int, is_complex: bool) -> bool:
    """Whether Trench's recursion is faster, which is one for all columns and corrections.

    Of complex numbers Levinson's takes twice as long.
    """
    return n >= (RECURSIVE if is_complex or columns > 1 else GENERAL)


def recursion_is_faster_than_gmres(n: int, columns: int) -> bool:
    """Whether Trench's recursion is faster: its set-up is of n² steps, but each column is free."""
    return n <= FEWEST * ITERATION * columns


def iterations_before_recursion(n: int, columns: int) -> int:
    """Return the iterations of GMRES, for each column, after which Trench's recursion is faster.

    Of one column it is not, as what has been iterated is lost then; of several only the first is.
    """
    return n // (ITERATION * columns) if columns > 1 else n


def levinson_is_fastest(n: int, columns: int) -> bool:
    """Whether Levinson's recursion is faster than any other method for a symmetric matrix.

    It takes n² steps for each column. CG in the DCT domain takes calls, which cost as much as three
    columns of `EQUAL` numbers, and a time in proportion to the numbers.
    """
    return n <= SHORT or columns * (n / EQUAL) ** 2 <= (3.0 + columns * n / EQUAL) / 4.0


def levinson_is_faster_than_inverse(n: int, columns: int) -> bool:
    """Whether Levinson's recursion is faster than what may follow CG in the DCT domain."""
    return columns * n**2 <= (STEPS_OF_CG if columns <= FEW else STEPS_OF_INVERSE)


def cosine_is_faster_than_inverse(n: int, columns: int) -> bool:
    """Whether CG in the DCT domain is faster than anything that may follow it."""
    is_first = columns <= FEW or columns * n**2 <= STEPS_OF_INVERSE  # The inverse is none before.
    return is_first or columns**2 * n <= COSINE_LIMIT


def fsai_is_faster_than_cosine(n: int) -> bool:
    """Whether FSAI is faster than CG in the DCT domain, for coefficients that decay slowly.

    Where the length is slow an iteration there takes six transforms, of a longer one.
    """
    return n >= FSAI and fast_length(n) > n
