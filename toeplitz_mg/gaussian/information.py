"""Fisher information of a normal distribution whose covariance depends on parameters."""

from dataclasses import replace

import numpy as np

from toeplitz_mg._typing import Array, Mask, Rows
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.gaussian.observed import Few, Gaps, Observed, Whole, by_column, inverse_block
from toeplitz_mg.operators import ToeplitzOperator


def covariance_information(known: Observed, derivatives: Array) -> Array:
    """Return tr(A_oo⁻¹ ∂ᵢA_oo A_oo⁻¹ ∂ⱼA_oo)/2 from the derivatives ∂ᵢc of the covariances.

    Let D_k be twice the derivative of log det A_oo by c_k for k > 0. The information is -Σ_k ∂ᵢc_k
    ∂ⱼD_k, with half of the first term. For few observed points dense matrices are used.
    """
    if isinstance(known, Few):
        blocks = [known.divide(ToeplitzOperator(dc).block(known.index)) for dc in derivatives]
        return np.array([[0.5 * np.vdot(a, b.T) for b in blocks] for a in blocks])
    if isinstance(known, Whole):
        changes = [sums for _, sums in _differentiate(known, derivatives)]
    elif isinstance(known, Gaps):
        changes = _differentiate_with_gaps(known, derivatives)
    else:
        known.logdet()  # Raises the error that explains why.
    weights = np.where(np.arange(derivatives.shape[1]) > 0, -1.0, -0.5)
    information = (derivatives * weights) @ np.transpose(changes)
    return 0.5 * (information + information.T)


def information_of_contrasts(known: Observed, Z: Rows, inside: Mask, derivatives: Array) -> Array:
    """Return how much less information the restricted likelihood has than the likelihood.

    The restricted likelihood has tr(P ∂ᵢA P ∂ⱼA)/2 with P = A_oo⁻¹ - Z Zᵀ, Z = A_oo⁻¹ Q M^(-1/2)
    and M = Qᵀ A_oo⁻¹ Q. The rows of `Z` are the columns of this Z.
    """
    W = [ToeplitzOperator(dc).apply(Z) * inside for dc in derivatives]
    solved, blocks = [known.solve(rows)[0] for rows in W], [rows @ Z.T for rows in W]
    crossed = np.array([[np.vdot(a, b) for b in solved] for a in W])
    return crossed - 0.5 * np.array([[np.vdot(a, b) for b in blocks] for a in blocks])


def _differentiate(whole: Whole, derivatives: Array) -> list[tuple[Array, Array]]:
    """Return the derivatives of x = A⁻¹ e₁ and of the sums D of the diagonals of A⁻¹.

    The first is -A⁻¹ ∂A x. D x₀ is a quadratic form of x (`SzegoPolynomial.diagonal_sums`).
    """
    column = whole.column
    x, circle, n = column.x, column.polynomial.circle, len(column.x)
    rows = np.array([ToeplitzOperator(dc).apply(x[np.newaxis])[0] for dc in derivatives])
    a = column.polynomial.values
    heavy, found = n * a - 2.0 * column.polynomial.slopes, []
    for dx in -column.solve(rows):
        z = circle.values(dx)
        heavier = n * z - 2.0 * circle.values(np.arange(float(n)) * dx)
        sums = circle.coefficients((heavy * z.conj() + heavier * a.conj()).real, n)
        found.append((dx, sums - dx[0] / x[0] * column.polynomial.diagonal_sums))
    return found


def _differentiate_with_gaps(gaps: Gaps, derivatives: Array) -> list[Array]:
    """Return the derivatives of D with gaps (see `Gaps.by_covariances`).

    D is that of the whole series minus the correlation of x with λ = A⁻¹ ∇, where ∇ is the
    derivative of log det B by x. For a change ∂x of x, B x₀ is quadratic in x, and ∇ x₀ is linear
    in x and in B⁻¹ up to a constant, so differences give exact derivatives.
    """
    column, index = gaps.whole.column, gaps.missing
    x, circle, inverse = column.x, column.polynomial.circle, gaps.inverse()

    def form(z: Array) -> Array:
        upper = np.triu(z[0] * inverse_block(replace(column, x=z), index))
        return upper + np.triu(upper, 1).T

    def multiply(z: Array, M: Array) -> Array:
        product = z[0] * by_column(z, index, M)
        product[0] += len(index)
        return product

    B, of_x = form(x) / x[0], multiply(x, inverse)
    gradient = of_x / x[0]
    gradient[0] -= len(index) / x[0]
    multiplier = column.solve(gradient[np.newaxis])
    p, q, found = circle.values(x), circle.values(multiplier[0]), []
    for dc, (dx, sums) in zip(derivatives, _differentiate(gaps.whole, derivatives), strict=True):
        step = 0.5 / (max(norm(dx) / norm(x), abs(dx[0]) / x[0]) or 1.0)
        change = (form(x + step * dx) - form(x - step * dx)) / (2.0 * step)
        inverse_change = -inverse @ ((change - dx[0] * B) / x[0]) @ inverse
        moved = (multiply(x + step * dx, inverse) - of_x) / step + multiply(x, inverse_change)
        moved = (moved - dx[0] * gradient) / x[0]
        moved = column.solve((moved - ToeplitzOperator(dc).apply(multiplier)[0])[np.newaxis])[0]
        r, s = circle.values(dx), circle.values(moved)
        found.append(sums - circle.coefficients((r * q.conj() + s * p.conj()).real, len(x)))
    return found
