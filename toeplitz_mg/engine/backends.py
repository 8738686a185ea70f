"""The backends of `scipy.fft` that are set in a thread, for other threads that work for it.

``scipy.fft.set_backend`` sets one in the thread that calls it. What hands it on is no public name
of SciPy's: no other file knows of it.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from typing import Any

from scipy import fft

uarray: Any = getattr(getattr(fft, "_backend", None), "ua", None)


def chosen_backends() -> Callable[[], AbstractContextManager[None]] | None:
    """Return what makes a context in which any thread has the backends that this one has.

    It is None where this SciPy hands them on by other names: then no thread may do what another
    was asked for.
    """
    try:
        return partial(uarray.set_state, uarray.get_state())
    except AttributeError:
        return None
