"""Results in files, and in the containers of other libraries.

A result is an ``.npz`` file of its arrays by their names, which `numpy.load` reads too, and of a
text in JSON, `about`: what kind of result it is, its numbers, and the units of all. Of a result
with parts, as `FrictionalResult`, the name of the part comes before that of its array, as in
`normal_pressure`. `save`, `to_xarray` and `to_vtk` are methods of results.
"""

import base64
import json
import os
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, fields, is_dataclass
from importlib import import_module
from math import prod
from pathlib import Path
from typing import Any, BinaryIO, TypeVar
from xml.etree import ElementTree

import numpy as np
from numpy.lib.format import read_array_header_1_0, read_array_header_2_0, read_magic

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.results.quantities import (
    Quantity,
    fields_on_grid,
    name_units,
    quantities,
    require_whole,
)
from toeplitz_mg.halfspace import CombinedMaterial, Material
from toeplitz_mg.whole_files import check_folder, find_status, new_whole

FORMAT = "toeplitz_mg contact result"  # What a file of ours says that it is.
LONGEST = 2**24  # Most bytes of the text in a file.
ROUNDING = 1e-6  # Relative error of the places and of the sums in a file.
TYPES = {"b": "UInt8", "f": "Float64", "i": "Int64"}  # Those of VTK, by the kind of a dtype.

Kind = TypeVar("Kind")
KINDS: dict[str, type] = {}  # What a file may have, and a result in a file for a part.
Arrays = Iterable[tuple[str, Array]]  # Names and fields, whose first axis is that of components.


def loadable(kind: type[Kind]) -> type[Kind]:
    """Let files have this class of results: a decorator."""
    KINDS[kind.__name__] = kind
    return kind


