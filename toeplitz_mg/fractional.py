"""Fractional derivatives on a uniform grid, as coefficients of Toeplitz matrices.

Fractional diffusion of order 1.5 from a wall to a wall, with coefficients that vary, as the flow
along x and against it: one implicit step in time.

>>> import numpy as np
>>> from scipy.sparse import diags_array, eye_array
>>> import toeplitz_mg as tmg
>>> n, order, step = 2**14 - 1, 1.5, 0.01
>>> h = 1.0 / (n + 1)
>>> x = h * np.arange(1, n + 1)
>>> A = tmg.ToeplitzOperator(*tmg.fractional.grunwald_coefficients(order, n))
>>> D1, D2 = diags_array(1.0 + x**2), diags_array(1.0 + (1.0 - x) ** 2)
>>> S = D1 @ A + D2 @ A.T + h**order / step * eye_array(n)
>>> b = h**order / step * np.exp(-100.0 * (x - 0.5) ** 2)  # From the concentration before.
>>> u, info = tmg.gmres(S, b, M=tmg.tau_preconditioner(S), rtol=1e-8, restart=15, maxiter=1)
>>> info
0
"""

from math import gamma

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.values import count, finite


def riesz_coefficients(order: float, n: int) -> Array:
    """Return the first column of -h^α times the Riesz derivative of order α, on n points.

    Parameters
    ----------
    order : float
        The order α, 0 < α ≤ 2.
    n : int
        Number of interior points of an interval, with the spacing h; the function is zero outside.

    Returns
    -------
    ndarray of shape (n,)
        The Fourier coefficients of ``|2 sin θ/2|^α``, for ``ToeplitzOperator(c)``, which is
        symmetric positive definite. For α = 2 they are 2, -1, 0, 0, …

    Raises
    ------
    TypeError, ValueError
        If `order` is not such a number, or `n` not a positive integer.

    See Also
    --------
    toeplitz_mg.tau_preconditioner : the preconditioner; iterations do not depend on n.

    Notes
    -----
    These are fractional centred differences, with an error of order h². The Riesz derivative is the
    fractional power -(-d²/dx²)^(α/2); on several axes add the derivatives along each axis.

    References
    ----------
    M. D. Ortigueira, Riesz potential operators and inverses via fractional centred derivatives,
    Int. J. Math. Math. Sci. (2006). C. Çelik, M. Duman, Crank-Nicolson method for the fractional
    diffusion equation with the Riesz fractional derivative, J. Comput. Phys. 231 (2012).

    Examples
    --------
    >>> import numpy as np
    >>> from toeplitz_mg.fractional import riesz_coefficients
    >>> riesz_coefficients(2.0, 4)
    array([ 2., -1., -0., -0.])
    >>> c = np.zeros((63, 63))  # On two axes.
    >>> c[:, 0] += riesz_coefficients(1.5, 63)
    >>> c[0, :] += riesz_coefficients(1.2, 63)
    """
    order, n = _check_order(order, 0.0), count("n", n)
    k = np.arange(1.0, n)
    first = gamma(order + 1.0) / gamma(order / 2.0 + 1.0) ** 2
    return first * np.cumprod(np.append(1.0, (k - 1.0 - order / 2.0) / (k + order / 2.0)))


def grunwald_coefficients(order: float, n: int) -> tuple[Array, Array]:
    """Return the first column and row of -h^α times a Riemann-Liouville derivative on n points.

    Parameters
    ----------
    order : float
        The order α, 1 ≤ α ≤ 2.
    n : int
        Number of interior points of an interval, with the spacing h; the function is zero outside.

    Returns
    -------
    c, r : ndarray of shape (n,)
        For ``A = ToeplitzOperator(c, r)``: A of the left derivative, ``A.T`` of the right one.

    Raises
    ------
    TypeError, ValueError
        If `order` is not such a number, or `n` not a positive integer.

    See Also
    --------
    riesz_coefficients : the symmetric derivative.
    toeplitz_mg.tau_preconditioner : a preconditioner.

    Notes
    -----
    This is the Grünwald formula shifted by one point, with an error of order h.

    References
    ----------
    M. M. Meerschaert, C. Tadjeran, Finite difference approximations for fractional advection-
    dispersion flow equations, J. Comput. Appl. Math. 172 (2004).

    Examples
    --------
    >>> from toeplitz_mg import ToeplitzOperator
    >>> from toeplitz_mg.fractional import grunwald_coefficients
    >>> ToeplitzOperator(*grunwald_coefficients(1.5, 3)).toarray()
    array([[ 1.5   , -1.    ,  0.    ],
           [-0.375 ,  1.5   , -1.    ],
           [-0.0625, -0.375 ,  1.5   ]])
    """
    order, n = _check_order(order, 1.0), count("n", n)
    k = np.arange(1.0, n + 1.0)
    weights = np.cumprod(np.append(1.0, (k - 1.0 - order) / k))
    row = np.zeros(n)
    row[:2] = -weights[1::-1][:n]
    return 0.0 - weights[1:], row


def _check_order(order: float, least: float) -> float:
    order = finite("order", order)
    if not (least <= order <= 2.0 and order > 0.0):
        rule = "be above 0 and at most 2" if least == 0.0 else "lie between 1 and 2"
        raise ValueError(f"order is {order}, but must {rule}")
    return order
