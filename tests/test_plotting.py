"""Pictures of contacts: what is in colours, what is left white, and what they are labelled."""

import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.systems import refuses
from tests.test_result import (
    ALL,
    BOTH,
    PRESSED,
    PRESSED_LINE,
    ROLLED,
    ROLLED_LINE,
    SHIFTED,
    SHIFTED_LINE,
    press,
)
from toeplitz_mg.contact import friction, normal_contact, subsurface_stresses, surfaces

figure_module = pytest.importorskip("matplotlib.figure")

FIELDS = {"NormalResult": ("pressure", "gap", "displacement")}
FIELDS["TangentialResult"] = ("traction", "slip", "displacement")
CASES = [
    pytest.param(result, field, id=f"{k} {field}")
    for k, result in enumerate(ALL)
    for field in FIELDS[type(result).__name__]
]


def axes_of(count=1):
    figure = figure_module.Figure(figsize=(5.0 * count, 4.0), layout="constrained")
    return figure.subplots(1, count, squeeze=False)[0]


def draw(result, field=None):
    (ax,) = axes_of()
    assert result.plot(field, ax=ax) is ax
    return ax


def render(ax):
    ax.figure.draw_without_rendering()


def labels(ax):
    """The labels of the bars of colours, and of the axes."""
    bars = [bar.get_ylabel() for bar in ax.child_axes]
    return [text for text in (*bars, ax.get_xlabel(), ax.get_ylabel()) if text]


@pytest.mark.parametrize(("result", "field"), CASES)
def test_every_field_is_drawn_with_its_unit(result, field):
    ax = draw(result, field)
    render(ax)
    (label,) = (text for text in labels(ax) if field in text)
    if field in ("pressure", "traction"):
        assert label == f"{field} [N/mm²]"
    elif field == "slip" and result.creepages is not None:
        assert label == "slip over distance rolled [–]"
    else:
        assert label.endswith(("[mm]", "[µm]"))
    assert "x [mm]" in labels(ax)
    assert ax.get_title().startswith("P = " if result.stick is None else "F = ")
    assert ("μ P = " in ax.get_title()) == (result.stick is not None)


def test_what_is_zero_is_white_and_low_values_are_light():
    ax = draw(PRESSED)
    (image,) = ax.get_images()
    shown = image.get_array().T
    assert np.array_equal(~np.ma.getmaskarray(shown), PRESSED.contact)
    assert np.array_equal(shown[PRESSED.contact], PRESSED.pressure[PRESSED.contact])
    assert image.norm.vmin == 0.0
    brightness = image.cmap([0.0, 0.5, 1.0])[:, :3] @ [0.299, 0.587, 0.114]
    assert brightness[0] > 0.8
    assert brightness[0] > brightness[1] > brightness[2]
    assert brightness[0] < 0.95  # White is for what does not touch.


def test_small_lengths_are_numbered_in_smaller_units():
    for unit, count in (("µm", 1e3), ("nm", 1e6)):
        (bar,) = draw(replace(PRESSED, gap=PRESSED.gap / count), "gap").child_axes
        assert bar.get_ylabel() == f"gap [{unit}]"
        assert bar.yaxis.get_major_formatter()(-3.0 / count) == "−3"


@pytest.mark.parametrize("missing", [0, 5])
def test_the_gap_is_white_where_there_is_none_and_slip_where_the_bodies_stick(missing):
    """The gap also where there is no material."""
    gap = PRESSED.gap.copy()
    gap[:missing] = np.inf
    for result, field, white in (
        (replace(PRESSED, gap=gap), "gap", PRESSED.contact | np.isinf(gap)),
        (SHIFTED, "slip", ~SHIFTED.sliding),
        (ROLLED, "slip", ~ROLLED.sliding),
    ):
        (image,) = draw(result, field).get_images()
        assert np.array_equal(np.ma.getmaskarray(image.get_array().T), white)
        assert np.isfinite(image.norm.vmax)


@pytest.mark.parametrize("result", [SHIFTED, ROLLED])
def test_stick_and_slip_have_two_colours_and_a_legend(result):
    ax = draw(result)
    stick, slip = (~np.ma.getmaskarray(image.get_array().T) for image in ax.get_images())
    assert np.array_equal(stick, result.stick)
    assert np.array_equal(slip, result.sliding)
    first, second = (image.cmap(0.7)[:3] for image in ax.get_images())
    assert first[2] - first[0] > 0.4  # Blue
    assert second[0] - second[2] > 0.4  # Orange
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["stick", "slip"]


