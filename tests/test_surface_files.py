"""Surfaces, and profiles of wheels and rails, as instruments write them."""

import gzip
import struct
import sys
from contextlib import nullcontext
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.systems import refuses
from toeplitz_mg.contact import ContactWarning, Material, normal_contact, surfaces

pytestmark = pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")
RNG = np.random.default_rng(4)
HEIGHTS = RNG.random((6, 5))


def table(separator, encoding="utf-8"):
    rows = (separator.join(map(str, row)) for row in HEIGHTS.tolist())
    return "\r\n".join(rows).encode(encoding)


TABLES = {"a.csv": table(";", "utf-16"), "a.dat": table(" ")}
TABLES["a.txt.gz"] = gzip.compress(table(","))


@pytest.mark.parametrize("name", TABLES)
def test_tables_need_no_library(name, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    (tmp_path / name).write_bytes(TABLES[name])
    surface = surfaces.read(tmp_path / name, element=2.0, unit=("nm", "um"))
    assert_allclose(surface.heights, 1e-6 * HEIGHTS)
    assert_allclose(surface.element, (2e-3, 2e-3))
    assert surfaces.read(tmp_path / name).element is None


@pytest.mark.parametrize("across", [460.0, 100.0])
def test_yaw_twists_what_is_no_sphere(across):
    y = np.linspace(-30.0, 30.0, 121)
    pair = {
        "wheel": np.c_[y, y**2 / (2 * across)],
        "rail": np.c_[y, -(y**2) / 600],
        "radius": 460.0,
    }
    gaps = [surfaces.wheel_rail((21, 21), (0.5, 0.5), **pair, yaw=k).gap for k in (0.02, 0.0)]
    x, y = surfaces.centres((21, 21), (0.5, 0.5))
    assert_allclose(gaps[0] - gaps[1], 0.02 * (1 / 460 - 1 / across) * x * y, atol=1e-5)


@pytest.mark.parametrize(
    ("comment", "scale"),
    [("heights in um", 1e-3), ("units: nm", 1e-6), ("z [µm]", 1e-3), ("x in mm, z in um", None)],
)
def test_a_comment_says_the_unit_of_heights_or_is_doubted(comment, scale, tmp_path):
    (path := tmp_path / "a.txt").write_text(f"# {comment}\n1 2 3 4\n5 6 7 8\n", "utf-8")
    with nullcontext() if scale else pytest.warns(ContactWarning, match=f"comment '# {comment}'"):
        assert surfaces.read(path, element=0.1).heights[1, 3] == 8.0 * (scale or 1.0)


def test_only_heights_are_read_from_arrays(tmp_path):
    # The first two have 2 n² bytes, as files of the shuttle's radar, which have no other mark.
    for name, shape in (("a.npy", (0, 4)), ("a.xyz", (3, 3)), ("b.npy", (2, 3, 4)), ("c.npy", ())):
        np.save(tmp_path / "a.npy", np.zeros(shape))
        (tmp_path / "a.npy").rename(tmp_path / name)
        refuses(ValueError, name, surfaces.read, tmp_path / name, element=1.0, unit="mm")


@pytest.mark.parametrize(("level", "degree"), [("mean", 0), ("plane", 1), ("quadratic", 2)])
@pytest.mark.parametrize("shape", [(40, 30), (50,)])
def test_level_removes_a_polynomial_from_what_is_there(level, degree, shape, tmp_path):
    axes = surfaces.centres(shape, (0.1,) * len(shape))
    x, y = axes[0], axes[-1]
    form = 7.0 + (degree > 0) * (0.2 * x - 0.1 * y) + (degree > 1) * (0.3 * x**2 + 0.2 * x * y)
    form[3:9] = np.nan
    np.save(tmp_path / "a.npy", form)
    read = surfaces.read(tmp_path / "a.npy", level=level).heights
    assert_array_equal(np.isnan(read), np.isnan(form))
    assert_allclose(read[~np.isnan(read)], 0.0, atol=1e-13)


def metro_pro(path, raw, pixel):
    """Write a file of Zygo's MetroPro: a header of 834 bytes, then integers, by columns."""
    header = bytearray(834)
    struct.pack_into(">4sHI", header, 0, b"\x88\x1b\x03\x6f", 1, 834)
    struct.pack_into(">HHI", header, 68, *raw.shape, 4 * raw.size)
    struct.pack_into(">ff", header, 164, 0.5, 633e-9)  # Scale, wavelength, then obliquity.
    struct.pack_into(">f", header, 176, 1.0)
    struct.pack_into(">f", header, 184, pixel)
    struct.pack_into(">h", header, 218, 1)
    path.write_bytes(bytes(header) + raw.T.astype(">i4").tobytes())


def test_a_binary_dat_of_an_interferometer(tmp_path):
    pytest.importorskip("SurfaceTopography")
    raw = RNG.integers(-9000, 9000, (24, 16))
    raw[2, 3] = 2147483640  # What the instrument did not see.
    metro_pro(tmp_path / "lens.dat", raw, pixel=2e-6)
    surface = surfaces.read(tmp_path / "lens.dat")
    assert_allclose(surface.element, (2e-3, 2e-3), rtol=1e-6)
    assert surface.heights.shape == raw.shape
    assert np.flatnonzero(np.isnan(surface.heights)).tolist() == [2 * 16 + 3]
    there = raw < 2147483640
    scale = 1e3 * 0.5 * 633e-9 / 32768
    assert_allclose(surface.heights[there], scale * raw[there], rtol=1e-6)
    load = {"material": Material(E=70e3, nu=0.3), "pressure": 5.0, "periodic": True}
    pressed = normal_contact(heights=surface, **load)
    assert_allclose(pressed.pressure.mean(), 5.0)
    assert not pressed.pressure[2, 3]


def test_what_is_no_table_of_heights_is_offered_to_the_library(tmp_path):
    library = pytest.importorskip("SurfaceTopography")
    x, y = np.meshgrid(2.0 * np.arange(6), 3.0 * np.arange(5), indexing="ij")
    points = "\n".join(f"{a} {b} {c}" for a, b, c in zip(x.flat, y.flat, HEIGHTS.flat, strict=True))
    for name, data in (("a.txt", points.encode()), ("a.xyz.gz", gzip.compress(points.encode()))):
        (tmp_path / name).write_bytes(data)
        surface = surfaces.read(tmp_path / name, unit="um")
        assert_allclose(surface.heights, 1e-3 * HEIGHTS)
        assert_allclose(surface.element, (2e-3, 3e-3))
    at = np.sort(100.0 * RNG.random(200))
    np.savetxt(tmp_path / "stylus.txt", np.c_[at, 3.0 * at])
    read = partial(surfaces.read, tmp_path / "stylus.txt", unit="um")
    for given, said in (({}, "give element="), ({"element": 200.0}, "less than the length")):
        refuses(ValueError, said, read, **given)
    evenly = read(element=0.5)
    assert_allclose(np.diff(evenly.heights), 1.5e-3)
    assert_allclose(evenly.element, 5e-4)
    container = pytest.importorskip("SurfaceTopography.Container.SurfaceContainer")
    two = [library.Topography(k * HEIGHTS, (12.0, 15.0), unit="nm") for k in (1, 2)]
    container.InMemorySurfaceContainer(two).to_zip(str(tmp_path / "two.zip"))
    for channel in (1, "1"):
        read = surfaces.read(tmp_path / "two.zip", channel=channel)
        assert_allclose(read.heights, 2e-6 * HEIGHTS)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"level": "cubic"}, "level is 'cubic', but must be one of mean, plane, quadratic"),
        ({"channel": 1}, "channel is 1, but .* contains heights only"),
        ({"unit": "yard"}, "unit is 'yard'"),
        ({"element": -1.0}, "element is -1.0, but its sizes must be positive"),
    ],
)
def test_what_cannot_be_meant_of_a_file_is_refused(given, message, tmp_path):
    (tmp_path / "a.txt").write_bytes(table(" "))
    refuses(ValueError, message, surfaces.read, tmp_path / "a.txt", **given)
    surface = surfaces.read(tmp_path / "a.txt", element=1.0)
    for wrong in ({"element": 2.0}, {"unit": "um"}):
        with pytest.raises(ValueError, match=r"heights has its own, .*mm: leave it out"):
            normal_contact(heights=surface, material=Material(E=1.0, nu=0.3), force=1.0, **wrong)


