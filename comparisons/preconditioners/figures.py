"""Figures of contact areas in three dimensions: tractions, spectra and convergence."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.linalg import eigh, eigvals
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from comparisons.contact.punch3d import METHODS
from comparisons.harness import report
from comparisons.harness.report import Row
from comparisons.systems.masks import rough
from comparisons.systems.punch import Punch, influence
from toeplitz_mg._typing import Array
from toeplitz_mg.operators.structure import unwrap

N, QUICK_N = 256, 32
DENSE_N = 48  # Elements across the largest grid whose spectrum is computed, densely.


def irregular(n: int) -> Array:
    """Return the mask of a rough patch in an ellipse."""
    x = (2.0 * np.arange(n) + 1.0) / n - 1.0
    return rough(0.7, n) & (np.hypot(x[:, None], 1.5 * x[None, :]) < 0.95)


def traction(n: int, path: Path) -> list[Row]:
    """Draw the tractions of a bonded shift of an irregular area, coupled."""
    mask = irregular(n)
    A = influence("coupled", mask, (2.0 / n, 2.0 / n))
    u = np.repeat([1.0, 0.0], np.count_nonzero(mask))
    q, info = tmg.cg(A, u, M=tmg.sine_preconditioner(A), rtol=1e-8)
    if info:
        raise ArithmeticError("not converged")
    fields = np.full((2, n, n), np.nan)
    fields[:, mask] = q.reshape(2, -1)
    figure = Figure(figsize=(11, 4.8), layout="constrained")
    for ax, field, name in zip(figure.subplots(1, 2), fields, ("q_x", "q_y"), strict=True):
        low, high = np.nanquantile(field, [0.01, 0.99])
        image = ax.imshow(field.T, origin="lower", extent=(-1, 1, -1, 1), vmin=low, vmax=high)
        ax.set(title=f"{name} by a shift of 1 along x, G = 1, ν = 0.28", xlabel="x", ylabel="y")
        figure.colorbar(image, ax=ax)
    report.write_figure(path, figure, dpi=130)
    return [{"points in contact": len(q) // 2, "force along x": float(q[: len(q) // 2].sum())}]


def spectrum(n: int, path: Path) -> list[Row]:
    """Draw the eigenvalues of M A with and without the modification of the row sums."""
    rows: list[Row] = []
    figure = Figure(figsize=(11, 4.8), layout="constrained")
    for ax, area in zip(figure.subplots(1, 2), ("square", "rough, 30 %"), strict=True):
        A = Punch(area, "normal", n).operator()
        for name, preconditioner in (
            ("M", tmg.fft_preconditioner),
            ("M̄", tmg.fft_rsm_preconditioner),
            ("cosine", tmg.cosine_preconditioner),
            ("sine", tmg.sine_preconditioner),
            ("FSAI", tmg.fsai_preconditioner),
        ):
            P = preconditioner(A) @ np.eye(A.shape[0])
            values = np.sort(_eigenvalues(P, A.toarray()))
            ax.plot(np.linspace(0.0, 1.0, len(values)), values, label=name)
            rows.append({"area": area, "M": name, "smallest": values[0], "largest": values[-1]})
        ax.set(title=f"{area}, {n} x {n}", xlabel="share of the eigenvalues", yscale="log")
        ax.set(ylabel="eigenvalues of M A")
        ax.grid(alpha=0.3)
        ax.legend()
    report.write_figure(path, figure, dpi=130)
    return rows


def _eigenvalues(P: Array, A: Array) -> Array:
    """Return the eigenvalues of P A, both symmetric; real where A is positive definite."""
    try:
        return eigh(P, np.linalg.inv(A), eigvals_only=True)
    except np.linalg.LinAlgError:
        return eigvals(P @ A).real


def convergence(n: int, path: Path) -> list[Row]:
    """Draw the residuals of CG over the iterations and the work, for some areas."""
    rows: list[Row] = []
    figure = Figure(figsize=(13, 8), layout="constrained")
    axes = figure.subplots(2, 3, sharey=True)
    for column, area in enumerate(("square", "circle", "rough, 30 %")):
        punch = Punch(area, "coupled", n)
        A, b = punch.operator(), punch.displacement()
        for name in ("CG", "CG + |q| circulant", "CG + cosine", "CG + sine", "CG + FSAI", "CG + M"):
            history, units = residuals(A, b, METHODS[name])
            axes[0, column].semilogy(history, label=name)
            axes[1, column].semilogy(np.arange(len(history)) * units, history)
            rows.append({"area": area, "method": name, "iterations": len(history) - 1})
        axes[0, column].set(title=f"{area}, coupled, {n} x {n}", xlabel="iterations", xlim=(0, 60))
        axes[1, column].set(xlabel="work units", xlim=(0, 80))
        for ax in axes[:, column]:
            ax.grid(alpha=0.3)
            ax.set(ylabel="‖r‖/‖b‖", ylim=(1e-9, 3.0))
    axes[0, 0].legend()
    report.write_figure(path, figure, dpi=130)
    return rows


def residuals(
    A: LinearOperator, b: Array, preconditioner: Callable[[Any], Any]
) -> tuple[Sequence[float], float]:
    """Return the relative residuals of CG, and the work units of an iteration."""
    M = preconditioner(A)
    with tmg.count_products() as work:
        tmg.cg(A, b, M=M, rtol=0.0, maxiter=4)
    history = [1.0]

    def note(x: Array) -> None:
        history.append(float(np.linalg.norm(b - A @ x)) / float(np.linalg.norm(b)))

    tmg.cg(A, b, M=M, rtol=1e-8, callback=note)
    return history, work.units(unwrap(A)[0].shape[0]) / 4.0


def main(quick_n: int = QUICK_N) -> None:
    """Draw the figures."""
    arguments = report.options("preconditioners.figures", "Tractions, spectra, convergence.")
    n = quick_n if arguments.quick else N
    for name, draw, size in (
        ("traction", traction, n),
        ("spectrum", spectrum, min(n, DENSE_N)),
        ("convergence", convergence, n),
    ):
        rows = draw(size, arguments.output / f"{name}.png")
        report.write_csv(arguments.output / f"{name}.csv", rows)
        report.show(name, rows)


if __name__ == "__main__":
    main()
