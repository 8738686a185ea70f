"""Results for a sequence of loads or steps, and tables of their numbers."""

from dataclasses import dataclass
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.results import NormalResult, TangentialResult, files, pictures
from toeplitz_mg.contact.results.base import Figure, Result, Summary, describe_cost, span
from toeplitz_mg.contact.results.quantities import CREEPAGES, name_units, quantities
from toeplitz_mg.values import positive

Kind = TypeVar("Kind", NormalResult, TangentialResult)


class Curve(Result):
    """A sequence of points with numbers, as a table and a plot."""

    _title: ClassVar[str]

    def to_dataframe(self, *, friction: float | None = None) -> Any:
        """Return the numbers of all points as a pandas table with one row per point.

        Parameters
        ----------
        friction : float, optional
            The force μ P, as for `plot`. Then forces F are given as -F/(μ P).

        Returns
        -------
        pandas.DataFrame
            ``attrs["units"]`` holds the units of the columns.
        """
        pandas = files.import_extra("pandas", "to_dataframe")
        self._complete()
        columns = self._columns(friction)
        table = pandas.DataFrame({name: values for name, (values, _) in columns.items()})
        table.attrs["units"] = {name: unit for name, (_, unit) in columns.items() if unit}
        return table.rename_axis("point")

    def to_xarray(self) -> Any:
        """Return the numbers of all points, and their fields if there are any, with units.

        Returns
        -------
        xarray.Dataset
            The first dimension is "point".
        """
        xarray = files.import_extra("xarray", "to_xarray")
        self._complete("to_xarray()")
        columns = self._columns().items()
        numbers = {name: ("point", x, {"units": unit}) for name, (x, unit) in columns}
        return self._stack_fields(xarray).assign(numbers).assign_attrs(kind=type(self).__name__)

    def plot(self, ax: Any = None, *, friction: float | None = None) -> Any:
        """Plot the force: over the approach for loads, over the varying creepage for rolling.

        Steps are plotted over the distance rolled; if their creepages vary because a force is
        given, the creepages are plotted.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw in; by default those of a new figure.
        friction : float, optional
            The force μ P, N; in plane strain N/mm. Then -F/(μ P) is plotted, as in the literature:
            forces oppose the creepage, so this is positive for positive creepage, and at most 1.

        Returns
        -------
        matplotlib.axes.Axes
        """
        if friction is not None:  # Checked before a figure is opened or a point is computed.
            positive("friction", friction, self.units.get("force", ""))
        ax = pictures.find_axes(ax)
        self._complete()
        columns = self._columns(friction, asks=False)
        over, drawn = self._choose(columns, friction)
        values, unit = columns[over]
        for name in drawn:
            ax.plot(values, columns[name][0], "o-", label=name.replace("force_", "along "))
        up = "creepage" if drawn[0] in CREEPAGES else "force" if friction is None else "-F/(μ P)"
        pictures.label_axis(ax.yaxis, up, columns[drawn[0]][1])
        largest = float(np.abs(values).max(initial=0.0))
        pictures.label_axis(ax.xaxis, over + " creepage" * (unit == "1"), unit, largest)
        if unit != "mm":  # Lengths choose their own unit.
            ax.ticklabel_format(axis="x", scilimits=(-2, 3))
        ax.axhline(0.0, color="0.7", linewidth=0.8, zorder=0)
        ax.legend()
        return ax

    def __repr__(self) -> str:
        """Return the first figures in one line."""
        _, figures, cost, _ = self._summary()
        few = ", ".join(f"{figure.name} {figure.text}" for figure in figures[:2])
        return f"<{type(self).__name__} {self._extent}{': ' * bool(few)}{few}; {cost}>"

    def _summary(self) -> Summary:
        title = f"{self._title} of {self._extent}, from the first to the last"
        products = self._table(asks=False).get("products", 0)
        return Summary(title, self._figures(), describe_cost(int(np.sum(products))))

    @property
    def units(self) -> dict[str, str]:
        """The units of the numbers by name."""
        return name_units(self)

    @property
    def _extent(self) -> str:
        there = len(self._table(asks=False).get("products", ()))
        every = getattr(self, "points", there)
        return f"{there} points" if there == every else f"{there} of {every} points"

    def _figures(self) -> list[Figure]:
        table, units = self._table(asks=False), {"creepages": "", "spin": "1/mm"}
        if "creepages" in table and table["creepages"].ndim > 1:
            table["creepages"], table["spin"] = np.split(table["creepages"], [2], axis=1)
        units = self.units | units | {"stick_share": ""}
        first = [name for name in ("approach", "creepages", "force") if name in table]
        figures = [Figure(x, table[x], units.get(x, "")) for x in dict.fromkeys((*first, *table))]
        shown = [x for x in figures if x.value.any() and x.name != "products"]
        return [span(figure) for figure in shown if not np.isnan(figure.value).any()]

    def _stack_fields(self, xarray: Any) -> Any:
        """Return a dataset with the fields of all points."""
        return xarray.Dataset()

    def _table(self, *, asks: bool = True) -> dict[str, Array]:
        """Return the numbers of the points by name; the first axis counts the points."""
        declared = quantities(type(self)).items()
        table = {name: getattr(self, name) for name, q in declared if q.axes.startswith("points")}
        return {name: values for name, values in table.items() if values is not None}

    def _columns(
        self, friction: float | None = None, *, asks: bool = True
    ) -> dict[str, tuple[Array, str]]:
        """Return the columns of the table, one per component, with their units."""
        table, units, columns = self._table(asks=asks), dict(self.units), {}
        if friction is not None:
            friction = positive("friction", friction, units.get("force", ""))
            if "creepages" not in table:
                raise ValueError(
                    f"friction is {friction}, but must be None: a {self._title.lower()} has no "
                    "tangential forces"
                )
            table["force"], units["force"] = 0.0 - table["force"] / friction, "1"
        for name, values in table.items():
            components, each = np.atleast_2d(values.T), units.get(name, "").split(", ")
            names = [f"{name}_{axis}" for axis in "xy"] if len(components) > 1 else [name]
            for k, column in enumerate(components):
                own = CREEPAGES[k] if name == "creepages" else names[k]
                columns[own] = column, each[min(k, len(each) - 1)]
        return columns

    def _choose(self, columns: Any, friction: float | None = None) -> tuple[str, list[str]]:
        """Return the names of the columns to plot: the abscissa, and the ordinates."""
        forces = [name for name in columns if name.startswith("force")]
        varied = [x for x in CREEPAGES if x in columns and np.ptp(columns[x][0]) > 0.0]
        if "approach" in columns:
            return "approach", forces
        if "distance" in columns:
            return "distance", varied if varied and friction is None else forces
        return (varied or CREEPAGES)[0], forces


