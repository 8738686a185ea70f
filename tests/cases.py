"""Pairs of an operator and its dense matrix, the latter by definition and free of FFTs.

A pair shows a kind of operator (a matrix, one of the preconditioners, a cycle) on a matrix with
traits: its axes, a mask, coupled components, complex entries. `PAIRS` marks those as slow that show
no kind with a trait that an earlier pair has not shown.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np
import pytest
import scipy.fft
import scipy.linalg
import scipy.sparse
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from toeplitz_mg import halfspace
from toeplitz_mg.paper import algorithm


@dataclass(frozen=True, eq=False)
class Case:
    kind: str
    matrix: str
    traits: frozenset
    operator: Callable[[type], LinearOperator]  # Makes the operator of a dtype.
    dense: np.ndarray
    symmetric: bool = True  # Hermitian, where it is complex.
    positive: bool = True

    @property
    def name(self):
        return f"{self.kind}: {self.matrix}"

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


def grid_of(lags):
    """The shape of the grid on which a matrix has these lags."""
    return tuple((m + 1) // 2 for m in lags.shape)


def random_lags(*grid_shape):
    rng = np.random.default_rng(sum(grid_shape))
    return rng.standard_normal([2 * n - 1 for n in grid_shape])


def dominant_lags(*grid_shape):
    """Random ones, of which that of lag zero is the largest."""
    lags = random_lags(*grid_shape)
    lags.flat[lags.size // 2] += 2.0 * lags.size
    return lags


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


def complex_kernel(components, *grid_shape):
    """The same with complex lags, but those of the first component; Hermitian."""
    kernel = coupled_kernel(components, *grid_shape)
    for i in range(1, components):
        kernel[i][i] = kernel[i][i] * waves(*grid_shape)
    kernel[1][0] = 0.1 * complex_lags(*grid_shape) / kernel[0][0].size ** 2
    kernel[0][1] = np.flip(kernel[1][0]).conj()
    return kernel


def half_space_kernel(components, *grid_shape):
    """The tangential components of equal materials; of unequal ones the normal one too."""
    element = (0.5, 0.5)
    x, y = halfspace.all_offsets(grid_shape, element)

    def influence(pair, **material):
        return getattr(halfspace, f"influence_{pair}")(x, y, element, G=1.0, **material)

    xx, xy, yy, zz = (influence(pair, nu=0.28) for pair in ("xx", "xy", "yy", "zz"))
    if components == 2:
        return [[xx, xy], [xy, yy]]
    xz, yz = (influence(pair, K=0.2) for pair in ("xz", "yz"))
    return [[xx, xy, xz], [xy, yy, yz], [-xz, -yz, zz]]


# Dense definitions --------------------------------------------------------------------------


def differences(grid_shape):
    """The differences i - j of every pair of points, along each axis."""
    points = np.indices(grid_shape).reshape(len(grid_shape), -1)
    return [np.subtract.outer(k, k) for k in points]


def dense_of_lags(lags):
    """The matrix a[i - j]."""
    shape = grid_of(lags)
    return lags[tuple(k + n - 1 for k, n in zip(differences(shape), shape, strict=True))]


def dense_of_column(c):
    """The matrix that is symmetric along every axis: c[|i - j|]."""
    return c[tuple(abs(k) for k in differences(c.shape))]


def dense_of_kernel(kernel, dense=dense_of_lags):
    like = np.zeros_like(dense(kernel[0][0]))
    return np.block([[like if lags is None else dense(lags) for lags in row] for row in kernel])


def submatrix(A, mask):
    return A[np.ix_(mask.ravel(), mask.ravel())]


def periodic(column):
    """The circulant matrix of any number of axes with this first column."""
    shape = column.shape
    return column[tuple(k % n for k, n in zip(differences(shape), shape, strict=True))]


def dense_M(kernel):
    """The leading block of the inverse of the (block) circulant, of size 2 n - 1 (paper, §3.1)."""

    def wrapped(lags):
        return periodic(np.roll(lags, [-(m // 2) for m in lags.shape], range(lags.ndim)))

    inverse = np.linalg.inv(dense_of_kernel(kernel, wrapped))
    leading = np.zeros((len(kernel), *kernel[0][0].shape), dtype=bool)
    leading[(slice(None), *map(slice, grid_of(kernel[0][0])))] = True
    return submatrix(inverse, leading)


def dense_rsm(M, gamma):
    return algorithm.modify_row_sums(M, M.sum(axis=1), gamma)(np.eye(len(M)))


def dense_sd(A, M, m):
    Z = np.zeros((len(A), m))
    for j, part in enumerate(np.array_split(np.arange(len(A)), m)):
        Z[part, j] = 1.0
    return algorithm.deflate(A, M, Z)(np.eye(len(A)))


def dense_circulant(lags):
    """The circulant of the means of the entries that a circulant has in common."""
    dense, shape = dense_of_lags(lags), grid_of(lags)
    at = tuple(k % n for k, n in zip(differences(shape), shape, strict=True))
    total, count = np.zeros(shape, dense.dtype), np.zeros(shape)
    np.add.at(total, at, dense)
    np.add.at(count, at, 1.0)
    return periodic(total / count)


def dense_chan(lags):
    return np.linalg.inv(dense_circulant(lags))


def dense_block_chan(kernel):
    zero = 0 * kernel[0][0]
    blocks = [[dense_circulant(zero if b is None else b) for b in row] for row in kernel]
    return np.linalg.inv(np.block(blocks))


def dense_tapered(lags):
    """That of coefficients that decay by e^-|k/n| faster."""
    k = np.meshgrid(*(np.arange(1 - n, n) / n for n in grid_of(lags)), indexing="ij")
    return dense_chan(lags * np.exp(-sum(map(np.abs, k))))


def dense_strang(lags):
    """The inverse of the circulant of the nearest lags; of n/2 and -n/2 the mean."""
    shape = grid_of(lags)
    column = np.zeros(shape, lags.dtype)
    for point in np.ndindex(shape):
        nearest = [
            sorted({k, k - n}, key=abs)[: 1 + (2 * k == n)]
            for k, n in zip(point, shape, strict=True)
        ]
        chosen = np.ix_(*([k + n - 1 for k in ks] for ks, n in zip(nearest, shape, strict=True)))
        column[point] = lags[chosen].mean()
    return np.linalg.inv(periodic(column))


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
    smooth = eye - smoother(A, dense_M([[lags_of(c)]])) @ A
    power = np.linalg.matrix_power
    E = power(smooth, post) @ (eye - coarse @ A) @ power(smooth, pre)
    return (eye - E) @ np.linalg.inv(A)


def smooth_rsm(A, M):
    return dense_rsm(M, M.sum(axis=1).min())


def smooth_sd(A, M):
    return dense_sd(A, M, 2)


def continued(c):
    """The coefficients with that of lag n along each axis, half the symbol's period.

    On longer grids the period is a fast length; below 62 elements every length is fast.
    """
    if sum(n > 1 for n in c.shape) == 1 and has_simple_tail(c.ravel()):
        line = periodised(c.ravel())
        full = np.zeros([len(line) if n > 1 else 2 for n in c.shape])  # One element has no lags.
        full[tuple(slice(None) if n > 1 else 0 for n in c.shape)] = line
        return full
    for axis, n in enumerate(c.shape):
        last, before = (np.take(c, [max(n - k, 0)], axis) for k in (1, 2))
        # A parabola goes on from the last two, flat at its end, unless they differ too much.
        smaller, larger = np.sort(np.abs([last, before]), axis=0)
        is_alike = (smaller >= larger / 2) & (n > 1)
        c = np.concatenate([c, np.where(is_alike, last + (last - before) / 2, 0.0)], axis=axis)
    return c


def log_slope_and_curvature(c):
    """The logarithmic slope and curvature of the last coefficients, at the last but one."""
    first, middle, last = np.log(c[-3:])
    return (last - first) / 2, last - 2 * middle + first


def has_simple_tail(c):
    """Whether the last coefficients decrease as k^-1.5 does, or faster."""
    if len(c) < 4 or c[-1] <= 1e-9 * c[0] or np.any(np.diff(c[-3:]) >= 0):
        return False
    slope, curvature = log_slope_and_curvature(c)
    return slope**2 >= 1.5 * curvature


def periodised(c):
    """The sums over all lags k + 2 n j of the coefficients, continued by exp(αt + βt²)."""
    n = len(c)
    slope, curvature = log_slope_and_curvature(c)
    assert curvature <= 0.01 * slope**2  # It does not decay by a power of the lag.
    lags = np.arange(64 * n)
    t = lags - (n - 1.0)
    curvature = min(curvature, 0.0)
    a = c[-1] * np.exp((slope + curvature) * t + curvature * t**2 / 2)
    a[:n] = c
    ends = [m for m in range(2 * n, len(a), 2 * n) if a[m] <= 1e-9 * c[0]]
    a[ends[0] :] = 0.0
    signed = np.concatenate([-lags[:0:-1], lags])
    even = np.concatenate([a[:0:-1], a])
    return np.array([even[(signed - k) % (2 * n) == 0].sum() for k in range(n + 1)])


def dense_trigonometric(c, wave, first):
    """Q diag(1/f) Qᵀ, f the symbol at θ = πk/n and Q the DCT-II or DST-II."""
    Q, samples = np.eye(1), continued(c)
    for axis, n in enumerate(c.shape):
        k = np.arange(first, first + n)
        # The lags 0 and n count once.
        weights = np.where(np.arange(n + 1) % n == 0, 1.0, 2.0)
        cosines = weights * np.cos(np.pi * np.outer(k, np.arange(n + 1)) / n)
        samples = np.moveaxis(np.tensordot(cosines, samples, (1, axis)), 0, axis)
        basis = wave(np.pi * np.outer(np.arange(n) + 0.5, k) / n)
        Q = np.kron(Q, basis / np.linalg.norm(basis, axis=0))
    return Q @ np.diag(1.0 / samples.ravel()) @ Q.T


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
    m = len(c)
    c = continued(c)
    k, length = np.arange(2 * m), 2 * m
    cosines = np.cos(2 * np.pi * np.outer(k, k) / length)
    embedding = np.concatenate([c, c[-2:0:-1]])
    cepstrum = cosines @ np.log(cosines @ embedding) / length
    causal = np.where(k % m == 0, 0.5, 1.0) * (k <= m) * cepstrum
    waves = np.exp(-2j * np.pi * np.outer(k, k) / length)
    q = (waves.conj() @ np.exp(-waves @ causal) / length).real[:m]
    return dense_inverse_of_columns(q[0] * q, q[0] * q)


def dense_inverse_of_columns(x, y):
    """(L Lᵀ - U Uᵀ)/x₀: x is the first column of the inverse, y its first row."""
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


# Matrices -----------------------------------------------------------------------------------


def in_precision(x, dtype):
    """Return numbers, complex ones as such, in the precision of a real dtype."""
    return x.astype(np.result_type(dtype, np.complex64 if np.iscomplexobj(x) else np.float32))


def of_lags(lags, dtype):
    return None if lags is None else tmg.ToeplitzOperator.from_lags(in_precision(lags, dtype))


def coupled(kernel):
    """Return what makes the matrix of coupled components, in a precision."""
    return lambda dtype: tmg.CoupledOperator(
        [[of_lags(lags, dtype) for lags in row] for row in kernel]
    )


@dataclass(frozen=True, eq=False)
class Matrix:
    """A matrix of these lags, or of a kernel of several components, perhaps on a mask."""

    name: str
    kernel: list
    mask: np.ndarray | None = None

    def __call__(self, dtype):
        """Make the operator."""
        if len(self.kernel) > 1:
            A = coupled(self.kernel)(dtype)
        else:
            A = of_lags(self.kernel[0][0], dtype)
        return A if self.mask is None else tmg.MaskedOperator(A, self.mask)

    def cut(self, dense):
        return dense if self.mask is None else submatrix(dense, self.mask)

    @cached_property
    def dense(self):
        return self.cut(dense_of_kernel(self.kernel))

    @cached_property
    def is_hermitian(self):
        return np.allclose(self.dense, self.dense.conj().T)

    @property
    def grid_shape(self):
        return grid_of(self.kernel[0][0])

    @property
    def is_line(self):
        """Whether it has one axis of several points at most, and so is a Toeplitz matrix."""
        return max(self.grid_shape) == np.prod(self.grid_shape)

    @property
    def masks(self):
        """A mask for each component; they may differ."""
        whole = np.ones((len(self.kernel), *self.grid_shape), bool)
        return whole if self.mask is None else self.mask.reshape(whole.shape)

    @property
    def masked(self):
        """The matrix on a mask; the last component has fewer unknowns."""
        mask = np.stack([checkered(*self.grid_shape)] * len(self.kernel))
        if len(mask) > 1:
            mask[-1] &= np.arange(mask[0].size).reshape(self.grid_shape) % 2 == 0
        return Matrix(f"masked {self.name}", self.kernel, mask if len(mask) > 1 else mask[0])

    @cached_property
    def traits(self):
        """What one may ask whether an operator has been shown with."""
        axes = ("line", "plane", "three axes")[len(self.grid_shape) - 1]
        symmetry = "Hermitian" if self.is_hermitian else "general"
        field = "complex" if np.iscomplexobj(self.dense) else "real"
        where = "whole" if self.mask is None else "masked"
        traits = {axes, where, (symmetry, field)}
        traits |= {("coupled", where, field)} if len(self.kernel) > 1 else set()
        return frozenset(traits | ({"one unknown"} if len(self.dense) == 1 else set()))


def name_of(shape):
    return "x".join(map(str, shape))


def even(c):
    """The matrix that is symmetric along every axis."""
    return Matrix(name_of(c.shape), [[lags_of(c)]])


def general(name, lags):
    return Matrix(f"{name} {name_of(grid_of(lags))}", [[lags]])


EVEN = [
    *(even(contact(*shape)) for shape in ((16,), (1,), (2,), (5, 7), (8, 8), (6, 1), (1, 6))),
    *(even(exponential(*shape)) for shape in ((31,), (3, 4, 5))),
]
LINE, PLANE, SQUARE = EVEN[-2], EVEN[3], EVEN[4]
GENERAL = [general("general", random_lags(*s)) for s in ((13,), (3, 4), (2, 1, 3), (6,), (1,))]


# The pairs ----------------------------------------------------------------------------------


def pair(kind, matrix, dense, of=lambda A: A, *, trait=None, holds=True, **others):
    """A pair of `of` a matrix and `dense`; `holds` says whether this is Hermitian and definite."""
    name, traits = matrix.name, matrix.traits
    if trait:
        name, traits = f"{trait}, {name}", traits | {trait}
    others = {"symmetric": holds, "positive": holds, **others}
    return Case(kind, name, traits, lambda dtype: of(matrix(dtype)), dense, **others)


def is_refused(f, dense):
    """Whether this is indefinite, as M_bar and τ may be; that it is refused is tested elsewhere."""
    may_be = f in (tmg.fft_rsm_preconditioner, tmg.tau_preconditioner)
    return may_be and np.linalg.eigvalsh(dense)[0] <= 0.0


def componentwise(lags, mask):
    """Preconditioners that take coupled components one by one, and their matrices on a mask."""
    M, c = dense_M([[lags]]), lags[tuple(slice(m // 2, None) for m in lags.shape)]
    yield tmg.fft_rsm_preconditioner, dense_rsm(submatrix(M, mask), M.sum(axis=1).min())
    yield tmg.cosine_preconditioner, submatrix(dense_trigonometric(c, np.cos, 0), mask)
    yield tmg.sine_preconditioner, submatrix(dense_trigonometric(c, np.sin, 1), mask)
    yield tmg.tau_preconditioner, submatrix(dense_tau(c), mask)
    yield tmg.strang_preconditioner, submatrix(dense_strang(lags), mask)
    yield TAPERED, submatrix(dense_tapered(lags), mask)
    if sum(n > 1 for n in c.shape) <= 2:  # Few unknowns are solved for directly.
        yield tmg.fsai_preconditioner, np.linalg.inv(submatrix(dense_of_lags(lags), mask))


TAPERED = preconditioner_of_the_page()


def of_real(matrix):
    """The preconditioners of real symmetric matrices, of one component or more: (f, dense)."""
    yield tmg.fft_preconditioner, matrix.cut(dense_M(matrix.kernel))
    yield tmg.chan_preconditioner, matrix.cut(dense_block_chan(matrix.kernel))
    lags = [matrix.kernel[i][i] for i in range(len(matrix.kernel))]
    for of_one in zip(*map(componentwise, lags, matrix.masks), strict=True):
        f, dense = of_one[0][0], scipy.linalg.block_diag(*(x for _, x in of_one))
        if not is_refused(f, dense):
            yield f, dense


def of_any(matrix, part):
    """The preconditioners of complex and general matrices: (f, dense, whether it is Hermitian).

    Some are those of the Hermitian part, if it is given.
    """
    ((lags,),) = matrix.kernel
    holds = matrix.is_hermitian
    yield tmg.chan_preconditioner, matrix.cut(dense_chan(lags)), holds
    yield tmg.strang_preconditioner, matrix.cut(dense_strang(lags)), holds
    if matrix.is_line:
        n = max(matrix.grid_shape)
        half = n if holds else scipy.fft.next_fast_len(2 * n)
        yield tmg.spectral_preconditioner, matrix.cut(dense_factors(lags.ravel(), half)), holds
    if part is not None:
        at_zero = part.flat[part.size // 2].real
        unit = 0.7 / at_zero * np.eye(len(matrix.dense), dtype=lags.dtype)
        inverse = np.linalg.inv(matrix.cut(dense_of_lags(part)))  # Few unknowns are solved for.
        yield tmg.fft_preconditioner, matrix.cut(dense_M([[part]])), True
        yield tmg.default_preconditioner, inverse, True
        yield partial(tmg.jacobi_preconditioner, omega=0.7), unit, True


def kind_of(f):
    return getattr(f, "func", f).__name__.removesuffix("_preconditioner")


def _operators():
    for matrix in (*EVEN, *GENERAL):
        for A in (matrix, matrix.masked):
            yield pair("A", A, A.dense, symmetric=A.is_hermitian, positive=matrix in EVEN)
    c, r = random_lags(4), random_lags(4)[::-1]
    lags = dense_of_lags(random_lags(2, 3))  # Any array will do: made symmetric, but not even.
    lags = lags[:5, :5] + lags[:5, :5][::-1, ::-1]
    yield pair("A", general("symmetric, not even", lags), dense_of_lags(lags), positive=False)
    a = complex_lags(7)[:7]
    a = np.r_[abs(a).sum(), a[1:]]
    b = complex_lags(9)[8:]
    both = general("complex symmetric", np.r_[b[:0:-1], b])
    yield pair("A", both, scipy.linalg.toeplitz(b, b), holds=False)
    for name, dense, *given in (
        ("of c", dense_of_column(contact(5, 7)), contact(5, 7)),
        ("of c and r", scipy.linalg.toeplitz(c, r), c, r),
        ("of complex c", scipy.linalg.toeplitz(a), a),
    ):

        def build(dtype, given=given):
            return tmg.ToeplitzOperator(*(in_precision(x, dtype) for x in given))

        holds = name != "of c and r"
        yield Case("A", name, frozenset({name}), build, dense, symmetric=holds, positive=holds)


def _preconditioners():
    for whole in EVEN:
        ((lags,),) = whole.kernel
        M_full = dense_M([[lags]])
        for matrix in (whole, whole.masked):
            A, M = matrix.dense, matrix.cut(M_full)
            for f, dense in of_real(matrix):
                yield pair(kind_of(f), matrix, dense, f)
            gamma = 2.0 * abs(M_full.sum(axis=1).min())
            M_bar = dense_rsm(M, gamma)
            if not is_refused(tmg.fft_rsm_preconditioner, M_bar):
                rsm = partial(tmg.fft_rsm_preconditioner, gamma=gamma)
                yield pair("fft_rsm", matrix, M_bar, rsm, trait="gamma")
            for m in (1, 2, 3):
                if m < len(A):  # As many subdomains as unknowns leave nothing.
                    sd = partial(tmg.fft_sd_preconditioner, n_subdomains=m)
                    dense = dense_sd(A, M, m)
                    yield pair("fft_sd", matrix, dense, sd, trait=f"{m} subdomains", holds=False)
            jacobi = partial(tmg.jacobi_preconditioner, omega=0.7)
            yield pair("jacobi", matrix, 0.7 / A[0, 0] * np.eye(len(A)), jacobi)
            if matrix.is_line:
                c = lags.ravel()[lags.size // 2 :]
                spectral = matrix.cut(dense_spectral(c))
                yield pair("spectral", matrix, spectral, tmg.spectral_preconditioner)
        if whole.is_line:
            inverse = partial(tmg.toeplitz_inverse, rtol=1e-2)
            yield pair("inverse", whole, np.linalg.inv(whole.dense), inverse)


def _coupled():
    sizes = (2, (3, 4)), (2, (7,)), (3, (2, 5)), (3, (5, 1)), (2, (2, 3, 2))
    half_space = (2, (5, 7)), (2, (8, 8)), (2, (1, 6)), (3, (5, 4)), (3, (6, 1))
    for name, kernel_of, given in (
        ("", coupled_kernel, sizes),
        ("half-space ", half_space_kernel, half_space),
    ):
        for components, shape in given:
            kernel = kernel_of(components, *shape)
            whole = Matrix(f"{name}{components} components {name_of(shape)}", kernel)
            for matrix in (whole, whole.masked):
                A, M = matrix.dense, matrix.cut(dense_M(kernel))
                yield pair("A", matrix, A)
                for f, dense in of_real(matrix):
                    yield pair(kind_of(f), matrix, dense, f)
                sd = tmg.fft_sd_preconditioner
                yield pair("fft_sd", matrix, dense_sd(A, M, 2), sd, holds=False)
            general = [list(row) for row in kernel]
            general[1][0] = kernel[1][0] + 0.3 * kernel[0][0]
            matrix = Matrix(f"general {whole.name}", general)
            yield pair("A", matrix, matrix.dense, holds=False)
    for components, shape in sizes[:-1]:
        kernel = complex_kernel(components, *shape)
        whole = Matrix(f"Hermitian {components} components {name_of(shape)}", kernel)
        chan = dense_block_chan(kernel)
        for matrix in (whole, whole.masked):
            yield pair("A", matrix, matrix.dense)
            M = matrix.cut(dense_M(kernel))
            yield pair("fft", matrix, M, tmg.fft_preconditioner)
            yield pair("chan", matrix, matrix.cut(chan), tmg.chan_preconditioner)
        general = [list(row) for row in kernel]
        general[0][1] = 0.2 * complex_lags(*shape)
        matrix = Matrix(f"complex {components} components {name_of(shape)}", general)
        yield pair("A", matrix, matrix.dense, holds=False)
        yield pair("A, transposed", matrix, matrix.dense.T, lambda A: A.T, holds=False)


def _cycles():
    for c in (contact(16), exponential(32) + 0.1, contact(8, 8)):
        for pre, post, gamma in ((1, 1, 1), (1, 0, 1), (0, 1, 1), (2, 1, 1), (1, 1, 2), (0, 2, 2)):
            given = {"pre": pre, "post": post, "gamma": gamma, "coarsest": 4}
            yield pair(
                "multigrid",
                even(c),
                dense_cycle(c, smooth_rsm, **given),
                partial(tmg.multigrid, **given),
                trait=f"{'VW'[gamma - 1]}({pre},{post})",
                holds=pre == post,
            )
    kernel = half_space_kernel(2, 8, 8)
    yield pair(
        "multigrid",
        Matrix("2 components", kernel),
        scipy.linalg.block_diag(
            *(dense_cycle(kernel[i][i][7:, 7:], smooth_rsm, 1, 1, 1, 4) for i in (0, 1))
        ),
        partial(tmg.componentwise(tmg.multigrid), coarsest=4),
    )
    sd = partial(tmg.multigrid, pre=0, smoother=tmg.fft_sd_preconditioner, coarsest=4)
    dense = dense_cycle(contact(16), smooth_sd, 0, 1, 1, 4)
    yield pair("multigrid", even(contact(16)), dense, sd, trait="V(0,1) with SD", holds=False)
    alone, trait = even(contact(5)), "the coarsest grid alone"
    yield pair("multigrid", alone, np.linalg.inv(alone.dense), tmg.multigrid, trait=trait)


def _complex_and_general():
    """Complex matrices, Hermitian and general, and real ones that are not symmetric."""
    for shape in ((13,), (4, 6), (2, 3, 4), (3, 5), (16,), (6, 1), (2,), (1,)):
        matrices = [general("Hermitian", waves(*shape)), general("complex", complex_lags(*shape))]
        if shape in ((13,), (4, 6)):
            matrices.append(general("Hermitian and even", waves(*shape).real + 0j))
        if max(shape) > 2:  # A real circulant of another size is symmetric.
            matrices.append(general("general", dominant_lags(*shape)))
        for whole in matrices:
            ((lags,),) = whole.kernel
            is_hermitian = whole.name.startswith("Hermitian")
            for matrix in (whole, whole.masked):
                pairs = list(of_any(matrix, lags if is_hermitian else None))
                if np.iscomplexobj(lags):
                    pairs.append((lambda A: A, matrix.dense, is_hermitian))
                if matrix is whole and whole.is_line:
                    pairs.append((tmg.toeplitz_inverse, np.linalg.inv(whole.dense), is_hermitian))
                for f, dense, _ in pairs:
                    kind = kind_of(f).replace("<lambda>", "A").replace("toeplitz_", "")
                    yield pair(kind, matrix, dense, f, holds=is_hermitian)
                    if matrix.name.startswith("complex") and shape in ((13,), (3, 5)):
                        yield pair(
                            f"{kind}, transposed",
                            matrix,
                            dense.T,
                            lambda A, f=f: f(A).T,
                            holds=False,
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


def in_diagonals(diagonals, dtype):
    return [scipy.sparse.diags_array(in_precision(d, dtype)) for d in diagonals]


def _sums():
    """Sums of a matrix and diagonal ones, which stand for themselves in the dense definition."""
    complex_ones = general("Hermitian", waves(9)), general("complex", complex_lags(3, 4))
    for whole in (*GENERAL[:3], LINE, PLANE, *complex_ones):
        for matrix in (whole, whole.masked):
            given = diagonals(len(matrix.dense))
            for formula, (sum_of, keeps) in SUMS.items():

                def of(A, sum_of=sum_of, given=given):
                    precision = np.result_type(A.dtype.type(0).real)
                    D, E = in_diagonals(given, precision)
                    return sum_of(A, D, E, scipy.sparse.eye_array(*D.shape, dtype=precision))

                dense = sum_of(matrix.dense, *map(np.diag, given), np.eye(len(matrix.dense)))
                is_symmetric = formula == "A + A.T" and not np.iscomplexobj(dense)
                yield pair(
                    "sum",
                    matrix,
                    dense,
                    of,
                    trait=formula,
                    symmetric=is_symmetric or (keeps and matrix.is_hermitian),
                    positive=False,
                )


def _preconditioners_of_sums():
    """Of D A + E, and of Z A Zᴴ + E with a complex Z, which is Hermitian where A is."""
    complex_ones = [
        general(name, lags(*shape))
        for name, lags in (("Hermitian", waves), ("complex", complex_lags))
        for shape in ((9,) if lags is waves else (13,), (3, 4))
    ]
    dominant = general("general", dominant_lags(13))
    for whole in (LINE, PLANE, SQUARE, *complex_ones, dominant):
        is_even = whole in EVEN
        for matrix in (whole, whole.masked):
            d, e = diagonals(len(matrix.dense))
            z = d * np.exp(1j * np.arange(len(d)) ** 2) if np.iscomplexobj(matrix.dense) else d
            formulas = {"D A + E": (d, 1.0 + 0.0 * d)}
            if not is_even:
                formulas["Z A Z* + E"] = (z, z.conj())
            for formula, (left, right) in formulas.items():
                ((lags,),) = whole.kernel
                zero = tuple(m // 2 for m in lags.shape)
                diagonal = (left * right * lags[zero] + e).real
                scale = 1.0 / np.sqrt(diagonal)
                mean = (left * right / diagonal).mean() * lags
                mean[zero] += (e / diagonal).mean()
                scaled = Matrix("mean", [[mean]], matrix.mask)
                for f, dense, holds in list(of_mean(scaled, is_even)):

                    def of(A, f=f, given=(left, right, e)):
                        L, R, E = in_diagonals(given, np.result_type(A.dtype.type(0).real))
                        return f(L @ A @ R + E)

                    dense = (scale[:, np.newaxis] * dense * scale).astype(lags.dtype)
                    yield pair(kind_of(f), matrix, dense, of, trait=formula, holds=holds)


def of_mean(mean, is_even):
    """The preconditioners of a sum, scaled to ones on the diagonal: those of its mean."""
    if not is_even:
        ((lags,),) = mean.kernel
        yield from of_any(mean, (lags + np.flip(lags).conj()) / 2)
        return
    pairs = list(of_real(mean))
    A, M = mean.dense, pairs[0][1]
    yield from ((f, dense, True) for f, dense in pairs)
    yield partial(tmg.jacobi_preconditioner, omega=0.7), 0.7 * np.eye(len(A)), True
    yield tmg.fft_sd_preconditioner, dense_sd(A, M, 2), False
    for f in (tmg.default_preconditioner, tmg.multigrid):  # Few unknowns are solved for.
        yield f, np.linalg.inv(A), True


CASES = [
    *_operators(),
    *_preconditioners(),
    *_coupled(),
    *_cycles(),
    *_complex_and_general(),
    *_sums(),
    *_preconditioners_of_sums(),
]


def quick_ones(cases):
    """Those that show a kind of operator with a trait that no earlier one shows."""
    shown = set()
    for case in cases:
        new = {(case.kind, trait) for trait in case.traits} - shown
        shown |= new
        if new:
            yield case


QUICK = list(quick_ones(CASES))
PAIRS = [
    pytest.param(case, id=str(case), marks=() if case in QUICK else pytest.mark.slow)
    for case in CASES
]
