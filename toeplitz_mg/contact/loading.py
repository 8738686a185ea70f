"""What contact problems have for answers, from files."""

import os
from typing import Any

from toeplitz_mg.contact.normal.result import NormalResult
from toeplitz_mg.contact.saving import load_result
from toeplitz_mg.contact.stresses import Stresses
from toeplitz_mg.contact.tangential.curves import CreepCurve
from toeplitz_mg.contact.tangential.result import TangentialResult
from toeplitz_mg.contact.unlike.result import Before, FrictionalResult

# What a file may have, and what a result in a file may have for a part.
KINDS: dict[str, type] = {
    kind.__name__: kind
    for kind in (NormalResult, TangentialResult, FrictionalResult, Before, CreepCurve, Stresses)
}


def load(path: str | os.PathLike[str]) -> Any:
    """Read a result that `save` has written.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    NormalResult, TangentialResult, FrictionalResult, CreepCurve or Stresses
        What was saved.

    Raises
    ------
    OSError
        Where there is no such file.
    ValueError
        Where it is another file than of `save`.

    See Also
    --------
    NormalResult.save, TangentialResult.save, FrictionalResult.save, CreepCurve.save, Stresses.save

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
    return load_result(path, KINDS)