@dataclass(eq=False, repr=False)
class Results(Curve, Generic[Kind]):
    """A sequence of results, computed during iteration (see `LoadCurve`)."""

    results: Any
    points: int
    keep: bool = True

    _kind: ClassVar[type]
    _warns: ClassVar[bool] = False  # Whether each result warns. Steps warn once.

    def __post_init__(self) -> None:
        """Accept the results of a file, or an iterator that computes them."""
        self._rows: list[dict[str, Any]] = []  # Numbers of the results that were not kept.
        self._given = 0
        self._failure: str = ""
        if not isinstance(self.results, list):
            self._coming, self.results = self.results, []
            return
        self._coming = iter(())
        kinds = {(type(x).__name__, x.shape, x.element) for x in self.results}
        name, there = self._kind.__name__, len(self.results)
        if {kind for kind, *_ in kinds} != {name} or len(kinds) > 1 or there != self.points:
            raise ValueError(
                f"results are {there} of {kinds}, but must be {self.points} {name}s of one grid"
            )

    def __iter__(self) -> Self:
        """Continue; after the last result, start again with the first."""
        if self._given == self.points:
            self._given = 0
        return self

    def __next__(self) -> Kind:
        """Return the next result, and compute it if needed."""
        if self._given == self.points:
            raise StopIteration
        k = self._given - len(self._rows)
        if k < 0:
            self._require_kept("a second iteration")
        if k < len(self.results):
            result: Kind = self.results[k]
        else:
            result = self._compute()
            if self._warns:
                doubts.warn(result.warnings)
        self._given += 1
        return result

    def __len__(self) -> int:
        """Return the total number of results, computed or not."""
        return self.points

    @property
    def units(self) -> dict[str, str]:
        """The units of the numbers and the fields by name."""
        units = name_units(self.results[0]) if self.results else {}
        return units | {"distance": "mm"} if "creepages" in units else units

    @property
    def _there(self) -> int:
        """The number of computed results."""
        return len(self._rows) + len(self.results)

    def _compute(self) -> Kind:
        """Compute the next result."""
        if self._failure:
            raise RuntimeError(f"no more than {self._extent} are there, as {self._failure}")
        try:
            result: Kind = next(self._coming)
        except BaseException as error:  # Includes interruptions, which end a generator too.
            self._failure = f"the next one ended with {error!r}"
            raise
        if self.results and not self.keep:
            self._rows.append(_list_numbers(self.results.pop(), asks=False))
        self.results.append(result)
        if self._there == self.points:
            self._coming = iter(())  # Release the generator and its fields.
        return result

    def _complete(self, needs_fields: str = "") -> None:
        if not self.points:
            raise ValueError("the curve has no points, but must have one at least")
        if needs_fields:
            self._require_kept(needs_fields)
        while self._there < self.points:
            result = self._compute()
            if not self.keep:
                _list_numbers(result, asks=True)  # This computes and stores its stiffness.
            if self._warns:
                doubts.warn(result.warnings, within=1)

    def _require_kept(self, what: str) -> None:
        if not self.keep:
            raise ValueError(f"keep is False, but {what} needs the fields of all: use keep=True")

    def _table(self, *, asks: bool = True) -> dict[str, Array]:
        rows = [*self._rows, *(_list_numbers(result, asks=asks) for result in self.results)]
        names = [x for x in rows[0] if all(x in row for row in rows)] if rows else []
        table = {name: np.array([row[name] for row in rows]) for name in names}
        if "creepages" in table:
            table["distance"] = self.results[0].element[0] * np.arange(1.0, 1.0 + len(rows))
        return table

    def _stack_fields(self, xarray: Any) -> Any:
        doubted = dict.fromkeys(text for result in self.results for text in result.warnings)
        fields = xarray.concat(
            [result.to_xarray() for result in self.results], "point", data_vars="all",
            coords="minimal", compat="override", join="override", combine_attrs="drop_conflicts",
        )  # fmt: skip
        return fields.assign_attrs(warnings="\n".join(doubted))


