"""``toeplitz-mg solve``: a system of the user's own, from files."""

import argparse
from pathlib import Path

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg import MaskedOperator, ToeplitzOperator
from toeplitz_mg._typing import Array
from toeplitz_mg.cli import files, linear
from toeplitz_mg.cli.arguments import complete
from toeplitz_mg.cli.linear import System


def run(given: argparse.Namespace) -> int:
    """Run the command, and return the exit status."""
    options = complete(given)
    A: LinearOperator = ToeplitzOperator(_load_real(options.column))
    if options.mask is not None:
        A = MaskedOperator(A, _load_mask(options.mask))
    b = _load_real(options.rhs)
    on_grid = options.mask is not None and b.shape == A.grid_shape
    if on_grid:
        b = b[A.mask]
    elif b.size == A.shape[0] and b.shape in (A.grid_shape, (A.shape[0],)):
        b = b.ravel()
    else:
        raise ValueError(
            f"{options.rhs} has shape {b.shape}, but the unknowns are {A.shape[0]} "
            f"on the grid {A.grid_shape}"
        )
    title = f"{options.column} with {A.shape[0]} unknowns"
    return linear.run(System(title, A, b, on_grid=on_grid), options)


def _load_real(path: Path) -> Array:
    """Read real numbers, in double precision: no less has the residual that is asked for."""
    array = files.load(path)
    if array.dtype.kind not in "buif":
        raise ValueError(f"{path} has dtype {array.dtype}, but must be of real numbers")
    wrong = np.argwhere(~np.isfinite(array))
    if wrong.size:
        place = tuple(wrong[0].tolist())
        raise ValueError(f"{path} has the value {array[place]} at {place}, but must be finite")
    return array.astype(np.float64)


def _load_mask(path: Path) -> Array:
    """Read a mask of booleans, or of 0 and 1."""
    mask = files.load(path)
    if mask.dtype == np.bool_:
        return mask
    if mask.dtype.kind not in "uif":
        raise ValueError(f"{path} has dtype {mask.dtype}, but must be of booleans, or of 0 and 1")
    others = mask[(mask != 0) & (mask != 1)]
    if others.size:
        raise ValueError(f"{path} has the value {others[0]:g}, but must be of 0 and 1")
    return mask.astype(bool)
