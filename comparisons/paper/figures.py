"""Figures 3, 6, 7 and 9 to 13 of the paper: where the FFT smoother fails, and its two remedies."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from comparisons.harness.report import Row, Table, write_csv, write_figure
from toeplitz_mg._typing import Array
from toeplitz_mg.paper.algorithm import column_of_inverse

N = 32  # Number of elements in all figures but the third.
ELEMENT = np.arange(1, N + 1)
DOTS: dict[str, Any] = {"color": "red", "marker": ".", "markersize": 7, "linewidth": 0.5}
CIRCLES: dict[str, Any] = {"color": "blue", "marker": "o", "markersize": 6, "linewidth": 0.5}
CIRCLES["markerfacecolor"] = "none"


def unit_matrix(n: int) -> tmg.ToeplitzOperator:
    """Return the matrix of test 1 for G = 1, as the paper has it; I - M A does not depend on G."""
    problem = tmg.contact.problems.test1(n)
    return tmg.ToeplitzOperator(problem.material.G * problem.A.c)


def iteration_matrix(preconditioner: Callable[[tmg.ToeplitzOperator], LinearOperator]) -> Array:
    """Return I - M A, dense."""
    A = unit_matrix(N)
    return np.eye(N) - preconditioner(A) @ A.toarray()


def eigenpairs(R: Array) -> tuple[Array, Array]:
    """Return eigenvalues, ascending, and eigenvectors (columns) of an iteration matrix.

    Every R here commutes with the reversal of the elements, so that each eigenvector is even or
    odd, and its first half an eigenvector of a matrix half as large. This also tells apart the
    two eigenvectors of a double eigenvalue: the even one comes first.
    """
    half = len(R) // 2
    values, vectors = [], []
    for parity in (1, -1):
        # All are real but for rounding.
        w, V = map(np.real, np.linalg.eig(R[:half, :half] + parity * R[:half, : half - 1 : -1]))
        V /= np.sqrt(2.0) * np.linalg.norm(V, axis=0)
        V *= np.sign(V[abs(V).argmax(axis=0), np.arange(half)])  # The largest entry is positive.
        values.append(w)
        vectors.append(np.vstack([V, parity * V[::-1]]))
    w, V = np.concatenate(values), np.hstack(vectors)
    order = np.argsort(w.round(10), kind="stable")
    return w[order], V[:, order]


def spectral_radii(A: tmg.ToeplitzOperator, gammas: Array) -> Array:
    """Return the spectral radius of I - M̄ A for each γ; only a multiple of I in M̄ depends on γ."""
    M_bar = tmg.fft_rsm_preconditioner(A)
    shifts = (gammas - M_bar.gamma)[:, np.newaxis, np.newaxis]
    R = np.eye(A.shape[0]) - (M_bar.toarray() + shifts * np.eye(A.shape[0])) @ A.toarray()
    return abs(np.linalg.eigvals(R)).max(axis=1)


def data_of(figure: Figure) -> list[Row]:
    """Return the points of all curves of a figure."""
    return [
        {"panel": panel.get_title(), "curve": line.get_label(), "x": x, "y": y}
        for panel in figure.axes
        for line in panel.lines
        for x, y in np.asarray(line.get_xydata()).tolist()
    ]


def subplots(columns: int, xlabel: str, ylabel: str, rows: int = 1) -> tuple[Figure, list[Axes]]:
    """Return a figure and its panels."""
    figure = Figure(figsize=(1.0 + 4.5 * columns, 0.4 + 3.6 * rows), layout="constrained")
    axes = list(figure.subplots(rows, columns, squeeze=False).flat)
    for panel in axes:
        panel.set(xlabel=xlabel, ylabel=ylabel)
        panel.grid(alpha=0.3)
    return figure, axes


def plot_eigenvalues(axes: Axes, values: Array, label: str, style: dict[str, Any]) -> None:
    """Plot eigenvalues in their order."""
    axes.plot(ELEMENT, values, label=label, **style | {"linestyle": "none"})
    axes.set(xlabel="index", ylabel="eigenvalue")


def plot_application(axes: Axes, R: Array, v: Array, R_name: str, v_name: str) -> None:
    """Plot a vector in red dots, and what R makes of it in blue circles."""
    axes.plot(ELEMENT, v, label=f"${v_name}$", **DOTS)
    axes.plot(ELEMENT, R @ v, label=f"${R_name}\\,{v_name}$", **CIRCLES)
    axes.margins(y=0.18)
    axes.legend(loc="upper center", ncols=2)


def figure_03() -> Figure:
    """Draw columns of A⁻¹, and what the algorithm of the paper's Figure 4 makes of them."""
    n = 16
    A = unit_matrix(n)
    inverse = np.linalg.inv(A.toarray())
    figure, (left, right) = subplots(2, "element", "traction, for G = 1")
    for K, style in {1: "rD-", 3: "bo-", 8: "g^-", 12: "ks-"}.items():
        c, m = inverse[:, K - 1], column_of_inverse(A.c, K)
        for panel, y in ((left, c), (right, m)):
            (line,) = panel.plot(np.arange(1, len(y) + 1), y, style, label=f"K = {K}")
            line.set(markersize=5, markerfacecolor="none", linewidth=0.5)
    right.axvline(n + 0.5, color="grey", linestyle="--", label="contact ends")
    left.set_title("(a) columns $c^K$ of $A^{-1}$")
    right.set_title("(b) coefficients $m^K$ by FFT")
    for panel in (left, right):
        panel.legend()
    return figure


