"""The points of the surface at which influence coefficients are needed, relative to the load."""

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.values import count, positive, refuse_masked


def offsets(grid_shape: tuple[int, int], element: tuple[float, float]) -> tuple[Array, Array]:
    """Return the points of the first column of a matrix that is symmetric along both axes.

    They go with ``ToeplitzOperator(c)``, for coefficients that are even in x and in y; those of
    `all_offsets` go with ``ToeplitzOperator.from_lags(lags)``, for any.

    Parameters
    ----------
    grid_shape : (int, int)
        n₁ × n₂ elements.
    element : (float, float)
        Size h₁ × h₂ of an element.

    Returns
    -------
    x, y : ndarray of shape (n₁, 1) and (1, n₂)
        The centres i h₁ and j h₂, i = 0 … n₁ - 1, j = 0 … n₂ - 1.

    Raises
    ------
    ValueError
        For a grid without elements, or an element whose size is not positive.
    TypeError
        For numbers of elements that are not integers, or sizes that are not real numbers.

    See Also
    --------
    all_offsets : of all quadrants.
    influence_matrix : the matrix.

    Examples
    --------
    >>> import toeplitz_mg as tmg
    >>> x, y = tmg.halfspace.offsets((32, 16), (0.25, 0.5))
    >>> A = tmg.ToeplitzOperator(
    ...     tmg.halfspace.influence_zz(x, y, (0.25, 0.5), G=82000.0, nu=0.28)
    ... )
    >>> A.grid_shape
    (32, 16)

    A_xy is odd, and needs the negative lags too:

    >>> x, y = tmg.halfspace.all_offsets((32, 16), (0.25, 0.5))
    >>> A_xy = tmg.ToeplitzOperator.from_lags(
    ...     tmg.halfspace.influence_xy(x, y, (0.25, 0.5), G=82000.0, nu=0.28)
    ... )
    >>> A_xy.grid_shape
    (32, 16)
    """
    h1, h2 = check_element(element)
    n1, n2 = _grid(grid_shape)
    return h1 * np.arange(n1)[:, None], h2 * np.arange(n2)[None, :]


def all_offsets(grid_shape: tuple[int, int], element: tuple[float, float]) -> tuple[Array, Array]:
    """Return the points of all coefficients, negative lags too.

    They go with ``ToeplitzOperator.from_lags(lags)``, for any coefficients, such as A_xy; those of
    `offsets` go with ``ToeplitzOperator(c)``, for coefficients that are even in x and in y.

    Parameters
    ----------
    grid_shape : (int, int)
        n₁ × n₂ elements.
    element : (float, float)
        Size h₁ × h₂ of an element.

    Returns
    -------
    x, y : ndarray of shape (2 n₁ - 1, 1) and (1, 2 n₂ - 1)
        i h₁ and j h₂, i = -(n₁ - 1) … n₁ - 1, j = -(n₂ - 1) … n₂ - 1.

    Raises
    ------
    ValueError
        For a grid without elements, or an element whose size is not positive.
    TypeError
        For numbers of elements that are not integers, or sizes that are not real numbers.

    See Also
    --------
    offsets : of one quadrant, where the coefficients are even.
    influence_matrix : the matrix.

    Examples
    --------
    >>> import toeplitz_mg as tmg
    >>> x, y = tmg.halfspace.all_offsets((3, 2), (1.0, 1.0))
    >>> a_xy = tmg.halfspace.influence_xy(x, y, (1.0, 1.0), G=1.0, nu=0.3)
    >>> tmg.ToeplitzOperator.from_lags(a_xy).grid_shape
    (3, 2)
    """
    h1, h2 = check_element(element)
    n1, n2 = _grid(grid_shape)
    return h1 * np.arange(1 - n1, n1)[:, None], h2 * np.arange(1 - n2, n2)[None, :]


def check_element(element: tuple[float, float]) -> tuple[float, float]:
    """Return the two sizes of an element, or say what is wrong with them."""
    if refuse_masked("element", element).shape != (2,):
        raise ValueError(f"element is {element}, but an element has the two sizes h1 and h2")
    return positive("element[0]", element[0]), positive("element[1]", element[1])


def _grid(grid_shape: tuple[int, int]) -> tuple[int, int]:
    if refuse_masked("grid_shape", grid_shape).shape != (2,):
        raise ValueError(f"grid_shape is {grid_shape}, but the surface has the two axes x and y")
    return count("grid_shape[0]", grid_shape[0]), count("grid_shape[1]", grid_shape[1])