def save(result: Any, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write everything to an ``.npz`` file, with units, whole or not at all.

    Parameters
    ----------
    path : str or path
        Must end in ``.npz``.
    overwrite : bool
        Whether a file that is there already may be replaced.

    Raises
    ------
    FileExistsError
        Where there is a file and `overwrite` is false: it is left as it is.
    OSError, ValueError
        Where the file cannot be written, or its name does not end in ``.npz``.

    See Also
    --------
    load : reads it; `numpy.load` finds the arrays by their names, and a text in JSON, `about`.
    """
    result._complete("save()")
    arrays, about = _describe(result)
    text = json.dumps({"format": FORMAT} | about, ensure_ascii=False, indent=1)
    everything: dict[str, Any] = arrays | {"about": np.array(text)}
    with new_file(path, ".npz", overwrite=overwrite) as file:
        np.savez(file, **everything)


def load(path: str | os.PathLike[str]) -> Any:
    """Read a result that `save` has written.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    NormalResult, TangentialResult, FrictionalResult, Stresses, CreepCurve, LoadCurve, RollingSteps
        What was saved.

    Raises
    ------
    OSError
        Where there is no such file.
    ValueError
        Where it is another file than of `save`.

    See Also
    --------
    NormalResult : its `save` writes such a file, as that of the other results does.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from toeplitz_mg import contact
    >>> steel, element = contact.Material(E=210000.0, nu=0.3), (0.01, 0.01)
    >>> gap = contact.surfaces.sphere((64, 64), element, radius=10.0)
    >>> pressed = contact.normal_contact(gap, element, material=steel, force=100.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "pressed.npz"
    ...     pressed.save(path)
    ...     again = contact.load(path)
    >>> again
    <NormalResult 64 x 64: force 100 N, approach 0.0034825 mm, contact 0.1116 mm²; 10 products>
    """
    path = Path(path)
    try:
        with path.open("rb") as opened:
            file = np.load(opened, allow_pickle=False)
            if isinstance(file, np.ndarray):
                raise ValueError("it is a single array")
            with file:
                return _compose(_Arrays(file), _read_about(file))
    except OSError:
        raise
    except Exception as error:  # NumPy, zip files and JSON raise many.
        said = "" if "pickle" in str(error) else f": {error}"  # NumPy advises to unpickle anything.
        raise ValueError(f"{path} is not a file of a contact result{said}") from error


def _read_about(file: Any) -> dict[str, Any]:
    """Return the text of a file, which says what it has."""
    if "about" not in file.files:
        raise ValueError(f"it names no format, but must be {FORMAT!r}, as `save` writes it")
    size = file.zip.getinfo("about.npy").file_size
    if size > LONGEST:
        raise ValueError(f"its text has {size} bytes, but must have at most {LONGEST}")
    about: dict[str, Any] = json.loads(str(file["about"]))
    if about.get("format") != FORMAT:
        raise ValueError(
            f"its format is {about.get('format')!r}, but must be {FORMAT!r}, as `save` writes it"
        )
    return about


class _Arrays:
    """The arrays of a file, of which only what is asked for is read, and of the right shape.

    Parameters
    ----------
    file : NpzFile
    prefix : str
        What the names of those of a part begin with.
    """

    def __init__(self, file: Any, prefix: str = "") -> None:
        self._file, self._prefix = file, prefix

    def of_part(self, name: str) -> "_Arrays":
        """Return the arrays of a part of a result."""
        return _Arrays(self._file, f"{self._prefix}{name}_")

    def __contains__(self, name: str) -> bool:
        return self._prefix + name in self._file.files

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of an array, without reading that."""
        return self._header(name)[0]

    def read(self, name: str, quantity: Quantity, sizes: Mapping[str, tuple[int, ...]]) -> Array:
        """Return an array, whose shape and numbers are those of a quantity."""
        shape, dtype = self._header(name)
        allowed = quantity.shapes(sizes)
        if shape not in allowed:
            raise ValueError(
                f"{self._prefix}{name} has shape {shape}, but must have "
                f"{' or '.join(map(str, allowed))}"
            )
        if dtype.kind != quantity.kind:
            kind = {"f": "real numbers", "b": "truth values", "i": "integers"}[quantity.kind]
            raise ValueError(f"{self._prefix}{name} is of type {dtype}, but must have {kind}")
        array: Array = self._file[self._prefix + name]
        _check_numbers(self._prefix + name, array, quantity)
        return array

    def _header(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
        read = {(1, 0): read_array_header_1_0, (2, 0): read_array_header_2_0}
        with self._file.zip.open(f"{self._prefix}{name}.npy") as opened:
            shape, _, dtype = read[read_magic(opened)](opened)
        return shape, dtype


def _check_numbers(name: str, value: Any, quantity: Quantity) -> None:
    """Refuse what is no number, and infinity where a quantity is always finite."""
    if quantity.beyond == "nan":
        return
    values = np.asarray(value)
    wrong = values[np.isnan(values) if quantity.beyond else ~np.isfinite(values)]
    if wrong.size:
        raise ValueError(f"{name} has {wrong.flat[0]}, but must be finite")


def _describe(result: Any) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return the arrays of a result, or of a part of one, and in words and numbers the rest."""
    arrays, values = _split_fields(result)
    about: dict[str, Any] = {"kind": type(result).__name__, "values": values, "parts": {}}
    if "material" in vars(result):
        about |= {"material": asdict(result.material), "units": name_units(result)}
    elif hasattr(result, "units"):
        about |= {"units": result.units}
    for name, part in _parts(result).items():
        own, about["parts"][name] = _describe(part)
        arrays |= {f"{name}_{key}": x for key, x in own.items()}
    return arrays, about


def _compose(
    arrays: _Arrays,
    about: dict[str, Any],
    sizes: Mapping[str, tuple[int, ...]] | None = None,
) -> Any:
    """Return what `_describe` has described, checked against the sizes of the grid."""
    if about["kind"] not in KINDS:
        raise ValueError(f"its kind is {about['kind']!r}, but must be one of {', '.join(KINDS)}")
    kind = KINDS[about["kind"]]
    given = {name: _thaw(value) for name, value in about["values"].items()}
    sizes = dict(sizes or {}) | _find_sizes(arrays, given)
    for name, part in about.get("parts", {}).items():
        given[name] = _compose(arrays.of_part(name), part, sizes)
        sizes.setdefault("grid", getattr(given[name], "shape", ()))
    if "material" in about:
        given["material"] = _read_material(about["material"])
    if "x" in arrays:
        place = Quantity("mm", "axis")
        given["centres"] = tuple(
            arrays.read(name, place, {"axis": (n,)})
            for name, n in zip("xy", sizes["grid"], strict=False)
        )
    for name, quantity in quantities(kind).items():
        if quantity.axes and name in arrays:
            given[name] = arrays.read(name, quantity, sizes)
        elif given.get(name) is not None:
            _check_numbers(name, given[name], quantity)
    _check_sums(given)
    if "results" in {field.name for field in fields(kind)}:
        given["results"] = [given.pop(name) for name in about["parts"]]
    return kind(**given)


def _find_sizes(arrays: _Arrays, given: Mapping[str, Any]) -> dict[str, tuple[int, ...]]:
    """Return the sizes of the axes that fields of a result or of a part have."""
    sizes = {"points": arrays.shape("power")} if "power" in arrays else {}
    if "shape" in given:
        sizes["grid"] = given["shape"]
    elif "x" in arrays:
        sizes["grid"] = tuple(n for name in "xy" if name in arrays for n in arrays.shape(name))
    if "depths" in arrays:
        sizes["depths"] = arrays.shape("depths")
    return sizes


def _check_sums(given: Mapping[str, Any]) -> None:
    """Refuse places that are not equidistant, and tractions whose sum is not the force."""
    if "shape" not in given:
        return
    for x, h in zip(given["centres"], given["element"], strict=False):
        if not np.allclose(np.diff(x), h, rtol=ROUNDING, atol=0.0):
            raise ValueError(f"the centres of its elements are not {h} mm apart, but must be")
    field = "traction" if "traction" in given else "pressure"
    q, area = given[field], prod(given["element"])
    axes = tuple(range(-len(given["shape"]), 0))
    total, size = (area * x.sum(axis=axes) for x in (q, np.abs(q)))
    if np.max(np.abs(total - given["force"])) > ROUNDING * np.max(size):
        raise ValueError(f"the sum of its {field} is {total}, but its force is {given['force']}")


def import_extra(name: str, method: str) -> Any:
    """Return xarray or pandas, extras that are slow to import, or say how to install them."""
    try:
        return import_module(name)
    except ImportError as error:
        raise ImportError(f"{method}() needs {name}: pip install 'toeplitz-mg[xarray]'") from error


def _parts(result: Any) -> dict[str, Any]:
    """Return the parts of a result that have fields of their own; of a curve its results."""
    own = {field.name: vars(result)[field.name] for field in fields(result)}
    own |= {f"result_{k}": part for k, part in enumerate(own.get("results", ()))}
    return {k: value for k, value in own.items() if k != "material" and is_dataclass(value)}


def _list_parts(result: Any) -> dict[str, Any]:
    """Return the parts of a result that are results."""
    return {name: part for name, part in _parts(result).items() if "centres" in vars(part)}


def _split_fields(result: Any) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return the arrays of a result by their names, and its other values but its parts."""
    if "shape" in vars(result):
        require_whole(result)
    arrays: dict[str, Array] = dict(zip("xy", vars(result).get("centres", ()), strict=False))
    values: dict[str, Any] = {}
    parts = _parts(result)
    for field in fields(result):
        if field.name in ("material", "centres", "results", *parts):
            continue
        value = getattr(result, field.name)
        if isinstance(value, np.ndarray) and value.ndim:
            arrays[field.name] = value
        else:
            values[field.name] = value.item() if isinstance(value, np.generic) else value
    return arrays, values


def to_xarray(result: Any) -> Any:
    """Return the fields as an `xarray.Dataset`, with coordinates and units.

    Returns
    -------
    xarray.Dataset
        Numbers that are no fields are in its `attrs`.
    """
    xarray = import_extra("xarray", "to_xarray")
    if parts := {name: to_xarray(part) for name, part in _list_parts(result).items()}:
        fields_of = {f"{name}_{k}": x for name, part in parts.items() for k, x in part.items()}
        about = {f"{name}_{k}": x for name, part in parts.items() for k, x in part.attrs.items()}
        return xarray.Dataset(fields_of, attrs=about)
    arrays, values = _split_fields(result)
    units, fields, grid = name_units(result), fields_on_grid(result), "xy"[: len(result.shape)]
    coordinates: dict[str, Any] = {name: (name, arrays.pop(name), {"units": "mm"}) for name in grid}
    if any(x.ndim > len(grid) for x in fields.values()):
        coordinates["component"] = ("component", ["x", "y"], {})
    axes = ("component", *grid)
    variables = {k: (axes[-x.ndim :], x, {"units": units[k]}) for k, x in fields.items()}
    attributes: dict[str, Any] = {"kind": type(result).__name__}
    attributes |= {name: x for name, x in arrays.items() if name not in fields}
    attributes |= _keep_in_netcdf(values | _list_constants(result.material))
    attributes |= {f"{name}_units": unit for name, unit in units.items() if name in attributes}
    return xarray.Dataset(variables, coordinates, attributes)


def _list_constants(material: CombinedMaterial) -> dict[str, Any]:
    """Return the combined constants by their names, and those of the bodies, as `G_1`."""
    constants = asdict(material)
    for k, body in enumerate(constants.pop("bodies") or (), 1):
        constants |= {f"{name}_{k}": value for name, value in body.items()}
    return constants


def _keep_in_netcdf(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values as netCDF can keep them, without those that it cannot."""
    kept: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, bool):
            kept[name] = int(value)
        elif name == "warnings":
            kept[name] = "\n".join(value)
        elif value not in (None, ()):
            kept[name] = value
    return kept


def _read_material(values: dict[str, Any]) -> CombinedMaterial:
    """Return the combined constants, with the bodies where the file has them."""
    bodies = values.pop("bodies", None)
    if bodies is not None:
        first, second = (
            Material.rigid() if np.isinf(body["G"]) else Material.from_shear(**body)
            for body in bodies
        )
        bodies = first, second
    return CombinedMaterial(**values, bodies=bodies)


def _thaw(value: Any) -> Any:
    """Return a tuple for a list of JSON."""
    return tuple(map(_thaw, value)) if isinstance(value, list) else value


@contextmanager
def new_file(path: str | os.PathLike[str], ending: str, *, overwrite: bool) -> Iterator[BinaryIO]:
    """Open a file that is there when it is whole, in the place of none unless that is wanted."""
    path = Path(path)
    if path.suffix != ending:
        raise ValueError(f"path is {path}, but must end in {ending}")
    check_folder(path)
    old = find_status(path)
    if old is not None and not stat.S_ISREG(old.st_mode):
        raise OSError(f"{path} is no regular file, so it is not replaced")
    there = FileExistsError(f"{path} is there already: overwrite=True replaces it")
    if old is not None and not overwrite:
        raise there
    try:
        with new_whole(path, replaces=overwrite) as file:
            yield file
    except FileExistsError:  # It has come in the meantime.
        raise there from None


def to_vtk(result: Any, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write the fields as an image of VTK, which ParaView and PyVista read.

    Parameters
    ----------
    path : str or path
        Must end in ``.vti``.
    overwrite : bool
        Whether a file that is there already may be replaced.

    Raises
    ------
    FileExistsError, OSError, ValueError
        As `save`.
    """
    parts = _list_parts(result)
    fields = {f"{k}_{name}": x for k, p in parts.items() for name, x in fields_on_grid(p).items()}
    result = parts.get("normal", result)
    fields = fields or fields_on_grid(result)
    shape, axes = result.shape, len(result.shape)
    sizes = (*result.element[:axes], *(1.0,) * (3 - axes))
    origin = (*(x[0] - h / 2.0 for x, h in zip(result.centres, sizes, strict=False)), 0.0, 0.0)[:3]
    place = {"Origin": " ".join(f"{x!r}" for x in map(float, origin))}
    place |= {"Spacing": " ".join(f"{h!r}" for h in sizes)}
    vectors = ((k, _complete(x) if x.ndim > axes else x[None]) for k, x in fields.items())
    extent = " ".join(f"0 {n}" for n in (*shape, 0, 0)[:3])
    root, _ = _make_vtk("ImageData", extent, place, "CellData", vectors)
    _write_vtk(root, path, ".vti", overwrite=overwrite)


def stresses_to_vtk(
    stresses: Any, path: str | os.PathLike[str], *, overwrite: bool = False
) -> None:
    """Write the stresses as a grid of VTK, which ParaView and PyVista read, z being the depth.

    Parameters
    ----------
    path : str or path
        Must end in ``.vtr``.
    overwrite : bool
        Whether a file that is there already may be replaced.

    Raises
    ------
    FileExistsError, OSError, ValueError
        As `save`; also where depths are not in order.
    """
    if not (np.diff(stresses.depths) > 0.0).all():
        raise ValueError(
            f"depths are {stresses.depths}, but must increase: a grid of VTK has no other ones"
        )
    x, y = (*stresses.centres, np.zeros(1))[:2]
    shape = len(stresses.depths), len(x), len(y)
    fields = ((name, a.reshape(shape).transpose(1, 2, 0)[None]) for name, a in stresses.fields())
    extent = " ".join(f"0 {len(a) - 1}" for a in (x, y, stresses.depths))
    root, piece = _make_vtk("RectilinearGrid", extent, {}, "PointData", fields)
    coordinates = ElementTree.SubElement(piece, "Coordinates")
    for name, values in (("x", x), ("y", y), ("depth", stresses.depths)):
        coordinates.append(_encode_for_vtk(name, values[None]))
    _write_vtk(root, path, ".vtr", overwrite=overwrite)


def _make_vtk(
    kind: str, extent: str, place: dict[str, str], of: str, arrays: Arrays
) -> tuple[ElementTree.Element, ElementTree.Element]:
    """Return a file, and its piece, with these arrays of its points or cells."""
    about = {"type": kind, "version": "1.0", "byte_order": "LittleEndian"}
    root = ElementTree.Element("VTKFile", about, header_type="UInt64")
    whole = ElementTree.SubElement(root, kind, place, WholeExtent=extent)
    piece = ElementTree.SubElement(whole, "Piece", Extent=extent)
    data = ElementTree.SubElement(piece, of)
    for name, x in arrays:
        data.append(_encode_for_vtk(name, x))
    return root, piece


def _write_vtk(
    root: ElementTree.Element, path: str | os.PathLike[str], ending: str, *, overwrite: bool
) -> None:
    with new_file(path, ending, overwrite=overwrite) as file:
        ElementTree.ElementTree(root).write(file, encoding="utf-8", xml_declaration=True)


def _complete(x: Array) -> Array:
    """Return vectors of three components."""
    return np.concatenate([x, np.zeros((3 - len(x), *x.shape[1:]))])


def _encode_for_vtk(name: str, x: Array) -> ElementTree.Element:
    """Return a field as VTK has it: components first, then the first axis running first."""
    element = ElementTree.Element("DataArray", Name=name, type=TYPES[x.dtype.kind])
    element.set("format", "binary")
    if len(x) > 1:
        element.set("NumberOfComponents", str(len(x)))
    data = np.ascontiguousarray(x.T)
    data = data.astype(data.dtype.newbyteorder("<"), copy=False)
    size = np.array(data.nbytes, "<u8")
    element.text = base64.b64encode(size.tobytes() + data.tobytes()).decode()
    return element
