"""Results in files, and conversion to the containers of other libraries.

A result is saved as an ``.npz`` file, which `numpy.load` reads too. It holds the arrays by their
names, and a JSON text, `about`, with the kind of result, its numbers and all units. If a result has
parts, as a `FrictionalResult` does, the name of the part precedes that of the array, as in
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
from typing import Any, BinaryIO, TypeVar, get_args
from xml.etree import ElementTree
from zipfile import ZipFile, ZipInfo

import numpy as np
from numpy.lib.format import (
    read_array,
    read_array_header_1_0,
    read_array_header_2_0,
    read_magic,
)

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.results.consistency import check_array, check_values, find_types
from toeplitz_mg.contact.results.quantities import (
    Quantity,
    fields_on_grid,
    name_units,
    quantities,
    require_whole,
)
from toeplitz_mg.halfspace import CombinedMaterial, Material
from toeplitz_mg.whole_files import check_folder, find_status, new_whole

FORMAT = "toeplitz_mg contact result"  # Identifies a file written by `save`.
LONGEST = 2**24  # Largest size in bytes of the JSON text, and of arrays of any compression ratio.
MOST_COMPRESSED = 100  # Largest compression ratio of longer arrays: fields are not all zeros.
AXES = {"points": "stick_share", "depths": "depths"}  # Arrays whose lengths are sizes of axes.
HEADERS = {(1, 0): read_array_header_1_0, (2, 0): read_array_header_2_0}
TYPES = {"b": "UInt8", "f": "Float64", "i": "Int64"}  # Names of the types in VTK, by dtype kind.

Kind = TypeVar("Kind")
KINDS: dict[str, type] = {}  # Classes that a file, or a part of a result in a file, may have.
Arrays = Iterable[tuple[str, Array]]  # Names and fields; vectors have the component axis first.


def loadable(kind: type[Kind]) -> type[Kind]:
    """Register a class of results for `save` and `load`: a decorator."""
    KINDS[kind.__name__] = kind
    return kind


def save(result: Any, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write the whole result with its units to an ``.npz`` file.

    Parameters
    ----------
    path : str or path
        Must end in ``.npz``.
    overwrite : bool
        Whether to replace an existing file. A write that fails leaves no partial file.

    Raises
    ------
    FileExistsError
        If the file exists and `overwrite` is false; it is left unchanged.
    OSError, ValueError
        If the file cannot be written, or its name does not end in ``.npz``.

    See Also
    --------
    load : reads the file.
    """
    result._complete("save()")
    arrays, about = _describe(result)
    text = json.dumps({"format": FORMAT} | about, ensure_ascii=False, indent=1)
    everything: dict[str, Any] = arrays | {"about": np.array(text)}
    with new_file(path, ".npz", overwrite=overwrite) as file:
        np.savez(file, **everything)


def load(path: str | os.PathLike[str]) -> Any:
    """Read a result written by its `save` method.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    NormalResult, TangentialResult, FrictionalResult, Stresses, CreepCurve, LoadCurve, RollingSteps
        The saved result.

    Raises
    ------
    OSError
        If there is no such file.
    ValueError
        If the file was not written by `save`.

    See Also
    --------
    NormalResult : `save` is a method of this and all other results.

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
                arrays = _Arrays(file.zip)
                return _compose(arrays, _read_about(arrays))
    except OSError:
        raise
    except Exception as error:  # NumPy, zipfile and json raise many kinds.
        said = "" if "pickle" in str(error) else f": {error}"  # NumPy advises to unpickle.
        raise ValueError(f"{path} is not a file of a contact result{said}") from error


def _read_about(arrays: "_Arrays") -> dict[str, Any]:
    """Return the content of the JSON text of a file."""
    wanted = f"but must be {FORMAT!r}, as `save` writes it"
    if "about" not in arrays:
        raise ValueError(f"it names no format, {wanted}")
    shape, dtype = arrays.header("about")
    if shape or dtype.kind != "U" or dtype.itemsize > LONGEST:
        raise ValueError(
            f"about is of type {dtype} and shape {shape}, but must be one text of {LONGEST} bytes "
            "at most"
        )
    about = json.loads(str(arrays.take("about")), parse_int=_read_integer)
    found = about.get("format") if isinstance(about, dict) else None
    if found != FORMAT:
        raise ValueError(f"its format is {found!r}, {wanted}")
    return dict(about)


def _read_integer(text: str) -> float:
    """Return an integer; as a float if it is too long for NumPy's integers."""
    return int(text) if len(text) < 19 else float(text)


