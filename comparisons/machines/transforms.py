"""What libraries of transforms gain: products with SciPy's and with MKL's, and by hand.

By hand is what one writes in two lines, ``irfft(spectrum * rfft(x, length), length)[:n]``, by
`mkl_fft` where it can be imported, else by `scipy.fft`; bare are two complex transforms of as many
numbers as the grid has, by the same, and for products by SciPy's by `scipy.fft`. CPU time on one
thread, in turns; the shortest.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import scipy.fft

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.report import Row
from toeplitz_mg._typing import Array

# By hand and bare. In place those of mkl_fft are wrong at many lengths on some processors.
fastest: Any = scipy.fft
with suppress(ImportError):
    import mkl_fft

    fastest = mkl_fft

SHAPES = (300,), (1024,), (4096,), (16_384,), (65_536,), (98_304,), (2**17,), (10**6,), (2**20,)
GRIDS = (64, 64), (256, 256), (512, 512), (1024, 1024), (48, 48, 48)
TURNS, SECONDS = 40, 1.0  # Most turns, and CPU seconds after which there are no more.
SHORTEST = 2e-4  # CPU seconds of a turn, so that the clock resolves it.
RATIOS = {"bare": "of_bare", "by hand": "of_hand"}
FORMATS = {"grid": "", "transforms": "", "seconds": ".2g", "of_scipy": ".2f", "by_hand": ""}
FORMATS |= {"of_hand": ".2f", "of_bare": ".2f"}


def by_hand(c: Array, x: Array) -> Callable[[], Array]:
    """Return the product as one writes it."""
    lengths = [scipy.fft.next_fast_len(2 * n - 1, real=True) for n in c.shape]
    spectrum = scipy.fft.rfftn(tmg.ToeplitzOperator(c).circulant(tuple(lengths))).real.copy()
    cut = tuple(map(slice, c.shape))
    field = x.reshape(c.shape)
    if c.ndim == 1:
        return lambda: fastest.irfft(spectrum * fastest.rfft(field, *lengths), *lengths)[cut]
    return lambda: fastest.irfftn(spectrum * fastest.rfftn(field, lengths), lengths)[cut]


def measure(shape: tuple[int, ...], turns: int) -> Iterator[Row]:
    """Time all products on a grid, in turns."""
    c = 1.0 / (1.0 + np.sqrt(sum(k**2 for k in np.indices(shape, sparse=True))))
    x = np.random.default_rng(0).standard_normal(c.size)
    actions: dict[str, Callable[[], Any]] = {"by hand": by_hand(c, x)}
    Z = np.zeros(shape, np.complex128)  # Bare are two complex transforms on a grid.
    actions["bare scipy"] = lambda: scipy.fft.ifftn(scipy.fft.fftn(Z))
    actions["bare mkl"] = lambda: fastest.ifftn(fastest.fftn(Z))
    names = ["scipy"] + ["mkl"] * (tmg.use_transforms() == "mkl")
    for name in names:
        with tmg.use_transforms(name):
            A = tmg.ToeplitzOperator(c)
        actions[name] = partial(A.dot, x)
    times: dict[str, list[float]] = {name: [] for name in actions}
    repeats = dict.fromkeys(actions, 1)
    for turn in range(-2, turns):
        for name, action in actions.items():
            if sum(times[name]) * repeats[name] > SECONDS:
                continue
            with tmg.use_transforms(name if name in names else "scipy"):
                start = process_time()
                for _ in range(repeats[name]):
                    action()
                spent = process_time() - start
            if turn >= 0:
                times[name].append(spent / repeats[name])
            elif turn == -1:  # The first call of each plans its transforms.
                repeats[name] = max(1, round(SHORTEST / max(spent, 1e-6)))
    least = {name: min(seconds) for name, seconds in times.items()}
    hand = fastest.__name__
    for name in names:
        row: Row = {"grid": " x ".join(map(str, shape)), "transforms": name}
        row |= {"seconds": least[name], "of_scipy": least[name] / least["scipy"], "by_hand": hand}
        row["of_hand"] = least[name] / least["by hand"]
        yield row | {"of_bare": least[name] / least[f"bare {name}"]}


def run(
    folder: Path, *, shapes: Sequence[tuple[int, ...]] = SHAPES + GRIDS, turns: int = TURNS
) -> None:
    """Time everything, a grid at a time."""
    table = report.Table("Whose transforms", folder / "transforms.csv", FORMATS, {"grid": 14})
    for shape in shapes:
        table.extend(measure(shape, turns))


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of docs/benchmarks.md."""
    table: dict[str, Row] = {}
    for row in rows:
        name = {"mkl": "MKL", "scipy": "SciPy"}[row["transforms"]]
        cells = table.setdefault(row["grid"], {"grid": row["grid"]})
        cells |= {f"product, {name}": report.format_seconds(row["seconds"])}
        cells |= {f"{name} / {by}": f"{row[key]:.2f}" for by, key in RATIOS.items()}
        if name == "MKL":
            cells["MKL / SciPy"] = f"{row['of_scipy']:.2f}"
    return list(table.values())
