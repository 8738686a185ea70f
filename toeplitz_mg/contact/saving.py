"""Results in files, and in the containers of other libraries.

A result is an ``.npz`` file of its arrays by their names, which `numpy.load` reads too, and of a
text in JSON, `about`: what kind of result it is, its numbers, and the units of all. Of a result
with parts, as `FrictionalResult`, the name of the part comes before that of its array, as in
`normal_pressure`. `save` and `to_xarray` are methods of all kinds of results.
"""

import json
import os
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.fields import require_whole
from toeplitz_mg.contact.units import name_units
from toeplitz_mg.halfspace import CombinedMaterial, Material
from toeplitz_mg.whole_files import check_folder, find_status, new_whole

FORMAT = "toeplitz_mg contact result"  # What a file of ours says that it is.


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
    arrays, about = _describe(result)
    text = json.dumps({"format": FORMAT} | about, ensure_ascii=False, indent=1)
    everything: dict[str, Any] = arrays | {"about": np.array(text)}
    with new_file(path, ".npz", overwrite=overwrite) as file:
        np.savez(file, **everything)


def load_result(path: str | os.PathLike[str], kinds: Mapping[str, type]) -> Any:
    """Read a result of one of some kinds, by their names (see `contact.load`)."""
    path = Path(path)
    try:
        with path.open("rb") as opened:
            file = np.load(opened, allow_pickle=False)
            if isinstance(file, np.ndarray):
                raise ValueError("it is a single array")
            with file:
                arrays = {name: file[name] for name in file.files}
        about = json.loads(str(arrays.pop("about", "{}")))
        if about.get("format") != FORMAT:
            found = (
                f"its format is {about['format']!r}" if "format" in about else "it names no format"
            )
            raise ValueError(f"{found}, but must be {FORMAT!r}, as `save` of a result writes it")
        return _compose(arrays, about, kinds)
    except OSError:
        raise
    except Exception as error:  # NumPy, zip files and JSON raise many.
        said = "" if "pickle" in str(error) else f": {error}"  # NumPy advises to unpickle anything.
        raise ValueError(f"{path} is not a file of a contact result{said}") from error


def _describe(result: Any) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return the arrays of a result, or of a part of one, and in words and numbers the rest."""
    arrays, values = split_fields(result)
    about: dict[str, Any] = {"kind": type(result).__name__, "values": values, "parts": {}}
    if "material" in vars(result):
        about |= {"material": asdict(result.material), "units": name_units(result)}
    elif hasattr(result, "units"):
        about |= {"units": result.units}
    for name, part in _parts(result).items():
        own, about["parts"][name] = _describe(part)
        arrays |= {f"{name}_{key}": x for key, x in own.items()}
    return arrays, about


def _compose(arrays: dict[str, Array], about: dict[str, Any], kinds: Mapping[str, type]) -> Any:
    """Return what `_describe` has described."""
    given = {name: _thaw(value) for name, value in about["values"].items()}
    for name, part in about.get("parts", {}).items():
        own = {key: arrays.pop(key) for key in [*arrays] if key.startswith(f"{name}_")}
        own = {key.removeprefix(f"{name}_"): x for key, x in own.items()}
        given[name] = _compose(own, part, kinds)
    if "material" in about:
        given["material"] = _read_material(about["material"])
    if "x" in arrays:
        given["centres"] = tuple(arrays.pop(name) for name in "xy" if name in arrays)
    if about["kind"] not in kinds:
        raise ValueError(f"its kind is {about['kind']!r}, but must be one of {', '.join(kinds)}")
    return kinds[about["kind"]](**given, **arrays)


def import_xarray() -> Any:
    """Return xarray, which is an extra, and slow to import, or say how to install it."""
    try:
        import xarray
    except ImportError as error:
        raise ImportError("to_xarray() needs xarray: pip install 'toeplitz-mg[xarray]'") from error
    return xarray


def _parts(result: Any) -> dict[str, Any]:
    """Return the parts of a result that have fields of their own."""
    own = {field.name: vars(result)[field.name] for field in fields(result)}
    return {k: value for k, value in own.items() if k != "material" and is_dataclass(value)}


def list_parts(result: Any) -> dict[str, Any]:
    """Return the parts of a result that are results."""
    return {name: part for name, part in _parts(result).items() if "centres" in vars(part)}


def split_fields(result: Any) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return the arrays of a result by their names, and its other values but its parts."""
    if "contact" in vars(result):
        require_whole(result)
    arrays: dict[str, Array] = dict(zip("xy", vars(result).get("centres", ()), strict=False))
    values: dict[str, Any] = {}
    parts = _parts(result)
    for field in fields(result):
        if field.name in ("material", "centres", *parts):
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

    Raises
    ------
    ImportError
        Where xarray is not installed: ``pip install 'toeplitz-mg[xarray]'``.
    """
    xarray = import_xarray()
    if parts := {name: to_xarray(part) for name, part in list_parts(result).items()}:
        fields_of = {f"{name}_{k}": x for name, part in parts.items() for k, x in part.items()}
        about = {f"{name}_{k}": x for name, part in parts.items() for k, x in part.attrs.items()}
        return xarray.Dataset(fields_of, attrs=about)
    arrays, values = split_fields(result)
    units, grid = name_units(result), ("x", "y")[: len(result.shape)]
    coordinates: dict[str, Any] = {name: (name, arrays.pop(name), {"units": "mm"}) for name in grid}
    variables: dict[str, Any] = {}
    attributes: dict[str, Any] = {"kind": type(result).__name__}
    for name, x in arrays.items():
        if x.shape[-len(grid) :] != result.contact.shape:
            attributes[name] = x
            continue
        components = ("component",) * (x.ndim - len(grid))
        variables[name] = ((*components, *grid), x, {"units": units[name]})
        if components:
            coordinates["component"] = ("component", ["x", "y"], {})
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
