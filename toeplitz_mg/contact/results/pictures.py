"""Pictures of contacts: fields in colours, areas of stick and slip, arrows for vectors.

Elements outside the contact are white, and low values are light. Areas are shown by colours, not by
outlines, which would be wider than the spots of rough surfaces.
"""

from functools import partial
from math import isfinite, prod
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.results.quantities import name_units, quantities, require_whole

# Blue and orange, which are distinct for colour-blind readers too.
STICK, SLIP = "#3182BD", "#E6550D"
LIGHTEST = 0.15  # Share of a colour map left out at the light end, as too close to white.
PEAK = 1.25  # Above this ratio of the maximum to the NEARLY-quantile, the quantile is the top.
NEARLY = 0.995  # The quantile that PEAK refers to.
BAR, SPACE = 0.14, 0.1  # Width of a colour bar, and of the space before it, inches.
ARROWS = 15  # Arrows along each side of a square contact.
SHORTEST = 0.03  # Arrows shorter than this share of the longest are drawn as points.
# Units of lengths on labels: the smallest maximum that uses it, mm, and the units per mm.
LENGTHS = ((0.1, 1.0, "mm"), (1e-4, 1e3, "µm"), (0.0, 1e6, "nm"))
FILLED = 0.3  # No arrows if the contact fills less of its bounding rectangle: they hide spots.


def draw(result: Any, field: Any = None, ax: Any = None) -> Any:
    """Draw a field of a result and return the axes (see `NormalResult.plot`)."""
    require_whole(result)
    if field is not None and not isinstance(field, str):
        field, ax = None, field  # Only the axes were given.
    declared = quantities(type(result))
    names = [k for k, q in declared.items() if q.shades and getattr(result, k) is not None]
    field = field or names[0]
    if field not in names:
        raise ValueError(f"field is {field!r}, but must be one of {', '.join(names)}")
    ax = find_axes(ax)
    (_draw_line if len(result.shape) == 1 else _draw_surface)(result, field, ax)
    if result.stick is not None and result.creepages is not None:
        _show_travel(ax, 0.91 if len(result.shape) == 1 else 0.05)
    if not ax.get_title():
        ax.set_title(_name_load(result), fontsize="medium")
    return ax


def label_axis(axis: Any, name: str, unit: str, largest: float = np.inf) -> None:
    """Label an axis or colour bar with its unit ("1" for a plain number).

    Small lengths have tick labels in µm or nm; the data stay in mm.
    """
    if unit == "mm":
        factor, unit = next((k, small) for least, k, small in LENGTHS if not 0.0 < largest < least)
        if factor != 1.0:
            axis.set_major_formatter(partial(_write_tick, factor))
    axis.set_label_text(f"{name} [{'–' if unit == '1' else unit}]")


def _write_tick(factor: float, value: float, _: int | None = None) -> str:
    return f"{factor * value + 0.0:.6g}".replace("-", "−")


def _label_places(ax: Any, *axes: Array) -> None:
    """Label the x and y axes of a picture in the same unit."""
    largest = max(float(np.abs(x).max()) for x in axes)
    for axis, name, _ in zip((ax.xaxis, ax.yaxis), "xy", axes, strict=False):
        label_axis(axis, name, "mm", largest)


def _name_load(result: Any) -> str:
    """Return the force of a result as text; for tangential results also the friction limit."""
    force = result._figures()[0].text.replace("-", "−")
    if result.stick is None:
        return f"P = {force}"
    carried = prod(result.element) * float(result.bound.sum())
    limit = f"\nμ P = {carried:.5g} {name_units(result)['force']}" if isfinite(carried) else ""
    return f"F = {force}{limit}"


def find_axes(ax: Any, columns: int = 1) -> Any:
    """Return the given axes, or new ones side by side on a new figure.

    Raises
    ------
    ImportError
        If matplotlib is not installed.
    """
    try:
        from matplotlib import pyplot as plt  # Optional, and slow to import.
    except ImportError as error:
        raise ImportError("plot() needs matplotlib: pip install 'toeplitz-mg[plot]'") from error
    if ax is None:
        width, height = plt.rcParams["figure.figsize"]
        size = (columns * width, height)
        _, ax = plt.subplots(1, columns, figsize=size, layout="compressed")
    return ax


