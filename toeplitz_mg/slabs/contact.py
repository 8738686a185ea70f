"""Contact on the rows of each rank: the searches of `toeplitz_mg.contact`, on a grid in slabs.

The searches are those functions' own, and so are their arguments; a coarser grid, or a window, of
few elements is solved by every rank alone.
"""

from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from inspect import signature
from typing import Any

from numpy.typing import ArrayLike

from toeplitz_mg import contact
from toeplitz_mg._typing import Array, Element
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.checks import check_bound
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.normal.problem import Pressed, press
from toeplitz_mg.contact.results import NormalResult, TangentialResult, check_converged
from toeplitz_mg.contact.tangential.friction import Shifted, shift_bodies
from toeplitz_mg.contact.tangential.rolling import Rolled, compare_loads, roll
from toeplitz_mg.contact.tangential.steps import Stepped, roll_steps
from toeplitz_mg.slabs.grid import SlabGrid
from toeplitz_mg.slabs.slab import Slab, require_slab
from toeplitz_mg.values import field

# The arguments of the functions of `contact` that are taken on slabs.
SEARCH = ("tolerance", "nested", "max_products", "progress")
MOTION = ("longitudinal", "lateral", "spin", "force", "slip", "pole")


def normal_contact(
    gap: ArrayLike, slab: Slab, element: Element, *, material: Any, **arguments: Any
) -> NormalResult:
    """Press two bodies together (see `contact.normal_contact`).

    Parameters
    ----------
    gap : array_like of shape `slab.local`
        This rank's rows of the gap, mm. They may come from a file that is mapped into memory.
    slab : Slab
        Of a grid of two axes.
    element, material, **arguments
        Those of `contact.normal_contact`: approach, force, tolerance, nested, max_products and
        progress. They are the same on all ranks, but `progress`.

    Returns
    -------
    NormalResult
        Its fields have this rank's rows. The numbers are those of the whole contact, and the work
        is that of all ranks, each of which does all that there is on coarser grids of few elements.

    See Also
    --------
    toeplitz_mg.contact.normal_contact : on one machine, also in line contact. What it warns of or
        raises on one rank it does on all.

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
    grid, z, how = _begin(contact.normal_contact, names, gap, slab, element, material, arguments)
    asked = _agree(slab, Pressed.of, grid, z, **how)
    return _check(press(grid, z, asked, how["progress"]), how)


def friction(
    bound: ArrayLike, slab: Slab, element: Element, *, material: Any, **arguments: Any
) -> TangentialResult:
    """Shift two bodies in contact tangentially (see `contact.friction`).

    Parameters
    ----------
    bound : array_like of shape `slab.local`
        This rank's rows of the traction bound, N/mm².
    slab : Slab
        Of a grid of two axes.
    element, material, **arguments
        Those of `contact.friction`: shift, force, previous (a result on the same rows), tolerance,
        nested, max_products and progress. Of a field of shifts, (2, n1, n2), each has its rows.

    Returns
    -------
    TangentialResult
        As that of `normal_contact`.

    Raises
    ------
    ValueError, TypeError, ContactError
        What `contact.friction` raises on one machine, on all ranks.

    See Also
    --------
    toeplitz_mg.contact.friction : the same on one machine.
    """
    names = ("shift", "force", "previous", *SEARCH)
    grid, g, how = _begin(contact.friction, names, bound, slab, element, material, arguments)
    asked = _agree(slab, Shifted.of, grid, g, **how)
    return _check(shift_bodies(grid, g, asked, how["progress"]), how)


def rolling(
    bound: ArrayLike, slab: Slab, element: Element, *, material: Any, **arguments: Any
) -> TangentialResult:
    """Roll steadily towards positive x, by creepages or forces (see `contact.rolling`).

    Parameters
    ----------
    bound, slab, element, material
        As in `friction`.
    **arguments
        Those of `contact.rolling`: longitudinal, lateral, spin, force, moment, slip (this rank's
        rows of a field), pole, tolerance, nested, max_products, progress and options.

    Returns
    -------
    TangentialResult
        As that of `normal_contact`.

    Raises
    ------
    ValueError, TypeError, ContactError
        What `contact.rolling` raises on one machine, on all ranks.

    See Also
    --------
    toeplitz_mg.contact.rolling : the same on one machine.
    """
    names = (*MOTION, "moment", *SEARCH, "options")
    grid, g, how = _begin(contact.rolling, names, bound, slab, element, material, arguments)
    asked = _agree(slab, Rolled.of, g.shape, **how)
    result = roll(grid, g, asked, how["progress"], may_slide=True)
    _, force, moment, *_ = how["asked"]
    return _check(result, how, compare_loads(result, force, moment))


def rolling_steps(
    bound: ArrayLike, slab: Slab, element: Element, *, material: Any, **arguments: Any
) -> Iterator[TangentialResult]:
    """Roll step by step, one element in each, from given tractions (see `contact.rolling_steps`).

    Parameters
    ----------
    bound, slab, element, material
        As in `friction`.
    **arguments
        Those of `contact.rolling_steps`: longitudinal, lateral, spin, force, slip, pole, steps,
        previous (a result on the same rows), tolerance, max_products and progress.

    Yields
    ------
    TangentialResult
        The result after each step. All ranks have to take the same number of them.

    See Also
    --------
    toeplitz_mg.contact.rolling_steps : the same on one machine.
    """
    names = (*MOTION, "steps", "previous", "tolerance", "max_products", "progress")
    grid, g, how = _begin(contact.rolling_steps, names, bound, slab, element, material, arguments)
    return roll_steps(grid, g, _agree(slab, Stepped.of, grid, g.shape, **how), how["progress"])


def _begin(
    function: Callable[..., Any],
    names: tuple[str, ...],
    rows: ArrayLike,
    slab: Slab,
    element: Element,
    material: Any,
    given: dict[str, Any],
) -> tuple[Any, Array, dict[str, Any]]:
    """Return the grid, this rank's rows of a field, and arguments of a function of `contact`.

    Those that are not given have its own defaults. What makes no sense is refused by all ranks.
    """
    require_slab(slab)
    with slab.agree():
        for name in given:
            if name not in names:
                raise TypeError(
                    f"{name} is given, but {function.__name__} on slabs takes {', '.join(names)}"
                )
        call = signature(function).bind(rows, None, material=None, **given)
    call.apply_defaults()
    how = {name: call.arguments[name] for name in names}
    if "pole" in how:
        longitudinal, lateral, spin, force, slip, pole = (how.pop(name) for name in MOTION)
        creepages = (longitudinal, lateral, spin)
        how["asked"] = creepages, force, how.pop("moment", None), slip, pole
    name = next(iter(call.arguments))
    with slab.agree() as same:
        x = field(name, rows) if name == "gap" else check_bound(rows)
        if len(slab.shape) != 2:
            raise ValueError(f"the grid is {slab.shape}, but contact on slabs has two axes")
        if x.shape != slab.local:
            raise ValueError(f"{name} has shape {x.shape}, but this rank's rows have {slab.local}")
        whole = Grid.of(slab.shape, element, material, None)
        same["element"], same["material"] = whole.element, whole.material
    return SlabGrid(whole, slab), x, how


def _agree(slab: Slab, read: Callable[..., Any], *where: Any, **how: Any) -> Any:
    """Return the arguments that are read, which all ranks refuse, or have alike."""
    with slab.agree() as same:
        asked = read(*where, **how)
        same.update(_describe(asked))
    return asked


def _describe(asked: Any) -> dict[str, Any]:
    """Return what has to be the same on all ranks; of fields and results whether they are given."""
    told: dict[str, Any] = {}
    for part in fields(asked):
        value = getattr(asked, part.name)
        if is_dataclass(value) and part.compare:
            told |= _describe(value)
        elif part.compare or value is None:
            told[part.name] = value
        else:
            told[part.name] = "given"
    return told


def _check(result: Any, how: dict[str, Any], reached: str = "") -> Any:
    """Return a result that has converged, and warn of what is doubtful about it."""
    doubts.warn(check_converged(result, how["tolerance"], reached).warnings, within=1)
    return result
