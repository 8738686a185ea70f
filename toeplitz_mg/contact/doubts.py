"""Warnings about input that is valid, but may not be what was meant.

Each is a sentence in the `warnings` of a result, and is issued as a `ContactWarning`. The public
functions examine their own input and result; warnings about internal coarse grids are suppressed.
"""

import re
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from math import prod
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.grid import Grid, keep
from toeplitz_mg.contact.results.base import remake

FEWEST = 10  # With fewer elements across a contact, its area and pressures are rough guesses.
# If the largest spot has a smaller share of the contact, its resolution does not matter; if the
# edge elements carry a smaller share of the load, the edge of the grid does not matter.
NEGLIGIBLE = 0.05
CUT = 0.5  # Share of the load on the elements connected to an edge, above which that edge matters.
STEEP = 1.0  # A gap with such slopes is steep: half-space theory needs slopes far below.
MOSTLY = 0.5  # Share of the grid that is steep, above which it is more than a few steps.
# Mean pressure over Young's modulus of the softer body, above which linear elasticity fails: a
# steel sphere on steel reaches it when the contact is half as wide as the sphere.
HARD = 0.1
MOST_CREEPAGE = 0.1  # Creepages of rolling bodies are far smaller; spin is taken times the radius.
MOST_FRICTION = 2.0  # Hardly any pair of bodies has a larger coefficient of friction.
FLAT = 1e-6  # Largest sag of the gap between two edges, over the interference, for a flat punch.
REVERSED = -0.9  # Correlation of the mean gap with a parabola; -1 for a sphere of reversed sign.
# Smallest error of a moment to warn about, relative to the largest moment and to the moment.
OF_LARGEST, OF_MOMENT = 0.01, 0.1
LITTLE = 0.1  # If a smaller share of the contact sticks, nearly all of it slides.
UNCOUPLED = 1e-3  # Below this difference parameter, coupling is smaller than the grid error.

UNDETERMINED = (
    "the force is all that friction carries: everything slides, and any large creepage has this "
    "force, so that creepages, slip and power are NaN; prescribe the creepage instead"
)


class ContactWarning(UserWarning):
    """The input is valid, but may not be what was meant.

    The grid may be too small or too coarse for the contact, a unit or a sign may be wrong, or the
    problem may be beyond the theory of half-spaces. The `warnings` of a result lists all of them.

    See Also
    --------
    ContactError : raised if no solution was found.
    """


_gathered: ContextVar[list[str] | None] = ContextVar("_gathered", default=None)


def warn(doubts: tuple[str, ...], *, within: int = 0, known: tuple[str, ...] = ()) -> None:
    """Issue the warnings at the line that called the public function, `within` frames further up.

    Warnings in `known` were issued before, for example for the normal result given to friction.
    """
    for doubt in doubts:
        if (gathered := _gathered.get()) is not None:
            gathered.append(doubt)
        elif doubt not in known:
            warnings.warn(doubt, ContactWarning, stacklevel=3 + within)


def add(result: Any, found: tuple[str, ...]) -> Any:
    """Return a result with more warnings."""
    return remake(result, warnings=(*result.warnings, *found)) if found else result


@contextmanager
def gather_doubts() -> Iterator[Callable[[], tuple[str, ...]]]:
    """Suppress warnings inside; the yielded function returns them, the first one of each kind."""
    found: list[str] = []
    token = _gathered.set(found)
    try:
        yield lambda: tuple({re.split(r"\d", doubt)[0]: doubt for doubt in found[::-1]}.values())
    finally:
        _gathered.reset(token)


def examine_pressures(grid: Grid, z: Array, p: Array, interference: float) -> tuple[str, ...]:
    """Return the warnings for the pressures `p` if the gap was `z`."""
    contact = p > 0.0
    return (
        *_check_units(grid, z, contact),
        *_check_resolution(grid, contact),
        *_check_load(grid, p, contact),
        *_check_edge(grid, z, p, interference),
    )


def examine_bound(grid: Grid, contact: Array) -> tuple[str, ...]:
    """Return the warnings for a tangential problem with these elements in contact.

    The bound is given, so it does not matter if the contact reaches the edge of the grid.
    """
    return _examine_elements(grid, contact.tobytes())


@keep
def _examine_elements(grid: Grid, contact: bytes) -> tuple[str, ...]:
    elements = np.frombuffer(contact, bool).reshape(-1, *grid.shape[1:])
    return (*_check_resolution(grid, elements), *_check_coupling(grid))


