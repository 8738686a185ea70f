"""What `speed` compares: products and solves of this package, and what one writes by hand.

Each is set up for a first column and a vector, and returns what is timed.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import scipy.fft
import scipy.linalg
import scipy.signal
from scipy.sparse.linalg import LinearOperator, cg

import toeplitz_mg as tmg
from comparisons.harness.measuring import TOLERANCE
from comparisons.systems.symbols import COLUMNS
from toeplitz_mg._typing import Array

Action = Callable[[], Any]
SetUp = Callable[[Array, Array], Action]  # Takes a first column and a vector.


class Plain:
    """The product that one writes by hand: the spectrum of fast lengths, kept."""

    def __init__(self, c: Array) -> None:
        self.shape = c.shape
        self.cut = tuple(slice(n) for n in c.shape)
        self.lengths = tuple(scipy.fft.next_fast_len(2 * n - 1, real=True) for n in c.shape)
        for axis, (n, length) in enumerate(zip(c.shape, self.lengths, strict=True)):
            gap = [(0, length - 2 * n + 1 if k == axis else 0) for k in range(c.ndim)]
            mirrored = np.flip(np.take(c, np.arange(1, n), axis=axis), axis)
            c = np.concatenate([np.pad(c, gap), mirrored], axis=axis)
        self.spectrum = scipy.fft.rfftn(c).real

    def __call__(self, x: Array) -> Array:
        """Multiply a vector."""
        hat = self.spectrum * scipy.fft.rfftn(x.reshape(self.shape), self.lengths)
        return scipy.fft.irfftn(hat, self.lengths)[self.cut].ravel()


class PlainCirculant:
    """The inverse of a circulant, likewise."""

    def __init__(self, column: Array) -> None:
        self.n = len(column)
        self.spectrum = 1.0 / scipy.fft.rfft(column).real

    def __call__(self, x: Array) -> Array:
        """Multiply a vector."""
        return scipy.fft.irfft(self.spectrum * scipy.fft.rfft(x), self.n)


def covariance(axes: int, n: int) -> Array:
    """Return coefficients on a grid of so many axes and n elements in all."""
    k = np.indices((round(n ** (1 / axes)),) * axes)
    return np.exp(-np.sqrt((k**2).sum(axis=0)))


def chan_column(c: Array) -> Array:
    """Return the first column of T. Chan's circulant."""
    n = len(c)
    k = np.arange(n)
    return ((n - k) * c + k * np.r_[0.0, c[:0:-1]]) / n


def strang_column(c: Array) -> Array:
    """Return the first column of Strang's circulant."""
    n = len(c)
    k = np.arange(n)
    return c[np.minimum(k, n - k)]


def plain_product(c: Array, b: Array) -> Action:
    """Multiply by hand."""
    return partial(Plain(c), b)


def our_product(c: Array, b: Array) -> Action:
    """Multiply by the engine."""
    return partial(tmg.ToeplitzOperator(c).apply, b, np.empty_like(b))


def operator_product(c: Array, b: Array) -> Action:
    """Multiply by the LinearOperator, with SciPy's checks."""
    A = tmg.ToeplitzOperator(c)
    return lambda: A @ b


def matmul_toeplitz(c: Array, b: Array) -> Action:
    """Multiply by SciPy's function."""
    return partial(scipy.linalg.matmul_toeplitz, c, b, check_finite=False)


def fftconvolve(c: Array, b: Array) -> Action:
    """Multiply by SciPy's convolution."""
    lags = np.concatenate([c[:0:-1], c])
    return lambda: scipy.signal.fftconvolve(lags, b, "valid")


def bare_transforms(c: Array, b: Array) -> Action:
    """Transform only, in real numbers, there and back."""
    length = scipy.fft.next_fast_len(2 * len(c) - 1, real=True)
    return lambda: scipy.fft.irfft(scipy.fft.rfft(b, length), length)


def by_ducc0(set_up: SetUp, c: Array, b: Array) -> Action:
    """Do the same with the transforms of ducc0."""
    from toeplitz_mg import ducc0_backend

    scipy.fft.set_global_backend(ducc0_backend)
    return set_up(c, b)


def plain_cg(
    preconditioner: Callable[[Array], Any] | None, c: Array, b: Array, rtol: float = TOLERANCE
) -> Action:
    """Solve by SciPy's cg with all written by hand, set-up included."""

    def solve() -> Array:
        shape = (len(c), len(c))
        A = LinearOperator(shape, Plain(c), dtype=float)
        inverse = preconditioner and PlainCirculant(preconditioner(c))
        M = None if inverse is None else LinearOperator(shape, inverse, dtype=float)
        x, info = cg(A, b, M=M, rtol=rtol, maxiter=2000)
        if info:
            raise ArithmeticError("not converged")
        return x

    return solve