class _Arrays:
    """The arrays of a file, which are checked and read one by one on request.

    Parameters
    ----------
    file : ZipFile
    prefix : str
        What the array names of a part start with.
    """

    def __init__(self, file: ZipFile, prefix: str = "") -> None:
        self._file, self._prefix = file, prefix

    def of_part(self, name: str) -> "_Arrays":
        """Return the arrays of a part of the result."""
        return _Arrays(self._file, f"{self._prefix}{name}_")

    def __contains__(self, name: str) -> bool:
        return f"{self._prefix}{name}.npy" in self._file.namelist()

    def length(self, name: str) -> tuple[int, ...]:
        """Return the shape of a 1D array without reading its data."""
        shape = self.header(name)[0]
        if len(shape) != 1 or not shape[0]:
            raise ValueError(f"{name} has shape {shape}, but must have one axis")
        return shape

    def read(self, name: str, quantity: Quantity, sizes: Mapping[str, tuple[int, ...]]) -> Array:
        """Return an array after checking its shape and type against its quantity."""
        check_array(name, *self.header(name), quantity, sizes)
        array = self.take(name)
        return array.astype(array.dtype.newbyteorder("="), copy=False)

    def take(self, name: str) -> Array:
        """Return an array, if its size in the file matches its header."""
        shape, dtype = self.header(name)
        member = self._find(name)
        if member.file_size > max(LONGEST, MOST_COMPRESSED * member.compress_size):
            raise ValueError(
                f"{name} has {member.file_size} bytes, compressed to {member.compress_size}, but "
                f"must have at most {MOST_COMPRESSED} times as many, as numbers have"
            )
        with self._file.open(member) as opened:
            HEADERS[read_magic(opened)](opened)
            size = opened.tell() + dtype.itemsize * prod(shape)
            if member.file_size != size:
                raise ValueError(f"{name} has {member.file_size} bytes, but must have {size}")
        with self._file.open(member) as opened:  # Anew: a seek disables the checksum.
            array: Array = read_array(opened, allow_pickle=False)
        return array

    def header(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
        """Return the shape and the dtype of an array without reading its data."""
        with self._file.open(self._find(name)) as opened:
            try:
                shape, _, dtype = HEADERS[read_magic(opened)](opened)
            except (KeyError, ValueError):
                raise ValueError(f"{name} is no array of NumPy") from None
        return shape, dtype

    def _find(self, name: str) -> ZipInfo:
        """Return the zip entry of an array, which must occur exactly once."""
        path = f"{self._prefix}{name}.npy"
        found = [one for one in self._file.infolist() if one.filename == path]
        if len(found) != 1:
            raise ValueError(f"{name} is there {len(found)} times, but must be once")
        return found[0]


def _describe(result: Any) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return the arrays of a result or part, and a dictionary for JSON with everything else."""
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
    about: Mapping[str, Any],
    sizes: Mapping[str, tuple[int, ...]] | None = None,
) -> Any:
    """Return the result that `_describe` has described, after checking it against the grid."""
    name = about.get("kind")
    if not isinstance(name, str) or name not in KINDS:
        raise ValueError(f"its kind is {name!r}, but must be one of {', '.join(KINDS)}")
    kind = KINDS[name]
    given = {name: _thaw(value) for name, value in _take(about, "values").items()}
    check_values(kind, given)
    sizes = dict(sizes or {}) | _find_sizes(kind, arrays, given)
    types = find_types(kind)
    for k, (name, part) in enumerate(_take(about, "parts").items()):
        allowed = (types.get(name), *get_args(types.get(name)))
        if "results" in types and name == f"result_{k}":
            allowed = (kind._kind,)  # type: ignore[attr-defined]
        wanted = [one.__name__ for one in allowed if one in KINDS.values()]
        if not isinstance(part, dict) or part.get("kind") not in wanted:
            raise ValueError(f"{name} is no part of a {kind.__name__}, or of another kind")
        try:
            given[name] = _compose(arrays.of_part(name), part, sizes)
        except (ValueError, TypeError) as error:
            raise ValueError(f"of its part {name}, {error}") from error
        sizes.setdefault("grid", getattr(given[name], "shape", ()))
    if "material" in types:
        given["material"] = _read_material(_take(about, "material"))
    if "centres" in types:
        place = Quantity("mm", "axis")
        given["centres"] = tuple(
            arrays.read(name, place, {"axis": (n,)})
            for name, n in zip("xy", sizes["grid"], strict=False)
        )
    for name, quantity in quantities(kind).items():
        if quantity.axes and name in arrays:
            if name in given:
                raise ValueError(f"{name} is there as an array and as a value, but must be once")
            given[name] = arrays.read(name, quantity, sizes)
    if "results" in types:
        given["results"] = [given.pop(name) for name in about["parts"]]
    for name in types:
        if name not in given:
            raise ValueError(f"{name} is missing, but a {kind.__name__} has it")
    return kind(**given)


def _take(about: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the entry of the JSON text under a name."""
    found = about.get(name)
    if not isinstance(found, dict):
        raise ValueError(f"its {name} is {found!r:.50}, but must be an object of JSON")
    return found


def _find_sizes(
    kind: type, arrays: _Arrays, given: Mapping[str, Any]
) -> dict[str, tuple[int, ...]]:
    """Return the sizes of the axes that the fields of a result or part may have."""
    types = find_types(kind)
    sizes = {name: arrays.length(of) for name, of in AXES.items() if of in types}
    if "shape" in types:
        sizes["grid"] = given.get("shape", ())
    elif "centres" in types:
        sizes["grid"] = tuple(n for name in "xy" if name in arrays for n in arrays.length(name))
    if "grid" in sizes and (len(sizes["grid"]) not in (1, 2) or min(sizes["grid"]) < 1):
        raise ValueError(f"its grid has shape {sizes['grid']}, but must have one axis or two")
    return sizes


def import_extra(name: str, method: str) -> Any:
    """Return xarray or pandas, which are optional and slow to import, or raise ImportError."""
    try:
        return import_module(name)
    except ImportError as error:
        raise ImportError(f"{method}() needs {name}: pip install 'toeplitz-mg[xarray]'") from error


def _parts(result: Any) -> dict[str, Any]:
    """Return the parts of a result that have fields of their own; for a curve, its results."""
    own = {field.name: vars(result)[field.name] for field in fields(result)}
    own |= {f"result_{k}": part for k, part in enumerate(own.get("results", ()))}
    return {k: value for k, value in own.items() if k != "material" and is_dataclass(value)}


def _list_parts(result: Any) -> dict[str, Any]:
    """Return the parts of a result that are results."""
    return {name: part for name, part in _parts(result).items() if "centres" in vars(part)}


def _split_fields(result: Any) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return the arrays of a result by name, and its other values except its parts."""
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
        Scalars are stored in its `attrs`.
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
    """Return the combined constants by name, and those of the bodies, as in `G_1`."""
    constants = asdict(material)
    for k, body in enumerate(constants.pop("bodies") or (), 1):
        constants |= {f"{name}_{k}": value for name, value in body.items()}
    return constants


def _keep_in_netcdf(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values in a form that netCDF can store; others are omitted."""
    kept: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, bool):
            kept[name] = int(value)
        elif name == "warnings":
            kept[name] = "\n".join(value)
        elif value not in (None, ()):
            kept[name] = value
    return kept