# Wheel and rail ---------------------------------------------------------------------------------

Y = np.linspace(-35.0, 30.0, 131)
TREAD = np.c_[Y, np.where(Y < -30.0, -0.3 * (Y + 30.0) ** 2, 0.0) + Y / 40.0 + Y**2 / 1000.0]
HEAD = np.c_[Y, -(Y**2) / 600.0][Y > -28.0]  # The flange is beside it.


@pytest.mark.parametrize(("lateral", "roll"), [(0.0, 0.0), (2.0, 0.0), (-1.5, 0.02)])
def test_paraboloids_touch_with_their_curvatures(lateral, roll):
    grid, bodies = ((20, 30), (0.2, 0.1)), {"wheel": TREAD[Y > -29.0], "rail": HEAD}
    found = surfaces.wheel_rail(*grid, **bodies, radius=460.0, lateral=lateral, roll=roll)
    # z = y/40 + y²/1000, turned and shifted, less -y²/600 is least where the slopes are alike.
    slope = -found.point[0] / 300.0
    own = 1.0 / 40.0 + (found.point[0] - lateral) / 500.0 + roll
    assert_allclose(own, slope, atol=2e-4 if roll else 1e-9)
    assert_allclose(found.angle, np.arctan(slope), atol=1e-9)
    at = found.point[0] - lateral
    assert_allclose(found.radius, 460.0 - at / 40.0 - at**2 / 1000.0, atol=1e-2 if roll else 1e-9)
    x, y = surfaces.centres(*grid)
    tilt = np.cos(found.angle - roll)
    expected = tilt * x**2 / (2.0 * found.radius) + 0.5 * (1 / 500.0 + 1 / 300.0) * y**2
    assert_allclose(found.gap, expected, atol=2e-5)