def our_cg(preconditioner: Any, c: Array, b: Array) -> Action:
    """Solve by our cg, set-up included."""

    def solve() -> Array:
        A = tmg.ToeplitzOperator(c)
        x, info = tmg.cg(A, b, M=preconditioner(A), rtol=TOLERANCE)
        if info:
            raise ArithmeticError("not converged")
        return x

    return solve


def our_multigrid(c: Array, b: Array) -> Action:
    """Solve by V(0,1) cycles, set-up included."""

    def solve() -> Array:
        A = tmg.ToeplitzOperator(c)
        x, info = tmg.richardson(A, b, M=tmg.multigrid(A, pre=0), rtol=TOLERANCE)
        if info:
            raise ArithmeticError("not converged")
        return x

    return solve


def drop_in(c: Array, b: Array) -> Action:
    """Solve by `solve_toeplitz`."""
    return partial(tmg.solve_toeplitz, c, b, rtol=TOLERANCE)


def levinson(c: Array, b: Array) -> Action:
    """Solve by SciPy's Levinson recursion."""
    return partial(scipy.linalg.solve_toeplitz, c, b, check_finite=False)


def cholesky(c: Array, b: Array) -> Action:
    """Solve by a dense factorisation."""
    if len(c) > 2**14:
        raise MemoryError("too large for a dense matrix")
    return lambda: scipy.linalg.solve(scipy.linalg.toeplitz(c), b, assume_a="pos")


def inverse(columns: int, c: Array, b: Array) -> Action:
    """Solve for further right-hand sides; the set-up is not timed."""
    G = tmg.toeplitz_inverse(tmg.ToeplitzOperator(c))
    B = np.random.default_rng(0).standard_normal((columns, len(c)))
    out = np.empty_like(B)
    return lambda: G.G.apply(B, out)


single = np.float32
PRODUCTS: dict[str, SetUp] = {
    "plain": plain_product,
    "ours": our_product,
    "ours, @": operator_product,
    "ours, ducc0": partial(by_ducc0, our_product),
    "bare transforms": bare_transforms,
    "matmul_toeplitz": matmul_toeplitz,
    "fftconvolve": fftconvolve,
}
ALONG_AXES: dict[str, SetUp] = {key: PRODUCTS[key] for key in ("plain", "ours", "ours, ducc0")}
SYSTEMS: dict[str, Callable[[int], Array]] = COLUMNS | {
    "two axes": partial(covariance, 2),
    "three axes": partial(covariance, 3),
}
SOLVES: dict[str, SetUp] = {
    "plain CG + T. Chan": partial(plain_cg, chan_column),
    "plain CG + Strang": partial(plain_cg, strang_column),
    "plain CG": partial(plain_cg, None),
    "Levinson": levinson,
    "dense Cholesky": cholesky,
    "solve_toeplitz": drop_in,
    "CG + M": partial(our_cg, tmg.fft_preconditioner),
    "CG + M, float32": partial(our_cg, partial(tmg.fft_preconditioner, dtype=single)),
    "CG + cosine": partial(our_cg, tmg.cosine_preconditioner),
    "CG + spectral": partial(our_cg, tmg.spectral_preconditioner),
    "CG + spectral, float32": partial(our_cg, partial(tmg.spectral_preconditioner, dtype=single)),
    "CG + FSAI": partial(our_cg, tmg.fsai_preconditioner),
    "CG + FSAI, float32": partial(our_cg, partial(tmg.fsai_preconditioner, dtype=single)),
    "V(0,1)": our_multigrid,
    "CG + M, ducc0": partial(by_ducc0, partial(our_cg, tmg.fft_preconditioner)),
    "CG + spectral, ducc0": partial(by_ducc0, partial(our_cg, tmg.spectral_preconditioner)),
    "CG + FSAI, float32, ducc0": partial(
        by_ducc0, partial(our_cg, partial(tmg.fsai_preconditioner, dtype=single))
    ),
}
THREADED = (
    "plain",
    "ours",
    "ours, ducc0",
    "fftconvolve",
    "plain CG + T. Chan",
    "solve_toeplitz",
    "CG + M",
    "CG + FSAI",
    "V(0,1)",
)
FURTHER: dict[str, SetUp] = {
    "plain product": plain_product,
    "toeplitz_inverse, 1": partial(inverse, 1),
    "toeplitz_inverse, 64": partial(inverse, 64),
}
