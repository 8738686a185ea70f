"""Figures of contact problems: tractions beside the analytic curves, and convergence."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from comparisons.harness import report
from comparisons.harness.report import Row
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import ContactResult, surfaces


def picture(results: Sequence[ContactResult], theory: Array | None, title: str, path: Path) -> None:
    """Draw the tractions and the areas, and what theory says."""
    is_line = results[0].contact.ndim == 1
    profile = theory is not None and not is_line
    count = 2 if profile else len(results)
    figure = Figure(figsize=(5.5 * count, 4.5), layout="constrained")
    figure.suptitle(title)
    axes = figure.subplots(1, count, squeeze=False)[0]
    for ax, result in zip(axes, results, strict=False):
        result.plot(ax=ax)
    if theory is not None and is_line:
        (x,) = surfaces.centres(theory.shape, results[0].element[0])
        axes[0].plot(x, theory, "--", color="#009E73", label="theory")
        axes[0].legend()
    elif theory is not None:
        _profile(axes[1], results[0], theory)
    report.write_figure(path, figure, dpi=110)


def _profile(ax: Any, result: ContactResult, theory: Array) -> None:
    """Draw the traction along x through the middle."""
    h1, h2 = result.element
    x = surfaces.centres(theory.shape, (h1, h2))[0][:, 0]
    row = theory.shape[1] // 2
    traction = result.traction if result.stick is None else result.traction[0]
    ax.plot(x, traction[:, row], label="this solver")
    ax.plot(x, theory[:, row], "k--", label="theory")
    if result.stick is not None and result.bound is not None:
        ax.plot(x, result.bound[:, row], "k:", label="traction bound")
        ax.fill_between(
            x, 0.0, traction[:, row], where=result.stick[:, row], alpha=0.3, label="stick"
        )
    ax.set(xlabel="x [mm], at y = 0", ylabel="traction [N/mm²]")
    ax.legend()


def rough_picture(results: Sequence[ContactResult], N: int, path: Path) -> None:
    """Draw the pressures on a rough surface at several loads."""
    figure = Figure(figsize=(4.8 * len(results), 3.8), layout="constrained")
    for ax, result in zip(figure.subplots(1, len(results)), results, strict=True):
        result.plot(ax=ax)
        ax.set(title=f"{result.contact_fraction:.1%} in contact, F = {result.force:.3g}")
    figure.suptitle(f"Pressures on a rough surface, {N} x {N}")
    report.write_figure(path, figure, dpi=110)


def convergence(errors: Sequence[Row], path: Path) -> None:
    """Draw the errors against theory over N."""
    cases = report.group(errors, "case")
    columns = 4
    figure = Figure(figsize=(16, 4.0 * -(-len(cases) // columns)), layout="constrained")
    axes = figure.subplots(-(-len(cases) // columns), columns, squeeze=False).ravel()
    for ax, (case, own) in zip(axes, cases.items(), strict=False):
        for quantity, curve in report.group(own, "quantity").items():
            points = [(row["N"], abs(row["error"])) for row in curve]
            ax.loglog(*zip(*points, strict=True), "o-", label=quantity)
        sizes = np.array(sorted({row["N"] for row in own}))
        ax.loglog(sizes, 2.0 / sizes, "k:", label="2/N")
        ax.set(title=case, xlabel="N", ylabel="relative error")
        ax.set_xticks(sizes[-1::-2], [str(n) for n in sizes[-1::-2]])
        ax.set_xticks([], minor=True)
        ax.grid(alpha=0.3)
        ax.legend(fontsize="small")
    for ax in axes[len(cases) :]:
        ax.set_axis_off()
    report.write_figure(path, figure, dpi=110)
