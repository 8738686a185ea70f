"""The fewest neighbours in a row of G that solve a trial problem with few iterations.

For a slowly decaying kernel, such as that of a half-space, twelve preceding cells are enough. A
smooth covariance such as Matérn's needs more, and so do very long elements, particularly if few
cells are active: then a row has only one or two of the many cells that matter. So conjugate
gradients are run with P on a small grid, one part of which is fully active and the rest to a tenth.
The trial does not detect what acts along chains of cells longer than its grid: coefficients at
isolated lags, or a nearly singular Laplacian.
"""

from dataclasses import replace
from math import inf, isqrt, log

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.conjugate_gradients import ConjugateGradients
from toeplitz_mg.operators import MaskedOperator, ToeplitzOperator
from toeplitz_mg.preconditioners.fsai.build import Options, build
from toeplitz_mg.preconditioners.fsai.cellgrid import AGGREGATE
from toeplitz_mg.preconditioners.fsai.levels import LevelMatrix
from toeplitz_mg.preconditioners.fsai.rows import Refused, require_positive
from toeplitz_mg.preconditioners.fsai.stencil import NEIGHBOURS, Stencil

NUMBERS = NEIGHBOURS, 24, 40  # Numbers to try: half of the cells within the distance 2, 3 and 4.
COARSE_ON_LINE = 24  # Neighbours on coarse levels of a line if the finest has more than the fewest.
CELLS = 2**12  # Cells of the trial grid, a square if possible, with three levels.
CELLS_OF_LINE = 2**14  # Cells of a trial on a line, where CELLS make too few aggregates at an edge.
SPARSE = 0.1  # Share of active cells in the sparse part; with less, most cells are isolated.
PART = 0.75  # Share of the grid in the sparse part, so that it has enough unknowns.
REDUCTION = 1e-8  # Relative residual at which a trial ends.
# Most iterations of a trial. Large grids with any mask take up to 1.2 times as many, and elements
# longer than 1:100 up to 1.5 times; 16 are promised. A kernel within half an iteration of this
# limit takes 14 to 16, whether accepted or not.
MOST = 13.6
COARSENED = Options(direct=30)  # So few direct unknowns that E is coarsened too.


def select_stencil(kernel: Array) -> Stencil:
    """Return the stencil with the fewest neighbours that suffice for a one-component kernel.

    Raises
    ------
    numpy.linalg.LinAlgError
        If 40 do not suffice, or the construction fails.
    """
    for neighbours in NUMBERS:
        stencil = Stencil.of_one(kernel, neighbours)
        if is_enough(stencil):
            return stencil
    raise Refused(
        f"conjugate gradients take more than {MOST} iterations on a trial problem with the sparse "
        f"approximate inverse of {neighbours} neighbours: too smooth a kernel for it; give "
        "neighbours=… to use it all the same, with more iterations"
    )


def choose_stencil(
    near: Array, is_line: bool, unknowns: int, is_whole: bool, options: Options
) -> tuple[Stencil, Options]:
    """Return the stencil of one component, and the options of its levels.

    Parameters
    ----------
    near : ndarray of shape (n1, n2)
        The coefficients, or at least the near ones.
    is_line : bool
        Whether the grid has one axis.
    unknowns : int
    is_whole : bool
        Whether all cells of the grid are unknowns.
    options : Options

    Raises
    ------
    numpy.linalg.LinAlgError
        If `select_stencil` does.
    """
    if is_line and is_whole:
        # The matrix that `line` builds, which exploits that all rows are equal.
        stencil = Stencil(near[None, None], AGGREGATE - 1, AGGREGATE - 1)
        return stencil, replace(options, direct=options.direct_on_line)
    if options.neighbours is not None or unknowns <= options.direct:
        # A direct solve has no G, so the number of neighbours does not matter.
        neighbours = options.neighbours or NEIGHBOURS
    else:
        neighbours = select_stencil(near.reshape(1, -1) if is_line else near).neighbours
    stencil = Stencil.of_one(near, neighbours)
    if is_line and neighbours > NEIGHBOURS:  # Coarse levels would dominate the iterations.
        stencil = replace(stencil, coarse_neighbours=COARSE_ON_LINE)
    return stencil, options


def is_enough(stencil: Stencil) -> bool:
    """Whether these neighbours suffice for a one-component kernel."""
    return count_iterations(stencil) <= MOST


def count_iterations(stencil: Stencil) -> float:
    """Return the number of iterations of a trial, with a fraction of the last; inf if too many."""
    kernel = stencil.grid.kernel
    cells = CELLS_OF_LINE if kernel.shape[0] == 1 else CELLS
    rows = min(len(kernel), max(isqrt(cells), cells // kernel.shape[1]))
    kernel = kernel[:rows, : cells // rows]
    is_sparse = np.arange(1, kernel.shape[1] + 1) <= PART * kernel.shape[1]
    active = np.random.default_rng(1).random(kernel.shape) < np.where(is_sparse, SPARSE, 1.0)
    small = Stencil.of_one(kernel, stencil.neighbours)
    # A table of rows takes longer than the few hundred rows themselves.
    matrix = LevelMatrix.of_mask(small, active).without_table()
    P = build(small, matrix, np.dtype(np.float64), COARSENED)
    A = MaskedOperator(ToeplitzOperator(kernel), active)
    r = np.random.default_rng(0).standard_normal(A.shape[0])
    length = float(np.linalg.norm(r))
    goal = REDUCTION * length
    iteration = ConjugateGradients(A.apply, lambda r, out: P(r))
    for count in range(2 * int(MOST)):
        step = iteration.step(r)
        if not iteration.rho > 0.0:
            return inf
        require_positive("for some vector on a small grid xᵀ A x is", iteration.curvature)
        r -= step * iteration.product
        previous, length = length, float(np.linalg.norm(r))
        if length <= goal:
            length = max(length, np.finfo(np.float64).tiny)
            return count + log(previous / goal) / log(previous / length)
    return inf
