"""What a contact problem has for an answer, and the error where it has none."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array


@dataclass(frozen=True)
class ContactResult:
    """Tractions and displacements, areas, forces, and what they cost.

    Fields have the shape of the grid, (n,) or (n1, n2); tangential ones on a surface have the
    components x and y first, (2, n1, n2).

    Attributes
    ----------
    element : tuple of float
        Size of an element, mm.
    traction : ndarray
        The pressure, or the tangential traction, N/mm².
    displacement : ndarray
        The displacement of both bodies together along the traction, mm, in rolling too. In
        tangential contact it is given, as the slip is, in contact only, and zero elsewhere.
    contact : ndarray of bool
        Where the bodies touch: the pressure is positive, or the traction bound is.
    area : float
        The area of contact, mm²; in plane strain its width, mm.
    force : float or ndarray of shape (2,)
        The sum of the traction, N; in plane strain N per mm of length.
    rigid : float or ndarray
        The motion of the bodies far away: the approach (mm); the shift (mm); in rolling the
        creepages (longitudinal, lateral, spin), the first two dimensionless, the spin in 1/mm, and
        in line contact the longitudinal one alone.
    gap : ndarray or None
        In normal contact, the gap under load, mm: at least zero, and zero in contact, within
        `residual` of the largest interference.
    slip : ndarray or None
        In tangential contact, the slip (Eq. 1): along minus the traction where the bodies slide,
        zero where they stick. It is in mm, in rolling over the distance rolled, dimensionless.
    stick : ndarray of bool or None
        In tangential contact, where the bodies stick.
    bound : ndarray or None
        In tangential contact, the traction bound g, N/mm².
    products : int
        Products with the matrix of this grid; in tangential contact with that of the smallest
        rectangle around the elements in contact.
    work : float
        All work, that on coarser grids, in preconditioners and in transforms of coefficients
        too, in such products.
    iterations : tuple of int
        Iterations of the Krylov method on this grid, between two changes of the areas.
    warnings : tuple of str
        Why the answer may not be of the problem that was meant, each of which is a
        `ContactWarning` too: the grid too small or too coarse, a unit or a sign mistaken, or
        pressures and slopes beyond the theory.
    residual : float
        The largest violation of the conditions of contact, at most the tolerance. It is relative,
        in normal contact to the largest interference; in friction to the largest displacement
        that there would be without slip, or was before; in steady rolling to the largest rigid
        slip, and in a step of rolling to what would be without slip, if that is larger.
    """

    element: tuple[float, ...]
    traction: Array
    displacement: Array
    contact: Array
    area: float
    force: Any
    rigid: Any
    gap: Array | None = None
    slip: Array | None = None
    stick: Array | None = None
    bound: Array | None = None
    products: int = 0
    work: float = 0.0
    iterations: tuple[int, ...] = ()
    residual: float = 0.0
    warnings: tuple[str, ...] = ()

    @property
    def sliding(self) -> Array | None:
        """In tangential contact, where the bodies slide on each other."""
        return None if self.stick is None else self.contact & ~self.stick

    @property
    def magnitude(self) -> Array:
        """The size of the traction in each element, N/mm²."""
        is_vector = self.traction.ndim > self.contact.ndim
        return np.hypot(*self.traction) if is_vector else np.abs(self.traction)

    def plot(self, ax: Any = None) -> Any:
        """Draw the traction, and the areas of contact and of stick.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default on a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ImportError
            Where matplotlib is not installed.
        """
        try:
            from matplotlib import pyplot as plt  # It is an extra, and slow to import.
        except ImportError as error:
            raise ImportError("plot() needs matplotlib: pip install 'toeplitz-mg[plot]'") from error
        if ax is None:
            _, ax = plt.subplots(layout="constrained")
        (self._draw_line if self.contact.ndim == 1 else self._draw_surface)(ax)
        return ax

    def _draw_line(self, ax: Any) -> None:
        n, h = len(self.contact), self.element[0]
        x = h * (np.arange(n) - (n - 1) / 2.0)
        ax.plot(x, self.traction, label="pressure" if self.stick is None else "traction")
        if self.bound is not None and self.stick is not None:
            bound = np.where(np.isfinite(self.bound), self.bound, np.nan)
            ax.plot(x, bound, "k:", label="traction bound")
            ax.plot(x, -bound, "k:")
            ax.fill_between(
                x, 0.0, self.traction, where=self.stick, alpha=0.3, step="mid", label="stick"
            )
        ax.set(xlabel="x [mm]", ylabel="traction [N/mm²]")
        ax.legend()

    def _draw_surface(self, ax: Any) -> None:
        (n1, n2), (h1, h2) = self.contact.shape, self.element
        extent = (-n1 * h1 / 2, n1 * h1 / 2, -n2 * h2 / 2, n2 * h2 / 2)
        image = ax.imshow(self.magnitude.T, origin="lower", extent=extent, cmap="viridis")
        ax.figure.colorbar(image, ax=ax, label="traction [N/mm²]")
        for area, colour in ((self.contact, "w"), (self.stick, "r")):
            if area is not None and area.any() and not area.all() and min(n1, n2) > 1:
                ax.contour(
                    area.T.astype(float), [0.5], extent=extent, origin="lower", colors=colour
                )
        ax.set(xlabel="x [mm]", ylabel="y [mm]")


class ContactError(RuntimeError):
    """The areas of contact, stick or slip were not found to the tolerance.

    Attributes
    ----------
    result : ContactResult
        The last iterate, with its `residual`.
    """

    def __init__(self, message: str, result: ContactResult) -> None:
        super().__init__(message)
        self.result = result


def check_converged(result: ContactResult, tolerance: float) -> ContactResult:
    """Return the result, or raise ContactError where it violates the conditions of contact."""
    if result.residual <= tolerance:
        return result
    law, scale = ("Coulomb's law is", "displacement, or rigid slip")
    if result.stick is None:
        law, scale = ("the conditions of contact are", "interference")
    raise ContactError(
        f"after {result.products} products {law} violated by {result.residual:.1e} of the largest "
        f"{scale}, but the tolerance is {tolerance:g}",
        result,
    )
