"""The values of a series with gaps, and its pandas index if it has one."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.values import numbers


@dataclass(frozen=True)
class Labels:
    """A series or field with NaN where nothing was observed."""

    values: Array
    series: Any = None  # The given Series, whose index is used for results.

    @classmethod
    def of(cls, y: Any) -> "Labels":
        """Accept arrays, masked arrays, and a Series, or a table of one, with equal steps."""
        if hasattr(y, "columns"):
            if len(y.columns) != 1:
                raise TypeError(
                    f"y is a table of {len(y.columns)} columns, but must be one series: take one "
                    "of its columns"
                )
            y = y.iloc[:, 0]
        if hasattr(y, "iloc"):
            _check_index(y.index)
            return cls(y.to_numpy(dtype=np.float64, na_value=np.nan), y)
        return cls(fill(y))

    @property
    def name(self) -> str:
        """The name of the series."""
        name = getattr(self.series, "name", None)
        return "y" if name is None else str(name)

    def wrap(self, values: Array) -> Any:
        """Return values in the form of the input; for additional values the index is continued."""
        if self.series is None:
            return values
        index = self.index(len(values) - len(self.values))
        return type(self.series)(values, index=index, name=self.series.name)

    def index(self, steps: int, spacing: float = 1.0) -> Any:
        """Return the index continued by so many steps, or multiples of the spacing."""
        if self.series is None:
            return np.arange(len(self.values) + steps) * spacing
        index = self.series.index
        if not steps:
            return index
        import pandas as pd  # Installed, as y is a pandas Series.

        if isinstance(index, pd.DatetimeIndex):
            times = pd.date_range(index[-1], periods=steps + 1, freq=_frequency(index))
            return index.append(times[1:])
        step = 1 if isinstance(index, pd.PeriodIndex) else index[-1] - index[-2]
        return index.append(pd.Index([index[-1] + (k + 1) * step for k in range(steps)]))


def fill(y: ArrayLike) -> Array:
    """Return a copy of y with NaN where it is masked."""
    if not isinstance(y, np.ma.MaskedArray):
        return numbers("y", y)
    values = numbers("y", np.asarray(y.data))
    values[np.ma.getmaskarray(y)] = np.nan
    return values


def _frequency(index: Any) -> Any:
    """Return the frequency of timestamps, or None if their steps differ."""
    import pandas as pd

    with warnings.catch_warnings(action="ignore"):  # A deprecation in pandas 4.
        return index.freq or pd.infer_freq(index)


def _check_index(index: Any) -> None:
    """Raise an error if rows of an index are missing: gaps must be NaN."""
    import pandas as pd

    if len(index) < 3:
        return
    if isinstance(index, pd.DatetimeIndex):
        is_regular = _frequency(index) is not None
    else:
        ticks = index.asi8 if isinstance(index, pd.PeriodIndex) else index.to_numpy()
        if ticks.dtype.kind not in "iufm":
            raise TypeError(
                f"the index of y has dtype {index.dtype}, but must be of numbers or times"
            )
        steps = np.diff(ticks)
        is_regular = bool(steps.all() and np.allclose(steps / steps[0], 1.0))
    if not is_regular:
        raise ValueError(
            "the index of y does not have equal steps, but must: rows that are missing become NaN "
            "by y.asfreq('W') (or another frequency), or by y.reindex(range(first, last + 1))"
        )
