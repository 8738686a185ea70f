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
    b = _load_right_hand_side(options.rhs)
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
    array = files.load(path)
    if array.dtype.kind not in "buif":
        raise ValueError(f"{path} has dtype {array.dtype}, but must be of real numbers")
    return array


def _load_mask(path: Path) -> Array:
    """Read a mask of booleans, or of 0 and 1."""
    mask = files.load(path)
    if mask.dtype.kind in "uif" and np.isin(mask, (0, 1)).all():
        return mask.astype(bool)
    if mask.dtype != np.bool_:
        raise ValueError(f"{path} has dtype {mask.dtype}, but must be of booleans, or of 0 and 1")
    return mask


def _load_right_hand_side(path: Path) -> Array:
    b = _load_real(path)
    if not np.isfinite(b).all():
        raise ValueError(f"{path} has entries that are not finite")
    return b.astype(np.float32 if b.dtype == np.float32 else np.float64)