def examine_friction(grid: Grid, mu: Any) -> tuple[str, ...]:
    """Return the warning for a large coefficient of friction; infinity means bonded bodies."""
    finite = np.atleast_1d(0.0 if mu is None else mu)
    largest = max(grid.vectors.gather(float(finite.max(initial=0.0, where=finite < np.inf))))
    if largest <= MOST_FRICTION:
        return ()
    return (
        f"mu is {largest:.3g}, but coefficients of friction are hardly ever above "
        f"{MOST_FRICTION:g}: give a fraction, 0.3 for 30 %",
    )


def examine_creepages(creepages: Iterable[float | None], area: float) -> tuple[str, ...]:
    """Return the warnings for large creepages (longitudinal, lateral, spin) and a contact area."""
    radius, found = float(np.sqrt(area / np.pi)), []
    slips = zip(("longitudinal", "lateral", "spin"), creepages, (1.0, 1.0, radius), strict=False)
    for name, value, arm in slips:
        if value is None or not abs(value) * arm > MOST_CREEPAGE:
            continue
        said = f"the {name} creepage is {value:.3g}"
        if name == "spin":
            said = f"the spin is {value:.3g} per mm, a creepage of {abs(value) * arm:.3g} at the "
            said += f"contact's radius of {radius:.3g} mm"
        found.append(
            f"{said}, but creepages are hardly ever above {MOST_CREEPAGE:g}: give a fraction, "
            "0.001 for 0.1 %"
        )
    return tuple(found)


def examine_moment(moment: float, off: float, most: float, stick: float) -> tuple[str, ...]:
    """Return the warning for a moment that is given while nearly all elements slide.

    The moment then has the error `off`, half an element times the lateral force. `most` is the
    largest moment that friction can carry, `stick` the share of the contact that sticks.
    """
    if stick > LITTLE or off <= max(OF_LARGEST * most, OF_MOMENT * abs(moment)):
        return ()
    return (
        f"the moment is {moment:.3g}, but as nearly everything slides it is uncertain by {off:.3g} "
        f"(half an element times the lateral force; {off / most:.0%} of the largest moment), and "
        "so is the spin: use shorter elements along x",
    )


def _check_units(grid: Grid, z: Array, contact: Array) -> Iterator[str]:
    """Yield a warning if heights are as large as lengths: they may be in another unit."""
    vectors = grid.vectors
    length = max([n * h for n, h in zip(grid.shape, grid.element, strict=False)])
    if (depth := vectors.max(z) - vectors.min(z)) > length:
        yield (
            f"the gap varies by {depth:.3g} on a grid of length {length:.3g}: heights and elements "
            "must be in the same unit"
        )
    # The share of the grid that is steep, and the largest slope in contact.
    most, in_contact = 0.0, 0.0
    for axis, h in enumerate(grid.element[: z.ndim]):
        heights, touching = grid.lines(z, axis), grid.lines(contact, axis)
        slopes = np.abs(heights[..., 1:] - heights[..., :-1]) / h
        if vectors.max(slopes) <= STEEP:
            continue
        # A step beside the contact, as at the rim of a punch, is not a slope in contact.
        pairs = touching[..., 1:] & touching[..., :-1]
        steps = prod(grid.shape) - prod(grid.shape) // grid.shape[axis]
        most = max(most, vectors.count(slopes > STEEP) / max(1, steps))
        in_contact = max(in_contact, vectors.max(np.where(pairs, slopes, 0.0)))
    if in_contact > STEEP:
        yield (
            f"the gap has slopes up to {in_contact:.3g} in contact, but half-spaces have slopes "
            "far below 1: heights and elements must be in the same unit"
        )
    elif most > MOSTLY:
        yield (
            "the gap has slopes above 1 on most of the grid, but half-spaces have slopes far below "
            "1: heights and elements must be in the same unit"
        )


def _check_resolution(grid: Grid, contact: Array) -> Iterator[str]:
    """Yield a warning if too few elements lie across the largest spot, unless it is one of many."""
    # A grid with one row of elements is a line contact, or plane strain.
    axes = [axis for axis, n in enumerate(grid.shape) if n > 1] or [0]
    runs = [_longest_run(grid, contact, axis) for axis in axes]
    across, elements = min(runs), grid.vectors.count(contact)
    if 0 < across < FEWEST and prod(runs) > NEGLIGIBLE * elements:
        yield (
            f"the contact is only {across} element{'s' * (across > 1)} across: use smaller "
            f"elements, at least {FEWEST} across the largest spot"
        )


