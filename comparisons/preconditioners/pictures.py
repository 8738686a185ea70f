"""Pictures of the pages: pressures on areas of every kind, and the eigenvalues of M A."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.linalg import eigh, eigvals

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import PRECONDITIONERS
from comparisons.harness.report import Row
from comparisons.preconditioners.areas import operator
from comparisons.systems import masks
from toeplitz_mg._typing import Array

SHOWN = 128  # Elements across the grid whose pressures are drawn.
DENSE_N = 48  # Elements across the largest grid whose spectrum is computed, densely.
DRAWN = ("M", "M̄", "cosine", "sine", "FSAI")  # Preconditioners whose spectra are drawn.


def run(folder: Path, n: int = SHOWN) -> None:
    """Draw both pictures, and list the ends of the spectra."""
    draw_areas(n, folder / "areas.png")
    table = report.Table("Eigenvalues of M A", folder / "spectrum.csv", room={"area": 12})
    draw_spectra(table, min(n, DENSE_N), folder / "spectrum.png")


def draw_areas(n: int, path: Path) -> None:
    """Draw the pressures under a rigid displacement of each area."""
    figure = Figure(figsize=(17, 9), layout="constrained")
    axes = figure.subplots(3, 5).ravel()
    for ax, (area, mask) in zip(axes, masks.FRAGMENTED.items(), strict=False):
        A = operator(area, n)
        p, info = tmg.cg(A, np.ones(A.shape[0]), M=tmg.default_preconditioner(A), rtol=1e-6)
        if info:
            raise ArithmeticError("not converged")
        field = np.full((n, n), np.nan)
        field[mask(n)] = p
        image = ax.imshow(
            field.T, origin="lower", extent=(-1, 1, -1, 1), cmap="YlOrRd",
            vmin=0.0, vmax=float(np.quantile(p, 0.95)), interpolation="none",
        )  # fmt: skip
        bar = ax.inset_axes((1.04, 0.0, 0.05, 1.0))
        figure.colorbar(image, cax=bar, extend="max")
        ax.set(title=area, xlabel="x", ylabel="y", xticks=[-1, 0, 1], yticks=[-1, 0, 1])
    figure.suptitle(f"Pressures over G under a unit displacement, of {n}² elements")
    for ax in axes[len(masks.FRAGMENTED) :]:
        ax.set_axis_off()
    report.write_figure(path, figure, dpi=130)


def draw_spectra(table: report.Table, n: int, path: Path) -> None:
    """Draw the eigenvalues of M A on a square and on a rough area."""
    figure = Figure(figsize=(11, 4.8), layout="constrained")
    for ax, area in zip(figure.subplots(1, 2), ("full", "rough, 30 %"), strict=True):
        A = operator(area, n)
        for name in DRAWN:
            M = PRECONDITIONERS[name](A)
            assert M is not None
            values = np.sort(_eigenvalues(M @ np.eye(A.shape[0]), A.toarray()))
            ax.plot(np.linspace(0.0, 1.0, len(values)), values, label=name)
            row: Row = {"area": area, "M": name}
            table.add(row | {"smallest": f"{values[0]:.3g}", "largest": f"{values[-1]:.3g}"})
        ax.set(title=f"{area}, {n} x {n}", xlabel="share of the eigenvalues", yscale="log")
        ax.set(ylabel="eigenvalues of M A")
        ax.grid(alpha=0.3)
        ax.legend()
    report.write_figure(path, figure, dpi=130)


def _eigenvalues(P: Array, A: Array) -> Array:
    """Return the eigenvalues of P A, both symmetric; real where A is positive definite."""
    try:
        return eigh(P, np.linalg.inv(A), eigvals_only=True)
    except np.linalg.LinAlgError:
        return eigvals(P @ A).real
