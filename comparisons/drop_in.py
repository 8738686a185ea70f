"""`toeplitz_mg.solve_toeplitz` against the faster of two rivals, at every size.

The rivals: `scipy.linalg.solve_toeplitz`, and what one writes by hand, CG with T. Chan's circulant,
on `mkl_fft` where that can be imported, else on `scipy.fft`. CPU time on one thread, set-ups and
the check of our residual included; the contenders in turns, whose order is drawn, in one process, a
fresh one for each symbol and decade; low quantiles, of fewer turns for one that takes long.
``--symbols``, ``--sizes``, ``--columns`` and ``--digits``, of the residual, choose others.
``--channels`` compares `solve_block_toeplitz` for autoregressions of so many channels with a dense
Cholesky factor.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from itertools import groupby

import numpy as np
import scipy.linalg
from scipy.fft import next_fast_len
from scipy.sparse.linalg import LinearOperator, cg

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import time_in_turns
from comparisons.harness.processes import in_a_fresh_process, prepare
from comparisons.harness.report import Row
from comparisons.machines.transforms import fastest
from comparisons.systems import symbols
from toeplitz_mg._typing import Array

SYMBOLS = ("contact", "fGn, H = 0.9", "0.9^k", "exp(-k/1000)", "θ²")
A_DECADE = 24  # Sizes in each decade beyond the first 40.
LONG = 2**17  # Unknowns for which SciPy's takes half a minute: once, for the contact kernel.
SIZES = (*range(1, 41), *(round(10 ** (k / A_DECADE)) for k in range(39, 6 * A_DECADE + 1)), LONG)
TABULATED = (32, 100, 316, 1000, 3162, 10_000, 100_000, LONG, 1_000_000)  # In docs/benchmarks.md.
QUICK_SIZES = (*range(1, 41, 6), *SIZES[40:80:8])
COLUMNS = (1, 64)
DIGITS = 8  # Those of the relative residual that is asked for, unless told otherwise.
MOST_NUMBERS = 2**22  # Of the right-hand sides of a system.
LEVINSON_STEPS = 2**28  # Most steps, n² a column, of SciPy's, and so n = 16,384.
BY_HAND = range(100, LONG + 1)  # Sizes for the rival by hand, which is far behind at the others.
FORMATS = {"symbol": "", "columns": "d", "n": "d", "seconds": ".2g", "scipy_seconds": ".2g"}
FORMATS |= {"by_hand_seconds": ".2g", "ratio": ".2f", "method": "", "iterations": "d"}
FORMATS |= {"residual": ".0e"}


def solve_by_hand(c: Array, b: Array, rtol: float) -> Array:
    """Solve by SciPy's CG with T. Chan's circulant, all written on the fastest transforms."""
    n = len(c)
    k, length = np.arange(n), next_fast_len(2 * n - 1, real=True)
    symbol = fastest.rfft(np.concatenate([c, np.zeros(length - 2 * n + 1), c[:0:-1]])).real
    eigenvalues = fastest.rfft(((n - k) * c + k * np.r_[0.0, c[:0:-1]]) / n).real

    def multiply(x: Array) -> Array:
        return fastest.irfft(symbol * fastest.rfft(x, length), length)[:n]

    def precondition(x: Array) -> Array:
        return fastest.irfft(fastest.rfft(x) / eigenvalues, n)

    A, M = (LinearOperator((n, n), f, dtype=float) for f in (multiply, precondition))
    x, info = cg(A, b, M=M, rtol=rtol, maxiter=2000)
    if info:
        raise ArithmeticError("not converged")
    return x


def measure(name: str, sizes: Sequence[int], columns: int, rtol: float) -> list[Row]:
    """Time all contenders in this process."""
    return [measure_one(name, n, columns, rtol) for n in sizes]


def measure_one(name: str, n: int, columns: int, rtol: float) -> Row:
    """Time all contenders on one system, in turns, after a first run of each."""
    c = symbols.column(name, n)
    b = np.random.default_rng(0).standard_normal((n, columns) if columns > 1 else n)
    x, info = tmg.solve_toeplitz(c, b, rtol=rtol, full_output=True)
    contenders: dict[str, Callable[[], object]] = {
        "seconds": partial(tmg.solve_toeplitz, c, b, rtol=rtol)
    }
    if columns * n**2 <= LEVINSON_STEPS or (name, n, columns) == ("contact", LONG, 1):
        contenders["scipy_seconds"] = partial(scipy.linalg.solve_toeplitz, c, b)
    if columns == 1 and n in BY_HAND:
        with suppress(ArithmeticError):  # It may not converge.
            solve_by_hand(c, b, rtol)
            contenders["by_hand_seconds"] = partial(solve_by_hand, c, b, rtol)
    row: Row = {"symbol": name, "columns": columns, "n": n}
    row |= dict.fromkeys(("seconds", "scipy_seconds", "by_hand_seconds", "ratio"))
    row |= time_in_turns(contenders)
    if rivals := [row[key] for key in contenders if key != "seconds"]:
        row["ratio"] = row["seconds"] / min(rivals)  # To the faster rival.
    r = b - scipy.linalg.matmul_toeplitz(c, x)
    residual = float((np.linalg.norm(r, axis=0) / np.linalg.norm(b, axis=0)).max())
    return row | {"method": info.method, "iterations": info.iterations, "residual": residual}


def run(
    sizes: Sequence[int], names: Sequence[str], columns: Sequence[int], rtol: float
) -> Iterator[Row]:
    """Yield the rows of all systems, a decade at a time."""
    for name in names:
        for k in columns:
            some = [n for n in sizes if k * n <= MOST_NUMBERS]
            for _, decade in groupby(some, lambda n: len(str(n))):
                # A process of its own for each: what one leaves behind is not the time of the next.
                yield from in_a_fresh_process(partial(measure, name, list(decade), k, rtol))


def measure_channels(channels: Sequence[int], unknowns: Sequence[int]) -> Iterator[Row]:
    """Yield the times of block Toeplitz systems, and those of dense Cholesky factors."""
    random = np.random.default_rng(0)
    for k in channels:
        mixing = random.standard_normal((k, k)) / np.sqrt(k)
        for n in (N // k for N in unknowns):
            c = 0.8 ** np.arange(n)[:, None, None] * (mixing @ mixing.T)
            c[0] += np.eye(k)
            b = random.standard_normal((n, k))
            lags, i = np.concatenate([c[:0:-1].swapaxes(1, 2), c]), np.arange(n)

            def factor(lags: Array = lags, i: Array = i, b: Array = b) -> Array:
                A = lags[i[:, None] - i + len(i) - 1].swapaxes(1, 2).reshape(b.size, b.size)
                return scipy.linalg.cho_solve(scipy.linalg.cho_factor(A, lower=True), b.ravel())

            solve = partial(tmg.solve_block_toeplitz, c, b, full_output=True)
            contenders: dict[str, Callable[[], object]] = {"seconds": solve}
            contenders["dense_seconds"] = factor
            row = time_in_turns(contenders) | {"method": solve()[1].method}
            yield {"channels": k, "unknowns": n * k} | row


def worst(rows: Sequence[Row]) -> list[Row]:
    """Return the largest ratios to the faster rival, and where they are."""
    table: list[Row] = []
    for (symbol, columns), own in report.group(rows, "symbol", "columns").items():
        ratios = [(row["ratio"], row["n"]) for row in own if row["ratio"] is not None]
        ratio = "{:.2f} at {}".format(*max(ratios)) if ratios else "no rival"
        table.append({"symbol": symbol, "columns": columns, "largest ratio": ratio})
    return table


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of docs/benchmarks.md: some sizes across, the contact kernel in full."""
    found = {(row["symbol"], row["columns"], row["n"]): row for row in rows}

    def line(title: str, name: str, columns: int, key: str) -> Row:
        cells: Row = {"n": title}
        for n in TABULATED:
            value = found.get((name, columns, n), {}).get(key)
            shown = "" if value is None else f"{value:.2f}"
            cells[f"{n:,}"] = report.format_seconds(value) if key.endswith("seconds") else shown
        return cells

    titles = {"scipy_seconds": "SciPy", "by_hand_seconds": "CG with T. Chan's circulant by hand"}
    titles |= {"seconds": "this package", "ratio": "its time over that of the faster rival"}
    table = [
        line(f"contact kernel, {k} right-hand side{'s' * (k > 1)}: {title}", "contact", k, key)
        for k in COLUMNS
        for key, title in titles.items()
    ]
    table += [
        line(f"{name}, {k}: the same ratio", name, k, "ratio")
        for k in COLUMNS
        for name in SYMBOLS[1:]
    ]
    return [cells for cells in table if any(list(cells.values())[1:])]


@report.interruptible
def main(argv: Sequence[str] | None = None) -> None:
    """Run the comparison."""
    prepare("comparisons.drop_in")
    arguments = report.options(
        "drop_in",
        "Compare solve_toeplitz with SciPy's.",
        argv=argv,
        symbols=tuple(symbols.COLUMNS),
        sizes=[],
        columns=list(COLUMNS),
        digits=DIGITS,
        channels=[],
    )
    if arguments.channels:
        unknowns = arguments.sizes or (200, 400, 600, 800, 1200, 2400)
        channels = list(measure_channels(arguments.channels, unknowns))
        report.show("Seconds of block Toeplitz systems", channels)
        return
    sizes = arguments.sizes or (QUICK_SIZES if arguments.quick else SIZES)
    room = {"symbol": 12, "seconds": 8, "method": 40}
    table = report.Table("Seconds", arguments.output / "drop_in.csv", FORMATS, room)
    names, rtol = arguments.symbols or SYMBOLS, 10.0**-arguments.digits
    table.extend(run(sizes, names, arguments.columns, rtol))
    report.show("The largest ratios to the faster rival, and where", worst(table.rows))


if __name__ == "__main__":
    main()
