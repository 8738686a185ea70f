"""The command contact: what it prints, writes and refuses."""

import io
import json
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.command_line import assert_refused, main
from toeplitz_mg.contact import (
    Material,
    friction,
    frictional_contact,
    frictional_rolling,
    normal_contact,
    rolling,
    surfaces,
)

pytestmark = pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")

STEEL = Material.from_shear(82000.0, 0.28)


def round_gap(shape, element):
    """The gap of a sphere, or of a cylinder where the grid has one axis."""
    make = surfaces.sphere if len(shape) == 2 else surfaces.cylinder
    return make(shape, element, radius=10.0)


def read(path):
    with np.load(path) as file:
        return dict(file)


def run(*options):
    return main(["contact", *options])


def figures(printed):
    """The lines of the last table, by their names."""
    lines = printed[printed.index("this run") :].splitlines()[1:]
    return {line[:26].strip(): [float(x) for x in line[26:].split()] for line in lines if line[26:]}


# What it does ---------------------------------------------------------------------------------


def test_hertz_is_that_of_theory(capsys):
    assert run("hertz") == 0
    printed = capsys.readouterr().out
    assert "sphere of 10 mm, 256 x 256 elements" in printed
    found = figures(printed)
    for name in ("force [N]", "approach [mm]", "largest pressure [N/mm²]"):
        ours, theory = found[name]
        assert_allclose(ours, theory, rtol=1e-4)
    violations = [
        float(line.split()[1]) for line in printed.splitlines() if line[:10].strip().isdigit()
    ]
    assert violations == sorted(violations, reverse=True)
    assert violations[-1] <= 1e-8


