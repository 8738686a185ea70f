"""Contact problems with a grid in slabs: `toeplitz_mg.contact` on the rows of each rank.

The algorithms and arguments are those of `toeplitz_mg.contact`. Every rank solves small coarse
grids and windows on its own.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from numpy.typing import ArrayLike

from toeplitz_mg import contact
from toeplitz_mg._typing import Array, Element, Numbers
from toeplitz_mg.contact.checks import check_pressed, read_bound, require_pressed
from toeplitz_mg.contact.curves import RollingSteps
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.results import NormalResult, TangentialResult
from toeplitz_mg.halfspace.materials import Bodies
from toeplitz_mg.slabs.grid import SlabGrid
from toeplitz_mg.slabs.messages import SharedProgress
from toeplitz_mg.slabs.slab import Slab, require_slab
from toeplitz_mg.values import field

# The arguments of the functions of `contact` that are supported on slabs.
SEARCH = ("tolerance", "nested", "max_products", "progress")
MOTION = ("longitudinal", "lateral", "spin", "force", "slip", "pole")
DOC = """{summary}, on slabs (see `contact.{name}`).

Parameters
----------
pressed : NormalResult
    The bodies that are pressed together, a result of `normal_contact` on these rows.
slab : Slab
    The slab of a grid of two axes.
mu, bound
    The coefficient of friction, with `pressed`; or, instead of both, this rank's rows of the
    traction bound, of shape `slab.local`, N/mm².
element, material
    Needed with `bound`.
**arguments
    As for `contact.{name}`: {taken}. All but `progress` must be the same on all ranks.
    A `previous` result, and each component of a field, has this rank's rows.

Returns
-------
TangentialResult, or RollingSteps
    With this rank's rows, as for `normal_contact`. All ranks must take the same number of steps.

See Also
--------
toeplitz_mg.contact.{name} : the function for one process. Errors of one rank are raised on all.
"""


def normal_contact(
    gap: ArrayLike, slab: Slab, element: Element, *, material: Bodies, **arguments: Any
) -> NormalResult:
    """Press two bodies together (see `contact.normal_contact`).

    Parameters
    ----------
    gap : array_like of shape `slab.local`
        This rank's rows of the gap, mm, for example from a memory-mapped file.
    slab : Slab
        The slab of a grid with two axes.
    element, material, **arguments
        As for `contact.normal_contact`: approach, force, tolerance, nested, max_products and
        progress. All but `progress` must be the same on all ranks.

    Returns
    -------
    NormalResult
        Its fields have this rank's rows. Numbers such as force and area are those of the whole
        contact, and the work is that of all ranks.

    See Also
    --------
    toeplitz_mg.contact.normal_contact : the function for one process. Warnings and errors of one
        rank are raised on all.

    Examples
    --------
    >>> from mpi4py import MPI
    >>> from toeplitz_mg import contact, slabs
    >>> steel, element = contact.Material(E=210000.0, nu=0.28), (0.01, 0.01)
    >>> slab = slabs.Slab(MPI.COMM_WORLD, (64, 64))
    >>> gap = contact.surfaces.sphere((64, 64), element, radius=10.0)[slab.rows]
    >>> pressed = slabs.normal_contact(gap, slab, element, material=steel, force=100.0)
    >>> f"{pressed.approach:.5f} mm"
    '0.00351 mm'
    """
    names = ("approach", "force", *SEARCH)
    return _on_rows(contact.normal_contact, names, (gap,), slab, element, material, arguments)


def _on_rows(
    function: Callable[..., Any],
    names: tuple[str, ...],
    bodies: tuple[Any, ...],
    slab: Slab,
    element: Any,
    material: Any,
    given: dict[str, Any],
) -> Any:
    """Call a function of `contact` with a grid in slabs; all ranks refuse unsupported arguments."""
    require_slab(slab)
    progress = given.get("progress")
    with slab.agree() as same:
        for other in given:
            if other not in names:
                raise TypeError(
                    f"{other} is given, but {function.__name__} on slabs takes {', '.join(names)}"
                )
        if len(bodies) == 1:
            name, rows = "gap", field("gap", *bodies)
        else:
            pressed, bound, mu = bodies
            rows, element, material = _read_bound(pressed, bound, mu, element, material)
            name = "bound"
        if len(slab.shape) != 2:
            raise ValueError(f"the grid is {slab.shape}, but contact on slabs must have two axes")
        if rows.shape != slab.local:
            raise ValueError(
                f"{name} has shape {rows.shape}, but this rank's rows have {slab.local}"
            )
        whole = Grid.of(slab.shape, element, material, None)
        same["element"], same["material"] = whole.element, whole.material
    grid = SlabGrid.of_rows(whole, slab)
    solve = partial(function, element=grid, material=material, **{name: rows})
    if not any(slab.gather(progress is not None)):
        return solve(**given)
    shared = SharedProgress(slab, progress)
    if progress is None or callable(progress):  # Other objects are refused below.
        given = {**given, "progress": shared}
    with shared.heard():
        found = solve(**given)
    if not isinstance(found, RollingSteps):
        return found
    return RollingSteps(_hear(found, shared), found.points, found.keep)


def _hear(results: Iterator[Any], shared: SharedProgress) -> Iterator[Any]:
    """Yield results one after the other, each as soon as all ranks have it."""
    while True:
        with shared.heard():
            result = next(results, None)
        if result is None:
            return
        yield result


def _read_bound(
    pressed: Any, bound: Any, mu: Any, element: Any, material: Any
) -> tuple[Array, Any, Any]:
    """Return this rank's rows of a traction bound, the element and the material."""
    if pressed is None or bound is not None or element is not None or material is not None:
        return check_pressed(pressed, bound, element, material, None, mu)[:3]
    require_pressed(pressed)
    return read_bound(pressed, mu), pressed.element, pressed.material


def _with_friction(function: Callable[..., Any], *names: str) -> Callable[..., Any]:
    """Return the version on slabs of a function of `contact` that takes these arguments."""

    def on_slabs(
        pressed: NormalResult | None = None,
        slab: Any = None,
        *,
        mu: Numbers | None = None,
        bound: Numbers | None = None,
        element: Element | None = None,
        material: Bodies | None = None,
        **arguments: Any,
    ) -> Any:
        bodies = pressed, bound, mu
        return _on_rows(function, names, bodies, slab, element, material, arguments)

    name, taken = function.__name__, ", ".join(names)
    summary = (function.__doc__ or "").split("\n")[0].split(":")[0].rstrip(".")
    on_slabs.__doc__ = DOC.format(summary=summary, name=name, taken=taken)
    on_slabs.__name__ = on_slabs.__qualname__ = name
    on_slabs.__module__ = "toeplitz_mg.slabs"
    return on_slabs


friction: Callable[..., TangentialResult] = _with_friction(
    contact.friction, "shift", "force", "previous", *SEARCH
)
rolling: Callable[..., TangentialResult] = _with_friction(
    contact.rolling, *MOTION, "moment", *SEARCH, "options"
)
rolling_steps: Callable[..., RollingSteps] = _with_friction(
    contact.rolling_steps, *MOTION, "steps", "previous", *SEARCH[:1], *SEARCH[2:], "keep"
)
