"""Pictures of contacts: fields, and the areas of contact, of stick and of slip."""

from typing import Any

import numpy as np


def draw(result: Any, ax: Any = None) -> Any:
    """Draw the traction of a result, and the areas of contact and of stick, and return the axes."""
    try:
        from matplotlib import pyplot as plt  # It is an extra, and slow to import.
    except ImportError as error:
        raise ImportError("plot() needs matplotlib: pip install 'toeplitz-mg[plot]'") from error
    if ax is None:
        _, ax = plt.subplots(layout="constrained")
    (_draw_line if result.contact.ndim == 1 else _draw_surface)(result, ax)
    return ax


def _draw_line(result: Any, ax: Any) -> None:
    x = result.x
    traction = result.traction if result.traction.ndim == 1 else result.magnitude
    ax.plot(x, traction, label="pressure" if result.stick is None else "traction")
    if result.stick is not None:
        bound = np.where(np.isfinite(result.bound), result.bound, np.nan)
        ax.plot(x, bound, "k:", label="traction bound")
        ax.plot(x, -bound, "k:")
        ax.fill_between(x, 0.0, traction, where=result.stick, alpha=0.3, step="mid", label="stick")
    ax.set(xlabel="x [mm]", ylabel="traction [N/mm²]")
    ax.legend()


def _draw_surface(result: Any, ax: Any) -> None:
    (n1, n2), (h1, h2) = result.contact.shape, result.element
    extent = (-n1 * h1 / 2, n1 * h1 / 2, -n2 * h2 / 2, n2 * h2 / 2)
    image = ax.imshow(result.magnitude.T, origin="lower", extent=extent, cmap="viridis")
    ax.figure.colorbar(image, ax=ax, label="traction [N/mm²]")
    for area, colour in ((result.contact, "w"), (result.stick, "r")):
        if area is not None and area.any() and not area.all() and min(n1, n2) > 1:
            ax.contour(area.T.astype(float), [0.5], extent=extent, origin="lower", colors=colour)
    ax.set(xlabel="x [mm]", ylabel="y [mm]")
