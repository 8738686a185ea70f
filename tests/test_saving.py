"""What is written of a result comes back whole, here and in other libraries; no file is lost."""

import base64
import json
import os
import pickle
from dataclasses import fields, is_dataclass, replace
from functools import partial
from xml.etree import ElementTree
from zipfile import ZipFile

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal, assert_equal

from tests.systems import refuses
from tests.test_result import (
    ALL,
    BOTH,
    CURVE,
    PRESSED,
    ROLLED_LINE,
    SHIFTED,
    SPHERE,
    STRESSES,
    press_unlike,
)
from toeplitz_mg import contact
from toeplitz_mg.contact import friction, normal_contact, surfaces

WITH_ALL = replace(PRESSED, stiffness=0.1 + 0.2, warnings=("ä < b", "c"))
BONDED = friction(
    bound=np.where(PRESSED.contact, np.inf, 0.0),
    element=PRESSED.element,
    material=PRESSED.material,
    shift=(1, 0),
)


def assert_same(one, other):
    """All fields are the same to the last bit, and of the same type."""
    assert type(one) is type(other)
    if is_dataclass(one):
        for field in fields(one):
            assert_same(getattr(one, field.name), getattr(other, field.name))
    elif isinstance(one, np.ndarray):
        assert one.dtype == other.dtype
        assert_array_equal(one, other)
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        list(map(assert_same, one, other))
    else:
        assert_equal(one, other)


CYLINDER = surfaces.cylinder(64, 0.025, radius=1.0), 0.025
BOTH_LINE = press_unlike(CYLINDER, 0.1, press_unlike(CYLINDER, 0.05))
PRESSED_UNLIKE = normal_contact(*SPHERE, material=BOTH.normal.material, force=0.1)
BELOW_A_LINE = contact.subsurface_stresses(ROLLED_LINE, depths=0.1)
BEYOND = {"mu": 0.3, "force": (0.3 * PRESSED.force, 0.0)}
SLIDE = contact.rolling, partial(contact.creep_curve, spin=[0.0, 0.1])
with pytest.warns(contact.ContactWarning, match="creepages"):  # They, slip and power are NaN.
    SLIDING = [roll(PRESSED, **BEYOND) for roll in SLIDE]
SAVED = [*ALL, WITH_ALL, BONDED, PRESSED_UNLIKE, BOTH, BOTH_LINE, CURVE, STRESSES, BELOW_A_LINE]
FULL = normal_contact(np.zeros(16), 0.1, material=PRESSED.material, force=1.0, periodic=True)
SAVED += [*SLIDING, FULL]


@pytest.mark.parametrize("result", SAVED)
def test_what_is_saved_is_loaded_and_can_be_read_without_this_package(result, tmp_path):
    result.save(tmp_path / "x.npz")
    assert_same(contact.load(tmp_path / "x.npz"), result)
    with np.load(tmp_path / "x.npz", allow_pickle=False) as file:
        about, arrays = json.loads(str(file["about"])), dict(file)
    assert about["kind"] == type(result).__name__
    for part, text in (about["parts"] or {"": about}).items():
        own = vars(getattr(result, part) if part else result)
        own = dict(zip("xy", own.get("centres", ()), strict=False)) | own
        there = {k.removeprefix(f"{part}_"): x for k, x in arrays.items() if k.startswith(part)}
        for name in there.keys() - {"about"}:
            assert_array_equal(there[name], own[name])
            assert part == "before" or name == "products" or text["units"][name]
        for k, x in text["values"].items():
            assert not np.isscalar(x) or x != x or own[k] == x


@pytest.mark.parametrize(("surface", "state"), [(SPHERE, BOTH), (CYLINDER, BOTH_LINE)])
def test_frictional_contact_goes_on_from_a_file(surface, state, tmp_path):
    """The state before the last step is there too."""
    state.save(tmp_path / "x.npz")
    again = contact.load(tmp_path / "x.npz")
    press_unlike(surface, 0.12, state)  # Matrices that are kept are no work of what comes next.
    assert_same(*(press_unlike(surface, 0.12, x) for x in (state, again)))


each_format = pytest.mark.parametrize(("write", "ending"), [("save", "npz"), ("to_vtk", "vti")])


@each_format
def test_a_file_is_not_replaced_by_accident(write, ending, tmp_path):
    path = tmp_path / f"x.{ending}"
    path.write_text("his")
    refuses(FileExistsError, "overwrite=True replaces it", getattr(PRESSED, write), path)
    assert path.read_text() == "his"
    getattr(PRESSED, write)(path, overwrite=True)
    assert path.stat().st_size > 1000
    assert os.listdir(tmp_path) == [path.name]