def draw_section(stresses: Any, field: str, label: str, ax: Any) -> Any:
    """Draw a stress along x and over the depth, and return the axes (see `Stresses.plot`)."""
    ax = find_axes(ax)
    values, contact, x = getattr(stresses, field), stresses.contact, stresses.centres[0]
    if values.ndim > 2:  # Draw the section through the largest value.
        column = np.unravel_index(np.abs(values).argmax(), values.shape)[-1]
        values, contact = values[..., column], None if contact is None else contact[:, column]
        ax.set_title(f"y = {stresses.centres[1][column]:.3g} mm", fontsize="medium")
    k, i = np.unravel_index(np.abs(values).argmax(), values.shape)
    top, is_signed = float(abs(values[k, i])) or 1.0, values.min() < 0.0
    image = ax.pcolormesh(
        x, stresses.depths, values, shading="nearest", vmax=top, vmin=-top if is_signed else 0.0,
        cmap="RdBu_r" if is_signed else "YlOrRd",
    )  # fmt: skip
    label_axis(_add_bar(ax, image, SPACE).ax.yaxis, label, "N/mm²")
    if contact is not None and contact.any():
        h = float(x[1] - x[0])
        edges = (x[:, None] + h * np.array([-0.5, 0.5])).ravel()
        height = np.where(np.repeat(contact, 2), stresses.depths[0], np.nan)
        name = f"contact, {h * contact.sum():.4g} mm wide"
        ax.plot(edges, height, "k-", linewidth=5, solid_capstyle="butt", clip_on=False, label=name)
    place = f"x = {x[i]:.3g}, depth = {stresses.depths[k]:.3g} mm"
    largest = f"{values[k, i]:.4g} N/mm² at {place}"
    ax.plot(x[i], stresses.depths[k], "k+", markersize=11, clip_on=False, label=largest)
    ax.set_aspect("equal")
    label_axis(ax.xaxis, "x", "mm", size := float(np.abs(x).max()))
    label_axis(ax.yaxis, "depth", "mm", size)
    ax.invert_yaxis()
    ax.legend(loc="lower center", fontsize="x-small")
    return ax


def _draw_line(result: Any, field: str, ax: Any) -> None:
    """Plot a field over x."""
    x, values = result.x, getattr(result, field)
    if values.ndim > 1:  # Line contact with two components.
        values = np.hypot(*values)
    if result.stick is not None:
        values = np.where(result.contact, values, 0.0 if field == "traction" else np.nan)
    colour = "#000000" if result.stick is not None else "#D55E00"
    ax.plot(x, values, color=colour, linewidth=1.5, label=field)
    if field == "pressure":
        ax.fill_between(x, 0.0, values, color=colour, alpha=0.2, linewidth=0)
    if field == "traction":
        bound = np.where(np.isfinite(result.bound), result.bound, np.nan)
        ax.plot(x, bound, "k:", linewidth=1, label="traction bound")
        ax.plot(x, -bound, "k:", linewidth=1)
        edges = (x[:, None] + result.element[0] * np.array([-0.5, 0.5])).ravel()
        for name, area, shade in _areas(result):
            inside, height = np.repeat(area, 2), np.repeat(values, 2)
            ax.fill_between(
                edges, 0.0, height, where=inside, color=shade, alpha=0.6, linewidth=0, label=name
            )
        ax.legend(fontsize="small")
    ax.axhline(0.0, color="0.7", linewidth=0.8, zorder=0)
    _label_places(ax, x)
    finite = np.abs(values[np.isfinite(values)])
    label_axis(ax.yaxis, *_name(result, field), float(finite.max(initial=0.0)))


def _draw_surface(result: Any, field: str, ax: Any) -> None:
    """Draw a field in colours with a colour bar, and arrows if it is a vector field."""
    values = getattr(result, field)
    size = np.hypot(*values) if values.ndim > 2 else values
    shown = result.contact
    if result.stick is None and field != "pressure":  # Other fields extend beyond the contact.
        shown = ~result.contact if field == "gap" else np.ones_like(result.contact)
    if field == "plastic":
        shown = result.plastic > 0.0
    if field == "slip":  # Zero where the bodies stick.
        shown = result.sliding
    shown = shown & np.isfinite(size)  # The gap is infinite outside the material.
    top = _top(size[shown])
    shades = quantities(type(result))[field].shades.split()
    if len(shades) > 1:
        places = (SPACE, SPACE + 1.2 * BAR)
        for (name, area, shade), colours, place in zip(_areas(result), shades, places, strict=True):
            bar = _add_bar(ax, _show(result, ax, size, area, colours, top), place)
            ax.plot([], [], "s", color=shade, label=name)
            if place == SPACE:
                bar.set_ticks([])
        ax.legend(loc="upper right", fontsize="x-small", handlelength=1.0, borderpad=0.3)
    else:
        bar = _add_bar(ax, _show(result, ax, size, shown, shades[0], top), SPACE)
    label_axis(bar.ax.yaxis, *_name(result, field), top)
    if values.ndim > 2:
        _show_arrows(result, ax, values)
    _label_places(ax, result.x, result.y)


