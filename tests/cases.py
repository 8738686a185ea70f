"""Pairs of an operator and its dense matrix, the latter by definition and free of FFTs."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import prod
from pathlib import Path

import numpy as np
import scipy.fft
import scipy.linalg
import scipy.sparse
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from toeplitz_mg import halfspace
from toeplitz_mg.engine.lengths import near_fast_length


@dataclass(frozen=True)
class Case:
    name: str
    operator: Callable[[type], LinearOperator]  # Makes the operator of a dtype.
    dense: Callable[[], np.ndarray]
    symmetric: bool = True  # Hermitian, where it is complex.
    positive: bool = True

    def __str__(self):
        return self.name


def preconditioner_of_the_page():
    """Return the preconditioner that `docs/architecture.md` shows, as it stands there."""
    page = (Path(__file__).parent.parent / "docs" / "architecture.md").read_text()
    (block,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    namespace = {}
    exec(compile(block, "architecture.md", "exec"), namespace)
    return namespace["tapered_preconditioner"]


# Coefficients -------------------------------------------------------------------------------


def contact(*grid_shape):
    """Half-space coefficients, of square elements on two axes, of thin ones on one."""
    if len(grid_shape) == 1:
        (n,) = grid_shape
        x, y = halfspace.offsets((n, 1), (8.0 / n, 100.0))
        return halfspace.influence_xx(x, y, (8.0 / n, 100.0), G=1.0, nu=0.28)[:, 0]
    x, y = halfspace.offsets(grid_shape, (0.5, 0.5))
    return halfspace.influence_zz(x, y, (0.5, 0.5), G=1.0, nu=0.28)


def exponential(*grid_shape):
    """A covariance of any number of axes."""
    k = np.indices(grid_shape)
    return np.exp(-k.sum(axis=0) / 2.0)


def lags_of(c):
    """All coefficients of a matrix that is symmetric along every axis."""
    for axis, n in enumerate(c.shape):
        c = np.take(c, np.abs(np.arange(1 - n, n)), axis=axis)
    return c


def random_lags(*grid_shape):
    rng = np.random.default_rng(sum(grid_shape))
    return rng.standard_normal([2 * n - 1 for n in grid_shape])


def checkered(*grid_shape):
    """A mask with single elements and runs."""
    mask = np.indices(grid_shape).sum(axis=0) % 5 != 1
    mask.flat[0] = True
    return mask


def waves(*grid_shape):
    """The lags of a Hermitian positive definite matrix: three damped plane waves, and noise."""
    k = np.meshgrid(*(np.arange(1 - n, n) for n in grid_shape), indexing="ij")
    size = np.exp(-sum(map(np.abs, k)))
    lags = sum(p * size * np.exp(1j * f * sum(k)) for p, f in ((1.0, 0.3), (0.5, 1.1), (0.2, -2.0)))
    lags[tuple(n - 1 for n in grid_shape)] += 2.0
    return (lags + np.flip(lags).conj()) / 2


def complex_lags(*grid_shape):
    """The lags of a general matrix: none is zero, and that of lag zero is the largest."""
    shape = [2 * n - 1 for n in grid_shape]
    rng = np.random.default_rng(sum(grid_shape))
    lags = rng.uniform(-1.0, 1.0, shape) + 1j * rng.uniform(-1.0, 1.0, shape)
    lags[tuple(n - 1 for n in grid_shape)] += 2.0 * lags.size
    return lags


# Dense definitions --------------------------------------------------------------------------


def differences(grid_shape):
    """The differences i - j of every pair of points, along each axis."""
    points = np.indices(grid_shape).reshape(len(grid_shape), -1)
    return [np.subtract.outer(k, k) for k in points]


def dense_of_lags(lags):
    """The matrix a[i - j]."""
    shape = tuple((n + 1) // 2 for n in lags.shape)
    return lags[tuple(k + n - 1 for k, n in zip(differences(shape), shape, strict=True))]


def dense_of_column(c):
    """The matrix that is symmetric along every axis: c[|i - j|]."""
    return c[tuple(abs(k) for k in differences(c.shape))]


def periodic(column):
    """The circulant matrix of any number of axes with this first column."""
    shape = column.shape
    return column[tuple(k % n for k, n in zip(differences(shape), shape, strict=True))]


def embedded(c):
    """The first column of the circulant of size 2 n - 1 along each axis."""
    for axis, n in enumerate(c.shape):
        c = np.take(c, [*range(n), *range(n - 1, 0, -1)], axis=axis)
    return c


def dense_M(c):
    """The leading block of the inverse of the embedding (paper, §3.1)."""
    column = embedded(c)
    leading = np.zeros(column.shape, dtype=bool)
    leading[tuple(slice(n) for n in c.shape)] = True
    inverse = np.linalg.inv(periodic(column))
    m = inverse[:, 0].reshape(column.shape)[tuple(slice(n) for n in c.shape)]
    assert np.allclose(inverse[np.ix_(leading.ravel(), leading.ravel())], dense_of_column(m))
    return dense_of_column(m)


def dense_rsm(M, gamma):
    return M - np.diag(M.sum(axis=1) - gamma)


def dense_sd(A, M, m):
    Z = np.zeros((len(A), m))
    for j, part in enumerate(np.array_split(np.arange(len(A)), m)):
        Z[part, j] = 1.0
    E = Z.T @ M @ A @ Z
    return (np.eye(len(A)) - M @ A @ Z @ np.linalg.inv(E) @ Z.T) @ M


def tapered(c):
    """Coefficients that decay by e^-|k/n| faster."""
    steps = (k / n for k, n in zip(np.indices(c.shape), c.shape, strict=True))
    return c * np.exp(-sum(steps))


def strang_column(c):
    for axis, n in enumerate(c.shape):
        c = np.take(c, [min(k, n - k) for k in range(n)], axis=axis)
    return c


def chan_column(c):
    """The mean of each wrapped diagonal, axis by axis."""
    for axis, n in enumerate(c.shape):
        c = np.stack(
            [
                ((n - k) * np.take(c, k, axis) + k * np.take(c, (n - k) % n, axis)) / n
                for k in range(n)
            ],
            axis=axis,
        )
    return c


def nearest_circulant(lags):
    """The circulant of the means of the entries that a circulant has in common."""
    dense = dense_of_lags(lags)
    shape = tuple((m + 1) // 2 for m in lags.shape)
    at = tuple(k % n for k, n in zip(differences(shape), shape, strict=True))
    total, count = np.zeros(shape, dense.dtype), np.zeros(shape)
    np.add.at(total, at, dense)
    np.add.at(count, at, 1.0)
    return periodic(total / count)


def central_circulant(lags):
    """The circulant of the nearest lags; of n/2 and -n/2 the mean."""
    shape = tuple((m + 1) // 2 for m in lags.shape)
    column = np.zeros(shape, lags.dtype)
    for point in np.ndindex(shape):
        nearest = [
            sorted({k, k - n}, key=abs)[: 1 + (2 * k == n)]
            for k, n in zip(point, shape, strict=True)
        ]
        chosen = np.ix_(*([k + n - 1 for k in ks] for ks, n in zip(nearest, shape, strict=True)))
        column[point] = lags[chosen].mean()
    return periodic(column)


def aggregate(n):
    """Piecewise constant interpolation from n // 2 elements to n, along one axis."""
    P = np.zeros((n, max(n // 2, 1)))
    for j in range(P.shape[1]):
        P[2 * j : 2 * j + 2, j] = 1.0
    return P


def dense_cycle(c, smoother, pre, post, gamma, coarsest):
    """The cycle from explicit matrices, by its error propagation; grids of a power of two."""
    A = dense_of_column(c)
    if len(A) <= coarsest:
        return np.linalg.inv(A)
    P = np.eye(1)
    for n in c.shape:
        P = np.kron(P, aggregate(n))
    R = P.T / P.sum(axis=0).max()
    A_H = R @ A @ P
    half = tuple(max(n // 2, 1) for n in c.shape)
    B_H = dense_cycle(A_H[0].reshape(half), smoother, pre, post, gamma, coarsest)
    eye = np.eye(len(A))
    E_H = np.linalg.matrix_power(np.eye(len(A_H)) - B_H @ A_H, gamma)
    coarse = P @ (np.eye(len(A_H)) - E_H) @ np.linalg.inv(A_H) @ R
    smooth = eye - smoother(A, c) @ A
    power = np.linalg.matrix_power
    E = power(smooth, post) @ (eye - coarse @ A) @ power(smooth, pre)
    return (eye - E) @ np.linalg.inv(A)


def smooth_rsm(A, c):
    M = dense_M(c)
    return dense_rsm(M, M.sum(axis=1).min())


def smooth_sd(A, c):
    return dense_sd(A, dense_M(c), 2)


def continued(c):
    """The coefficients with lags up to a fast length along each axis, half the symbol's period."""
    if sum(n > 1 for n in c.shape) == 1 and has_simple_tail(c.ravel()):
        line = periodised(c.ravel())
        full = np.zeros([len(line) if n > 1 else 2 for n in c.shape])  # One element has no lags.
        full[tuple(slice(None) if n > 1 else 0 for n in c.shape)] = line
        return full
    for axis, n in enumerate(c.shape):
        fast = near_fast_length(n)
        ahead = fast - n + 1
        last, before = (np.take(c, max(n - k, 0), axis) for k in (1, 2))
        # A parabola goes on from the last two, flat at its end, unless they differ too much.
        smaller, larger = np.sort(np.abs([last, before]), axis=0)
        is_alike = (smaller >= larger / 2) & (n > 1)
        more = [
            np.where(is_alike, last + (last - before) * (t - t**2 / (2 * ahead)), 0.0)
            for t in range(1, ahead + 1)
        ]
        c = np.concatenate([c, np.stack(more, axis=axis)], axis=axis)
    return c


def log_slope_and_curvature(c):
    """The logarithmic slope and curvature of the last coefficients, at the last but `step`."""
    step = max(1, len(c) // 64)
    first, middle, last = np.log(c[-2 * step - 1 :: step])
    return step, (last - first) / (2 * step), (last - 2 * middle + first) / step**2


def has_simple_tail(c):
    """Whether the last coefficients decrease as k^-1.5 does, or faster."""
    last = c[-2 * max(1, len(c) // 64) - 1 :]
    if len(c) < 4 or last[-1] <= 1e-9 * c[0] or np.any(np.diff(last) >= 0):
        return False
    _, slope, curvature = log_slope_and_curvature(c)
    return slope**2 >= 1.5 * curvature


def periodised(c):
    """The sums over all lags k + 2 n j of the coefficients, continued by exp(αt + βt²)."""
    n = near_fast_length(len(c))
    step, slope, curvature = log_slope_and_curvature(c)
    assert curvature <= 0.01 * slope**2  # It does not decay by a power of the lag.
    lags = np.arange(64 * n)
    t = lags - (len(c) - 1.0)
    curvature = min(curvature, 0.0)
    a = c[-1] * np.exp((slope + curvature * step) * t + curvature * t**2 / 2)
    a[: len(c)] = c
    ends = [m for m in range(2 * n, len(a), 2 * n) if a[m] <= 1e-9 * c[0]]
    a[ends[0] :] = 0.0
    signed = np.concatenate([-lags[:0:-1], lags])
    even = np.concatenate([a[:0:-1], a])
    return np.array([even[(signed - k) % (2 * n) == 0].sum() for k in range(n + 1)])


def dense_trigonometric(c, wave, first):
    """Q diag(1/f) Qᵀ cut to the grid, f the symbol at θ = πk/n and Q the DCT-II or DST-II."""
    full = continued(c)
    Q, samples, kept = np.eye(1), full, np.ones(1, dtype=bool)
    for axis, n in enumerate(c.shape):
        fast = full.shape[axis] - 1
        k = np.arange(first, first + fast)
        # The lags 0 and `fast` count once.
        weights = np.where(np.arange(fast + 1) % fast == 0, 1.0, 2.0)
        cosines = weights * np.cos(np.pi * np.outer(k, np.arange(fast + 1)) / fast)
        samples = np.moveaxis(np.tensordot(cosines, samples, (1, axis)), 0, axis)
        basis = wave(np.pi * np.outer(np.arange(fast) + 0.5, k) / fast)
        Q = np.kron(Q, basis / np.linalg.norm(basis, axis=0))
        kept = np.kron(kept, np.arange(fast) < n).astype(bool)
    dense = Q @ np.diag(1.0 / samples.ravel()) @ Q.T
    return dense[np.ix_(kept, kept)]


def dense_tau(c):
    """Q diag(f) Qᵀ inverted, f the sums of a_k cos kθ at θ = πk/(n + 1) and Q the DST-I."""
    for axis, n in enumerate(c.shape):
        cosines = np.cos(np.pi * np.outer(np.arange(1, n + 1), np.arange(n)) / (n + 1))
        cosines[:, 1:] *= 2.0
        c = np.moveaxis(np.tensordot(cosines, c, (1, axis)), 0, axis)
    Q = np.eye(1)
    for n in c.shape:
        k = np.arange(1, n + 1)
        Q = np.kron(Q, np.sqrt(2 / (n + 1)) * np.sin(np.pi * np.outer(k, k) / (n + 1)))
    return Q @ np.diag(1.0 / c.ravel()) @ Q


def dense_spectral(c):
    """The Gohberg-Semencul formula in triangular matrices, for the spectral factor's column."""
    n = len(c)
    c = continued(c)
    m = len(c) - 1
    k, length = np.arange(2 * m), 2 * m
    cosines = np.cos(2 * np.pi * np.outer(k, k) / length)
    embedding = np.concatenate([c, c[-2:0:-1]])
    cepstrum = cosines @ np.log(cosines @ embedding) / length
    causal = np.where(k % m == 0, 0.5, 1.0) * (k <= m) * cepstrum
    waves = np.exp(-2j * np.pi * np.outer(k, k) / length)
    q = (waves.conj() @ np.exp(-waves @ causal) / length).real[:n]
    return dense_inverse_of_column(q[0] * q)


def dense_inverse_of_column(x):
    """(L Lᵀ - U Uᵀ)/x₀, both lower triangular, with the columns x and (0, x reversed)."""
    return dense_inverse_of_columns(x, x)


def dense_inverse_of_columns(x, y):
    """The same for a column and a row that differ, whose matrices come first and second."""
    zero = np.zeros(len(x))
    lower, upper = (scipy.linalg.toeplitz(a, zero) for a in (x, y))
    of_y, of_x = (scipy.linalg.toeplitz(np.r_[0.0, a[:0:-1]], zero) for a in (y, x))
    return (lower @ upper.T - of_y @ of_x.T) / x[0]


def dense_factors(lags, half):
    """The same of the Wiener-Hopf factors of the symbol, sampled at 2 `half` points."""
    n, length = (len(lags) + 1) // 2, 2 * half
    waves = np.exp(-2j * np.pi * np.outer(np.arange(length), np.arange(length)) / length)
    f = np.exp(-2j * np.pi * np.outer(np.arange(length), np.arange(1 - n, n)) / length) @ lags
    logarithm = np.log(abs(f)) + 1j * np.unwrap(np.angle(f))
    cepstrum = waves.conj() @ logarithm / length
    weights = np.r_[0.0, np.ones(half - 1), 0.5, np.zeros(half - 1)]
    causal = waves @ (weights * cepstrum)
    others = logarithm - cepstrum[0] - causal
    x = (waves.conj() @ np.exp(-causal))[:n]
    y = (waves @ np.exp(-others))[:n]  # These are the frequencies 0, -1, ...
    scale = np.exp(-cepstrum[0])
    dense = dense_inverse_of_columns(x * scale / x[0], y * scale / y[0])
    return dense if np.iscomplexobj(lags) else dense.real


# The pairs ----------------------------------------------------------------------------------


def submatrix(A, mask):
    return A[np.ix_(mask.ravel(), mask.ravel())]


def toeplitz(c):
    return lambda dtype: tmg.ToeplitzOperator(c.astype(dtype))


def masked(c):
    return lambda dtype: tmg.MaskedOperator(toeplitz(c)(dtype), checkered(*c.shape))


def applied(function, build, **arguments):
    return lambda dtype: function(build(dtype), **arguments)


COLUMNS = {
    "1": contact(1),
    "2": contact(2),
    "16": contact(16),
    "31": exponential(31),
    "6x1": contact(6, 1),
    "1x6": contact(1, 6),
    "5x7": contact(5, 7),
    "8x8": contact(8, 8),
    "3x4x5": exponential(3, 4, 5),
}


def _operators():
    for name, c in COLUMNS.items():
        mask = checkered(*c.shape)
        yield Case(f"A {name}", toeplitz(c), lambda c=c: dense_of_column(c))
        yield Case(
            f"A masked {name}", masked(c), lambda c=c, m=mask: submatrix(dense_of_column(c), m)
        )
    for shape in ((1,), (6,), (13,), (3, 4), (2, 1, 3)):
        lags = random_lags(*shape)
        yield Case(
            f"A general {shape}",
            lambda dtype, lags=lags: tmg.ToeplitzOperator.from_lags(lags.astype(dtype)),
            lambda lags=lags: dense_of_lags(lags),
            symmetric=False,
            positive=False,
        )
        mask = checkered(*shape)
        yield Case(
            f"A general masked {shape}",
            lambda dtype, lags=lags, m=mask: tmg.MaskedOperator(
                tmg.ToeplitzOperator.from_lags(lags.astype(dtype)), m
            ),
            lambda lags=lags, m=mask: submatrix(dense_of_lags(lags), m),
            symmetric=False,
            positive=False,
        )
    c, r = random_lags(4), random_lags(4)[::-1]
    yield Case(
        "A with r",
        lambda dtype: tmg.ToeplitzOperator(c.astype(dtype), r.astype(dtype)),
        lambda: scipy.linalg.toeplitz(c, r),
        symmetric=False,
        positive=False,
    )
    lags = dense_of_lags(random_lags(2, 3))  # Any array will do: made symmetric, but not even.
    lags = lags[:5, :5] + lags[:5, :5][::-1, ::-1]
    yield Case(
        "A symmetric, not even",
        lambda dtype: tmg.ToeplitzOperator.from_lags(lags.astype(dtype)),
        lambda: dense_of_lags(lags),
        positive=False,
    )


def componentwise(c, M, mask):
    """Preconditioners that take coupled components one by one, and their matrices on a mask."""
    yield tmg.fft_rsm_preconditioner, dense_rsm(submatrix(M, mask), M.sum(axis=1).min())
    yield tmg.cosine_preconditioner, submatrix(dense_trigonometric(c, np.cos, 0), mask)
    yield tmg.sine_preconditioner, submatrix(dense_trigonometric(c, np.sin, 1), mask)
    yield tmg.tau_preconditioner, submatrix(dense_tau(c), mask)
    yield tmg.strang_preconditioner, submatrix(np.linalg.inv(periodic(strang_column(c))), mask)
    yield tmg.chan_preconditioner, submatrix(np.linalg.inv(periodic(chan_column(c))), mask)
    inverse = np.linalg.inv(periodic(chan_column(tapered(c))))
    yield preconditioner_of_the_page(), submatrix(inverse, mask)
    if sum(n > 1 for n in c.shape) <= 2:  # Few unknowns are solved for directly.
        A = submatrix(dense_of_column(c), mask)
        yield tmg.fsai_preconditioner, np.linalg.inv(A)


def is_refused(f, matrix):
    """Whether this is indefinite, as M_bar and τ may be; that it is refused is tested elsewhere."""
    may_be = f in (tmg.fft_rsm_preconditioner, tmg.tau_preconditioner)
    return may_be and np.linalg.eigvalsh(matrix)[0] <= 0.0


def _preconditioners():
    for name, c in COLUMNS.items():
        M_full = dense_M(c)
        for label, build, mask in (
            ("", toeplitz(c), np.ones(c.shape, bool)),
            (" masked", masked(c), checkered(*c.shape)),
        ):
            name_of = f"{label} {name}"
            A, M = submatrix(dense_of_column(c), mask), submatrix(M_full, mask)
            yield Case(f"M{name_of}", applied(tmg.fft_preconditioner, build), lambda M=M: M)
            for f, matrix in componentwise(c, M_full, mask):
                if not is_refused(f, matrix):
                    yield Case(
                        f"{f.__name__}{name_of}", applied(f, build), lambda matrix=matrix: matrix
                    )
            gamma = 2.0 * abs(M_full.sum(axis=1).min())
            M_bar = dense_rsm(M, gamma)
            if not is_refused(tmg.fft_rsm_preconditioner, M_bar):
                yield Case(
                    f"M_bar{name_of}, gamma {gamma}",
                    applied(tmg.fft_rsm_preconditioner, build, gamma=gamma),
                    lambda M_bar=M_bar: M_bar,
                )
            for m in (1, 2, 3):
                if m < len(A):  # As many subdomains as unknowns leave nothing.
                    yield Case(
                        f"P M{name_of}, {m}",
                        applied(tmg.fft_sd_preconditioner, build, n_subdomains=m),
                        lambda A=A, M=M, m=m: dense_sd(A, M, m),
                        symmetric=False,
                        positive=False,
                    )
            yield Case(
                f"jacobi{name_of}",
                applied(tmg.jacobi_preconditioner, build, omega=0.7),
                lambda A=A: 0.7 / A[0, 0] * np.eye(len(A)),
            )
            if max(c.shape) == c.size:
                spectral = submatrix(dense_spectral(c.ravel()), mask)
                yield Case(
                    f"spectral{name_of}",
                    applied(tmg.spectral_preconditioner, build),
                    lambda spectral=spectral: spectral,
                )
        if max(c.shape) == c.size:
            yield Case(
                f"inverse {name}",
                applied(tmg.toeplitz_inverse, toeplitz(c), rtol=1e-2),
                lambda c=c: np.linalg.inv(dense_of_column(c)),
            )


def coupled_kernel(components, *grid_shape):
    """Lags of each pair of components: even in themselves, odd or of any kind between them."""
    k = np.stack(np.meshgrid(*(np.arange(1 - n, n) for n in grid_shape), indexing="ij"))
    size = np.exp(-np.abs(k).sum(axis=0))
    kernel = [[None] * components for _ in range(components)]
    for i in range(components):
        kernel[i][i] = size * (1.0 + i)
    kernel[1][0] = 0.2 * size * np.prod(np.sign(k), axis=0)  # It is odd along both axes, as A_xy.
    kernel[0][1] = np.flip(kernel[1][0])
    if components == 3:
        kernel[2][1] = 0.3 * size * np.sign(k[0])  # It is odd along one axis, as A_yz.
        kernel[1][2] = np.flip(kernel[2][1])
    return kernel


def dense_of_kernel(kernel, dense=dense_of_lags):
    like = np.zeros_like(dense(kernel[0][0]))
    return np.block([[like if lags is None else dense(lags) for lags in row] for row in kernel])


def dense_coupled_M(kernel):
    """The leading block of the inverse of the block circulant, all of size 2 n - 1."""

    def wrapped(lags):
        return periodic(np.roll(lags, [-(m // 2) for m in lags.shape], range(lags.ndim)))

    inverse = np.linalg.inv(dense_of_kernel(kernel, wrapped))
    leading = np.zeros((len(kernel), *kernel[0][0].shape), dtype=bool)
    leading[(slice(None), *(slice((m + 1) // 2) for m in kernel[0][0].shape))] = True
    return inverse[np.ix_(leading.ravel(), leading.ravel())]


def coupled(kernel):
    def build(dtype):
        return tmg.CoupledOperator(
            [[None if lags is None else of_lags(lags)(dtype) for lags in row] for row in kernel]
        )

    return build


def half_space_kernel(components, *grid_shape):
    """The tangential components of equal materials; of unequal ones the normal one too."""
    element = (0.5, 0.5)
    x, y = halfspace.all_offsets(grid_shape, element)
    xx, xy, yy, zz = (
        influence(x, y, element, G=1.0, nu=0.28)
        for influence in (
            halfspace.influence_xx,
            halfspace.influence_xy,
            halfspace.influence_yy,
            halfspace.influence_zz,
        )
    )
    if components == 2:
        return [[xx, xy], [xy, yy]]
    xz, yz = (
        influence(x, y, element, G=1.0, K=0.2)
        for influence in (halfspace.influence_xz, halfspace.influence_yz)
    )
    return [[xx, xy, xz], [xy, yy, yz], [-xz, -yz, zz]]


def _coupled():
    kernels = [
        (f"{components} {shape}", coupled_kernel(components, *shape))
        for components, shape in ((2, (3, 4)), (2, (7,)), (3, (2, 5)), (3, (5, 1)), (2, (2, 3, 2)))
    ] + [
        (f"half-space {components} {shape}", half_space_kernel(components, *shape))
        for components, shape in ((2, (5, 7)), (2, (8, 8)), (2, (1, 6)), (3, (5, 4)), (3, (6, 1)))
    ]
    for name, kernel in kernels:
        components, shape = len(kernel), tuple((m + 1) // 2 for m in kernel[0][0].shape)
        dense = dense_of_kernel(kernel)
        M = dense_coupled_M(kernel)
        mask = np.stack([checkered(*shape)] * components)
        mask[-1] &= np.arange(mask[0].size).reshape(shape) % 2 == 0
        c = [kernel[i][i][tuple(slice(n - 1, None) for n in shape)] for i in range(components)]
        M_each = [dense_M(x) for x in c]
        for label, build, cut in (
            ("", coupled(kernel), np.ones_like(mask)),
            (
                " masked",
                lambda dtype, k=kernel, m=mask: tmg.MaskedOperator(coupled(k)(dtype), m),
                mask,
            ),
        ):
            A, M_r = submatrix(dense, cut), submatrix(M, cut)
            each = zip(*map(componentwise, c, M_each, cut), strict=True)
            for f, matrix in (
                (lambda A: A, A),
                (tmg.fft_preconditioner, M_r),
                *(
                    (of_one[0][0], scipy.linalg.block_diag(*(x for _, x in of_one)))
                    for of_one in each
                ),
            ):
                if not is_refused(f, matrix):
                    yield Case(
                        f"{f.__name__} coupled{label} {name}",
                        applied(f, build),
                        lambda matrix=matrix: matrix,
                    )
            yield Case(
                f"P M coupled{label} {name}",
                applied(tmg.fft_sd_preconditioner, build),
                lambda A=A, M_r=M_r: dense_sd(A, M_r, 2),
                symmetric=False,
                positive=False,
            )
        general = [list(row) for row in kernel]
        general[1][0] = kernel[1][0] + 0.3 * kernel[0][0]
        yield Case(
            f"A coupled, general {name}",
            coupled(general),
            lambda general=general: dense_of_kernel(general),
            symmetric=False,
            positive=False,
        )


def _cycles():
    for name, c in {"16": contact(16), "32": exponential(32) + 0.1, "8x8": contact(8, 8)}.items():
        for pre, post, gamma in ((1, 1, 1), (1, 0, 1), (0, 1, 1), (2, 1, 1), (1, 1, 2), (0, 2, 2)):
            yield Case(
                f"{'VW'[gamma - 1]}({pre},{post}) {name}",
                applied(tmg.multigrid, toeplitz(c), pre=pre, post=post, gamma=gamma, coarsest=4),
                lambda c=c, p=(pre, post, gamma): dense_cycle(c, smooth_rsm, *p, 4),
                symmetric=pre == post,
                positive=pre == post,
            )
    kernel = half_space_kernel(2, 8, 8)
    yield Case(
        "V(1,1) of coupled components",
        applied(tmg.componentwise(tmg.multigrid), coupled(kernel), coarsest=4),
        lambda: scipy.linalg.block_diag(
            *(dense_cycle(kernel[i][i][7:, 7:], smooth_rsm, 1, 1, 1, 4) for i in (0, 1))
        ),
    )
    yield Case(
        "V(0,1) with SD 16",
        applied(
            tmg.multigrid,
            toeplitz(contact(16)),
            pre=0,
            smoother=tmg.fft_sd_preconditioner,
            coarsest=4,
        ),
        lambda: dense_cycle(contact(16), smooth_sd, 0, 1, 1, 4),
        symmetric=False,
        positive=False,
    )
    yield Case(
        "multigrid of the coarsest grid alone",
        applied(tmg.multigrid, toeplitz(contact(5))),
        lambda: np.linalg.inv(dense_of_column(contact(5))),
    )


def in_precision(x, dtype):
    """Return numbers, complex ones as such, in the precision of a real dtype."""
    return x.astype(np.result_type(dtype, np.complex64 if np.iscomplexobj(x) else np.float32))


def of_lags(lags):
    """Make the matrix of these lags, which of a complex one are so in either precision."""
    return lambda dtype: tmg.ToeplitzOperator.from_lags(in_precision(lags, dtype))


def masked_of(build, mask):
    return lambda dtype: tmg.MaskedOperator(build(dtype), mask)


def _complex_and_general():
    """Complex matrices, Hermitian and general, and real ones that are not symmetric.

    With the preconditioners that take them.
    """
    for shape in ((1,), (2,), (13,), (16,), (3, 5), (4, 6), (6, 1), (2, 3, 4)):
        general = random_lags(*shape)
        general.flat[general.size // 2] += 2.0 * general.size
        kinds = {
            "Hermitian": waves(*shape),
            "Hermitian and even": waves(*shape).real.astype(np.complex128),
            "complex": complex_lags(*shape),
            "general": general,
        }
        for kind, lags in kinds.items():
            if kind == "general" and max(shape) <= 2:
                continue  # A real circulant of this size is symmetric.
            if kind == "Hermitian and even" and shape not in ((13,), (4, 6)):
                continue  # These are Hermitian ones as the others: two shapes are enough.
            is_hermitian = kind.startswith("Hermitian")
            mask = checkered(*shape)
            for label, build, cut in (
                ("", of_lags(lags), np.ones(shape, bool)),
                (" masked", masked_of(of_lags(lags), mask), mask),
            ):
                dense = submatrix(dense_of_lags(lags), cut)
                pairs = [
                    (tmg.chan_preconditioner, np.linalg.inv(nearest_circulant(lags))),
                    (tmg.strang_preconditioner, np.linalg.inv(central_circulant(lags))),
                ]
                pairs = [(f, submatrix(matrix, cut)) for f, matrix in pairs]
                if kind != "general":
                    pairs.append((lambda A: A, dense))
                if max(shape) == prod(shape):
                    n = max(shape)
                    half = near_fast_length(n) if is_hermitian else scipy.fft.next_fast_len(2 * n)
                    factors = dense_factors(lags.ravel(), half)
                    pairs.append((tmg.spectral_preconditioner, submatrix(factors, cut)))
                    if not label:
                        pairs.append((tmg.toeplitz_inverse, np.linalg.inv(dense)))
                if is_hermitian:
                    M = submatrix(dense_coupled_M([[lags]]), cut)
                    pairs += [
                        (tmg.fft_preconditioner, M),
                        (tmg.default_preconditioner, np.linalg.inv(dense)),
                        (tmg.jacobi_preconditioner, None),
                    ]
                for f, matrix in pairs:
                    of = f
                    if f is tmg.jacobi_preconditioner:
                        of, matrix = partial(f, omega=0.7), 0.7 / dense[0, 0] * np.eye(len(dense))
                        matrix = matrix.astype(np.complex128)
                    yield Case(
                        f"{f.__name__} of {kind}{label} {shape}",
                        applied(of, build),
                        lambda matrix=matrix: matrix,
                        symmetric=is_hermitian,
                        positive=is_hermitian,
                    )
                    if kind == "complex" and shape in ((13,), (3, 5)):
                        yield Case(
                            f"{f.__name__}, transposed, of {kind}{label} {shape}",
                            lambda dtype, of=of, build=build: of(build(dtype)).T,
                            lambda matrix=matrix: matrix.T,
                            symmetric=False,
                            positive=False,
                        )
    c = complex_lags(7)[:7]
    c = np.r_[abs(c).sum(), c[1:]]
    yield Case(
        "A with complex c",
        lambda dtype: tmg.ToeplitzOperator(c.astype(np.result_type(dtype, np.complex64))),
        lambda: scipy.linalg.toeplitz(c),
    )
    even = complex_lags(9)[8:]
    yield Case(
        "A complex and symmetric",
        of_lags(np.r_[even[:0:-1], even]),
        lambda: scipy.linalg.toeplitz(even, even),
        symmetric=False,
        positive=False,
    )


def _coupled_and_complex():
    for components, shape in ((2, (3, 4)), (2, (7,)), (3, (2, 5)), (3, (5, 1))):
        kernel = coupled_kernel(components, *shape)
        for i in range(components):
            kernel[i][i] = kernel[i][i] * (waves(*shape) if i else 1.0)
        between = 0.1 * complex_lags(*shape) / kernel[0][0].size ** 2
        kernel[1][0] = between
        kernel[0][1] = np.flip(between).conj()
        mask = np.stack([checkered(*shape)] * components)
        mask[-1] &= np.arange(mask[0].size).reshape(shape) % 2 == 0
        for label, is_masked, cut in (("", False, np.ones_like(mask)), (" masked", True, mask)):
            build = coupled(kernel)
            build = masked_of(build, mask) if is_masked else build
            chan = dense_of_kernel(
                [
                    [kernel[i][i] if i == j else None for j in range(components)]
                    for i in range(components)
                ],
                lambda lags: np.linalg.inv(nearest_circulant(lags)),
            )
            for f, matrix in (
                (lambda A: A, dense_of_kernel(kernel)),
                (tmg.fft_preconditioner, dense_coupled_M(kernel)),
                (tmg.chan_preconditioner, chan),
            ):
                matrix = submatrix(matrix, cut)
                yield Case(
                    f"{f.__name__} coupled and Hermitian{label} {components} {shape}",
                    applied(f, build),
                    lambda matrix=matrix: matrix,
                )
        general = [list(row) for row in kernel]
        general[0][1] = 0.2 * complex_lags(*shape)
        build, dense = coupled(general), dense_of_kernel(general)
        yield Case(
            f"A coupled, complex {components} {shape}",
            build,
            lambda dense=dense: dense,
            symmetric=False,
            positive=False,
        )
        yield Case(
            f"A coupled, complex, transposed {components} {shape}",
            lambda dtype, build=build: build(dtype).T,
            lambda dense=dense: dense.T,
            symmetric=False,
            positive=False,
        )


# Sums with diagonal matrices -----------------------------------------------------------------


def diagonals(n):
    """Two diagonals of entries from 1/2 to 2."""
    return np.exp2(np.random.default_rng(n).uniform(-1.0, 1.0, (2, n)))


SUMS = {  # Each with whether it is Hermitian where A is.
    "2 A": (lambda A, D, E, one: 2 * A, True),
    "-A / 3 + I": (lambda A, D, E, one: -A / 3 + one, True),
    "2 I - A": (lambda A, D, E, one: 2 * one - A, True),
    "A + A.T": (lambda A, D, E, one: A + A.T, True),
    "A + D": (lambda A, D, E, one: A + D, True),
    "D - A": (lambda A, D, E, one: D - A, True),
    "D A": (lambda A, D, E, one: D @ A, False),
    "A D": (lambda A, D, E, one: A @ D, False),
    "D A D + 2 E": (lambda A, D, E, one: D @ A @ D + 2 * E, True),
    "D A + A D": (lambda A, D, E, one: D @ A + A @ D, True),
    "D A + E A.T + 3 I": (lambda A, D, E, one: D @ A + E @ A.T + 3 * one, False),
    "(D A - E) / 2": (lambda A, D, E, one: (D @ A - E) / 2, False),
}


def _sums():
    """Sums of a matrix and diagonal ones, which stand for themselves in the dense definition."""

    def of_one(sum_of, lags, mask):
        whole = of_lags(lags)
        unknowns = whole if mask.all() else masked_of(whole, mask)
        given = diagonals(np.count_nonzero(mask))

        def build(dtype):
            D, E = (scipy.sparse.diags_array(d.astype(dtype)) for d in given)
            return sum_of(unknowns(dtype), D, E, scipy.sparse.eye_array(*D.shape, dtype=dtype))

        def dense():
            matrix = submatrix(dense_of_lags(lags), mask)
            return sum_of(matrix, *map(np.diag, given), np.eye(len(matrix)))

        return build, dense

    matrices = {f"general {shape}": random_lags(*shape) for shape in ((13,), (3, 4), (2, 1, 3))}
    matrices |= {name: lags_of(COLUMNS[name]) for name in ("31", "5x7")}
    matrices |= {"Hermitian (9,)": waves(9), "complex (3, 4)": complex_lags(3, 4)}
    for name, lags in matrices.items():
        shape = tuple((m + 1) // 2 for m in lags.shape)
        for label, mask in (("", np.ones(shape, bool)), (" masked", checkered(*shape))):
            for formula, (sum_of, keeps) in SUMS.items():
                build, dense = of_one(sum_of, lags, mask)
                is_hermitian = keeps and np.allclose(lags, np.flip(lags).conj())
                is_hermitian |= formula == "A + A.T" and name.startswith("general")
                yield Case(
                    f"{formula}{label} {name}", build, dense, symmetric=is_hermitian, positive=False
                )


def averaged(c, d, e, mask):
    """The column of the mean of diag(d) A + diag(e), scaled to ones on the diagonal; the scale."""
    diagonal = d * c.flat[0] + e
    column = (d / diagonal).mean() * c
    column.flat[0] += (e / diagonal).mean()
    assert len(d) == np.count_nonzero(mask)
    return column, 1.0 / np.sqrt(diagonal)


def _preconditioners_of_sums():
    for name in ("31", "5x7", "8x8"):
        c = COLUMNS[name]
        for label, mask in (("", np.ones(c.shape, bool)), (" masked", checkered(*c.shape))):
            d, e = diagonals(np.count_nonzero(mask))
            column, scale = averaged(c, d, e, mask)

            def build(dtype, c=c, d=d, e=e, mask=mask):
                A = toeplitz(c)(dtype)
                A = A if mask.all() else tmg.MaskedOperator(A, mask)
                D, E = (scipy.sparse.diags_array(x.astype(dtype)) for x in (d, e))
                return D @ A + E

            M = dense_M(column)
            yield Case(
                f"jacobi of D A + E{label} {name}",
                applied(tmg.jacobi_preconditioner, build, omega=0.7),
                lambda s=scale: 0.7 * np.diag(s**2),
            )
            cases = [
                (tmg.fft_preconditioner, submatrix(M, mask)),
                *componentwise(column, M, mask),
            ]
            for f, matrix in cases:
                if not is_refused(f, matrix):
                    yield Case(
                        f"{f.__name__} of D A + E{label} {name}",
                        applied(f, build),
                        lambda matrix=matrix, s=scale: s[:, np.newaxis] * matrix * s,
                    )
            A, M_r = submatrix(dense_of_column(column), mask), submatrix(M, mask)
            yield Case(
                f"P M of D A + E{label} {name}",
                applied(tmg.fft_sd_preconditioner, build),
                lambda A=A, M=M_r, s=scale: s[:, np.newaxis] * dense_sd(A, M, 2) * s,
                symmetric=False,
                positive=False,
            )
            for f in (tmg.default_preconditioner, tmg.multigrid):  # Few unknowns are solved for.
                yield Case(
                    f"{f.__name__} of D A + E{label} {name}",
                    applied(f, build),
                    lambda A=A, s=scale: s[:, np.newaxis] * np.linalg.inv(A) * s,
                )


def _preconditioners_of_complex_and_general_sums():
    """Of Z A Zᴴ + E with a complex Z, Hermitian where A is, and of D A + E, which is not."""
    general = random_lags(13)
    general[12] += 26.0
    matrices = {
        "Hermitian (9,)": waves(9),
        "Hermitian (3, 4)": waves(3, 4),
        "complex (13,)": complex_lags(13),
        "complex (3, 4)": complex_lags(3, 4),
        "general (13,)": general,
    }
    for name, lags in matrices.items():
        shape = tuple((m + 1) // 2 for m in lags.shape)
        for label, mask in (("", np.ones(shape, bool)), (" masked", checkered(*shape))):
            d, e = diagonals(np.count_nonzero(mask))
            z = d * np.exp(1j * np.arange(len(d)) ** 2) if np.iscomplexobj(lags) else d
            for formula, left, right in (
                ("Z A Z* + E", z, z.conj()),
                ("D A + E", d, 1.0 + 0.0 * d),
            ):
                yield from _of_one_sum(f"{formula}{label} {name}", lags, mask, left, right, e)


def _of_one_sum(name, lags, mask, left, right, e):
    """Preconditioners of diag(left) A diag(right) + diag(e), on a mask."""
    whole = of_lags(lags)
    unknowns = whole if mask.all() else masked_of(whole, mask)

    def build(dtype):
        L, R, E = (scipy.sparse.diags_array(in_precision(x, dtype)) for x in (left, right, e))
        return L @ unknowns(dtype) @ R + E

    zero = tuple(n // 2 for n in lags.shape)
    diagonal = (left * right * lags[zero] + e).real
    scale = 1.0 / np.sqrt(diagonal)
    mean = (left * right / diagonal).mean() * lags
    mean[zero] += (e / diagonal).mean()
    part = (mean + np.flip(mean).conj()) / 2
    is_hermitian = np.allclose(mean, part, rtol=1e-12)
    pairs = [
        (tmg.chan_preconditioner, np.linalg.inv(nearest_circulant(mean)), is_hermitian),
        (tmg.strang_preconditioner, np.linalg.inv(central_circulant(mean)), is_hermitian),
        (tmg.fft_preconditioner, dense_coupled_M([[part]]), True),
        (partial(tmg.jacobi_preconditioner, omega=0.7), 0.7 * np.eye(mask.size), True),
    ]
    if mask.ndim == 1:
        n = mask.size
        half = near_fast_length(n) if is_hermitian else scipy.fft.next_fast_len(2 * n)
        pairs.append((tmg.spectral_preconditioner, dense_factors(mean, half), is_hermitian))
    pairs = [(f, submatrix(matrix, mask), holds) for f, matrix, holds in pairs]
    inverse = np.linalg.inv(submatrix(dense_of_lags(part), mask))
    pairs.append((tmg.default_preconditioner, inverse, True))  # Few unknowns are solved for.
    for f, matrix, holds in pairs:
        dense = scale[:, np.newaxis] * matrix * scale
        if np.iscomplexobj(lags):
            dense = dense.astype(np.complex128)
        yield Case(
            f"{getattr(f, 'func', f).__name__} of {name}",
            applied(f, build),
            lambda dense=dense: dense,
            symmetric=holds,
            positive=holds,
        )


CASES = [
    *_operators(),
    *_preconditioners(),
    *_coupled(),
    *_cycles(),
    *_complex_and_general(),
    *_coupled_and_complex(),
    *_sums(),
    *_preconditioners_of_sums(),
    *_preconditioners_of_complex_and_general_sums(),
]