@each_format
def test_a_file_is_written_whole_or_not_at_all(write, ending, tmp_path, monkeypatch):
    path = tmp_path / f"x.{ending}"
    path.write_text("his")

    def fail(*_):
        raise OSError("the disk is full")

    monkeypatch.setattr(os, "fsync", fail)
    refuses(OSError, "the disk is full", getattr(PRESSED, write), path, overwrite=True)
    assert path.read_text() == "his"
    assert os.listdir(tmp_path) == [path.name]


@each_format
def test_a_name_that_cannot_be_written_is_refused(write, ending, tmp_path):
    for name, error, said in (
        ("x.txt", ValueError, rf"x\.txt, but must end in \.{ending}"),
        (f"none/x.{ending}", OSError, "none is no folder"),
        (f"folder.{ending}", OSError, "is no regular file"),
    ):
        (tmp_path / f"folder.{ending}").mkdir(exist_ok=True)
        refuses(error, said, getattr(PRESSED, write), tmp_path / name, overwrite=True)


def refusal(path):
    with pytest.raises(ValueError, match="is not a file of a contact result") as caught:
        contact.load(path)
    return str(caught.value)


def test_other_files_are_no_results(tmp_path):
    PRESSED.save(tmp_path / "half.npz")
    whole = (tmp_path / "half.npz").read_bytes()
    (tmp_path / "half.npz").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.npz").write_text("nothing")
    np.savez(tmp_path / "arrays.npz", x=np.ones(3))
    np.savez(tmp_path / "foreign.npz", about=np.array('{"format": "of another"}'))
    about = {"format": "toeplitz_mg contact result", "kind": "Sum"}
    np.savez(tmp_path / "kind.npz", about=np.array(json.dumps(about)))
    with (tmp_path / "one.npz").open("wb") as file:
        np.save(file, np.ones(3))
    for name, said in (
        ("half", ""),
        ("text", ""),
        ("arrays", "it names no format"),
        ("foreign", "its format is 'of another'"),
        ("kind", "its kind is 'Sum', but must be one of NormalResult"),
        ("one", "it is a single array"),
    ):
        message = refusal(tmp_path / f"{name}.npz")
        assert said in message
        assert "pickle" not in message
    with pytest.raises(FileNotFoundError):
        contact.load(tmp_path / "none.npz")


def damaged(path, result, about=None, **arrays):
    """Save a result with other arrays, or another text, in the place of some of its own."""
    result.save(path, overwrite=True)
    with np.load(path) as file:
        own = {name: file[name] for name in file.files}
    if about:
        text = json.loads(str(own["about"]))
        text["values"] |= about
        own["about"] = np.array(json.dumps(text))
    np.savez_compressed(path, **own | arrays)
    return path


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"pressure": np.ones((16, 16))}, r"pressure has shape \(16, 16\), but must have"),
        ({"pressure": np.zeros((6000, 6000))}, "pressure has shape"),
        ({"pressure": np.full((48, 32), "a")}, "pressure is of type <U1, but must be of float64"),
        ({"pressure": 1j * np.ones((48, 32))}, "pressure is of type complex128"),
        ({"pressure": np.full((48, 32), np.nan)}, "pressure has nan, but must be finite"),
        ({"pressure": 2.0 * PRESSED.pressure}, "must be the sum of pressure over the elements"),
        ({"contact": PRESSED.pressure}, "contact is of type float64, but must be of bool"),
        ({"x": PRESSED.x**3}, "centres must be about zero, and along x 0.0416.* mm apart"),
        ({"about": {"approach": np.nan}}, "approach has nan"),
        ({"about": {"shape": (32, 48)}}, "has shape"),
        ({"about": {"shape": (2**22,)}, "x": np.zeros(2**22)}, "x has 33554560 bytes, compressed"),
        ({"about": {"force": "0.1"}}, "force is '0.1', but must be a number"),
        ({"about": {"pressure": 1.0}}, "pressure is 1.0, but must be an array"),
        ({"about": {"energy": 10**400}}, "energy has inf, but must be finite"),
    ],
)
def test_what_is_not_of_its_grid_is_refused(arrays, message, tmp_path):
    refuses(ValueError, message, contact.load, damaged(tmp_path / "x.npz", PRESSED, **arrays))


