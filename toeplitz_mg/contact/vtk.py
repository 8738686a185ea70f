"""Fields in files of VTK, which ParaView and PyVista read."""

import base64
import os
from collections.abc import Iterable
from typing import Any
from xml.etree import ElementTree

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.saving import list_parts, new_file, split_fields

TYPES = {"b": "UInt8", "f": "Float64", "i": "Int64"}  # Those of VTK, by the kind of a dtype.
Arrays = Iterable[tuple[str, Array]]  # Names and fields, whose first axis is that of components.


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
    arrays, _ = split_fields(result)
    for name, part in list_parts(result).items():
        arrays |= {f"{name}_{key}": x for key, x in split_fields(part)[0].items()}
        result = part
    shape, axes = result.contact.shape, len(result.contact.shape)
    sizes = (*result.element[:axes], *(1.0,) * (3 - axes))
    origin = (*(x[0] - h / 2.0 for x, h in zip(result.centres, sizes, strict=False)), 0.0, 0.0)[:3]
    place = {"Origin": " ".join(f"{x!r}" for x in map(float, origin))}
    place |= {"Spacing": " ".join(f"{h!r}" for h in sizes)}
    fields = [(name, x) for name, x in arrays.items() if x.shape[-axes:] == shape]
    vectors = ((name, _complete(x) if x.ndim > axes else x[None]) for name, x in fields)
    extent = " ".join(f"0 {n}" for n in (*shape, 0, 0)[:3])
    root, _ = _describe("ImageData", extent, place, "CellData", vectors)
    _write(root, path, ".vti", overwrite=overwrite)


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
    root, piece = _describe("RectilinearGrid", extent, {}, "PointData", fields)
    coordinates = ElementTree.SubElement(piece, "Coordinates")
    for name, values in (("x", x), ("y", y), ("depth", stresses.depths)):
        coordinates.append(_encode(name, values[None]))
    _write(root, path, ".vtr", overwrite=overwrite)


def _describe(
    kind: str, extent: str, place: dict[str, str], of: str, arrays: Arrays
) -> tuple[ElementTree.Element, ElementTree.Element]:
    """Return a file, and its piece, with these arrays of its points or cells."""
    about = {"type": kind, "version": "1.0", "byte_order": "LittleEndian"}
    root = ElementTree.Element("VTKFile", about, header_type="UInt64")
    whole = ElementTree.SubElement(root, kind, place, WholeExtent=extent)
    piece = ElementTree.SubElement(whole, "Piece", Extent=extent)
    data = ElementTree.SubElement(piece, of)
    for name, x in arrays:
        data.append(_encode(name, x))
    return root, piece


def _write(
    root: ElementTree.Element, path: str | os.PathLike[str], ending: str, *, overwrite: bool
) -> None:
    with new_file(path, ending, overwrite=overwrite) as file:
        ElementTree.ElementTree(root).write(file, encoding="utf-8", xml_declaration=True)


def _complete(x: Array) -> Array:
    """Return vectors of three components."""
    return np.concatenate([x, np.zeros((3 - len(x), *x.shape[1:]))])


def _encode(name: str, x: Array) -> ElementTree.Element:
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
