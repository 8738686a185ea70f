"""How fast everything is: products, solves, further right-hand sides, memory, growth with n.

Each contender is set up in a process of its own, and all processes of one size take turns, run by
run, so that what disturbs the machine disturbs them alike; medians of CPU and wall time, on one
thread. The plain contenders are what one writes on `scipy.fft` by hand. The physical limit of a
product is max(10 n log₂(2n)/R, 24 n/B), R the rate of complex transforms of length 4096, which
stay in the cache, and B the bandwidth of a triad, both measured at the start.
"""

import math
import os
import resource
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context, set_forkserver_preload
from multiprocessing.connection import Connection
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any

import numpy as np
import scipy.fft
import scipy.linalg
import scipy.signal
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, cg
from tqdm import tqdm

import toeplitz_mg as tmg
from comparisons import report
from comparisons.measuring import RUSAGE_BYTES
from comparisons.report import Row
from comparisons.symbols import COLUMNS

Array = NDArray[Any]
Action = Callable[[], Any]
Contender = Callable[[Array, Array], Action]  # the column and the vector; the call is the set-up

TOLERANCE = 1e-8
PRODUCT_SIZES = tuple(2**k for k in range(4, 25, 2))
SOLVE_SIZES = tuple(2**k for k in range(6, 23, 2))
LEVEL_SIZES = {"two levels": tuple(4**k for k in range(5, 12)), "three levels": (8**5, 8**7)}
QUICK_PRODUCTS, QUICK_SOLVES = (2**6, 2**10, 2**14), (2**6, 2**10)
TURN_SECONDS = 1.0  # of one contender's runs of one size
MOST_TURNS = 200
SLOW = 4.0  # seconds of one run, after which larger sizes are left out


class Plain:
    """The product that one writes by hand: the spectrum of fast lengths, kept."""

    def __init__(self, c: Array) -> None:
        self.shape = c.shape
        self.cut = tuple(slice(n) for n in c.shape)
        self.lengths = tuple(scipy.fft.next_fast_len(2 * n - 1, real=True) for n in c.shape)
        for level, (n, length) in enumerate(zip(c.shape, self.lengths, strict=True)):
            gap = [(0, length - 2 * n + 1 if k == level else 0) for k in range(c.ndim)]
            mirrored = np.flip(np.take(c, np.arange(1, n), axis=level), level)
            c = np.concatenate([np.pad(c, gap), mirrored], axis=level)
        self.spectrum = scipy.fft.rfftn(c).real

    def __call__(self, x: Array) -> Array:
        """Multiply a vector."""
        hat = self.spectrum * scipy.fft.rfftn(x.reshape(self.shape), self.lengths)
        return np.asarray(scipy.fft.irfftn(hat, self.lengths)[self.cut].ravel())


class PlainCirculant:
    """The inverse of a circulant, likewise."""

    def __init__(self, column: Array) -> None:
        self.n = len(column)
        self.spectrum = 1.0 / scipy.fft.rfft(column).real

    def __call__(self, x: Array) -> Array:
        """Multiply a vector."""
        return np.asarray(scipy.fft.irfft(self.spectrum * scipy.fft.rfft(x), self.n))


def covariance(levels: int, n: int) -> Array:
    """Return coefficients on a grid of so many levels and n elements in all."""
    k = np.indices((round(n ** (1 / levels)),) * levels)
    return np.asarray(np.exp(-np.sqrt((k**2).sum(axis=0))))


def chan_column(c: Array) -> Array:
    """Return the first column of T. Chan's circulant."""
    n = len(c)
    k = np.arange(n)
    return np.asarray(((n - k) * c + k * np.r_[0.0, c[:0:-1]]) / n)


def strang_column(c: Array) -> Array:
    """Return the first column of Strang's circulant."""
    n = len(c)
    k = np.arange(n)
    return np.asarray(c[np.minimum(k, n - k)])


def plain_product(c: Array, b: Array) -> Action:
    """Multiply by hand."""
    return partial(Plain(c), b)


def our_product(c: Array, b: Array) -> Action:
    """Multiply by the engine."""
    return partial(tmg.ToeplitzOperator(c)._apply, b, np.empty_like(b))


def operator_product(c: Array, b: Array) -> Action:
    """Multiply by the LinearOperator, with SciPy's checks."""
    A = tmg.ToeplitzOperator(c)
    return lambda: A @ b


def matmul_toeplitz(c: Array, b: Array) -> Action:
    """Multiply by SciPy's function."""
    return partial(scipy.linalg.matmul_toeplitz, c, b, check_finite=False)