def figure_06() -> Figure:
    """Draw the eigenvalues of I - M A, and the eigenvectors of the two below -1."""
    values, vectors = eigenpairs(iteration_matrix(tmg.fft_preconditioner))
    figure, (left, right) = subplots(2, "element", "eigenvector")
    plot_eigenvalues(left, values, "$R_F$", DOTS)
    for k, style in enumerate((DOTS, CIRCLES)):
        right.plot(ELEMENT, vectors[:, k], label=f"λ = {values[k]:.3f}", **style)
    right.legend()
    left.set_title("(a) eigenvalues of $R_F = I - MA$")
    right.set_title("(b) the two problematic eigenvectors")
    return figure


def figure_07() -> Figure:
    """Draw two Fourier modes before and after one application of I - M A."""
    R = iteration_matrix(tmg.fft_preconditioner)
    figure, axes = subplots(2, "element", "mode")
    for panel, k, title in zip(axes, (2, 30), ("(a) smooth", "(b) oscillatory"), strict=True):
        v = np.sin(k * np.pi * (ELEMENT - 0.5) / N)  # Here x is from the left end.
        plot_application(panel, R, v, "R_F", f"v_{{{k}}}")
        panel.set_title(f"{title} mode $v_{{{k}}}$")
    return figure


def figure_09() -> Figure:
    """Draw the eigenvalues with the FFT and with the FFT+SD smoother."""
    plain, _ = eigenpairs(iteration_matrix(tmg.fft_preconditioner))
    deflated, _ = eigenpairs(iteration_matrix(tmg.fft_sd_preconditioner))
    figure, (axes,) = subplots(1, "index", "eigenvalue")
    plot_eigenvalues(axes, plain, "$R_F = I - MA$", DOTS)
    plot_eigenvalues(axes, deflated, "$R_D = I - PMA$", CIRCLES)
    axes.set_title("Eigenvalues with the FFT and FFT+SD smoothers")
    axes.legend()
    return figure


