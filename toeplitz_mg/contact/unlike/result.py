"""What contact with friction of unlike materials has for an answer."""

from dataclasses import dataclass
from typing import NamedTuple

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.result import (
    ContactError,
    NormalResult,
    TangentialResult,
    check_converged,
)
from toeplitz_mg.values import real


class Before(NamedTuple):
    """Tractions before a step, with the force and the approach that pressed."""

    traction: Array
    force: float
    approach: float


@dataclass(frozen=True, eq=False)
class FrictionalResult:
    """Bodies that are pressed together with friction: what holds across, and what along.

    Attributes
    ----------
    normal : NormalResult
        Pressures, contact, approach; the displacement is that by tractions too.
    tangential : TangentialResult
        Tractions, slip, stick; the displacement is that by pressures too.
    residuals : tuple of float
        The largest violation of the conditions of normal contact, over the largest interference,
        in each iteration between the two problems.
    before : Before or None
        The state before this step; None in rolling.

    See Also
    --------
    NormalResult : without friction.
    TangentialResult : of bodies that were pressed before.
    """

    normal: NormalResult
    tangential: TangentialResult
    residuals: tuple[float, ...]
    before: Before | None = None

    @property
    def residual(self) -> float:
        """The violation that is left."""
        return self.residuals[-1]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Why the answer may not be of the problem that was meant."""
        return self.normal.warnings + self.tangential.warnings

    def summary(self) -> str:
        """Return the figures of both results with their units, a line each."""
        return f"{self.normal.summary()}\n\n{self.tangential.summary()}"

    def _repr_html_(self) -> str:
        return self.normal._repr_html_() + self.tangential._repr_html_()


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
