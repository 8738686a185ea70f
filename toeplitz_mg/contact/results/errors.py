"""The error of contact problems without an answer."""

from typing import Any, TypeVar

from toeplitz_mg.contact.results.normal import NormalResult
from toeplitz_mg.contact.results.tangential import TangentialResult

ContactResult = NormalResult | TangentialResult  # Of any contact problem.
Result = TypeVar("Result", NormalResult, TangentialResult)


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

    def __reduce__(self) -> tuple[Any, ...]:
        """Say how it is made anew, as where another process has raised it."""
        return type(self), (*self.args, self.result)


def check_converged(result: Result, tolerance: float, reached: str = "") -> Result:
    """Return the result, or raise ContactError where it violates the conditions of contact.

    What has been `reached` of what was given ends the message.
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