SIMPACK = "spline.begin\n units.len = 'm'\n point.begin\n{}\n point.end\nspline.end\n"
MINIPROF = "ProgramName=MiniProf\nColumnDef=X,Y,A,C,N,K\nXYPoints=131\n\n{}\n"


def write(path, points):
    """Write a profile: SIMPACK's has z downwards, in metres, MiniProf's the flange at the right."""
    if path.suffix in (".prr", ".prw"):
        rows = "\n".join(f"{1e-3 * y:.12g} {-1e-3 * z:.12g}" for y, z in points)
        path.write_text(SIMPACK.format(rows))
    else:
        side = -1.0 if path.suffix == ".whl" else 1.0
        rows = "\n".join(f"{side * y:.12g}\t{z:.12g}\t0.1\t0\t1\t2" for y, z in points)
        path.write_text(MINIPROF.format(rows))
    return path


@pytest.mark.parametrize("endings", [("prw", "prr"), ("whl", "ban")])
def test_profiles_are_read_in_their_conventions(endings, tmp_path):
    solve = partial(surfaces.wheel_rail, (16, 24), (0.5, 0.5), radius=460.0, lateral=1.0)
    expected = solve(wheel=TREAD, rail=HEAD)
    wheel, rail = (tmp_path / f"a.{ending}" for ending in endings)
    found = solve(wheel=write(wheel, TREAD), rail=write(rail, HEAD))
    assert_allclose(found.gap, expected.gap, atol=1e-8)
    assert_allclose(found.point, expected.point, atol=1e-6)


def test_noise_is_smoothed_and_what_ends_has_no_material():
    rng = np.random.default_rng(1)
    tread = TREAD[Y > -29.0]
    noisy = tread + [0.0, 1.0] * rng.normal(0.0, 2e-3, tread.shape)
    solve = partial(surfaces.wheel_rail, (8, 90), (0.5, 1.0), rail=HEAD, radius=460.0)
    exact, found = solve(wheel=tread), solve(wheel=noisy, smoothing=10.0)
    there = np.isfinite(exact.gap) & np.isfinite(found.gap)
    assert not there.all()
    assert_allclose(found.point, exact.point, atol=0.5)
    assert np.sqrt(np.mean((found.gap[there] - exact.gap[there]) ** 2)) < 0.012


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lateral": 80.0}, "have no y in common"),
        ({"roll": 0.3}, "touch where a profile ends"),
        ({"wheel": TREAD[:3]}, "has only 3 points"),
        ({"wheel": TREAD[:, :1]}, r"wheel has shape \(131, 1\), but must be"),
        ({"smoothing": -1.0}, "smoothing is -1.0"),
        ({"radius": 1.0}, "beyond the wheel"),
    ],
)
def test_what_is_no_wheel_on_a_rail_is_refused(change, message):
    given = {"wheel": TREAD, "rail": HEAD, "radius": 460.0} | change
    refuses(ValueError, message, surfaces.wheel_rail, (20, 20), (0.5, 0.5), **given)