def test_a_member_that_is_there_twice_is_refused(tmp_path):
    SHIFTED.save(tmp_path / "x.npz")
    with ZipFile(tmp_path / "x.npz", "a") as file, pytest.warns(UserWarning, match="Duplicate"):
        file.writestr("slip.npy", b"")
    refuses(ValueError, "slip is there 2 times", contact.load, tmp_path / "x.npz")


def test_what_belongs_to_no_field_is_not_read(tmp_path):
    more = damaged(tmp_path / "x.npz", PRESSED, more=np.array([object()], dtype=object))
    assert_same(contact.load(more), PRESSED)


FIELDS = {"traction", "displacement", "slip", "bound", "contact", "stick"}


def read_vtk(path):
    """Return the image element of a file of VTK, and its cell data by their names."""
    (image,) = ElementTree.parse(path).getroot()
    found = {}
    for data in image.iter("DataArray"):
        raw = base64.b64decode(data.text)
        assert int.from_bytes(raw[:8], "little") == len(raw) - 8
        dtype = {"Float64": "<f8", "UInt8": "u1"}[data.get("type")]
        found[data.get("Name")] = np.frombuffer(raw[8:], dtype)
    return image, found


def test_a_file_of_vtk_has_the_fields_of_the_cells(tmp_path):
    SHIFTED.to_vtk(tmp_path / "x.vti")
    image, found = read_vtk(tmp_path / "x.vti")
    assert image.get("WholeExtent") == "0 48 0 32 0 0"
    origin, spacing = (np.fromstring(image.get(k), sep=" ") for k in ("Origin", "Spacing"))
    assert_allclose(origin, [-1.0, -1.0, 0.0], atol=1e-12)
    assert_allclose(spacing[:2], SHIFTED.element)
    q = found["traction"].reshape(32, 48, 3)  # x runs first.
    assert np.array_equal(q[..., :2], SHIFTED.traction.T)
    assert not q[..., 2].any()
    assert np.array_equal(found["stick"].reshape(32, 48).T, SHIFTED.stick)
    assert {*found} == FIELDS


def test_lines_and_both_results_of_contact_with_friction_are_images_of_vtk_too(tmp_path):
    ROLLED_LINE.to_vtk(tmp_path / "x.vti")
    image, found = read_vtk(tmp_path / "x.vti")
    assert image.get("WholeExtent") == "0 64 0 0 0 0"
    assert np.array_equal(found["traction"], ROLLED_LINE.traction)
    assert {*found} == FIELDS
    BOTH.to_vtk(tmp_path / "x.vti", overwrite=True)
    names = {f"tangential_{name}" for name in FIELDS}
    names |= {f"normal_{name}" for name in ("pressure", "gap", "displacement", "contact")}
    assert {*read_vtk(tmp_path / "x.vti")[1]} == names


@pytest.mark.parametrize("result", [*ALL, WITH_ALL, STRESSES, BELOW_A_LINE])
def test_vtk_reads_it(result, tmp_path):
    kind, ending = ("RectilinearGrid", "vtr") if hasattr(result, "depths") else ("ImageData", "vti")
    reader = getattr(pytest.importorskip("vtk"), f"vtkXML{kind}Reader")()
    result.to_vtk(tmp_path / f"x.{ending}")
    reader.SetFileName(str(tmp_path / f"x.{ending}"))
    reader.Update()
    read = reader.GetOutput()
    if ending == "vtr":
        assert read.GetPointData().GetArray("xz").GetNumberOfTuples() == result.xx.size
        assert read.GetBounds()[4:] == (result.depths[0], result.depths[-1])
        return
    assert read.GetNumberOfCells() == result.contact.size
    name = "pressure" if result.stick is None else "traction"
    cell = int(np.argmax(result.magnitude.T))
    size = np.linalg.norm(read.GetCellData().GetArray(name).GetTuple(cell))
    assert_allclose(size, result.magnitude.max(), rtol=1e-14)


@pytest.mark.parametrize("result", [SHIFTED, ROLLED_LINE, WITH_ALL, BOTH, STRESSES, BELOW_A_LINE])
def test_a_dataset_has_the_fields_with_coordinates_and_units(result):
    pytest.importorskip("xarray")
    data, units = result.to_xarray(), {"slip": "1" if result is ROLLED_LINE else "mm"}
    units |= dict.fromkeys(("gap", "displacement", "plastic"), "mm")
    units |= dict.fromkeys(("contact", "stick"), "1")
    parts = {"normal": result.normal, "tangential": result.tangential} if result is BOTH else {}
    for name, x in data.items():
        part, _, own = name.partition("_") if parts else ("", "", name)
        assert np.array_equal(x, getattr(parts.get(part, result), own))
        assert x.attrs["units"] == units.get(own, "N/mm²")
        grid = tuple(axis for axis in ("depth", "x", "y") if axis in data.coords)
        assert x.dims in (grid, ("component", *grid))
    assert all(x.attrs["units"] == "mm" for k, x in data.coords.items() if k != "component")
    assert np.array_equal(data.x, (result if result is not BOTH else BOTH.normal).centres[0])


