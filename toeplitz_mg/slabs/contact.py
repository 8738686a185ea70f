"""Contact on the rows of each rank: the searches of `toeplitz_mg.contact`, on a grid in slabs.

The searches are those functions' own, and so are their arguments; a coarser grid of few elements is
solved by every rank alone. Tangential problems are solved on the whole grid, as the rows of a
window around the contact would have to go to other ranks.
"""

from collections.abc import Callable, Iterator
from inspect import signature
from types import SimpleNamespace
from typing import Any

from numpy.typing import ArrayLike

from toeplitz_mg import contact
from toeplitz_mg._typing import Array, Element
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.checks import check_bound
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.normal.problem import press
from toeplitz_mg.contact.result import NormalResult, TangentialResult, check_converged
from toeplitz_mg.contact.tangential.friction import shift_bodies
from toeplitz_mg.contact.tangential.rolling import roll
from toeplitz_mg.contact.tangential.steps import roll_steps
from toeplitz_mg.slabs.grid import SlabGrid
from toeplitz_mg.slabs.slab import Slab
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
        Its fields have this rank's rows. The numbers are those of the whole contact.

    Warns
    -----
    ContactWarning
        The warnings of `contact.normal_contact`, on every rank.

    Raises
    ------
    ValueError, TypeError, ContactError
        On all ranks, where `contact.normal_contact` raises it, or the ranks differ about arguments.

    See Also
    --------
    toeplitz_mg.contact.normal_contact : on one machine, also in line contact.

    Notes
    -----
    The pressures are the same up to rounding, and the products about as many.

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
    how = _bind(contact.normal_contact, ("approach", "force", *SEARCH), arguments)
    grid, z = _read("gap", gap, field, slab, element, material)
    return _check(press(grid, z, **how), how)


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
        nested, max_products and progress. They are the same on all ranks, but `progress`; of a
        field of shifts, (2, n1, n2), each has its rows.

    Returns
    -------
    TangentialResult
        As that of `normal_contact`, also in what it warns of and raises.

    See Also
    --------
    toeplitz_mg.contact.friction : the same on one machine.
    """
    how = _bind(contact.friction, ("shift", "force", "previous", *SEARCH), arguments)
    grid, g = _read("bound", bound, _check_bound, slab, element, material)
    return _check(shift_bodies(grid, g, _whole, **how), how)


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
        As that of `normal_contact`, also in what it warns of and raises.

    See Also
    --------
    toeplitz_mg.contact.rolling : the same on one machine.
    """
    how = _bind(contact.rolling, (*MOTION, "moment", *SEARCH, "options"), arguments)
    asked = _take_motion(how)
    grid, g = _read("bound", bound, _check_bound, slab, element, material)
    return _check(roll(grid, g, _whole, asked, **how), how)


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
    how = _bind(contact.rolling_steps, names, arguments)
    asked = _take_motion(how)
    grid, g = _read("bound", bound, _check_bound, slab, element, material)
    return roll_steps(grid, g, _whole, asked, **how)


def _whole(grid: Any, elements: Array) -> Any:
    """Return the whole of a grid, in the place of a window around the elements in contact."""
    return SimpleNamespace(whole=grid, grid=grid, cut=lambda x: x, extend=lambda x: x)


def _bind(
    function: Callable[..., Any], names: tuple[str, ...], given: dict[str, Any]
) -> dict[str, Any]:
    """Return these arguments of a function of `contact`, by default its own."""
    for name in given:
        if name not in names:
            raise TypeError(
                f"{name} is given, but {function.__name__} on slabs takes {', '.join(names)}"
            )
    call = signature(function).bind(None, None, material=None, **given)
    call.apply_defaults()
    return {name: call.arguments[name] for name in names}


def _take_motion(how: dict[str, Any]) -> tuple[Any, ...]:
    """Take the arguments of `Motion.of` from those of rolling."""
    longitudinal, lateral, spin, force, slip, pole = (how.pop(name) for name in MOTION)
    return (longitudinal, lateral, spin), force, how.pop("moment", None), slip, pole


def _read(
    name: str, rows: ArrayLike, check: Any, slab: Slab, element: Element, material: Any
) -> tuple[Any, Array]:
    """Return the grid, and this rank's rows of a field, or say what is wrong with them."""
    with slab.agree() as same:
        x = check(name, rows)
        if len(slab.shape) != 2:
            raise ValueError(f"the grid is {slab.shape}, but contact on slabs has two axes")
        if x.shape != slab.local:
            raise ValueError(f"{name} has shape {x.shape}, but this rank's rows have {slab.local}")
        whole = Grid.of(slab.shape, element, material, None)
        same["element"], same["material"] = whole.element, whole.material
    return SlabGrid(whole, slab), x


def _check_bound(name: str, bound: ArrayLike) -> Array:
    return check_bound(bound)


def _check(result: Any, how: dict[str, Any]) -> Any:
    """Return a result that has converged, and warn of what is doubtful about it."""
    doubts.warn(check_converged(result, how["tolerance"]).warnings)
    return result
