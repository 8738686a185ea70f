"""The arguments of distributions: numbers, means, and series with gaps."""

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.values import numbers, refuse_masked

SHOWN = 5  # Positions that an error names.


def check_mean(mean: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return means of this shape."""
    array = numbers("mean", mean)
    if not np.isfinite(array).all():
        raise ValueError("mean is not finite somewhere")
    try:
        return np.broadcast_to(array, shape)
    except ValueError:
        raise ValueError(
            f"mean has shape {array.shape}, but must broadcast to that of c, {shape}"
        ) from None


def check_series(
    y: ArrayLike, observed: ArrayLike | None, mean: Array, *, has_gaps: bool = True
) -> tuple[Array, Mask | None]:
    """Return y - mean, zero where it is not observed, of one or many series; and the mask."""
    residual = numbers("y", y)
    shape = mean.shape
    if residual.shape[max(residual.ndim - len(shape), 0) :] != shape:
        raise ValueError(
            f"y has shape {residual.shape}, but its last axes must be those of c, {shape}"
        )
    mask = None if observed is None else check_observed(observed, shape)
    residual -= mean
    if mask is not None:
        residual[..., ~mask] = 0.0
    wrong = ~np.isfinite(residual)
    if wrong.any():
        _refuse_positions(wrong, has_gaps and mask is None)
    return residual, mask


def check_observed(observed: ArrayLike, shape: tuple[int, ...]) -> Mask:
    """Return a copy, that cannot be changed, of the mask of what is observed."""
    mask = refuse_masked("observed", observed)
    if mask.dtype != np.bool_:
        raise TypeError(f"observed has dtype {mask.dtype}, but must be of booleans")
    if mask.shape != shape:
        raise ValueError(f"observed has shape {mask.shape}, but must have that of c, {shape}")
    if not mask.any():
        raise ValueError("y is observed nowhere, but must be somewhere")
    mask = mask.copy()
    mask.flags.writeable = False
    return mask


def _refuse_positions(wrong: Array, everywhere: bool) -> None:
    """Raise the ValueError that says where y is not finite."""
    positions = [tuple(map(int, p)) if len(p) > 1 else int(p[0]) for p in np.argwhere(wrong)]
    named = ", ".join(map(str, positions[:SHOWN]))
    more = f" and {len(positions) - SHOWN} more positions" if len(positions) > SHOWN else ""
    advice = ": say what is observed, as by observed=~np.isnan(y)" if everywhere else ""
    raise ValueError(f"y is not finite at {named}{more}, but must be where it is observed{advice}")