def _read_material(values: Mapping[str, Any]) -> CombinedMaterial:
    """Return the combined constants, and the bodies if the file has them."""
    wanted = [field.name for field in fields(CombinedMaterial)]
    if sorted(values) != sorted(wanted):
        raise ValueError(f"its material has {', '.join(values)}, but must have {', '.join(wanted)}")
    bodies = values["bodies"]
    try:
        if bodies is not None:
            first, second = (
                Material.rigid() if np.isinf(body["G"]) else Material.from_shear(**body)
                for body in bodies
            )
            bodies = first, second
        return CombinedMaterial(**{**values, "bodies": bodies})
    except (TypeError, ValueError, KeyError) as error:
        raise ValueError(f"its material cannot be: {error}") from error


def _thaw(value: Any) -> Any:
    """Convert the lists of JSON to tuples."""
    return tuple(map(_thaw, value)) if isinstance(value, list) else value


@contextmanager
def new_file(path: str | os.PathLike[str], ending: str, *, overwrite: bool) -> Iterator[BinaryIO]:
    """Open a file that appears under its name only when complete; see `save` for `overwrite`."""
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
    except FileExistsError:  # Created by someone else in the meantime.
        raise there from None


def to_vtk(result: Any, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write the fields as a VTK image (``.vti``) for ParaView or PyVista.

    Parameters
    ----------
    path : str or path
        Must end in ``.vti``.
    overwrite : bool
        Whether to replace an existing file.

    Raises
    ------
    FileExistsError, OSError, ValueError
        As for `save`.
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
    """Write the stresses as a VTK grid (``.vtr``) for ParaView or PyVista; z is the depth.

    Parameters
    ----------
    path : str or path
        Must end in ``.vtr``.
    overwrite : bool
        Whether to replace an existing file.

    Raises
    ------
    FileExistsError, OSError, ValueError
        As for `save`; also if the depths are not in increasing order.
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
    """Return an XML tree, and its piece, with these arrays of point or cell data."""
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
    """Return vectors with three components."""
    return np.concatenate([x, np.zeros((3 - len(x), *x.shape[1:]))])


def _encode_for_vtk(name: str, x: Array) -> ElementTree.Element:
    """Return a field in VTK's layout: components first, then the first axis varying fastest."""
    element = ElementTree.Element("DataArray", Name=name, type=TYPES[x.dtype.kind])
    element.set("format", "binary")
    if len(x) > 1:
        element.set("NumberOfComponents", str(len(x)))
    data = np.ascontiguousarray(x.T)
    data = data.astype(data.dtype.newbyteorder("<"), copy=False)
    size = np.array(data.nbytes, "<u8")
    element.text = base64.b64encode(size.tobytes() + data.tobytes()).decode()
    return element
