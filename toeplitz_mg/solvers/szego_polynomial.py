"""The polynomial a(z) = Σ xₖ zᵏ/x₀ of the column x = A⁻¹ e₁, on the unit circle.

Its values are computed once. They tell whether A⁻¹ is positive definite, and give the sums of its
diagonals and the logarithm of det A (`toeplitz_mg.solvers.szego`).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.columns.circle import OVERSAMPLING, Certificate, Circle, circle_of

MOST_SAMPLES = 16  # Most samples per unknown; with more, other methods are as fast.


@dataclass(frozen=True)
class SzegoPolynomial:
    """The polynomial a = x/x₀ of a column with a positive first entry.

    Attributes
    ----------
    x : ndarray of float64 or complex128, of shape (n,)
    """

    x: Array

    @cached_property
    def coefficients(self) -> Array:
        """The coefficients of a."""
        return np.asarray(self.x / self.x[0].real)

    @cached_property
    def circle(self) -> Circle:
        """A circle with so many points that a correlation does not wrap around."""
        return circle_of(2 * len(self.x) - 1, self.x.dtype)

    @cached_property
    def values(self) -> Array:
        """The values of a on the circle."""
        return self.circle.values(self.coefficients)

    @cached_property
    def slopes(self) -> Array:
        """The values of z a' on the circle."""
        return self.circle.values(np.arange(float(len(self.x))) * self.coefficients)

    @cached_property
    def certificate(self) -> Certificate:
        """Whether A⁻¹ is positive definite, as far as `MOST_SAMPLES` per unknown tell."""
        certificate = Certificate.of_values(self.coefficients, self.circle, self.values)
        return self._resolve(certificate, OVERSAMPLING, MOST_SAMPLES * len(self.x))

    def certify(self, most: int) -> Certificate:
        """Return the certificate, with up to `most` samples if fewer do not decide."""
        return self._resolve(self.certificate, 4 * MOST_SAMPLES, most)

    def _resolve(self, certificate: Certificate, samples: int, most: int) -> Certificate:
        while not certificate.resolved and samples * len(self.x) <= most:
            certificate = Certificate.of(self.coefficients, samples)
            samples *= 4
        return certificate

    @cached_property
    def diagonal_sums(self) -> Array:
        """Σ_i (A⁻¹)_(i,i+k), k = 0 … n - 1.

        By the Gohberg-Semencul formula it is Σ_p (n - k - 2p) x_p x̄_(p+k)/x₀. The weight is the
        mean of n - 2p and n - 2(p + k). So it is the mean of the correlations of (n - 2p) x_p with
        x and of x with that, whose values on the circle are complex conjugates.
        """
        a, slopes, n = self.values, self.slopes, len(self.x)
        products = a.real * (n * a.real - 2.0 * slopes.real)
        products += a.imag * (n * a.imag - 2.0 * slopes.imag)
        sums = self.circle.coefficients(products, n).conj()
        sums *= self.x[0].real
        return sums


def autocorrelations(x: Array) -> Array:
    """Return Σ_p x_p x̄_(p+k), k = 0 … n - 1."""
    circle = circle_of(2 * len(x) - 1, x.dtype)
    z = circle.values(x)
    return circle.coefficients(z.real**2 + z.imag**2, len(x)).conj()
