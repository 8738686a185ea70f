"""The method of the paper in one file, with its letters and in its order, in plain NumPy.

J. Zhao, E. A. H. Vollebregt, C. W. Oosterlee, "Multigrid with FFT smoother for a simplified 2D
frictional contact problem". Numbers in brackets are its equations and sections. Nothing is checked
here, and nothing is fast; the operators of the package do both, and are tested against this file.

>>> from toeplitz_mg.paper import algorithm
>>> A, u = algorithm.system(1, 2**15)  # Table IV, V(1,0): 6 (0.0430)
>>> levels = algorithm.grids(1, 2**15, algorithm.fft_rsm)
>>> p, k, q = algorithm.solve(A, u, lambda r: algorithm.cycle(levels, r, pre=1, post=0))
>>> print(f"{k} ({q:.4f})")
6 (0.0446)
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.fft import fft, ifft, irfft, rfft

from toeplitz_mg._typing import Array

Matrix = Any  # An object with `@`: a `Toeplitz`, or an array.
Smoother = Callable[[Array], Array]  # Maps a residual to a correction, such as r to M r (12).


def influence_coefficients(n: int, G: float, nu: float, a: float = 4.0, b: float = 50.0) -> Array:
    """Return a_0 … a_(n-1) for n x 1 elements on [-a, a] x [-b, b] (2.3, 2.4).

    They are integrals of ((1 - ν)/ρ + ν x²/ρ³)/(πG) over an element, ρ² = x² + y².
    """
    h = 2.0 * a / n
    x = h * (np.arange(n + 1) - 0.5)  # The sides of the elements.
    primitive = (1.0 - nu) * x * np.arcsinh(b / abs(x)) + b * np.arcsinh(x / b)
    return 2.0 / (np.pi * G) * np.diff(primitive)


def spread(x: Array, contact: Array) -> Array:
    """Return x on the potential contact area, with zeros where there is no contact (5.4)."""
    everywhere = np.zeros((len(contact), *x.shape[1:]))
    everywhere[contact] = x
    return everywhere


class Toeplitz:
    """The matrix t_|i-j| (7), or its rows and columns for the elements in contact (5.4)."""

    def __init__(self, t: Array, contact: Array) -> None:
        self.t, self.contact = t, contact

    def __matmul__(self, x: Array) -> Array:
        """Multiply by FFTs: T is the leading block of a circulant of order 2n."""
        n = len(self.t)
        eigenvalues = rfft(np.concatenate([self.t, [0.0], self.t[:0:-1]]))
        y = irfft(eigenvalues * rfft(spread(x, self.contact).T, 2 * n)).T[:n]
        return y[self.contact]


def column_of_inverse(a: Array, K: int) -> Array:
    """Return m^K, which approximates the Kth column of A⁻¹ (Figure 4)."""
    n = len(a)
    lags = np.concatenate([a[:0:-1], a])  # 1. a_-(n-1) … a_(n-1)
    u = np.zeros(2 * n - 1)
    u[n - 1 + K - 1] = 1.0  # 2. [0, e], where e_K = 1
    return ifft(fft(u) / fft(lags)).real  # 3.


def approximate_inverse(A: Toeplitz) -> Toeplitz:
    """Return M with the coefficients m_0 … m_(n-1) of m^K from its Kth on, K = n/2 (3.1)."""
    n = len(A.t)
    K = n // 2
    return Toeplitz(column_of_inverse(A.t, K)[K - 1 :][:n], A.contact)


def fft_smoother(A: Toeplitz, M: Toeplitz) -> Smoother:
    """Return r → M r (12)."""
    return lambda r: M @ r


def cycle(levels: list[tuple[Toeplitz, Smoother]], u: Array, pre: int, post: int) -> Array:
    """Return p after one V(pre, post)-cycle for A p = u from p = 0 (3.3)."""
    A, smooth = levels[0]
    if len(levels) == 1:
        return np.linalg.solve(A @ np.eye(len(u)), u)
    coarse = levels[1][0].contact
    p = np.zeros_like(u)
    for _ in range(pre):
        p = p + smooth(u - A @ p)  # (11)
    d = spread(u - A @ p, A.contact)
    d = (d[0::2] + d[1::2]) / 2.0  # (13)
    v = spread(cycle(levels[1:], d[coarse], pre, post), coarse)
    p = p + np.repeat(v, 2, axis=0)[A.contact]  # (14)
    for _ in range(post):
        p = p + smooth(u - A @ p)  # (11)
    return p


def deflate(A: Matrix, M: Matrix, Z: Array) -> Smoother:
    """Return r → P M r (18), where P = I - M A Z E⁻¹ Zᵀ (15, 16)."""
    MAZ = M @ (A @ Z)
    E = Z.T @ MAZ  # (17)
    return lambda r: M @ r - MAZ @ np.linalg.solve(E, Z.T @ (M @ r))


def fft_sd(A: Toeplitz, M: Toeplitz) -> Smoother:
    """Return the FFT + SD smoother, with the left and the right half as subdomains (4.1)."""
    n = np.count_nonzero(A.contact)
    is_left = np.arange(n) < (n + 1) // 2
    return deflate(A, M, np.column_stack([is_left, ~is_left]).astype(float))


def modify_row_sums(M: Matrix, sums: Array, gamma: float) -> Smoother:
    """Return r → M̄ r, where M̄ = M - diag(sum(M) - γ) (19)."""
    return lambda r: M @ r - ((sums - gamma) * r.T).T


def fft_rsm(A: Toeplitz, M: Toeplitz) -> Smoother:
    """Return the FFT + RSM smoother (4.2): γ from all of M, sums over the contact only (22)."""
    ones = np.ones(len(M.t))
    gamma = (Toeplitz(M.t, ones > 0.0) @ ones).min()  # (20)
    return modify_row_sums(M, M @ ones[M.contact], gamma)


def system(test: int, n: int) -> tuple[Toeplitz, Array]:
    """Return A and u of test 1, 2 or 3 with n x 1 elements (2.5, 5)."""
    G, nu = (0.3, 0.49) if test == 2 else (82000.0, 0.28)
    x = -4.0 + 8.0 / n * (np.arange(n) + 0.5)  # Centres of the elements.
    contact = (x < -2.0) | (x > 0.0) | (test != 3)
    u = x if test == 2 else np.full(n, 0.0008)
    return Toeplitz(influence_coefficients(n, G, nu), contact), u[contact]


def grids(
    test: int, n: int, smoother: Callable[[Toeplitz, Toeplitz], Smoother]
) -> list[tuple[Toeplitz, Smoother]]:
    """Return A and its smoother on n, n/2 … 2 elements, each discretised anew (3.3)."""
    matrices = [system(test, n >> k)[0] for k in range(n.bit_length() - 1)]
    return [(A, smoother(A, approximate_inverse(A))) for A in matrices]


def solve(A: Matrix, u: Array, step: Smoother, p: Array | None = None) -> tuple[Array, int, float]:
    """Return p, the iterations k and the convergence factor q, to ‖u - A p‖/‖u‖ ≤ 1e-8 (5)."""
    p = np.random.default_rng(0).random(len(u)) if p is None else p  # As in the paper.
    r = first = u - A @ p
    k = 0
    while np.linalg.norm(r) > 1e-8 * np.linalg.norm(u) and k < 100:
        p = p + step(r)  # (11)
        r, k = u - A @ p, k + 1
    return p, k, float(np.linalg.norm(r) / np.linalg.norm(first)) ** (1.0 / k)