def fftconvolve(c: Array, b: Array) -> Action:
    """Multiply by SciPy's convolution."""
    lags = np.concatenate([c[:0:-1], c])
    return lambda: scipy.signal.fftconvolve(lags, b, "valid")


def bare_transforms(c: Array, b: Array) -> Action:
    """Transform only, in real numbers, there and back."""
    length = scipy.fft.next_fast_len(2 * len(c) - 1, real=True)
    return lambda: scipy.fft.irfft(scipy.fft.rfft(b, length), length)


def by_ducc0(contender: Contender, c: Array, b: Array) -> Action:
    """Do the same with the transforms of ducc0."""
    from toeplitz_mg import ducc0_backend

    scipy.fft.set_global_backend(ducc0_backend)
    return contender(c, b)


def plain_cg(preconditioner: Callable[[Array], Any] | None, c: Array, b: Array) -> Action:
    """Solve by SciPy's cg with all written by hand, set-up included."""

    def solve() -> Array:
        shape = (len(c), len(c))
        A = LinearOperator(shape, Plain(c), dtype=float)
        inverse = preconditioner and PlainCirculant(preconditioner(c))
        M = None if inverse is None else LinearOperator(shape, inverse, dtype=float)
        x, info = cg(A, b, M=M, rtol=TOLERANCE, maxiter=2000)
        if info:
            raise ArithmeticError("not converged")
        return np.asarray(x)

    return solve


def our_cg(preconditioner: Any, c: Array, b: Array) -> Action:
    """Solve by our cg, set-up included."""

    def solve() -> Array:
        A = tmg.ToeplitzOperator(c)
        x, info = tmg.cg(A, b, M=preconditioner(A), rtol=TOLERANCE)
        if info:
            raise ArithmeticError("not converged")
        return x

    return solve


def our_multigrid(c: Array, b: Array) -> Action:
    """Solve by V(0,1) cycles, set-up included."""

    def solve() -> Array:
        A = tmg.ToeplitzOperator(c)
        x, info = tmg.richardson(A, b, M=tmg.multigrid(A, pre=0), rtol=TOLERANCE)
        if info:
            raise ArithmeticError("not converged")
        return x

    return solve


def drop_in(c: Array, b: Array) -> Action:
    """Solve by `solve_toeplitz`."""
    return partial(tmg.solve_toeplitz, c, b, rtol=TOLERANCE)


def levinson(c: Array, b: Array) -> Action:
    """Solve by SciPy's Levinson recursion."""
    return partial(scipy.linalg.solve_toeplitz, c, b, check_finite=False)


def cholesky(c: Array, b: Array) -> Action:
    """Solve by a dense factorisation."""
    if len(c) > 2**14:
        raise MemoryError("too large for a dense matrix")
    return lambda: scipy.linalg.solve(scipy.linalg.toeplitz(c), b, assume_a="pos")


def inverse(columns: int, c: Array, b: Array) -> Action:
    """Solve for further right-hand sides; the set-up is not timed."""
    G = tmg.toeplitz_inverse(tmg.ToeplitzOperator(c))
    B = np.random.default_rng(0).standard_normal((columns, len(c)))
    out = np.empty_like(B)
    return lambda: G.G._apply(B, out)


single = np.float32
PRODUCTS: dict[str, Contender] = {
    "plain": plain_product,
    "ours": our_product,
    "ours, @": operator_product,
    "ours, ducc0": partial(by_ducc0, our_product),
    "bare transforms": bare_transforms,
    "matmul_toeplitz": matmul_toeplitz,
    "fftconvolve": fftconvolve,
}
LEVELS: dict[str, Contender] = {key: PRODUCTS[key] for key in ("plain", "ours", "ours, ducc0")}
SYSTEMS: dict[str, Callable[[int], Array]] = COLUMNS | {
    "two levels": partial(covariance, 2),
    "three levels": partial(covariance, 3),
}
SOLVES: dict[str, Contender] = {
    "plain CG + T. Chan": partial(plain_cg, chan_column),
    "plain CG + Strang": partial(plain_cg, strang_column),
    "plain CG": partial(plain_cg, None),
    "Levinson": levinson,
    "dense Cholesky": cholesky,
    "solve_toeplitz": drop_in,
    "CG + M": partial(our_cg, tmg.fft_preconditioner),
    "CG + M, float32": partial(our_cg, partial(tmg.fft_preconditioner, dtype=single)),
    "CG + cosine": partial(our_cg, tmg.cosine_preconditioner),
    "CG + spectral": partial(our_cg, tmg.spectral_preconditioner),
    "CG + spectral, float32": partial(our_cg, partial(tmg.spectral_preconditioner, dtype=single)),
    "V(0,1)": our_multigrid,
    "CG + M, ducc0": partial(by_ducc0, partial(our_cg, tmg.fft_preconditioner)),
    "CG + spectral, ducc0": partial(by_ducc0, partial(our_cg, tmg.spectral_preconditioner)),
}
FURTHER: dict[str, Contender] = {
    "plain product": plain_product,
    "toeplitz_inverse, 1": partial(inverse, 1),
    "toeplitz_inverse, 64": partial(inverse, 64),
}