@files.loadable
class LoadCurve(Results[NormalResult]):
    """Results for a sequence of loads: an iterator that computes each `NormalResult`.

    An interrupted iteration continues where it stopped; after the last result, it starts again with
    the first without computing anew. `plot`, `to_dataframe`, `to_xarray` and `save` compute the
    remaining results. `len` is the total number of loads.

    Attributes
    ----------
    results : list
        The results computed so far; if `keep` is false, only the last one.
    points : int
        The number of loads.
    keep : bool
        Whether results are kept. Their numbers are always kept; the `stiffness` is NaN if it was
        not read before the next load.

    See Also
    --------
    load_curve : returns it.
    """

    _title, _kind, _warns = "Load curve", NormalResult, True


@files.loadable
class RollingSteps(Results[TangentialResult]):
    """Results of rolling step by step: an iterator that computes each `TangentialResult`.

    Methods and attributes are those of `LoadCurve`, with steps instead of loads.

    See Also
    --------
    rolling_steps : returns it.
    """

    _title, _kind = "Rolling", TangentialResult


def _list_numbers(result: Any, *, asks: bool) -> dict[str, Any]:
    """Return the numbers of a result; those computed on demand are computed (`asks`) or NaN."""
    own, numbers = vars(result), {}
    for name, quantity in quantities(type(result)).items():
        value = own[name]
        if "grid" in quantity.axes or value is None or type(value) is tuple:
            continue
        numbers[name] = value if not callable(value) else getattr(result, name) if asks else np.nan
    return numbers