@pytest.mark.parametrize(
    ("options", "name", "rtol"),
    [
        (["hertz", "--radius", "10", "40", "--approach", "0.003"], "force [N]", 1e-3),
        (["hertz", "--radius", "7", "3"], "approach [mm]", 1e-3),
        (["hertz", "--line"], "largest pressure [N/mm²]", 1e-3),
        (["shift", "--nu", "0"], "share that sticks", 0.02),
        (["shift", "--line", "--tangential", "-20"], "share that sticks", 0.05),
        (["shift", "--shift", "1e-4", "2e-4"], "share that sticks", 0.05),
        (["rolling", "--line", "--longitudinal", "0.001"], "force / (mu P)", 0.02),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_options(options, name, rtol, capsys):
    assert run(*options, "-n", "80") == 0
    ours, theory = figures(capsys.readouterr().out)[name]
    assert_allclose(ours, theory, rtol=rtol)


def test_rolling_with_all_creepages(capsys):
    """A negative number may have an exponent."""
    creepages = ["--longitudinal", "-1e-3", "--lateral", "0.0005", "--spin", "2E-3"]
    assert run("rolling", "-n", "40", *creepages) == 0
    found = figures(capsys.readouterr().out)
    assert found["creepages [1, 1, 1/mm]"] == [-1e-3, 5e-4, 2e-3]
    Fx, Fy = found["tangential force [N]"]
    assert Fx > 0.0 > Fy


def test_what_is_zero_to_the_tolerance_is_printed_as_zero(capsys):
    """By symmetry there is no force across: what the solver leaves of one says nothing."""
    assert run("rolling", "-n", "32", "--longitudinal=-2e-3") == 0
    _, across = figures(capsys.readouterr().out)["tangential force [N]"]
    assert across == 0.0


@pytest.mark.parametrize("is_line", [True, False])
def test_writes_the_fields(is_line, tmp_path, capsys):
    line = ["--line"] if is_line else []
    path, picture = tmp_path / "x.npz", tmp_path / "x.png"
    command = ["shift", "-n", "40", *line, "--force", "50", "-o", str(path), "--plot", str(picture)]
    assert run(*command) == 0
    assert f"written to {path}\ndrawn in {picture}\n" in capsys.readouterr().out
    assert sorted(p.name for p in tmp_path.iterdir()) == ["x.npz", "x.png"]
    assert picture.read_bytes().startswith(b"\x89PNG")
    fields = read(path)
    shape, element = fields["contact"].shape, tuple(fields["element"])
    assert shape == ((40,) if is_line else (40, 40))
    pressed = normal_contact(round_gap(shape, element), element, material=STEEL, force=50.0)
    assert_allclose(fields["pressure"], pressed.traction)
    assert_allclose(fields["approach"], pressed.rigid)
    force = 7.5 if is_line else (7.5, 0.0)
    shifted = friction(bound=0.3 * pressed.traction, element=element, material=STEEL, force=force)
    assert_allclose(fields["traction"], shifted.traction)
    assert np.array_equal(fields["stick"], shifted.stick)
    assert_allclose(fields["tangential_force"], force, atol=1e-9)
    assert_allclose(fields["x"], surfaces.centres(shape, element)[0])


def test_rolling_by_force_and_moment(capsys):
    loads = ["--tangential", "10", "5", "--moment", "0.3"]
    assert run("rolling", "-n", "32", "--radius", "10", *loads) == 0
    found = figures(capsys.readouterr().out)
    assert_allclose(found["tangential force [N]"], [10.0, 5.0], rtol=1e-5)
    assert len(found["creepages [1, 1, 1/mm]"]) == 3
    assert_allclose(found["moment [N mm]"], [0.3], rtol=1e-5)
    assert found["power over speed [N]"][0] > 0.0
    assert run("rolling", "-n", "32", "--line", "--tangential", "10") == 0
    found = figures(capsys.readouterr().out)
    # Carter's theory has the same force and stick for the creepage that was found.
    ours, theory = found["force / (mu P)"]
    assert_allclose(ours, theory, rtol=0.03)


def test_rolling_writes_its_fields(tmp_path):
    path = tmp_path / "x.npz"
    assert run("rolling", "-n", "30", "--mu", "0.2", "--output", str(path)) == 0
    fields = read(path)
    rolled = rolling(
        bound=0.2 * fields["pressure"],
        element=tuple(fields["element"]),
        material=STEEL,
        longitudinal=-0.002,
    )
    assert_allclose(fields["traction"], rolled.traction)
    assert_allclose(fields["rigid"], [-0.002, 0.0, 0.0])
    assert_allclose(fields["power"], rolled.power)
    assert_allclose(fields["moment"], rolled.moment, atol=1e-6)


@pytest.mark.parametrize("options", [["--tangential", "20"], ["--line", "--shift", "1e-4"]])
def test_infinite_friction_bonds(options, tmp_path, capsys):
    path = tmp_path / "x.npz"
    assert run("shift", "-n", "40", "--friction", "inf", *options, "-o", str(path)) == 0
    printed, _ = capsys.readouterr().out.split("written to")
    assert figures(printed)["share that sticks"] == [1.0, 1.0]
    fields = read(path)
    assert np.array_equal(fields["stick"], fields["contact"])
    assert np.array_equal(fields["bound"], np.where(fields["contact"], np.inf, 0.0))


def test_youngs_modulus_is_that_of_the_shear_modulus(capsys):
    assert run("hertz", "-n", "16", "--E", "2e5", "--nu", "0.25") == 0
    of_E = figures(capsys.readouterr().out)
    for same in (["--G", "8e4"], ["--E", "2e5", "--nu2", "0.25"]):  # The second is as the first.
        assert run("hertz", "-n", "1.6e1", "--nu", "0.25", *same) == 0
        assert figures(capsys.readouterr().out) == of_E
    assert_refused(run("hertz", "--E", "1", "--G", "1"), "--E and --G are both given", capsys)


# Two materials ---------------------------------------------------------------------------------

SOFT = Material(E=3000.0, nu=0.4)
SECOND = ["--E2", "3000", "--nu2", "0.4"]


@pytest.mark.parametrize(
    ("options", "second"),
    [
        (SECOND, SOFT),
        (["--G2", "3000", "--nu2", "0.4"], Material.from_shear(3000.0, 0.4)),
        (["--E2", "3000"], Material(E=3000.0, nu=0.28)),
        (["--nu2", "0.1"], Material.from_shear(82000.0, 0.1)),
        (["--E2", "inf"], Material.rigid()),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_the_second_body_is_that_of_the_python_interface(options, second, tmp_path):
    path = tmp_path / "x.npz"
    assert run("hertz", "-n", "16", *options, "-o", str(path)) == 0
    fields = read(path)
    gap = round_gap((16, 16), fields["element"])
    pressed = normal_contact(gap, fields["element"], material=(STEEL, second), force=100.0)
    assert_allclose(fields["approach"], pressed.approach, rtol=1e-6)


@pytest.mark.parametrize("load", [[], ["--shift", "1e-4"], ["--tangential", "1", "2"]])
def test_unlike_bodies_are_shifted_with_what_they_do_to_each_other(load, tmp_path, capsys):
    path = tmp_path / "x.npz"
    assert run("shift", "-n", "16", *SECOND, *load, "-o", str(path)) == 0
    assert "neglected" not in capsys.readouterr().out
    fields = read(path)
    moved = {"tangential_force": (15.0, 0.0)}
    if load:
        values = tuple(map(float, [*load[1:], "0"][:2]))
        moved = {"shift" if load[0] == "--shift" else "tangential_force": values}
    gap = round_gap((16, 16), fields["element"])
    expected = frictional_contact(
        gap, fields["element"], material=(STEEL, SOFT), mu=0.3, force=100.0, tolerance=1e-8, **moved
    )
    largest = expected.normal.max_pressure
    assert_allclose(fields["pressure"], expected.normal.pressure, atol=1e-6 * largest)
    assert_allclose(fields["traction"], expected.tangential.traction, atol=1e-6 * largest)


@pytest.mark.parametrize("line", [[], ["--line"]])
def test_unlike_bodies_roll_with_what_they_do_to_each_other(line, tmp_path, capsys):
    """Free of a tangential force they creep."""
    path = tmp_path / "x.npz"
    assert run("rolling", "-n", "16", *SECOND, "--tangential", "0", *line, "-o", str(path)) == 0
    printed = capsys.readouterr().out.partition("written to")[0]
    assert figures(printed)["force / (mu P)"] == [0.0]
    fields = read(path)
    gap, none = round_gap(fields["contact"].shape, fields["element"]), 0.0 if line else (0.0, 0.0)
    given = {"element": fields["element"], "material": (STEEL, SOFT), "mu": 0.3, "force": 100.0}
    expected = frictional_rolling(gap, **given, tangential_force=none, tolerance=1e-8)
    assert_allclose(fields["rigid"], expected.tangential.rigid, rtol=1e-5, atol=1e-10)
    assert np.abs(fields["rigid"]).max() > 1e-4


# A measured surface -----------------------------------------------------------------------------


def surface(tmp_path, n=40):
    """A file of heights, µm, on pixels of 25 µm; and the gap and the element, mm."""
    element = (0.025, 0.025)
    gap = surfaces.rough((n, n), element, rms=0.001, roll_off=0.3, seed=2)
    path = tmp_path / "heights.npy"
    np.save(path, -1e3 * gap)
    return path, gap, element


@pytest.mark.parametrize(
    "load", [{"force": 2.0}, {"approach": 0.002}, {"force": 2.0, "hardness": 400.0}]
)
@pytest.mark.parametrize("is_periodic", [True, False])
def test_a_surface_from_a_file_is_pressed(load, is_periodic, tmp_path, capsys):
    path, gap, element = surface(tmp_path)
    written = tmp_path / "fields.npz"
    options = ["--unit", "um", "--element", "25", *["--periodic"] * is_periodic]
    options += [word for name, value in load.items() for word in (f"--{name}", str(value))]
    assert run("rough", str(path), *options, "-o", str(written)) == 0
    printed = capsys.readouterr().out
    assert f"rough: {path}" in printed
    assert "stiffness" in printed
    expected = normal_contact(gap, element, material=STEEL, periodic=is_periodic, **load)
    fields = read(written)
    assert_allclose(fields["pressure"], expected.pressure, atol=1e-6 * expected.max_pressure)
    assert_allclose(fields["x"], surfaces.centres(gap.shape, element)[0])
    assert_allclose(fields["approach"], expected.approach, rtol=1e-6)
    assert "hardness" not in load or fields["pressure"].max() == load["hardness"]


def test_a_surface_of_the_library_is_pressed(tmp_path, capsys):
    pytest.importorskip("SurfaceTopography")
    _, gap, element = surface(tmp_path)
    x, y = np.meshgrid(*(25.0 * np.arange(n) for n in gap.shape), indexing="ij")
    path = tmp_path / "heights.xyz"
    np.savetxt(path, np.stack([x.ravel(), y.ravel(), -1e3 * gap.ravel()], axis=1))
    written = tmp_path / "fields.npz"
    options = ["--force", "2", "--unit", "um", "-o", str(written), "--overwrite"]
    assert run("rough", str(path), *options) == 0
    assert_allclose(read(written)["element"], element)
    capsys.readouterr()
    assert_refused(run("rough", str(path), "--force", "2"), f"{path} has no unit: give --", capsys)
    path.write_text("what is this")
    assert_refused(run("rough", str(path), *options), f"{path} cannot be read", capsys)


@pytest.mark.parametrize(("ending", "separator"), [("txt", " "), ("csv", ","), ("CSV", ";")])
def test_a_table_of_heights_needs_no_library(ending, separator, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)  # As if it were not installed.
    path, gap, element = surface(tmp_path)
    table, written = tmp_path / f"heights.{ending}", tmp_path / "fields.npz"
    heights = np.load(path)
    heights[3, 5] = np.nan  # What the instrument did not see.
    np.savetxt(table, heights, delimiter=separator)
    options = ["--force", "2", "--unit", "um", "--element", "25", "-o", str(written)]
    assert run("rough", str(table), *options) == 0
    gap[3, 5] = np.inf
    expected = normal_contact(gap, element, material=STEEL, force=2.0)
    fields = read(written)
    assert_allclose(fields["pressure"], expected.pressure, atol=1e-6 * expected.max_pressure)
    assert np.isinf(fields["gap"][3, 5])


@pytest.mark.parametrize("header", ["heights", "date: 2026-11-25", "step = 3\ntilt: -1"])
@pytest.mark.parametrize("separator", [" ", ","])
def test_comments_do_not_transpose_a_table(header, separator, tmp_path, capsys):
    pytest.importorskip("SurfaceTopography")
    heights = 1e-3 * np.random.default_rng(0).random((12, 20))
    reports = []
    for name, options in (("bare", {}), ("headed", {"header": header})):
        path = tmp_path / f"{name}.txt"
        np.savetxt(path, heights, delimiter=separator, **options)
        assert run("rough", str(path), "--force", "100", "--element", "0.1", "0.3") == 0
        reports.append(capsys.readouterr().out.replace(name, "").splitlines()[:6])
    assert reports[0] == reports[1]
    assert "12 x 20 heights" in reports[0][0]


def test_a_text_that_says_its_sizes_is_of_the_library(tmp_path, capsys):
    pytest.importorskip("SurfaceTopography")
    path = tmp_path / "heights.txt"
    header = "Channel: Topography\nWidth: 20 µm\nHeight: 12 µm\nValue units: m"
    np.savetxt(path, 1e-9 * np.random.default_rng(0).random((12, 20)), header=header)
    assert run("rough", str(path), "--force", "1e-6") == 0
    assert "20 x 12 heights" in capsys.readouterr().out


@pytest.mark.parametrize("sizes", [["25"], ["25", "4000"]])
def test_a_profile_is_pressed(sizes, tmp_path, capsys):
    """One number along it and, where it is not plane strain, one across it."""
    element = tuple(1e-3 * float(size) for size in sizes)
    gap = surfaces.rough(200, element, rms=0.001, roll_off=1.0, shortest=0.2, seed=2)
    path, written = tmp_path / "profile.txt", tmp_path / "fields.npz"
    np.savetxt(path, -1e3 * gap)
    options = ["--force", "2", "--unit", "um", "--element", *sizes]
    assert run("rough", str(path), *options, "-o", str(written)) == 0
    printed = capsys.readouterr().out
    unit = "N/mm" if len(sizes) == 1 else "N"
    assert f"force             2 {unit}\n" in printed
    assert ("200 heights of a profile, in plane strain: forces are N/mm" in printed) == (
        len(sizes) == 1
    )
    expected = normal_contact(gap, element, material=STEEL, force=2.0)
    fields = read(written)
    assert_allclose(fields["pressure"], expected.pressure, atol=1e-6 * expected.max_pressure)


def test_a_line_scan_of_the_library_is_pressed(tmp_path, capsys):
    pytest.importorskip("SurfaceTopography")
    x = 25.0 * np.arange(100)
    path, written = tmp_path / "scan.xyz", tmp_path / "fields.npz"
    np.savetxt(path, np.stack([x, -1e-4 * (x - x.mean()) ** 2], axis=1))
    options = ["--force", "2", "--unit", "um", "-o", str(written), "--overwrite"]
    assert run("rough", str(path), *options) == 0
    assert "100 heights of a profile, in plane strain: forces are N/mm" in capsys.readouterr().out
    expected = normal_contact(1e-7 * (x - x.mean()) ** 2, 0.025, material=STEEL, force=2.0)
    fields = read(written)
    assert_allclose(fields["pressure"], expected.pressure, atol=1e-6 * expected.max_pressure)
    np.savetxt(path, np.stack([x**1.1, np.zeros(100)], axis=1))
    assert_refused(run("rough", str(path), *options), "positions that are not evenly", capsys)
    assert run("rough", str(path), *options, "--element", "25") == 0  # It is interpolated.
    assert "217 heights of a profile" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["rough"], "rough needs a FILE of heights"),
        (["rough", "x.npy"], "rough needs --force, --approach or --pressure"),
        (["rough", "nowhere.npy", "--force", "1", "--element", "1"], "nowhere.npy"),
        (["rough", "nowhere.xyz", "--force", "1"], "nowhere.xyz"),
        (["rough", "FILE", "--force", "1"], "has no sizes: give --element"),
        (["rough", "FILE", "--force", "1", "--element", "0"], "--element is 0.0, but must be"),
        (["rough", "FILE", "--force", "1", "--element", "1", "--unit", "yd"], "unit is 'yd'"),
        (["rough", "FILE", "--force", "1", "--radius", "3"], "--radius is for hertz, shift and"),
        (["rough", "FILE", "--force", "1", "-n", "64"], "-n is for hertz, shift and rolling"),
        (["hertz", "FILE"], "is for contact rough"),
        (["hertz", "--hardness", "1"], "--hardness is for rough, not hertz"),
        (["rough", "FILE", "--force", "1", "--hardness", "0"], "--hardness is 0.0, but must be"),
        (["hertz", "--periodic"], "--periodic is for rough, not hertz"),
        (["rough", "OTHER", "--force", "1"], "needs SurfaceTopography: pip install"),
        (["rough", "HEADED", "--force", "1"], "needs SurfaceTopography: pip install"),
        (["rough", "POINTS", "--force", "1", "--element", "1"], "3 columns, like positions"),
        (["rough", "WORDS", "--force", "1", "--element", "1"], "is not a table of numbers"),
        (["rough", "WORDS", "--force", "1", "--element", "1"], "write nan for a missing height"),
        (["rough", "LINE", "--approach", "1", "--element", "1"], "only known up to a constant"),
        (
            ["rough", "CUBE", "--force", "1", "--element", "1"],
            "has shape (4, 4, 4), but must be heights",
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_surfaces_that_do_not_do(options, message, tmp_path, monkeypatch, capsys):
    path, *_ = surface(tmp_path)
    texts = {
        "OTHER": ("heights.xyz", "0 0 0"),
        "HEADED": ("heights.txt", "# Width: 10 um\n1 2 3 4\n5 6 7 8"),  # As Gwyddion writes it.
        "POINTS": ("points.txt", "0 0 1\n0 1 2\n1 0 3\n1 1 4"),
        "WORDS": ("words.csv", "1,,2,3\n4,5,6,7"),
        "LINE": ("line.txt", "1\n2\n3\n4"),
    }
    files_there = {"FILE": str(path), "CUBE": str(tmp_path / "cube.npy")}
    np.save(files_there["CUBE"], np.zeros((4, 4, 4)))
    for name, (file, text) in texts.items():
        (tmp_path / file).write_text(text)
        files_there[name] = str(tmp_path / file)
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)  # As if it were not installed.
    assert run(*(files_there.get(option, option) for option in options)) == 2
    told = capsys.readouterr().err
    assert message in told
    assert told.count("\n") == 1


def test_a_surface_is_not_written_over(tmp_path, capsys):
    path, *_ = surface(tmp_path)
    same = tmp_path / "heights.npz"
    same.hardlink_to(path)
    status = run("rough", str(path), "--force", "1", "--element", "1", "-o", str(same))
    assert_refused(status, "but that one is read", capsys)


# Refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["hertz", "--force", "-1"], "--force is -1.0, but must be positive"),
        (["hertz", "--force", "inf"], "--force is inf, but must be finite"),
        (["hertz", "--force", "1e99"], "--force is of size 1e+99, but must be"),
        (["hertz", "--radius", "0"], "no radius of curvature is zero"),
        (["hertz", "--radius", "1", "2", "3"], "--radius has 3 values"),
        (["hertz", "--radius", "1", "1e9"], "one may be at most 10000 times the other"),
        (["hertz", "--nu", "0.6"], "--nu is 0.6, but must be above -1 and at most 0.5"),
        (["hertz", "--nu2", "0.6"], "--nu2 is 0.6, but must be above -1 and at most 0.5"),
        (["hertz", "--G", "0"], "--G is 0.0"),
        (["hertz", "--E", "inf"], "--E is inf, but must be finite"),
        (["hertz", "--E2", "nan"], "--E2 is nan, but must be finite"),
        (["hertz", "--E2", "1", "--G2", "1"], "--E2 and --G2 are both given"),
        (["hertz", "-n", "7"], "-n is 7, but must be 8 to"),
        (["hertz", "-n", "1" + 30 * "0"], "but must be 8 to"),
        (["hertz", "--size", "0.1"], "--size is 0.1, but the contact is 0.3749 mm long"),
        (["hertz", "--tolerance", "1"], "--tolerance is 1.0, but must be below 1"),
        (["hertz", "--force", "1", "--approach", "1"], "--force and --approach are both given"),
        (["hertz", "--line", "--approach", "1"], "--approach is not for --line"),
        (["hertz", "--line", "--radius", "1", "2"], "--radius has several values, but --line"),
        (["hertz", "--friction", "0.3"], "--mu is for shift and rolling, not hertz"),
        (["shift", "--mu", "inf"], "--mu is inf: give --tangential or --shift"),
        (["shift", "--friction", "nan"], "--mu is nan, but must be finite"),
        (["shift", "--friction", "0"], "--mu is 0.0, but must be positive"),
        (["shift", "--tangential", "3", "--shift", "1"], "--tangential and --shift are both"),
        (["shift", "--tangential", "18", "24.1"], "but friction carries at most 30"),
        (["shift", "--spin", "1"], "--spin is for rolling, not shift"),
        (["shift", "--moment", "1"], "--moment is for rolling, not shift"),
        (["rolling", "--moment", "1", "--spin", "1"], "--moment and --spin are both given"),
        (["rolling", "--tangential", "1", "--lateral", "1"], "--tangential and --lateral are both"),
        (["rolling", "--tangential", "30"], "--tangential is 30, but must be less than 30, the"),
        (["rolling", "--line", "--moment", "1"], "--moment is not for --line"),
        (["rolling", "--line", "--lateral", "1"], "--lateral is not for --line"),
        (["hertz", "-o", "x.npy"], "--output is x.npy, but must end in .npz"),
        (["hertz", "-o", "/nowhere/x.npz"], "/nowhere is no folder"),
        (["hertz", "--plot", "x.foo"], "x.foo does not end in one of"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_refusals_are_one_line_and_status_two(options, message, capsys):
    assert_refused(run(*options), message, capsys)


def test_options_of_linear_systems_are_refused(capsys):
    status = main(["--solver", "cg", "contact", "hertz"])
    assert_refused(status, "--solver is for linear systems, not for contact", capsys)
    assert main(["-n", "16", "contact", "hertz"]) == 0


def test_not_converged_is_status_one_and_writes_nothing(tmp_path, capsys):
    tolerance = ("--tolerance", "1e-20")  # It is far below rounding.
    assert run("shift", "-n", "16", *tolerance, "-o", str(tmp_path / "x.npz")) == 1
    assert "NOT CONVERGED: after " in capsys.readouterr().out
    assert not list(tmp_path.iterdir())


def test_interruption_writes_nothing(tmp_path, monkeypatch, capsys):
    class Interrupting(io.StringIO):
        def write(self, text):
            if "violation" in text:
                raise KeyboardInterrupt
            return super().write(text)

    monkeypatch.setattr(sys, "stdout", Interrupting())
    assert run("hertz", "-o", str(tmp_path / "x.npz")) == 130
    assert "interrupted" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "option", [["--n", "32"], ["--tan", "3"], ["--out", "x.npz"], ["--file", "x"]]
)
def test_abbreviations_and_what_is_no_option_are_refused(option, capsys):
    with pytest.raises(SystemExit) as caught:
        run("shift", *option)
    assert caught.value.code == 2
    assert f"unrecognized arguments: {option[0]}" in capsys.readouterr().err


def test_help_of_a_case_has_its_options_only(capsys):
    with pytest.raises(SystemExit):
        run("rough", "--help")
    shown = capsys.readouterr().out
    assert "--hardness" in shown
    assert not any(name in shown for name in ("--radius", "--spin", "--mu", "--line"))


def test_figures_as_json(capsys):
    assert run("shift", "-n", "16", "--mu", "0.2", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert_allclose(found["tangential_force"], [10.0, 0.0], atol=1e-6)
    assert_allclose(found["theory"]["force"], found["force"])


def test_a_file_after_a_unit_is_read_and_its_figures_are_those_of_the_summary(tmp_path, capsys):
    np.savetxt(tmp_path / "a.txt", np.random.default_rng(0).random((16, 16)))
    options = "--force", "1", "--element", "1", "--unit", "nm", "um", str(tmp_path / "a.txt")
    assert run("rough", *options, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert {"stiffness", "area", "contact_fraction", "mean_pressure", "energy"} < {*found}