def test_what_is_no_field_is_an_attribute_of_a_dataset():
    pytest.importorskip("xarray")
    data = SHIFTED.to_xarray()
    assert np.array_equal(data.traction.sel(component="y"), SHIFTED.traction[1])
    assert data.attrs["area"] == SHIFTED.area
    assert data.attrs["area_units"] == "mm²"
    assert np.array_equal(data.attrs["shift"], SHIFTED.shift)
    assert BOTH.to_xarray().attrs["normal_force"] == BOTH.normal.force
    assert WITH_ALL.to_xarray().attrs["warnings"] == "ä < b\nc"


@pytest.mark.parametrize("result", [*ALL, WITH_ALL, PRESSED_UNLIKE])
def test_xarray_can_write_it(result, tmp_path):
    xarray = pytest.importorskip("xarray")
    result.to_xarray().to_netcdf(tmp_path / "x.nc", engine="scipy")
    again = xarray.load_dataset(tmp_path / "x.nc", engine="scipy")
    name = "pressure" if result.stick is None else "traction"
    assert np.array_equal(again[name], getattr(result, name))


def test_without_xarray_it_is_said_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "xarray", None)
    refuses(ImportError, r"pip install 'toeplitz-mg\[xarray\]'", PRESSED.to_xarray)


def test_what_all_ranks_compute_together_is_not_asked_of_one(tmp_path):
    """The stiffness of the rows that one rank has would wait for the others for ever."""

    def wait_for_ever():
        raise AssertionError("one rank alone asked for it")

    rows = replace(PRESSED, shape=(96, 32), stiffness=wait_for_ever)
    assert "stiffness" not in rows.summary()
    assert pickle.loads(pickle.dumps(rows)).stiffness is None
    with pytest.raises(
        ValueError, match=r"rows of one rank, \(48, 32\) of the \(96, 32\) elements"
    ):
        rows.save(tmp_path / "rows.npz")
    assert not list(tmp_path.iterdir())
    assert "stiffness" in PRESSED.summary()


# Stresses -----------------------------------------------------------------------------------


@pytest.mark.parametrize("stresses", [STRESSES, BELOW_A_LINE])
def test_stresses_as_a_grid_of_vtk(stresses, tmp_path):
    stresses.to_vtk(tmp_path / "x.vtr")
    grid, arrays = read_vtk(tmp_path / "x.vtr")
    sizes = [len(arrays[name]) for name in ("x", "y", "depth")]
    assert grid.get("WholeExtent") == " ".join(f"0 {n - 1}" for n in sizes)
    assert np.array_equal(arrays["depth"], stresses.depths)
    # The first axis runs first, the depths last.
    von_mises = arrays["von_mises"].reshape(sizes[::-1])
    expected = stresses.von_mises.reshape(sizes[2], sizes[0], sizes[1])
    assert np.array_equal(von_mises, expected.transpose(0, 2, 1))
    refuses(ValueError, r"must end in \.vtr", stresses.to_vtk, tmp_path / "x.vti")


class Trap:
    """What makes a folder where it is unpickled."""

    def __init__(self, folder):
        self.folder = folder

    def __reduce__(self):
        return os.mkdir, (str(self.folder),)


def test_nothing_is_unpickled(tmp_path):
    """A file may be anybody's: to read it must not run what it says."""
    sprung = tmp_path / "sprung"
    np.savez(tmp_path / "x.npz", about=np.array(Trap(sprung), dtype=object))
    (tmp_path / "y.npz").write_bytes(pickle.dumps(Trap(sprung)))
    for name in "xy":
        refusal(tmp_path / f"{name}.npz")
        assert not sprung.exists()


def test_depths_that_are_not_in_order_make_no_grid_of_vtk(tmp_path):
    wrong = replace(STRESSES, depths=STRESSES.depths[::-1])
    refuses(ValueError, "must increase", wrong.to_vtk, tmp_path / "x.vtr")
    assert not os.listdir(tmp_path)
