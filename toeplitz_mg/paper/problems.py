"""The three test problems of the paper (§2.5 and §5), in its units: N and mm."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg import halfspace
from toeplitz_mg._typing import Array
from toeplitz_mg.operators import MaskedOperator, ToeplitzOperator
from toeplitz_mg.values import count

STEEL = halfspace.Material.from_shear(82000.0, 0.28)
RUBBER = halfspace.Material.from_shear(0.3, 0.49)
A_HALF, B_HALF = 4.0, 50.0  # Half sides of the potential contact area along x and y, mm.


@dataclass(frozen=True)
class Problem:
    """A linear system A p = u of the contact problem without slip (paper, Eq. 10).

    Attributes
    ----------
    name : str
    A : ToeplitzOperator or MaskedOperator
        Influence coefficients, mm per N/mm².
    b : ndarray of shape (N,)
        Rigid shift u of the N elements in contact, mm.
    x : ndarray of shape (N,)
        Centres of the elements in contact, mm.
    h : float
        Width of an element, mm.
    material : Material

    See Also
    --------
    test1 : steel, a constant shift.
    test2 : rubber, a shift that grows with x.
    test3 : test 1 on two strips.
    """

    name: str
    A: LinearOperator
    b: Array
    x: Array
    h: float
    material: halfspace.Material

    def operator_of_grid_shape(self, grid_shape: tuple[int, ...]) -> ToeplitzOperator:
        """Discretise the potential contact area with another number of elements.

        Parameters
        ----------
        grid_shape : (int,)

        Returns
        -------
        ToeplitzOperator
            For ``rediscretised(problem.operator_of_grid_shape)``.
        """
        (n,) = grid_shape
        return _operator(n, self.material)


def test1(n: int) -> Problem:
    """Return test 1: steel, a constant shift of 0.0008 mm (paper, §2.5).

    Parameters
    ----------
    n : int
        Number of elements, each 8/n × 100 mm.

    Returns
    -------
    Problem

    Raises
    ------
    ValueError
        If `n` is below 1.
    TypeError
        If `n` is not an integer.

    See Also
    --------
    test2 : rubber, a shift that grows with x.
    test3 : test 1 on two strips.
    toeplitz_mg.multigrid : the solver.

    Examples
    --------
    >>> from toeplitz_mg.paper.problems import test1
    >>> test1(1000).A
    <ToeplitzOperator 1000, symmetric, float64>
    """
    x, h = _centres(n)
    return Problem("test 1", _operator(n, STEEL), np.full(n, 0.0008), x, h, STEEL)


def test2(n: int) -> Problem:
    """Return test 2: rubber, a shift equal to x, by spin (paper, §5).

    Parameters
    ----------
    n : int
        Number of elements, each 8/n × 100 mm.

    Returns
    -------
    Problem

    Raises
    ------
    ValueError
        If `n` is below 1.
    TypeError
        If `n` is not an integer.

    See Also
    --------
    test1 : steel, a constant shift.
    test3 : test 1 on two strips.
    toeplitz_mg.multigrid : the solver.

    Examples
    --------
    >>> from toeplitz_mg.paper.problems import test2
    >>> test2(4).b
    array([-3., -1.,  1.,  3.])
    """
    x, h = _centres(n)
    return Problem("test 2", _operator(n, RUBBER), x.copy(), x, h, RUBBER)


def test3(n: int) -> Problem:
    """Return test 3: test 1 on two strips, a wavy surface (paper, §5.4).

    Parameters
    ----------
    n : int
        Number of elements, each 8/n × 100 mm.

    Returns
    -------
    Problem
        The elements with their centre in (-4, -2) or (0, 4) are in contact.

    Raises
    ------
    ValueError
        If `n` is below 2, so that no element is in contact.
    TypeError
        If `n` is not an integer.

    See Also
    --------
    test1 : steel, a constant shift.
    test2 : rubber, a shift that grows with x.
    toeplitz_mg.multigrid : the solver.

    Examples
    --------
    >>> from toeplitz_mg.paper.problems import test3
    >>> test3(1024).A
    <MaskedOperator 768 of 1024 points of <ToeplitzOperator 1024, symmetric, float64>>
    """
    x, h = _centres(n)
    mask = (x < -2.0) | (x > 0.0)
    if not mask.any():
        raise ValueError(f"n is {n}, but test 3 needs at least 2 elements to have one in contact")
    A = MaskedOperator(_operator(n, STEEL), mask)
    return Problem("test 3", A, np.full(A.shape[0], 0.0008), x[mask], h, STEEL)


TESTS = {1: test1, 2: test2, 3: test3}  # The problems by their numbers in the paper.


def _centres(n: int) -> tuple[Array, float]:
    n = count("n", n)
    h = 2.0 * A_HALF / n
    return -A_HALF + h * (np.arange(n) + 0.5), h


def _operator(n: int, material: halfspace.Material) -> ToeplitzOperator:
    element = (2.0 * A_HALF / n, 2.0 * B_HALF)
    x, y = halfspace.offsets((n, 1), element)
    coefficients = halfspace.influence_xx(x, y, element, G=material.G, nu=material.nu)
    return ToeplitzOperator(coefficients[:, 0])
