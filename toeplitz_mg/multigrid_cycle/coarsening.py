"""The matrices of the coarser grids: R A P, or the same problem discretised anew."""

from collections.abc import Callable

from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Coarsening
from toeplitz_mg.multigrid_cycle.interpolation import Interpolation, piecewise_constant
from toeplitz_mg.multigrid_cycle.transfer import Transfer
from toeplitz_mg.operators import ToeplitzOperator


def galerkin(
    A: LinearOperator, interpolation: Interpolation = piecewise_constant
) -> LinearOperator:
    """Return R A P, the Galerkin coarse matrix, which is again Toeplitz, or one near it that is.

    Parameters
    ----------
    A : ToeplitzOperator or MaskedOperator of one
    interpolation : Interpolation

    Returns
    -------
    ToeplitzOperator or MaskedOperator
        On half the elements along each axis. On a mask the coarse elements are those all of whose
        fine elements are active; the matrix is exactly R A P there too. Only where copies go to
        an odd number n of elements, on a grid of several axes, does this differ: the coarse
        elements are then (n + 1)/2, each slightly shorter than 2 fine ones, R A P is not Toeplitz,
        and this matrix is near it.

    Raises
    ------
    TypeError, ValueError
        Where `A` is no Toeplitz operator, or not symmetric; where no coarse element of a mask is
        active as a whole.

    See Also
    --------
    rediscretised : the paper's coarse matrices.
    multigrid : takes it as ``coarsen=``.

    Notes
    -----
    Along each axis a_H[k] = ½ (a[2k-1] + 2 a[2k] + a[2k+1]), or, where the weights are w, the mean
    of the a[2k+j] with half of w convolved with itself. For copies to an odd n on several axes,
    with m = (n + 1)/2, the mean is over the a[j] by a hat about k n/m that is n/m wide on each
    side, as it is, with n/m = 2, where n is even.

    Examples
    --------
    >>> from toeplitz_mg import ToeplitzOperator, galerkin
    >>> galerkin(ToeplitzOperator([4.0, 2.0, 1.0, 0.0])).toarray()
    array([[6., 2.],
           [2., 6.]])
    """
    return Transfer.of(A, interpolation).coarse_matrix(A)


def rediscretised(
    operator_of_grid_shape: Callable[[tuple[int, ...]], ToeplitzOperator],
    interpolation: Interpolation = piecewise_constant,
) -> Coarsening:
    """Return a coarsening that discretises the problem anew on the coarse grid (the paper's).

    Parameters
    ----------
    operator_of_grid_shape : callable
        Maps a grid's shape to the Toeplitz operator of the same problem on that grid.
    interpolation : Interpolation
        The interpolation of the cycle, which decides the shape of the coarse grid.

    Returns
    -------
    callable
        For the argument `coarsen` of `multigrid`.

    Raises
    ------
    TypeError
        Where the argument cannot be called.

    See Also
    --------
    galerkin : the default.
    multigrid : takes it as ``coarsen=``.

    Examples
    --------
    >>> import toeplitz_mg as tmg
    >>> problem = tmg.contact.problems.test1(64)
    >>> coarsen = tmg.rediscretised(problem.operator_of_grid_shape)
    >>> coarsen(problem.A).grid_shape
    (32,)
    """
    if not callable(operator_of_grid_shape):
        raise TypeError(f"operator_of_grid_shape is {operator_of_grid_shape!r}, but must be called")

    def coarsen(A: LinearOperator) -> LinearOperator:
        transfer = Transfer.of(A, interpolation)
        return transfer.on_coarse_mask(operator_of_grid_shape(transfer.coarse_shape))

    return coarsen
