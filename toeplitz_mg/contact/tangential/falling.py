"""Friction that depends on the slip: its derivative is part of Newton's method.

Where an element slides, with the traction n |q| against the slip σ, the law is |q| = G(σ). Let
γ = G'(σ) k₀ be its slope relative to the stiffness of an element, where k₀ is the diagonal of K.
The linear system has the row

    k₀ n·dq + γ n·K dq = k₀ (G - |q|),

divided by 1 + |γ|: with γ = 0 it determines the traction's magnitude, and for steeply rising
friction the slip. So bound, slip and tractions are found together.

Rising friction has a unique solution. Where friction falls more steeply than elasticity resists at
some wavelength, there may be several: then the law is made steep step by step.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import next_fast_len

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.results import ContactError, TangentialResult
from toeplitz_mg.contact.tangential.law import Areas, direction, size
from toeplitz_mg.engine import fourier
from toeplitz_mg.values import field, in_range, numbers, positive

LEAST = 1e-10  # Lower limit of the factor: an element with a zero bound would leave the contact.
SLIPS = 32  # Number of slips at which the slope is evaluated to find the steepest.
SMALLEST = 1e-4  # The smallest of them over the largest.
LEAST_STEP = 1 / 16  # Smallest step from constant friction to the law.

Law = Callable[[Array], ArrayLike] | tuple[float, float, float]  # The user's argument.


def read_law(falling: Law | None, mu: Any, bound: Any) -> tuple[Any, Any]:
    """Return the coefficient of friction without slip, and the factor of the bound by the slip.

    Three numbers (μ_s, μ_k, s₀) are μ(s) = μ_k + (μ_s - μ_k) exp(-s/s₀); other laws are unchanged.
    """
    if not isinstance(falling, tuple | list | np.ndarray):
        return mu, falling
    given = field("falling", falling)
    if given.shape != (3,):
        raise ValueError(f"falling has shape {given.shape}, but must be (mu_s, mu_k, s0)")
    static = positive("mu_s of falling", given[0])
    kinetic, distance = float(given[1]), positive("s0 of falling", given[2])
    if not 0.0 <= kinetic < np.inf:
        raise ValueError(f"mu_k of falling is {kinetic:g}, but must be at least zero and finite")
    in_range("s0 of falling", distance)
    if mu is not None and np.any(wrong := (friction := field("mu", mu, "")) != static):
        raise ValueError(
            f"mu is {friction[wrong].flat[0]:g}, but falling has mu_s = {static:g}, the "
            "coefficient without slip: leave mu out"
        )

    def factor(s: Array) -> Array:
        part: Array = np.exp(-s / distance)
        return (kinetic + (static - kinetic) * part) / static

    return (static if bound is None else None) if mu is None else mu, factor


def follow(find: Callable[..., Any], K: Any, problem: Any, loads: Any, guess: Any = None) -> Any:
    """Return the state; if friction falls steeply, go from constant friction to the law in steps.

    `find` takes a problem, loads and a guess; K tells whether products are used up.
    """
    law = problem.falling
    state = find(problem, loads, guess)
    is_over = law is None or state.residual <= problem.tolerance or len(loads.wanted)
    if is_over or K.exhausted:
        return state
    part, step = 0.0, 1.0
    last = find(replace(problem, falling=replace(law, part=0.0)), loads)
    while step >= LEAST_STEP and not K.exhausted:
        new = min(1.0, part + step)
        less = replace(problem, falling=replace(law, part=new))
        found = find(less, loads, (last.q, last.areas))
        if found.residual > problem.tolerance:
            step *= 0.5
        elif new == 1.0:
            return found
        else:
            last, part = found, new
    # If friction falls at once, all elements slide fast.
    slide = (problem.g > 0.0) & np.isfinite(problem.g)
    fast = direction(problem.b) * np.where(slide, law.at(size(problem.b)), 0.0)
    if K.exhausted:
        return state
    return find(problem, loads, (fast, Areas((problem.g > 0.0) & ~slide, slide)))


def examine(
    result: TangentialResult, of_slip: Callable[[Array], Array], tolerance: float, K: Any
) -> tuple[str, ...]:
    """Return a warning if the solution may not be unique; raise an error if none was found."""
    is_one = result.slip.ndim == result.contact.ndim
    s = np.abs(result.slip) if is_one else np.hypot(*result.slip)
    falls, rises = _steepest(of_slip, s)
    resists = result.element[0] / _largest_of_symbol(K.A)
    slopes = (
        f"per unit of slip friction falls by up to {falls:.3g} N/mm², but the elastic tractions "
        f"change by as little as {resists:.3g} N/mm²"
    )
    if result.residual > tolerance and (falls > resists or not K.exhausted):
        steep = f"friction falls too steeply: {slopes}"
        if falls <= resists:
            steep = f"friction jumps: it rises by up to {rises:.3g} N/mm² per unit of slip"
        raise ContactError(
            f"after {result.products} products the law of friction is violated by "
            f"{result.residual:.1e}, but the tolerance is {tolerance:g}: {steep}",
            result,
        )
    doubt = f"{slopes}: there may be other answers: check the law, or choose one by guess="
    return (doubt,) if falls > resists else ()


def _steepest(of_slip: Callable[[Array], Array], slip: Array) -> tuple[float, float]:
    """Return the steepest fall and rise of friction per unit of slip, up to the given slip."""
    largest = float(slip.max(initial=0.0))
    inside = np.isfinite(of_slip(slip))
    if not inside.any() or largest == 0.0:
        return 0.0, 0.0
    slips = np.array([0.0, *np.geomspace(SMALLEST, 1.0, SLIPS) * largest])
    bounds = np.array([of_slip(np.full(slip.shape, s))[inside] for s in slips])
    slopes = np.diff(bounds, axis=0) / np.diff(slips)[:, None]
    return max(0.0, -float(slopes.min())), max(0.0, float(slopes.max()))


def _largest_of_symbol(K: Any) -> float:
    """Return the largest real part of the symbol of K: the largest compliance at any wavelength."""
    blocks = [K.component(i) for i in range(len(K.blocks))] if hasattr(K, "blocks") else [K]
    lengths = [next_fast_len(2 * n - 1) for n in blocks[0].grid_shape]
    return max(float(fourier.rfftn(block.circulant(lengths)).real.max()) for block in blocks)


def multiply(g: Array, falling: Callable[[Array], ArrayLike], s: Array) -> Array:
    """Return g times the factor of the bound for the slip s, or raise an error."""
    if not callable(falling):
        raise TypeError(
            f"falling is {falling!r}, but must be a function of the slip, (mu_s, mu_k, s0), or None"
        )
    factor = numbers("the factor of falling friction", falling(s))
    if factor.shape not in ((), s.shape):
        raise ValueError(
            f"falling has returned the shape {factor.shape}, but must return one number for each "
            f"of {s.shape} elements"
        )
    if not np.isfinite(factor).all() or (factor < 0.0).any():
        raise ValueError(
            f"falling has returned {factor.min():g} to {factor.max():g}, but must return finite "
            "factors that are at least zero"
        )
    factor = np.maximum(factor, LEAST)  # It may underflow.
    in_range("the factor of falling friction", float(factor.max(initial=0.0)))
    return g * factor
