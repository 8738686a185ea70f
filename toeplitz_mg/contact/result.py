"""What contact problems have for answers, and the error where they have none."""

import os
from typing import Any, TypeVar

from toeplitz_mg._typing import Mask
from toeplitz_mg.contact import saving
from toeplitz_mg.contact.normal.result import NormalResult
from toeplitz_mg.contact.tangential.result import TangentialResult
from toeplitz_mg.contact.unlike.result import Before, FrictionalResult

__all__ = [
    "ContactError",
    "ContactResult",
    "FrictionalResult",
    "NormalResult",
    "TangentialResult",
    "check_converged",
    "load",
    "touches_edge",
]

ContactResult = NormalResult | TangentialResult  # Of any contact problem.
# What a file may have, and what a result in a file may have for a part.
KINDS: dict[str, type] = {
    kind.__name__: kind for kind in (NormalResult, TangentialResult, FrictionalResult, Before)
}
Result = TypeVar("Result", NormalResult, TangentialResult)


def load(path: str | os.PathLike[str]) -> ContactResult | FrictionalResult:
    """Read a result that `save` has written.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    NormalResult, TangentialResult or FrictionalResult

    Raises
    ------
    OSError
        Where there is no such file.
    ValueError
        Where it is another file than of `save`.

    See Also
    --------
    NormalResult.save, TangentialResult.save, FrictionalResult.save

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
    return saving.load_result(path, KINDS)


class ContactError(RuntimeError):
    """The areas of contact, stick or slip were not found to the tolerance.

    Attributes
    ----------
    result : NormalResult or TangentialResult
        The last iterate, with its `residual`.

    See Also
    --------
    ContactWarning : doubt of an answer that was found.
    """

    def __init__(self, message: str, result: ContactResult) -> None:
        super().__init__(message)
        self.result = result


def check_converged(result: Result, tolerance: float) -> Result:
    """Return the result, or raise ContactError where it violates the conditions of contact."""
    if result.residual <= tolerance:
        return result
    law, scale = ("Coulomb's law is", "displacement, or rigid slip")
    if isinstance(result, NormalResult):
        law, scale = ("the conditions of contact are", "interference")
    raise ContactError(
        f"after {result.products} products {law} violated by {result.residual:.1e} of the largest "
        f"{scale}, but the tolerance is {tolerance:g}",
        result,
    )


def touches_edge(grid: Any, contact: Mask) -> bool:
    """Whether elements in contact are at an edge of the grid, along an axis of more than one."""
    return any(
        n > 1
        and not grid.periodic[axis]
        and grid.vectors.count(grid.lines(contact, axis)[..., :: n - 1])
        for axis, n in enumerate(grid.shape)
    )
