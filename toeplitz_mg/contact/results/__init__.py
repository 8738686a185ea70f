"""Results of contact problems, and the error raised if none is found."""

from toeplitz_mg.contact.results.both import Before, FrictionalResult
from toeplitz_mg.contact.results.errors import ContactError, ContactResult, check_converged
from toeplitz_mg.contact.results.normal import NormalResult
from toeplitz_mg.contact.results.tangential import TangentialResult

__all__ = [
    "Before",
    "ContactError",
    "ContactResult",
    "FrictionalResult",
    "NormalResult",
    "TangentialResult",
    "check_converged",
]
