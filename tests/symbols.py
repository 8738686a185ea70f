"""First columns of symmetric positive definite Toeplitz matrices, by name."""

import numpy as np

from tests.cases import contact


def fourier(f, n):
    """The first n Fourier coefficients of an even symbol, to the accuracy of 16 n samples."""
    theta = 2 * np.pi * np.arange(16 * n) / (16 * n)
    return np.fft.ifft(f(np.minimum(theta, 2 * np.pi - theta))).real[:n]


def _columns(n):
    k = np.arange(n, dtype=float)
    nugget = k == 0
    r = np.sqrt(3) * k / 50
    return {
        "theta^4 + 1": lambda: fourier(lambda t: t**4 + 1, n),
        "|theta|^3 + 0.01": lambda: fourier(lambda t: t**3 + 0.01, n),
        "|theta|^1.5": lambda: fourier(lambda t: t**1.5, n),
        "|theta|^3": lambda: fourier(lambda t: t**3, n),
        "theta^4": lambda: fourier(lambda t: t**4, n),
        "|theta|": lambda: fourier(lambda t: t, n),
        "theta^2": lambda: np.r_[np.pi**2 / 3, 2 * (-1.0) ** k[1:] / k[1:] ** 2],
        "2 - 2 cos": lambda: np.r_[2.0, -1.0, np.zeros(n - 2)],
        "(2 - 2 cos)^2": lambda: np.r_[6.0, -4.0, 1.0, np.zeros(n - 3)],
        "2 + 2 cos": lambda: np.r_[2.0, 1.0, np.zeros(n - 2)],
        "(1+k)^-1.1": lambda: (1 + k) ** -1.1,
        "cos k/(k+1)": lambda: np.cos(k) / (k + 1),
        "0.9^k": lambda: 0.9**k,
        "exp(-k/1000)": lambda: np.exp(-k / 1000),
        "Matern": lambda: (1 + r) * np.exp(-r) + 1e-8 * nugget,
        "Gaussian": lambda: np.exp(-((k / 10) ** 2) / 2) + 1e-4 * nugget,
        "fGn": lambda: ((k + 1) ** 1.8 - 2 * k**1.8 + abs(k - 1) ** 1.8) / 2,
        "1/(1+k^2/100)": lambda: 1 / (1 + k**2 / 100) + 1e-6 * nugget,
        "wide Gaussian": lambda: np.exp(-((4 * k / n) ** 2) / 2) + 1e-6 * nugget,
        "sinc": lambda: np.sinc(k / 3) + 1e-6 * nugget,
        "contact": lambda: contact(n),
    }


def symbol(name, n):
    return _columns(n)[name]()


ALL_SYMBOLS = list(_columns(1))