def _longest_run(grid: Grid, contact: Array, axis: int) -> int:
    """Return the largest number of consecutive elements in contact along an axis."""
    lines = grid.lines(contact, axis)
    if grid.periodic[axis]:  # A spot may continue at the other end.
        lines = np.concatenate([lines, lines], axis=-1)
    ends = np.zeros((*lines.shape[:-1], 1), bool)
    runs = np.concatenate([ends, lines, ends], axis=-1).ravel()
    changes = np.flatnonzero(runs[1:] != runs[:-1])
    longest = int(max(grid.vectors.gather(int((changes[1::2] - changes[::2]).max(initial=0)))))
    return min(longest, grid.shape[axis])


def _check_load(grid: Grid, p: Array, contact: Array) -> Iterator[str]:
    """Yield a warning if the pressures are too high for linear elasticity."""
    G, nu, bodies = grid.material.G, grid.material.nu, grid.material.bodies
    E = 2.0 * G * (1.0 + nu) if bodies is None else min(body.E for body in bodies)
    mean = grid.vectors.sum(p) / max(1, grid.vectors.count(contact))
    if mean > HARD * E:
        yield (
            f"the mean pressure is {mean / E:.3g} E, but linear elasticity holds for pressures far "
            f"below {HARD:g} E: check the units of load, modulus and elements"
        )


def _check_edge(grid: Grid, z: Array, p: Array, interference: float) -> Iterator[str]:
    """Yield a warning if the contact is cut off by the grid, or the gap has the wrong sign.

    If the gap is straight along an axis, flat or inclined, the bodies are assumed to end at the
    edge of the grid, like a punch. If a surface has many spots, those at the edge carry little
    load, so it does not matter what is beyond.
    """
    touched = [
        axis
        for axis, n in enumerate(grid.shape)
        if n > 1
        and not grid.periodic[axis]
        and _is_cut_off(grid, p, axis)
        and _largest_sag(grid, z, axis) > FLAT * interference
    ]
    if touched and all(_is_farthest_in_the_middle(grid, z, axis) for axis in touched):
        yield (
            "the bodies touch at the edge of the grid, and are farthest apart in the middle: "
            "check the sign of the gap, which is positive where they are apart"
        )
    elif touched:
        names = " and ".join("xy"[axis] for axis in touched)
        yield (
            f"the contact reaches the edge of the grid along {names}, where the bodies end: "
            "use a larger grid, or periodic=True for a sample of a larger surface"
        )


def _is_cut_off(grid: Grid, p: Array, axis: int) -> bool:
    """Whether the elements at the ends of an axis, or connected to these, carry much load."""
    lines, load = grid.lines(p, axis), grid.vectors.sum(p)
    contact = lines > 0.0
    first = np.logical_and.accumulate(contact, axis=-1)
    last = np.logical_and.accumulate(contact[..., ::-1], axis=-1)[..., ::-1]
    at_ends = grid.vectors.sum(lines[..., [0, -1]])
    up_to_ends = grid.vectors.sum(np.where(first | last, lines, 0.0))
    return at_ends > NEGLIGIBLE * load or up_to_ends > CUT * load


def _largest_sag(grid: Grid, z: Array, axis: int) -> float:
    """Return the largest sag of the gap below the chords between its ends along an axis."""
    z = grid.lines(z, axis)
    t = np.linspace(0.0, 1.0, z.shape[-1])
    return grid.vectors.max(np.abs(z - (1.0 - t) * z[..., :1] - t * z[..., -1:]))


def _is_farthest_in_the_middle(grid: Grid, z: Array, axis: int) -> bool:
    """Whether the mean gap along an axis is nearly a parabola with its maximum in the middle."""
    lines = grid.lines(z, axis)
    own = lines.reshape(-1, lines.shape[-1]).sum(axis=0)
    profile = np.sum(grid.vectors.gather(own), axis=0)
    profile -= profile.mean()
    parabola = np.linspace(-1.0, 1.0, len(profile)) ** 2
    parabola -= parabola.mean()
    sizes = float(np.linalg.norm(profile) * np.linalg.norm(parabola))
    return float(profile @ parabola) < REVERSED * sizes


def _check_coupling(grid: Grid) -> Iterator[str]:
    """Yield a warning if the pressures depend on the tangential tractions (unlike materials)."""
    K = grid.material.difference
    if abs(K) > UNCOUPLED:
        yield (
            f"the materials are unlike (difference parameter {K:.3g}), so that pressure and "
            "friction depend on each other, which is neglected here: use "
            "contact.frictional_contact, or contact.frictional_rolling for rolling"
        )
