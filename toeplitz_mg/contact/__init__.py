"""What the solvers are for: contact of elastic half-spaces."""

from toeplitz_mg.contact import problems, surfaces
from toeplitz_mg.contact.doubts import ContactWarning
from toeplitz_mg.contact.friction import friction
from toeplitz_mg.contact.normal import normal_contact
from toeplitz_mg.contact.result import ContactError, ContactResult
from toeplitz_mg.contact.rolling import rolling, rolling_steps

__all__ = [
    "ContactError",
    "ContactResult",
    "ContactWarning",
    "friction",
    "normal_contact",
    "problems",
    "rolling",
    "rolling_steps",
    "surfaces",
]
