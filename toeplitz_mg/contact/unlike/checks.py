"""Checks of contact with friction of unlike materials: what is given, and what was found."""

from toeplitz_mg.contact.result import ContactError, FrictionalResult, check_converged
from toeplitz_mg.values import real


def check_friction(mu: float) -> float:
    """Return a coefficient of friction, or say what is wrong with it."""
    mu = real("mu", mu)
    if not mu >= 0.0:
        raise ValueError(f"mu is {mu}, but a coefficient of friction is at least zero")
    return mu


def check_both(result: FrictionalResult, tolerance: float) -> FrictionalResult:
    """Return the result, or raise ContactError where it violates a condition."""
    check_converged(result.tangential, tolerance)
    if result.residual <= tolerance:
        return result
    raise ContactError(
        f"after {len(result.residuals)} iterations between pressures and friction the conditions "
        f"of contact are violated by {result.residual:.1e} of the largest interference, but the "
        f"tolerance is {tolerance:g}",
        result.normal,
    )
