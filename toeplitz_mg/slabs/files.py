"""Files that all ranks write together, completely or not at all."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import library_of
from toeplitz_mg.values import refuse_masked
from toeplitz_mg.whole_files import (
    check_folder,
    complete,
    find_part,
    find_status,
    find_target,
    new_part,
)


def save_rows(slab: Any, path: str | os.PathLike[str], x: Any) -> None:
    """Write a field to a ``.npy`` file, each rank its rows, on a disk that all ranks share.

    The file is written completely, or left as it was.

    Parameters
    ----------
    path : str or PathLike
        The same on all ranks. An old file is replaced when all ranks have written; its permissions
        are kept, and a link stays a link. Read it by ``np.load(path, mmap_mode="r")[slab.rows]``.
    x : array_like of shape ``slab.local``, or (components, ...) of that
        Numbers.
    """
    with slab.agree() as same:
        path = Path(path)
        x = refuse_masked("x", library_of(x).to_numpy(x))
        _check(path, x, slab)
        components = x.shape[: x.ndim - len(slab.local)]
        same["path"], same["the dtype of x"] = str(path), x.dtype
        same["the components of x"] = components
    head = BytesIO()
    about = {"descr": np.lib.format.dtype_to_descr(x.dtype), "fortran_order": False}
    np.lib.format.write_array_header_1_0(head, {**about, "shape": (*components, *slab.shape)})
    token = int(slab.gather(int.from_bytes(os.urandom(6), "big"))[0])  # That of rank 0.
    target = find_target(path)
    part = find_part(target, f"{token:012x}")
    try:
        with _together(slab, path):
            if not slab.comm.rank:
                with new_part(part, find_status(path)) as file:
                    file.write(head.getvalue())
                    file.truncate(file.tell() + prod(components) * prod(slab.shape) * x.itemsize)
        with _together(slab, path):
            _write(part, head.tell(), x.reshape(prod(components), *slab.local), slab)
        with _together(slab, path):
            if not slab.comm.rank:
                os.replace(part, target)
    finally:
        if not slab.comm.rank:
            part.unlink(missing_ok=True)


@contextmanager
def _together(slab: Any, path: Path) -> Iterator[None]:
    """If an OSError occurs on one rank, raise it on all, with the name of the file."""
    with slab.agree():
        try:
            yield
        except OSError as error:
            raise OSError(f"{path} cannot be written: {error.strerror or error}") from error


def _check(path: Path, x: Array, slab: Any) -> None:
    """Refuse an array that is not a field on this rank's rows, or cannot be written."""
    if x.dtype.kind not in "buifc":
        raise TypeError(f"x has dtype {x.dtype}, but must be of numbers")
    if x.shape[-len(slab.local) :] != slab.local:
        raise ValueError(f"x has shape {x.shape}, but must end in that of its rows, {slab.local}")
    if slab.comm.rank == 0:
        old = find_status(path)
        if old is not None and not stat.S_ISREG(old.st_mode):
            raise OSError(f"{path} is not a regular file, but must be one for ranks to write it")
        check_folder(path)


def _write(part: Path, start: int, X: Array, slab: Any) -> None:
    """Write this rank's rows of each component to their place in the file."""
    row = prod(slab.shape[1:]) * X.itemsize
    with open(part, "r+b") as file:
        for k, x in enumerate(X):
            file.seek(start + (k * slab.shape[0] + slab.rows.start) * row)
            file.write(np.ascontiguousarray(x).data)
        complete(file)