@pytest.mark.parametrize("result", [SHIFTED_LINE, ROLLED_LINE])
def test_in_line_contact_too(result):
    names = [text.get_text() for text in draw(result).get_legend().get_texts()]
    assert names == ["traction", "traction bound", "stick", "slip"]


@pytest.mark.parametrize("result", [SHIFTED, ROLLED])
@pytest.mark.parametrize("field", ["traction", "slip", "displacement"])
def test_arrows_point_along_the_field(result, field):
    from matplotlib.quiver import Quiver

    (arrows,) = (x for x in draw(result, field).collections if isinstance(x, Quiver))
    assert 10 <= len(arrows.U) <= 400
    values = getattr(result, field)
    for x, y, u, v in zip(arrows.X, arrows.Y, arrows.U, arrows.V, strict=True):
        place = (..., np.argmin(abs(result.x - x)), np.argmin(abs(result.y - y)))
        assert result.contact[place]
        assert_allclose([u, v], values[place])
    # The longest is as long as arrows are apart: they do not cross each other.
    longest = np.hypot(arrows.U, arrows.V).max() / arrows.scale
    assert longest < min(np.diff(np.unique(axis)).min() for axis in (arrows.X, arrows.Y)) * 1.5


@pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")
def test_nothing_is_outlined_nor_has_arrows_in_spots():
    """A line around spots of a few elements would be all that is seen of them."""
    contact = np.random.default_rng(0).random((48, 32)) < 0.1
    bodies = {"element": PRESSED.element, "material": PRESSED.material, "shift": (0.1, 0.0)}
    spots = friction(bound=np.where(contact, 1.0, 0.0), **bodies)
    gap = np.where(contact, 0.0, np.inf)
    pressed = normal_contact(gap, PRESSED.element, material=PRESSED.material, force=0.1)
    for result in (spots, pressed):
        assert not draw(result).collections


@pytest.mark.parametrize("result", [ROLLED, ROLLED_LINE])
def test_rolling_shows_the_direction_of_travel(result):
    ax = draw(result)
    arrow, name = ax.texts
    assert name.get_text() == "rolling"
    assert arrow.xy[0] > arrow.get_position()[0]
    assert not draw(SHIFTED).texts


@pytest.mark.parametrize("result", [PRESSED, SHIFTED, ROLLED])
def test_bars_of_colours_are_as_high_as_the_axes(result):
    axes = axes_of(2)
    for ax in axes:  # Several results on one figure.
        assert result.plot(ax) is ax
    axes[0].figure.draw_without_rendering()
    for ax in axes:
        box = ax.get_window_extent()
        for bar in ax.child_axes:
            own = bar.get_window_extent()
            assert_allclose([own.y0, own.y1], [box.y0, box.y1], atol=0.5)
            assert box.x1 < own.x0 < own.x1 <= ax.figure.bbox.x1


@pytest.mark.parametrize(
    ("result", "size"),
    [
        *((ROLLED, size) for size in ((5.0, 4.0), (10.5, 4.2), (8.0, 2.5), (4.5, 7.0))),
        *((result, (8.0, 2.5)) for result in (PRESSED, SHIFTED)),
    ],
)
def test_no_label_is_cut_off_or_covers_another(result, size):
    figure = figure_module.Figure(figsize=size, layout="compressed")
    axes = figure.subplots(1, 1 if size[0] < 8.0 else 2, squeeze=False)[0]
    for ax in axes:
        result.plot(ax=ax)
    figure.draw_without_rendering()
    boxes = [ax.get_tightbbox() for ax in axes]
    for box in boxes:
        assert box.x0 >= 0.0
        assert box.y0 >= 0.0
        assert box.x1 <= figure.bbox.x1
        assert box.y1 <= figure.bbox.y1
    assert all(a.x1 < b.x0 for a, b in pairwise(boxes))


def test_a_few_peaks_do_not_decide_the_colours():
    pressure = PRESSED.pressure.copy()
    pressure[24, 16] *= 100.0
    area, work = np.prod(PRESSED.element), 0.5 * pressure * PRESSED.displacement
    sums = {"force": area * pressure.sum(), "energy": area * work.sum()}
    ax = draw(replace(PRESSED, pressure=pressure, max_pressure=pressure.max(), **sums))
    assert ax.get_images()[0].norm.vmax < 2.0 * PRESSED.max_pressure
    (bar,) = ax.child_axes
    assert bar._colorbar.extend == "max"
    assert draw(PRESSED).get_images()[0].norm.vmax == PRESSED.max_pressure


@pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")
def test_nothing_in_contact_is_drawn_too():
    apart = press(0.0)
    for field in FIELDS["NormalResult"]:
        render(draw(apart, field))
    bound = np.zeros((48, 32))
    bound[20:24, 10:20] = 1.0
    bodies = {"element": PRESSED.element, "material": PRESSED.material}
    render(draw(friction(bound=bound, **bodies, shift=(0.0, 0.0))))


def test_contact_with_friction_is_the_pictures_of_both_beside_each_other():
    axes = axes_of(2)
    assert BOTH.plot(axes) == tuple(axes)
    for ax, part in zip(axes, (BOTH.normal, BOTH.tangential), strict=True):
        expected = draw(part)
        assert labels(ax) == labels(expected)
        for image, other in zip(ax.get_images(), expected.get_images(), strict=True):
            assert np.ma.allequal(image.get_array(), other.get_array())


DEPTHS = np.array([0.0, 0.02, 0.05, 0.1])


@pytest.mark.parametrize(
    ("field", "label"), [("von_mises", "von Mises"), ("max_shear", "largest shear"), ("xz", "xz")]
)
@pytest.mark.parametrize("result", [PRESSED, PRESSED_LINE])
def test_stresses_are_drawn_where_they_are_the_largest(result, field, label):
    stresses = subsurface_stresses(result, depths=DEPTHS)
    (ax,) = axes_of()
    assert stresses.plot(field, ax=ax) is ax
    ax.figure.draw_without_rendering()
    (image,) = ax.collections
    values = getattr(stresses, field)
    assert image.get_array().shape == (len(DEPTHS), len(result.x))
    assert np.abs(image.get_array()).max() == image.norm.vmax == np.abs(values).max()
    assert image.norm.vmin == (-image.norm.vmax if field == "xz" else 0.0)
    assert ax.yaxis_inverted()
    assert ax.get_aspect() == 1.0
    contact, largest = (line.get_xydata() for line in ax.lines)
    width = result.contact.reshape(len(result.x), -1).any(axis=1).sum() * result.element[0]
    assert width / 2 < np.ptp(contact[np.isfinite(contact[:, 1]), 0]) < 1.001 * width
    at = np.unravel_index(np.abs(values).argmax(), values.shape)
    assert_allclose(largest, [[result.x[at[1]], DEPTHS[at[0]]]])
    assert sorted(labels(ax)) == sorted([f"{label} [N/mm²]", "x [mm]", "depth [mm]"])


def test_another_field_and_depths_without_order_are_refused():
    with pytest.raises(ValueError, match="must be two or more"):
        subsurface_stresses(PRESSED_LINE, depths=0.1).plot()
    stresses = subsurface_stresses(PRESSED_LINE, depths=DEPTHS)
    with pytest.raises(ValueError, match="field is 'zx', but must be one of von_mises, max_shear"):
        stresses.plot("zx")
    for result, field in ((PRESSED, "slip"), (SHIFTED, "gap"), (ROLLED, "x")):
        refuses(ValueError, f"field is '{field}', but must be one of ", result.plot, field)


@pytest.mark.filterwarnings("ignore:.*non-interactive")
def test_by_default_it_is_a_new_figure():
    import matplotlib
    from matplotlib import pyplot

    pyplot.close("all")  # What other tests have left; the oldest matplotlib warns of it.
    matplotlib.use("Agg")
    ax = ROLLED.plot()
    assert ax.figure.number in pyplot.get_fignums()
    pyplot.close("all")


def test_without_matplotlib_it_is_said_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    refuses(ImportError, r"pip install 'toeplitz-mg\[plot\]'", PRESSED.plot)


@pytest.mark.parametrize("hardness", [0.3, 1e3])
def test_what_yields_is_drawn_where_there_is_a_hardness(hardness):
    gap = surfaces.sphere((24, 24), (0.1, 0.1), radius=1.0)
    soft = normal_contact(gap, (0.1, 0.1), material=PRESSED.material, force=0.3, hardness=hardness)
    assert (hardness == 0.3) == soft.plastic.any()
    assert any("plastic [" in label for label in labels(draw(soft, "plastic")))
    line = normal_contact(gap[:, 12], 0.1, material=PRESSED.material, force=0.5, hardness=hardness)
    assert any("plastic [" in label for label in labels(draw(line, "plastic")))
    refuses(ValueError, "field is 'plastic', but must be one of pressure", PRESSED.plot, "plastic")
