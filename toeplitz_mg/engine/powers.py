"""Powers of two that scale numbers near 1: that changes no digit of them."""

from typing import Any

import numpy as np


def power_above(size: Any) -> Any:
    """Return the power of two that scales a size, or sizes, to numbers from 1/2 to 1."""
    # Beyond these the scale itself, or its inverse, would over- or underflow.
    return np.clip(np.frexp(size)[1], -1000, 1000)
