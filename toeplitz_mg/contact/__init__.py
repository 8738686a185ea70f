"""Contact mechanics of elastic half-spaces: normal contact, friction and rolling."""

from toeplitz_mg.contact import surfaces
from toeplitz_mg.contact.curves import LoadCurve, RollingSteps
from toeplitz_mg.contact.doubts import ContactWarning
from toeplitz_mg.contact.interface import interfacial_stiffness
from toeplitz_mg.contact.normal.problem import load_curve, normal_contact
from toeplitz_mg.contact.results import (
    ContactError,
    ContactResult,
    FrictionalResult,
    NormalResult,
    TangentialResult,
)
from toeplitz_mg.contact.results.files import load
from toeplitz_mg.contact.subsurface import Stresses, subsurface_stresses
from toeplitz_mg.contact.tangential.friction import friction
from toeplitz_mg.contact.tangential.rolling import rolling
from toeplitz_mg.contact.tangential.solving import SteadyOptions
from toeplitz_mg.contact.tangential.steps import rolling_steps
from toeplitz_mg.contact.tangential.tables import (
    CreepCurve,
    KalkerCoefficients,
    creep_curve,
    kalker_coefficients,
)
from toeplitz_mg.contact.theory import HertzContact, hertz
from toeplitz_mg.contact.unlike.frictional import frictional_contact, frictional_rolling
from toeplitz_mg.halfspace import Material
from toeplitz_mg.paper import problems

__all__ = [
    "ContactError",
    "ContactResult",
    "ContactWarning",
    "CreepCurve",
    "FrictionalResult",
    "HertzContact",
    "KalkerCoefficients",
    "LoadCurve",
    "Material",
    "NormalResult",
    "RollingSteps",
    "SteadyOptions",
    "Stresses",
    "TangentialResult",
    "creep_curve",
    "friction",
    "frictional_contact",
    "frictional_rolling",
    "hertz",
    "interfacial_stiffness",
    "kalker_coefficients",
    "load",
    "load_curve",
    "normal_contact",
    "problems",
    "rolling",
    "rolling_steps",
    "subsurface_stresses",
    "surfaces",
]


def __dir__() -> list[str]:
    return __all__
