"""The error raised if a contact problem is not solved."""

from typing import Any, TypeVar

from toeplitz_mg.contact.results.normal import NormalResult
from toeplitz_mg.contact.results.tangential import TangentialResult

ContactResult = NormalResult | TangentialResult  # Of one contact problem.
Result = TypeVar("Result", NormalResult, TangentialResult)


class ContactError(RuntimeError):
    """The iteration did not converge: the areas of contact, stick or slip were not found.

    Attributes
    ----------
    result : NormalResult or TangentialResult
        The last iterate, with its `residual`.

    See Also
    --------
    ContactWarning : warns of input that may not be what was meant.
    """

    def __init__(self, message: str, result: ContactResult) -> None:
        super().__init__(message)
        self.result = result

    def __reduce__(self) -> tuple[Any, ...]:
        """Support pickling, by which errors reach other processes."""
        return type(self), (*self.args, self.result)


def check_converged(result: Result, tolerance: float, reached: str = "") -> Result:
    """Return the result, or raise ContactError if it violates the conditions of contact.

    The message ends with `reached`, which says how much of the given load was reached.
    """
    if result.residual <= tolerance:
        return result
    law, scale = ("Coulomb's law is", "displacement, or rigid slip")
    if isinstance(result, NormalResult):
        law, scale = ("the conditions of contact are", "interference")
    raise ContactError(
        f"after {result.products} products {law} violated by {result.residual:.1e} of the largest "
        f"{scale}, but the tolerance is {tolerance:g}{reached}",
        result,
    )
