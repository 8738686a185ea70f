"""`toeplitz_mg.solve_toeplitz` for several right-hand sides, and for batches of small systems.

The times of CG in the DCT domain for all right-hand sides, of the inverse and of the method that is
chosen, over that of SciPy's function: where the first two cross is what `COSINE_LIMIT` of
``solvers/crossovers.py`` says. Then batches of symmetric systems, as of frames of linear
prediction, and matrices without a symbol with so many right-hand sides that LU is sooner than
Levinson's recursion. CPU time on one thread, in turns, whose order is drawn.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from unittest.mock import patch

import numpy as np
import scipy.linalg
from tqdm import tqdm

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import time_call
from comparisons.harness.processes import in_a_fresh_process, prepare
from comparisons.harness.report import Row
from comparisons.speed.drop_in import Contender, time_in_turns
from comparisons.systems.symbols import column, random_pair
from toeplitz_mg.solvers import crossovers

SYMBOLS = ("contact", "fGn, H = 0.9", "0.9^k")
SIZES, QUICK_SIZES = (1024, 2048, 3001, 4096), (300,)
COLUMNS, QUICK_COLUMNS = (2, 3, 4, 6, 8, 16), (2, 16)
BATCHES, QUICK_BATCHES = ((1000, 12), (1000, 32), (100, 12), (200, 64)), ((100, 12),)
DENSE, QUICK_DENSE = ((500, 500), (2000, 100), (2000, 2000)), ((300, 100),)
LIMITS = {"CG in the DCT domain": 2**30, "inverse": 0}  # Values of `COSINE_LIMIT`.


def measure_columns(name: str, n: int, columns: Sequence[int]) -> list[Row]:
    """Time what may solve a symmetric system for several right-hand sides, by default's residual.

    Both methods stand behind the same choice, which is told to take the one or the other.
    """
    c = column(name, n)
    rows: list[Row] = []
    for k in columns:
        b = np.random.default_rng(0).standard_normal((n, k))
        solve = partial(tmg.solve_toeplitz, c, b, full_output=True)
        contenders = {
            method: Contender(partial(_limited, limit, solve)) for method, limit in LIMITS.items()
        }
        contenders["chosen"] = Contender(solve)
        contenders["SciPy"] = Contender(partial(scipy.linalg.solve_toeplitz, c, b))
        seconds = time_in_turns(contenders)
        row: Row = {"symbol": name, "n": n, "columns": k, "method": solve()[1].method}
        rows.append(row | seconds)
    return rows


def _limited(limit: int, solve: Callable[[], object]) -> None:
    with patch.object(crossovers, "COSINE_LIMIT", limit):
        solve()


def measure_batch(systems: int, n: int) -> Row:
    """Time a batch of positive definite systems beside SciPy's function, one after the other."""
    rng = np.random.default_rng(0)
    # Autocorrelations of noise, as of frames of a signal.
    power = np.abs(np.fft.rfft(rng.standard_normal((systems, 4 * n)))) ** 2
    c = np.fft.irfft(power)[:, :n]
    b = rng.standard_normal((systems, n))

    def by_scipy() -> None:
        for column_of_one, right in zip(c, b, strict=True):
            scipy.linalg.solve_toeplitz(column_of_one, right)

    at_once = partial(tmg.solve_toeplitz, c, b[..., np.newaxis])
    seconds = time_in_turns({"ours": Contender(at_once), "SciPy": Contender(by_scipy)})
    return {"systems": systems, "n": n} | seconds | {"ratio": seconds["ours"] / seconds["SciPy"]}


def measure_dense(n: int, columns: int) -> Row:
    """Time a system of random entries, not symmetric, once each: it takes seconds."""
    c, r = random_pair(n)
    b = np.random.default_rng(0).standard_normal((n, columns))
    (_, info), ours = time_call(partial(tmg.solve_toeplitz, (c, r), b, full_output=True))
    scipys = time_call(partial(scipy.linalg.solve_toeplitz, (c, r), b))[1]
    row: Row = {"n": n, "columns": columns, "method": info.method, "residual": info.residual}
    return row | {"ours": ours, "SciPy": scipys, "ratio": ours / scipys}


def run_columns(sizes: Sequence[int], columns: Sequence[int]) -> Iterator[list[Row]]:
    """Yield the rows so far, each symbol and size in a fresh process."""
    rows: list[Row] = []
    for name in tqdm(SYMBOLS, unit="symbol"):
        for n in sizes:
            rows += in_a_fresh_process(partial(measure_columns, name, n, columns))
            yield rows


def main() -> None:
    """Run the comparison."""
    prepare("comparisons.speed.columns")
    arguments = report.options("speed.columns", "Several right-hand sides, and batches.")
    quick = arguments.quick
    rows: list[Row] = []
    sizes, columns = (QUICK_SIZES, QUICK_COLUMNS) if quick else (SIZES, COLUMNS)
    for rows in run_columns(sizes, columns):
        report.write_csv(arguments.output / "columns.csv", rows)
    report.show("Seconds for several right-hand sides", _as_ratios(rows))
    batches = [measure_batch(*shape) for shape in (QUICK_BATCHES if quick else BATCHES)]
    report.write_csv(arguments.output / "batches.csv", batches)
    report.show("Seconds of batches", [_rounded(row) for row in batches])
    dense = [measure_dense(*shape) for shape in (QUICK_DENSE if quick else DENSE)]
    report.write_csv(arguments.output / "dense.csv", dense)
    report.show("Seconds of matrices without a symbol", [_rounded(row) for row in dense])


def _as_ratios(rows: Sequence[Row]) -> list[Row]:
    """Return the rows with the times of our methods over SciPy's."""
    ours = (*LIMITS, "chosen")
    return [_rounded(row | {key: row[key] / row["SciPy"] for key in ours}) for row in rows]


def _rounded(row: Row) -> Row:
    return {key: f"{v:.2g}" if isinstance(v, float) else v for key, v in row.items()}


if __name__ == "__main__":
    main()
