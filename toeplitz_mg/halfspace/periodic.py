"""Surfaces that are periodic along one axis or along all: displacements by waves of traction.

A wave of tractions t cos(q·x) on two half-spaces causes waves of displacements,

    u = 2/(G|q|) (t - ν q (q·t)/|q|²) cos(q·x) along the surface,    2(1-ν)/(G|q|) t cos(q·x) normal

to it. Along a periodic axis the tractions are sums of the waves that the grid resolves, and this
continuous symbol gives their displacements. Along a finite axis they are constant in each element,
as on a nonperiodic surface. There the modified Bessel functions K₀ and K₁ are integrated over the
elements. With c = cosh t, K₀(s) = ∫ exp(-s c) dt and K₁(s) = ∫ c exp(-s c) dt over all t ≥ 0, so
that over an element from a > 0 to a + w

    ∫ K₀ ds = ∫ exp(-a c) D/c dt,                D = 1 - exp(-w c),
    ∫ s K₁ ds = ∫ exp(-a c) (a D + g/c) dt,      g = 1 - (1 + w c) exp(-w c),
    ∫ s K₀ ds = ∫ exp(-a c) (a D + g/c)/c dt.

All terms are positive, so nothing cancels. The integrands are analytic within π/2 of the real axis
and decay double exponentially, so the error of the trapezoidal rule is only exp(-π²/step).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import acosh, factorial
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy import special
from scipy.fft import fftfreq, next_fast_len, rfftfreq

from toeplitz_mg._typing import Array
from toeplitz_mg.engine import fourier
from toeplitz_mg.engine.products import DiagonalisedProduct
from toeplitz_mg.halfspace.influence import line_contact_coefficients
from toeplitz_mg.halfspace.integrals import choose, sum_series
from toeplitz_mg.halfspace.materials import CombinedMaterial, check_constants
from toeplitz_mg.operators import CoupledOperator, DiagonalisedOperator, ToeplitzOperator
from toeplitz_mg.operators.coefficients import Coefficients
from toeplitz_mg.operators.positivity import require_positive

STEP = 0.2  # Step of the trapezoidal rule; its error is 4e-22.
FARTHEST = 39.0  # Exponents beyond this are neglected: exp(-39) is 1e-17.
NEAREST = 4  # Number of elements in the first block; the blocks further away are twice as large.
ALIKE = 1.25  # Largest ratio of the element widths in one block.
BLOCK = 2**15  # Exponentials computed at once; they stay in the cache.

# Up to z = w c = 1, g is z² Σ (-1)^k (k + 1)/(k + 2)! z^k: the next term is 1e-17.
G_SERIES = [[(-1.0) ** k * (k + 1) / factorial(k + 2)] for k in range(18)]
# Up to d = 1, ∫ K₀ from 0 to d is d Σ (d/2)^2k/(k!² (2k+1)) (Σ 1/j + 1/(2k+1) - γ - ln d/2), with
# j = 1 … k: the next term is 1e-18.
K0_SERIES = [
    [
        (sum(1.0 / j for j in range(1, k + 1)) + 1.0 / (2 * k + 1) - np.euler_gamma) * weight,
        -weight,
    ]
    for k in range(9)
    for weight in [1.0 / (factorial(k) ** 2 * (2 * k + 1))]
]


@dataclass(frozen=True)
class Waves:
    """The waves of a grid that is periodic along some of its axes (see `contact.grid.Grid`).

    Along a periodic axis the matrices are circulants; along a finite one they are embedded in
    circulants. Directions of displacements and tractions are named as in `periodic_eigenvalues`.
    """

    shape: tuple[int, ...]
    element: tuple[float, ...]
    material: CombinedMaterial
    periodic: tuple[bool, ...]
    reference: float

    @property
    def are_all(self) -> bool:
        """Whether waves describe everything: all axes are periodic, and no strip is finite."""
        return all(self.periodic) and len(self.element) == len(self.shape)

    def normal(self) -> tuple[ToeplitzOperator, float]:
        """Return the matrix of normal contact divided by its diagonal entry, and that entry."""
        return self._matrix("zz", is_scaled=True)

    def inverse_of_normal(self) -> tuple[ToeplitzOperator, float]:
        """Return the matrix from displacements to pressures over its diagonal, and that entry.

        All axes are periodic. A mean displacement causes no pressure.
        """
        eigenvalues = self._eigenvalues("zz")
        eigenvalues.flat[0] = np.inf
        return self._operator(1.0 / eigenvalues, is_scaled=True)

    def tangential(self, directions: str) -> ToeplitzOperator | CoupledOperator:
        """Return the matrix of tangential contact for tractions along "x" or "xy"."""
        if len(self.shape) == 1:
            # In plane strain "zz" and "xx" have the same coefficients.
            first = self._matrix("zz" if len(self.element) == 1 else "xx")[0]
            if directions == "x":
                return first
            return CoupledOperator([[first, None], [None, self._matrix("yy")[0]]])
        xx, xy, yy = (self._eigenvalues(directions) for directions in ("xx", "xy", "yy"))
        product = DiagonalisedProduct(
            np.array([[xx, xy], [xy, yy]]), self._lengths, (2, *self.shape)
        )
        first, second = self._matrix("xx")[0], self._matrix("yy")[0]
        # Without coupling (for example ν = 0) the block is zero.
        coupling = self._matrix("xy")[0] if xy.any() else None
        return CoupledOperator([[first, coupling], [coupling, second]], product=product)

    def invert(self, A: Any, dtype: DTypeLike | None) -> DiagonalisedOperator:
        """Return the inverse of a matrix, except for its mean and for finite axes.

        A finite axis is treated as periodic. The mean, which has no eigenvalue then, gets twice the
        largest one.
        """
        precision = np.dtype(dtype or A.dtype)
        if isinstance(A, CoupledOperator):
            xx, xy, yy = (self._eigenvalues_of_all(name) for name in ("xx", "xy", "yy"))
            xx.flat[0] = yy.flat[0] = 2.0 * max(xx.max(), yy.max())
            determinant = xx * yy - xy**2
            least = determinant / (xx + yy)
            inverse = np.array([[yy, -xy], [-xy, xx]]) / determinant
        else:
            least = self._eigenvalues_of_all("zz")
            least *= A.norm_bound / least.max()
            least.flat[0] = 2.0 * least.max()
            inverse = 1.0 / least
        subject = "the matrix of waves has the eigenvalue"
        require_positive(least, precision, subject, "dtype=np.float64")
        product = DiagonalisedProduct(inverse, self.shape, A.grid_shape, precision)
        return DiagonalisedOperator(product, "inverse of waves")

    def _matrix(
        self, directions: str, *, is_scaled: bool = False
    ) -> tuple[ToeplitzOperator, float]:
        """Return a matrix, divided by its diagonal entry if `is_scaled`, and that entry."""
        is_even = directions[0] == directions[1]
        return self._operator(self._eigenvalues(directions), is_scaled=is_scaled, is_even=is_even)

    def _operator(
        self, eigenvalues: Array, *, is_scaled: bool, is_even: bool = True
    ) -> tuple[ToeplitzOperator, float]:
        """Return the matrix from a circulant's eigenvalues, scaled on request, and its diagonal."""
        column = fourier.irfftn(eigenvalues, s=self._lengths)
        unit = float(column.flat[0])
        if is_scaled:
            column /= unit
            eigenvalues /= unit
        product = DiagonalisedProduct(eigenvalues, self._lengths, self.shape)
        if is_even:
            coefficients = Coefficients(column[tuple(map(slice, self.shape))].copy(), is_even=True)
        else:  # It is odd in x and in y. Average out the rounding of the transform.
            lags = column[np.ix_(*(np.arange(1 - n, n) for n in self.shape))]
            coefficients = Coefficients(0.5 * (lags + np.flip(lags)), is_even=False)
        return ToeplitzOperator(coefficients, product=product), unit

    @property
    def _lengths(self) -> tuple[int, ...]:
        """The length of the circulants along each axis."""
        if len(self.shape) == 1 or self.are_all:
            return self.shape
        return tuple(
            n if repeats else strip_length(n)
            for n, repeats in zip(self.shape, self.periodic, strict=True)
        )

    def _eigenvalues(self, directions: str) -> Array:
        """Return the eigenvalues of a circulant that embeds the matrix."""
        if self.are_all:
            return self._eigenvalues_of_all(directions)
        (n1, n2), (h1, h2) = (*self.shape, 1)[:2], self.element
        eigenvalues = strip_eigenvalues(
            (n1, n2),
            (h1, h2),
            self.periodic.index(True),
            directions,
            G=self.material.G,
            nu=self.material.nu,
            reference=self.reference,
        )
        # Strips of finite length are one element long.
        return eigenvalues if len(self.shape) == 2 else eigenvalues[: n1 // 2 + 1, 0]

    def _eigenvalues_of_all(self, directions: str) -> Array:
        """Return the eigenvalues for a surface that is periodic along all axes."""
        G, nu = self.material.G, self.material.nu
        return periodic_eigenvalues(self.shape, self.element, directions, G=G, nu=nu)


def periodic_eigenvalues(
    shape: tuple[int, ...],
    element: tuple[float, ...],
    directions: str = "zz",
    *,
    G: float,
    nu: float,
) -> Array:
    """Return the eigenvalues of the displacements on a surface that is periodic along all axes.

    Parameters
    ----------
    shape : (int,) or (int, int)
        Number of elements in a period. One axis is plane strain.
    element : tuple of float
        Element size, mm.
    directions : str
        Directions of displacement and traction: "zz" (normal), "xx", "xy" or "yy" (tangential).
    G, nu : float
        Shear modulus (N/mm²) and Poisson's ratio; for two materials those of `combined_material`.

    Returns
    -------
    ndarray of shape (n // 2 + 1,) or (n1, n2 // 2 + 1)
        For "zz" 2/(E*|q|) = 2(1-ν)/(G|q|), otherwise 2/(G|q|) (δ_ij - ν q_i q_j/|q|²), mm per
        N/mm², at the wavenumbers of `scipy.fft.rfftn`. It is zero at q = 0, because a mean traction
        moves an infinite half-space by any distance: displacements are relative to their mean.

    Notes
    -----
    The continuous symbol at the wavenumbers of the grid, as in `tamaas` and `aspher`. For an even
    number of elements the highest wave has no sign, and therefore does not couple x and y.

    References
    ----------
    K. L. Johnson, Contact Mechanics, §13.2.

    Examples
    --------
    >>> from toeplitz_mg.halfspace.periodic import periodic_eigenvalues
    >>> periodic_eigenvalues((4,), (0.25,), G=1.0, nu=0.5).round(6)
    array([0.      , 0.159155, 0.079577])
    """
    G, nu = check_constants(G, nu)
    last = len(shape) - 1
    along = [
        2.0 * np.pi * (rfftfreq if axis == last else fftfreq)(n, h)
        for axis, (n, h) in enumerate(zip(shape, element, strict=False))
    ]
    waves = [*np.meshgrid(*along, indexing="ij", sparse=True), 0.0]  # One axis has none along y.
    q = np.sqrt(sum(k**2 for k in waves))
    q.flat[0] = np.inf
    factor = np.array(1.0 - nu)
    if directions != "zz":
        i, j = ("xy".index(direction) for direction in directions)
        factor = float(i == j) - nu * waves[i] * waves[j] / q**2
        if i != j:
            for axis, n in enumerate(shape):
                if n % 2 == 0:
                    factor[(slice(None),) * axis + (n // 2,)] = 0.0
    eigenvalues: Array = 2.0 / (G * q) * factor
    return eigenvalues


def strip_length(n: int) -> int:
    """Return the length of the circulant that embeds n elements of a finite axis."""
    return 2 * next_fast_len(n, real=True) if n > 1 else 1


def strip_eigenvalues(
    shape: tuple[int, int],
    element: tuple[float, float],
    axis: int,
    directions: str = "zz",
    *,
    G: float,
    nu: float,
    reference: float,
) -> Array:
    """Return the eigenvalues of the displacements on a surface that is periodic along one axis.

    Parameters
    ----------
    shape : (int, int)
        Number of elements along each axis, in a period or from end to end.
    element : (float, float)
        Element size, mm.
    axis : int
        The periodic axis, 0 or 1.
    directions : str
        Directions of displacement and traction: "zz", "xx", "xy" or "yy".
    G, nu : float
        Shear modulus (N/mm²) and Poisson's ratio; for two materials those of `combined_material`.
    reference : float
        The distance at which a line load along the axis causes no displacement, mm. It fixes the
        constant: the displacements by all images of an element have no finite sum.

    Returns
    -------
    ndarray
        The eigenvalues of a circulant with the matrix as leading block, mm per N/mm², in the order
        of `scipy.fft.rfftn`. The finite axis is embedded in one of length `strip_length`.

    Notes
    -----
    A wave with the wavenumber q along the axis causes displacements at the distance t across it:
    2/(πG) times K₀ - ν q|t| K₁ along the axis, (1-ν) K₀ + ν q|t| K₁ across, (1-ν) K₀ normal to the
    surface, and -iν q t K₀ from along to across, with the modified Bessel functions K₀, K₁ of q|t|.
    These are the Fourier integrals of the symbol across the axis. They are integrated over the
    width of an element, to rounding. The mean is that of plane strain, or along the axis of
    antiplane shear.

    Examples
    --------
    >>> from toeplitz_mg.halfspace.periodic import strip_eigenvalues
    >>> strip_eigenvalues((4, 3), (0.25, 0.5), 0, G=1.0, nu=0.3, reference=6.0).shape
    (4, 4)
    """
    G, nu = check_constants(G, nu)
    other = 1 - axis
    n, h = shape[other], element[other]
    # Waves of both signs have the same eigenvalues.
    waves = 2.0 * np.pi * rfftfreq(shape[axis], element[axis])
    is_along = directions == 2 * "xy"[axis]
    is_odd = directions == "xy"
    if is_odd:
        weights = {"s_k0": -nu}
    elif directions == "zz":
        weights = {"k0": 1.0 - nu}
    else:
        weights = {"k0": 1.0, "s_k1": -nu} if is_along else {"k0": 1.0 - nu, "s_k1": nu}
    embedded = np.zeros((len(waves), strip_length(n)))
    embedded[1:, :n] = integrate_bessel(waves[1:] * h, n, **weights)
    embedded[1:, :n] *= 2.0 / (np.pi * G) / waves[1:, None]
    if is_odd and shape[axis] % 2 == 0:
        embedded[-1] = 0.0
    if not is_odd:
        embedded[0, :n] = line_contact_coefficients(
            n, h, G=G, nu=0.0 if is_along else nu, reference=reference
        )
    if n > 1:
        embedded[:, 1 - n :] = (-1.0 if is_odd else 1.0) * embedded[:, n - 1 : 0 : -1]
    hat = fourier.rfft(embedded)
    # The transform of an odd function is imaginary, and the wave along the axis has a factor i.
    quarter = -hat.imag if is_odd else hat.real
    quarter = quarter if axis == 0 else quarter.T
    length = shape[0] if axis == 0 else embedded.shape[1]
    eigenvalues = np.empty((length, quarter.shape[1]))
    eigenvalues[: len(quarter)] = quarter
    behind = length - len(quarter)
    eigenvalues[len(quarter) :] = (-1.0 if is_odd else 1.0) * quarter[behind:0:-1]
    return eigenvalues


def integrate_bessel(
    width: Array, n: int, *, k0: float = 0.0, s_k1: float = 0.0, s_k0: float = 0.0
) -> Array:
    """Return integrals over the elements of a line; the first element is centred at zero.

    Parameters
    ----------
    width : ndarray of shape (m,)
        Widths w of an element, ascending.
    n : int
        Number of elements, from w (j - ½) to w (j + ½), j = 0 … n - 1.
    k0, s_k1, s_k0 : float
        Weights of K₀(|s|), of |s| K₁(|s|) and of s K₀(|s|), which is odd.

    Returns
    -------
    ndarray of shape (m, n)
        Accurate to rounding, relative to the largest integral of K₀ with the same width.
    """
    integrals = np.zeros((len(width), n))
    if k0 or s_k1:  # The first element has two halves, which cancel for the odd function.
        half = 0.5 * width
        of_k0 = choose({0: 0.0, 1: 1.0}, half, _from_zero, half)
        # By parts, ∫ s K₁ ds = ∫ K₀ ds - s K₀.
        integrals[:, 0] = 2.0 * ((k0 + s_k1) * of_k0 - s_k1 * half * special.k0(half))
    for waves, elements in _blocks(width, n):
        w = width[waves, None]
        a = w * (np.arange(elements.start, elements.stop) - 0.5)
        c, step = _nodes(float(a[0, 0]))
        z = w * c
        D, of_a = -np.expm1(-z), s_k1 + s_k0 / c
        g = choose({0: 0.0, 1: 1.0}, z, _of_two, z) if s_k1 or s_k0 else 0.0
        factors = np.stack([(k0 * D + of_a * g) / c * step, of_a * D * step], axis=-1)
        exponent = np.multiply.outer(-a, c)
        of_one, of_a = np.moveaxis(np.exp(exponent, out=exponent) @ factors, -1, 0)
        integrals[waves, elements] = of_one + a * of_a
    return integrals


def _blocks(width: Array, n: int) -> Iterator[tuple[slice, slice]]:
    """Yield blocks of widths and elements with similar exponents, without negligible ones."""
    start = 0
    while start < len(width):
        w = float(width[start])
        stop = int(np.searchsorted(width, ALIKE * w, side="right"))
        first, end = 1, int(min(n, FARTHEST / w + 1.5))
        while first < end:
            size = max(BLOCK // len(_nodes(w * (first - 0.5))[0]), 1)
            last = min(max(2 * first, NEAREST), first + size, end)
            step = max(size // (last - first), 1)
            for k in range(start, stop, step):
                yield slice(k, min(k + step, stop)), slice(first, last)
            first = last
        start = stop


def _nodes(a: float) -> tuple[Array, Array]:
    """Return c and the weights of the trapezoidal rule, up to where exp(-a c) is negligible."""
    t = STEP * np.arange(int(acosh(max(FARTHEST / a, 1.0)) / STEP) + 2)
    return np.cosh(t), np.where(t == 0.0, 0.5 * STEP, STEP)


def _from_zero(is_far: int, d: Array) -> Array:
    """Return ∫ K₀ ds from 0 to d, for d ≤ 1, or for d ≥ 1 if `is_far`."""
    if is_far:  # The integral to infinity is π/2.
        c, step = _nodes(1.0)
        return np.pi / 2.0 - np.exp(np.multiply.outer(-d, c)) @ (step / c)
    half = 0.5 * d
    return d * sum_series(K0_SERIES, np.log(half), half * half)


def _of_two(is_far: int, z: Array) -> Array:
    """Return 1 - (1 + z) exp(-z), for z ≤ 1, or for z ≥ 1 if `is_far`."""
    if is_far:
        return -np.expm1(-z) - z * np.exp(-z)
    return z * z * sum_series(G_SERIES, z, z)