def _areas(result: Any) -> tuple[tuple[str, Array, str], tuple[str, Array, str]]:
    """Return the names, the elements and the colours of the areas of stick and slip."""
    return ("stick", result.stick, STICK), ("slip", result.sliding, SLIP)


def _name(result: Any, field: str) -> tuple[str, str]:
    """Return the label and the unit of a field."""
    unit, name = name_units(result)[field], quantities(type(result))[field].label or field
    return f"{name} over distance rolled" if unit == "1" else name, unit


def _top(values: Array) -> float:
    """Return the value of the darkest colour: the maximum, unless only few values are near it."""
    if not values.size or not values.max() > 0.0:
        return 1.0
    nearly, largest = float(np.quantile(values, NEARLY)), float(values.max())
    return nearly if 0.0 < PEAK * nearly < largest else largest


def _show(result: Any, ax: Any, size: Array, shown: Array, shades: str, top: float) -> Any:
    """Draw the values of some elements in shades from light to dark, and return the image."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    colours = ListedColormap(colormaps[shades](np.linspace(LIGHTEST, 1.0, 256)))
    h1, h2 = result.element
    extent = [result.x[0] - h1 / 2, result.x[-1] + h1 / 2]
    extent += [result.y[0] - h2 / 2, result.y[-1] + h2 / 2]
    masked = np.ma.masked_array(size, ~shown)
    return ax.imshow(masked.T, origin="lower", extent=extent, cmap=colours, vmin=0.0, vmax=top)


def _add_bar(ax: Any, image: Any, place: float) -> Any:
    """Add a colour bar as high as the axes, at a distance in inches to their right."""
    from matplotlib.transforms import ScaledTranslation, blended_transform_factory

    # In inches: a layout engine reads the width of decorations before it resizes the axes.
    inches = ax.figure.dpi_scale_trans + ScaledTranslation(1.0, 0.0, ax.transAxes)
    place_of_bar = blended_transform_factory(inches, ax.transAxes)
    inset = ax.inset_axes((place, 0.0, BAR, 1.0), transform=place_of_bar)
    largest = image.get_array().max()
    beyond = largest is not np.ma.masked and largest > image.norm.vmax
    return ax.figure.colorbar(image, cax=inset, extend="max" if beyond else "neither")


def _show_arrows(result: Any, ax: Any, vectors: Array) -> None:
    """Draw arrows along a vector field; the longest is as long as their spacing."""
    i, j = np.nonzero(result.contact)
    if not len(i):
        return
    first, last = (i.min(), j.min()), (i.max(), j.max())
    sides = [int(b - a) + 1 for a, b in zip(first, last, strict=True)]
    if len(i) < FILLED * sides[0] * sides[1]:
        return
    h1, h2 = result.element
    apart = (sides[0] * h1 * sides[1] * h2) ** 0.5 / ARROWS
    steps = [max(1, round(apart / h)) for h in (h1, h2)]
    rows, columns = (
        np.arange(a + (n - 1) % step // 2, b + 1, step)
        for a, b, n, step in zip(first, last, sides, steps, strict=True)
    )
    part = np.ix_(rows, columns)
    u, v = (x[part] for x in vectors)
    longest = float(np.hypot(u, v).max())
    if longest == 0.0:
        return
    shown = result.contact[part] & (np.hypot(u, v) > SHORTEST * longest)
    x, y = np.meshgrid(result.x[rows], result.y[columns], indexing="ij")
    ax.quiver(
        x[shown], y[shown], u[shown], v[shown], angles="xy", scale_units="xy", pivot="mid",
        scale=longest / (0.9 * apart), width=0.003, color="#000000",
    )  # fmt: skip


def _show_travel(ax: Any, height: float) -> None:
    """Show the direction of rolling, towards positive x, at this height of the axes."""
    arrow = {"arrowstyle": "-|>", "color": "#000000", "linewidth": 1.5}
    ends = {"xy": (0.19, height), "xytext": (0.02, height)}
    ax.annotate("", **ends, xycoords="axes fraction", arrowprops=arrow, annotation_clip=False)
    ax.text(0.02, height + 0.015, "rolling", transform=ax.transAxes, fontsize="small")
