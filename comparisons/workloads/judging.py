"""What is found of a job: its times in both trees, how far the answers agree, and what is wrong."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import exp, inf, isnan, log, log10, nan
from statistics import median
from typing import Any

import numpy as np

from comparisons.harness.report import Row, format_seconds

PEER_LIMIT = 1.1  # Largest ratio to SciPy's time, or that of the other tree, of jobs with a peer.
MEAN_LIMIT = 1.1  # Largest geometric mean of the ratios of all others to the other tree.
MEASUREMENTS = 3  # Most measurements of a job that is above its limit: two of them decide.
WORST = 5  # Jobs of the largest ratios that are named at the end.


@dataclass
class Measurement:
    """The least CPU seconds of a job, of some turns; infinite where not measured."""

    here: float = inf  # In this tree, in the other one, and of SciPy's function.
    there: float = inf
    peer: float = inf
    difference: float = 0.0  # The largest of two answers, over the largest number in them.
    errors: dict[str, str] = field(default_factory=dict)  # By the names of trees.


@dataclass
class Result:
    """All measurements of a job."""

    job: Any
    measurements: list[Measurement]

    @property
    def ratio(self) -> float:
        """The time here over that there, the median; not a number where it was not measured."""
        return middle([m.here / m.there for m in self._compared])

    @property
    def peer_ratio(self) -> float:
        """The time here over that of SciPy's function, likewise."""
        return middle([m.here / m.peer for m in self.measurements if m.here < inf > m.peer])

    @property
    def limit(self) -> float:
        """The largest ratio that the job may have."""
        return PEER_LIMIT if self.job.peer else float(self.job.limit)

    @property
    def is_settled(self) -> bool:
        """Whether the ratios that there are decide, as two of three do."""
        slow = [ratio > self.limit for ratio in self._judged]
        majority = MEASUREMENTS // 2 + 1
        return not any(slow) or sum(slow) >= majority or len(slow) - sum(slow) >= majority

    @property
    def faults(self) -> list[str]:
        """What is wrong, in words."""
        faults = [m.errors["here"] for m in self.measurements if "here" in m.errors][:1]
        difference = max(m.difference for m in self.measurements)
        if difference > self.job.tolerance:
            faults.append(f"answers differ by {difference:.1e}, more than {self.job.tolerance:.0e}")
        if middle(self._judged) > self.limit:
            others = "the other tree" + " and SciPy's function" * bool(self.job.peer)
            faults.append(f"takes more than {self.limit:g} of the time of {others}")
        return faults

    @property
    def row(self) -> Row:
        """What is printed of the job."""
        found = self.measurements
        times = {key: min(getattr(m, key) for m in found) for key in ("here", "there")}
        difference = max(m.difference for m in found)
        digits = "all" if difference == 0.0 else f"{max(0.0, -log10(difference)):.1f}"
        notes = [f"there: {m.errors['there']}" for m in found if "there" in m.errors][:1]
        row: Row = {"job": f"{self.job.family}: {self.job.name}"}
        row |= {key: format_seconds(s) if s < inf else "" for key, s in times.items()}
        ratios = {"ratio": self.ratio, "of SciPy's": self.peer_ratio}
        row |= {key: "" if isnan(ratio) else f"{ratio:.2f}" for key, ratio in ratios.items()}
        row["digits"] = digits if times["there"] < inf else ""
        return row | {"note": "; ".join(self.faults + notes)}

    @property
    def _judged(self) -> list[float]:
        if self.job.peer:
            return [m.here / max(m.there, m.peer) for m in self._compared]
        return [m.here / m.there for m in self._compared]

    @property
    def _compared(self) -> list[Measurement]:
        return [m for m in self.measurements if m.here < inf > m.there]


def middle(values: Sequence[float]) -> float:
    """Return the median, or no number of none."""
    return median(values) if values else nan


def differ(x: Any, y: Any) -> float:
    """Return the largest difference of two answers, over the largest number in them."""
    if x.shape != y.shape or not (np.isfinite(x).all() and np.isfinite(y).all()):
        return inf
    size = max(np.abs(x).max(initial=0.0), np.abs(y).max(initial=0.0))
    return float(np.abs(x - y).max(initial=0.0) / size) if size > 0.0 else 0.0


def summarise(results: Sequence[Result]) -> bool:
    """Print the geometric mean, the worst jobs and all faults; return whether all is well."""
    faults = [(result, fault) for result in results for fault in result.faults]
    compared = [result for result in results if not result.job.peer and not isnan(result.ratio)]
    mean = exp(sum(log(result.ratio) for result in compared) / max(1, len(compared)))
    if compared:
        compared.sort(key=lambda result: result.ratio, reverse=True)
        worst = ", ".join(
            f"{result.job.family}: {result.job.name} {result.ratio:.2f}"
            for result in compared[:WORST]
        )
        print(f"\nGeometric mean of {len(compared)} ratios: {mean:.3f}; may be {MEAN_LIMIT:g}")
        print(f"The largest: {worst}")
    for result, fault in faults:
        print(f"FAILED {result.job.family}: {result.job.name}: {fault}")
    return not faults and mean <= MEAN_LIMIT