def figure_10() -> Figure:
    """Draw the four leading eigenvectors with FFT+SD; the last two are the deflated constants."""
    R = iteration_matrix(tmg.fft_sd_preconditioner)
    values, vectors = eigenpairs(R)
    figure, axes = subplots(2, "element", "eigenvector", rows=2)
    for panel, letter, k in zip(axes, "abcd", (1, 0, -2, -1), strict=True):
        v = vectors[:, k]
        plot_application(panel, R, v, "R_D", "v")
        panel.set(title=f"({letter}) λ = {values[k]:.4f}", ylim=(-0.85, 0.95))
    return figure


def figure_11() -> Figure:
    """Draw the row sums of A⁻¹ and of M."""
    A = unit_matrix(N)
    exact = np.linalg.inv(A.toarray()).sum(axis=1)
    approximate = tmg.fft_preconditioner(A).toarray().sum(axis=1)
    figure, (axes,) = subplots(1, "row", "row sum, for G = 1")
    for sums, name, style in ((exact, "A^{-1}", DOTS), (approximate, "M", CIRCLES)):
        axes.plot(ELEMENT, sums, label=f"sum(${name}$)", **style)
    axes.set_title("Row sums of $A^{-1}$ and of $M$")
    axes.legend()
    return figure


def figure_12() -> Figure:
    """Draw the spectral radius of I - M̄ A over γ, and a closer look where it is smallest."""
    A = unit_matrix(N)
    gamma = tmg.fft_rsm_preconditioner(A).gamma
    figure, axes = subplots(2, "γ", "spectral radius of $R_R$")
    for panel, letter, (low, high) in zip(axes, "ab", ((0.0, 0.15), (0.07, 0.1)), strict=True):
        gammas = np.linspace(low, high, 151)
        radii = spectral_radii(A, gammas)
        panel.plot(gammas, radii, "b-")
        panel.axvline(gamma, color="red", linestyle="--", label=f"Eq. 20: {gamma:.4f}")
        panel.set_title(f"({letter}) γ in [{low:g}, {high:g}]")
        panel.legend(loc="upper left")
    return figure


def figure_13() -> Figure:
    """Draw the eigenvalues with FFT+RSM, and the eigenvectors of the lowest and the highest."""
    R = iteration_matrix(tmg.fft_rsm_preconditioner)
    values, vectors = eigenpairs(R)
    figure, (left, *axes) = subplots(3, "element", "eigenvector")
    plot_eigenvalues(left, values, "$R_R$", DOTS)
    left.set_title("(a) eigenvalues of $R_R = I - \\bar{M}A$")
    for panel, letter, k in zip(axes, "bc", (0, -1), strict=True):
        v = vectors[:, k]
        plot_application(panel, R, v, "R_R", "v")
        panel.set_title(f"({letter}) λ = {values[k]:.4f}")
    return figure


def numbers() -> Iterator[Row]:
    """Yield what can be compared: by the paper, and by this package."""
    A = unit_matrix(N)
    gamma = tmg.fft_rsm_preconditioner(A).gamma
    gammas = np.append(np.linspace(0.08, 0.09, 1001), gamma)
    radii = spectral_radii(A, gammas)
    best = radii.argmin()
    yield {"quantity": "γ = min sum(M)", "paper": "0.0837", "here": f"{gamma:.4g}"}
    yield {"quantity": "best γ", "paper": "0.087", "here": f"{gammas[best]:.4g}"}
    yield {"quantity": "ρ at these", "here": f"{radii[-1]:.4g}, {radii[best]:.4g}"}


FIGURES: dict[int, Callable[[], Figure]] = {
    **{3: figure_03, 6: figure_06, 7: figure_07, 9: figure_09},
    **{10: figure_10, 11: figure_11, 12: figure_12, 13: figure_13},
}


def run(folder: Path) -> None:
    """Draw all figures, write their data and show the numbers."""
    for number, draw in FIGURES.items():
        figure = draw()
        write_figure(folder / f"figure_{number:02}.png", figure, dpi=150)
        write_csv(folder / f"figure_{number:02}.csv", data_of(figure))
    Table(f"Test 1, {N} x 1, G = 1", room={"quantity": 22}).extend(numbers())
