"""How far answers violate the conditions of contact, recomputed from their tractions alone.

Products in double precision with the matrices of the half-space give the displacements, and these
the natural residuals: of pressures a₀ |p - max(0, p - w/a₀)|, of the gap w under load, and of
friction likewise with Coulomb's bound and the slip, which are zero where all conditions hold.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from comparisons.harness.inside import Grid
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import ContactResult, NormalResult, TangentialResult, surfaces

FAR = 1e12  # A shift over the largest displacement, beside which displacements are nothing.


def clip(q: Array, g: Any) -> Array:
    """Return tractions, components first, scaled down to a bound where they are above it."""
    size = np.sqrt((q**2).sum(axis=0))
    above = size > g
    return q * np.where(above, g / np.where(above, size, 1.0), 1.0)


def coulomb_residual(q: Array, slip: Array, g: Any, a0: float) -> float:
    """Return the largest natural residual of Coulomb's law: zero where tractions obey it."""
    return float(a0 * np.abs(q - clip(q - slip / a0, g)).max())


def measure(results: Sequence[ContactResult], gap: Array | None, bound: Array | None) -> float:
    """Return the largest violation by results, over the interference, or over what moves.

    Of unlike materials one is normal and one tangential, which are coupled. `gap` is that before
    the bodies touch, `bound` that which tangential results were to have.
    """
    pressed = [r for r in results if isinstance(r, NormalResult)]
    sheared = [r for r in results if isinstance(r, TangentialResult)]
    errors = [0.0]
    for normal in pressed:
        assert gap is not None
        errors.append(of_pressures(normal, gap, sheared))
    for tangential in sheared:
        assert bound is not None
        finite = np.isfinite(bound)
        least = float(np.max(bound, where=finite, initial=0.0)) or 1.0
        errors.append(float(np.abs(tangential.bound - bound)[finite].max(initial=0.0)) / least)
        errors.append(of_friction(tangential, pressed))
    return max(errors)


def of_pressures(result: NormalResult, gap: Array, sheared: Sequence[TangentialResult]) -> float:
    """Return the violation of p ≥ 0, w ≥ 0, p w = 0, over the interference."""
    grid, p = _grid_of(result), result.pressure
    A, unit = grid.scaled_normal()
    w = gap + unit * _multiply(A, p)
    for tangential in sheared:
        for C, q in zip(grid.coupling(), _components(tangential), strict=False):
            if C is not None:  # By reciprocity the transpose, which is minus itself.
                w -= _multiply(C, q)
    approach = float((p * w).sum() / p.sum())
    wrong = np.abs(np.minimum(w - approach, unit * p)).max()
    return float(wrong) / (result.approach - float(gap.min()))


def of_friction(result: TangentialResult, pressed: Sequence[NormalResult]) -> float:
    """Return the violation of Coulomb's law, over the displacement or the rigid slip."""
    grid, q = _grid_of(result), _components(result)
    A = grid.tangential()
    slip, a0 = _multiply(A, q), grid.diagonal(A)
    slip += sum(_strains(grid, normal.pressure) for normal in pressed)
    if result.creepages is None:
        rigid = -np.reshape(result.shift, (len(q), *(1,) * result.contact.ndim))
        scale = max(float(np.abs(rigid).max()), float(np.abs(slip).max()))
        if not result.stick.any():  # The shift is the least of many: all slides along the force.
            force = np.reshape(result.force, rigid.shape)
            rigid = rigid - FAR * scale * force / np.linalg.norm(force)
    else:
        h, K = result.element[0], grid.steady(A)
        ahead = sum(_strains(grid, normal.pressure, ahead=1) for normal in pressed)
        slip = (slip - _multiply(grid.upstream(), q) - ahead) / h
        rigid, a0 = _creep(result, len(q)), grid.diagonal(K) / h
        scale = float(np.abs(rigid * result.contact).max())
    slip = (slip + rigid) * result.contact
    return coulomb_residual(q, slip, result.bound, a0) / scale


def _strains(grid: Grid, p: Array, ahead: int = 0) -> Array:
    """Return the displacements along the surface by pressures."""
    return np.stack(
        [np.zeros(p.shape) if C is None else _multiply(C, p) for C in grid.coupling(ahead)]
    )


def _creep(result: TangentialResult, components: int) -> Array:
    """Return the rigid slip by the creepages of a result."""
    if components == 1:
        return np.full((1, *result.shape), float(result.creepages))
    longitudinal, lateral, spin = result.creepages
    h1, h2 = result.element
    x, y = surfaces.centres(result.shape, (h1, h2))
    return np.stack(np.broadcast_arrays(longitudinal - spin * y, lateral + spin * x))


def _grid_of(result: ContactResult) -> Grid:
    element: Any = result.element
    return Grid.of(result.shape, element, result.material, None, result.periodic or False)


def _components(result: TangentialResult) -> Array:
    return result.traction.reshape(-1, *result.shape)


def _multiply(A: Any, x: Array) -> Array:
    return (A @ x.reshape(-1)).reshape(x.shape)