@dataclass(frozen=True)
class Times:
    """Of one contender at one size."""

    cpu: float
    wall: float
    peak_vectors: float  # of n float64, above the process before the set-up
    note: str = ""


def _serve(contender: Contender, c: Array, b: Array, pipe: Connection) -> None:
    """Set a contender up, then run it whenever asked, and send the times."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        action = contender(c, b)
        action()
        while pipe.recv():
            wall, cpu = perf_counter(), process_time()
            action()
            cpu, wall = process_time() - cpu, perf_counter() - wall
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
            pipe.send((cpu, wall, peak * RUSAGE_BYTES / (8 * c.size)))
    except Exception as error:
        with suppress(OSError):
            pipe.send(f"{type(error).__name__}: {error}".partition("\n")[0])


def take_turns(contenders: dict[str, Contender], name: str, n: int) -> dict[str, Times]:
    """Time contenders at one size, in processes of their own, run by run in turns."""
    context = get_context("forkserver")
    pipes: dict[str, Connection] = {}
    processes = []
    results: dict[str, Times] = {}
    # Sent, not built there: the temporary arrays of building them would be the peak.
    c = SYSTEMS[name](n)
    b = np.random.default_rng(0).standard_normal(c.size)
    runs: dict[str, list[tuple[float, float, float]]] = {key: [] for key in contenders}
    for key, contender in contenders.items():
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(contender, c, b, theirs), daemon=True)
        process.start()
        theirs.close()
        processes.append(process)
        pipes[key] = ours
        _run(pipes, key, runs, results)  # it waits for the set-up: one at a time
    for turn in range(MOST_TURNS):
        for key in list(pipes):
            done = runs[key]
            # Seven at least, if they are not slow.
            seconds = sum(wall for _, wall, _ in done)
            if turn and (seconds > 10 * TURN_SECONDS or (turn > 6 and seconds > TURN_SECONDS)):
                continue
            _run(pipes, key, runs, results)
    for process in processes:
        process.kill()
        process.join()
    for key, done in runs.items():
        if done:
            cpu, wall, peak = zip(*done, strict=True)
            results[key] = Times(median(cpu), median(wall), max(peak))
    return results


def _run(
    pipes: dict[str, Connection],
    key: str,
    runs: dict[str, list[tuple[float, float, float]]],
    results: dict[str, Times],
) -> None:
    try:
        pipes[key].send(True)
        answer = pipes[key].recv()
    except (EOFError, OSError):
        answer = "the process died"
    if isinstance(answer, str):
        results[key] = Times(math.nan, math.nan, math.nan, answer)
        del pipes[key]
    else:
        runs[key].append(answer)


def compare(
    contenders: dict[str, Contender], name: str, sizes: Sequence[int], against: str
) -> list[Row]:
    """Time contenders at all sizes, and relate them to one of them."""
    rows: list[Row] = []
    left = dict(contenders)
    for n in tqdm(sizes, desc=f"{name}, against {against}", unit="size"):
        times = take_turns(left, name, n)
        base = times[against].cpu if against in times else math.nan
        for key, t in times.items():
            row = {"symbol": name, "n": n, "method": key, "cpu_s": t.cpu, "wall_s": t.wall}
            rows.append(row | {"ratio": t.cpu / base, "vectors": t.peak_vectors, "note": t.note})
        left = {k: c for k, c in left.items() if k not in times or times[k].wall < SLOW}
    return rows


def machine() -> tuple[float, float]:
    """Return R, flops a second of transforms in the cache, and B, bytes a second of a triad."""
    z = np.ones(4096, np.complex128)
    a, b, c = (np.ones(2**24) for _ in range(3))

    def triad() -> None:
        np.multiply(b, 3.0, out=a)
        np.add(a, c, out=a)

    def transform() -> None:
        for _ in range(100):
            scipy.fft.fft(z, overwrite_x=True)
            z[:] = 1.0

    seconds = {}
    for action in (transform, triad):
        runs = []
        for _ in range(9):
            start = perf_counter()
            action()
            runs.append(perf_counter() - start)
        seconds[action] = median(runs)
    # The triad in NumPy is two passes: 16 + 24 bytes a number.
    return 100 * 5 * 4096 * 12 / seconds[transform], 40.0 * 2**24 / seconds[triad]


def show(title: str, rows: Sequence[Row], key: str, spec: str) -> None:
    """Print a table, methods across."""
    table: dict[int, Row] = {}
    for row in rows:
        value = row[key]
        shown = "" if math.isnan(value) else format(value, spec)
        table.setdefault(row["n"], {"n": row["n"]})[row["method"]] = shown
    report.show(title, list(table.values()))


def show_growth(rows: Sequence[Row]) -> None:
    """Print the exponent of time over n."""
    table = []
    for method in dict.fromkeys(row["method"] for row in rows):
        own = {row["n"]: row["cpu_s"] for row in rows if row["method"] == method}
        ends = [n for n in own if n >= 2**16 and not math.isnan(own[n])]
        if len(ends) > 1:
            first, last = min(ends), max(ends)
            exponent = math.log(own[last] / own[first]) / math.log(last / first)
            table.append(
                {"method": method, "n": f"{first} … {last}", "exponent": f"{exponent:.3f}"}
            )
    report.show("Growth of time with n", table)


def plot(rows: Sequence[Row], title: str, path: Path) -> None:
    """Draw time over n."""
    figure = Figure(figsize=(9, 6), layout="constrained")
    ax = figure.subplots()
    for k, method in enumerate(dict.fromkeys(row["method"] for row in rows)):
        own = [row for row in rows if row["method"] == method]
        style = "--" if "plain" in method or method[0] in "LdmfSb" else "-"
        n, seconds = [row["n"] for row in own], [row["cpu_s"] for row in own]
        ax.plot(n, seconds, style, marker=".", color=f"C{k}" if k < 10 else "k", label=method)
    ax.set(xlabel="n", ylabel="CPU time, s", xscale="log", yscale="log", title=title)
    ax.set_xscale("log", base=2)
    ax.grid(alpha=0.3)
    ax.legend(ncols=2, fontsize=8)
    figure.savefig(path, dpi=130)


def main() -> None:
    """Run the comparison."""
    os.environ["OMP_NUM_THREADS"] = "1"  # read where the processes import BLAS
    set_forkserver_preload(["comparisons.speed"])
    arguments = report.options("speed", "Time products and solves.")
    folder, quick = arguments.output, arguments.quick
    R, B = machine()
    print(f"Transforms in the cache: {R / 1e9:.1f} Gflop/s; triad: {B / 1e9:.1f} GB/s")

    products = compare(PRODUCTS, "contact", QUICK_PRODUCTS if quick else PRODUCT_SIZES, "plain")
    for row in products:
        n = row["n"]
        row["limit"] = max(10 * n * math.log2(2 * n) / R, 24 * n / B) / row["cpu_s"]
    report.write_csv(folder / "products.csv", products)
    show("One product: CPU time against the plain one", products, "ratio", ".2f")
    show("One product: CPU time, µs", [r | {"us": r["cpu_s"] * 1e6} for r in products], "us", ".4g")
    show("One product: fraction of the physical limit", products, "limit", ".2f")
    plot(products, "One product", folder / "products.png")

    levels: list[Row] = []
    for name, sizes in LEVEL_SIZES.items():
        rows = compare(LEVELS, name, sizes[:1] if quick else sizes, "plain")
        levels += rows
        show(f"One product in {name}: CPU time against the plain one", rows, "ratio", ".2f")
    report.write_csv(folder / "levels.csv", levels)

    solves: list[Row] = []
    for name in ("contact", "fGn, H = 0.9"):
        rows = compare(SOLVES, name, QUICK_SOLVES if quick else SOLVE_SIZES, "plain CG + T. Chan")
        solves += rows
        report.write_csv(folder / "solves.csv", solves)
        show(f"{name}, to 1e-8: CPU time against plain CG + T. Chan", rows, "ratio", ".2f")
        show(f"{name}, to 1e-8: CPU time, s", rows, "cpu_s", ".2g")
        show(f"{name}: peak memory, vectors of n", rows, "vectors", ".1f")
        plot(rows, f"{name}: a solve to 1e-8", folder / f"solves_{name[:3]}.png")

    further = compare(
        FURTHER, "contact", (2**10,) if quick else (2**10, 2**16, 2**20), "plain product"
    )
    report.write_csv(folder / "further.csv", further)
    show("Further right-hand sides: CPU time against one plain product", further, "ratio", ".2f")
    show_growth(products + [row for row in solves if row["symbol"] == "contact"])


if __name__ == "__main__":
    main()
