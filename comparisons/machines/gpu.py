"""Products and solves on arrays of other libraries, as on a GPU, against those on NumPy's.

For each size of a square grid of a half-space: the error of a product, and its time beside that of
its four transforms, as they are called, on fields that they extend by zeros and whose axes they
exchange, and bare, of what lies as they like it best; iterations of CG with the cosine
preconditioner, the seconds from the coefficients to the solution, and the most bytes that are held
meanwhile. The same with FSAI on an area in fragments. For normal contact of a sphere the products,
and the seconds from the gap to the result, also of the first time, when some libraries compile. For
README's blocks the seconds. NumPy's arrays have all threads. It says on what it ran: figures of a
CPU say nothing about a GPU.
"""

import gc
import platform
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
import scipy.fft

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import time_call
from comparisons.harness.report import Row
from toeplitz_mg import contact, halfspace
from toeplitz_mg._typing import Array

LIBRARIES = ("jax", "cupy", "torch", "array_api_strict")
SIZES = (256, 512, 1024, 2048, 4096, 8192, 16384)  # Powers of two, as `transforms` takes them.
COMPARED = 2048  # Side of the largest grid that is multiplied and solved on NumPy's arrays too.
CONTACT = 4096  # The same that is pressed.
RUNS = 7  # Of which the median is taken.
ELEMENT = (0.01, 0.01)
STEEL = contact.Material(E=210000.0, nu=0.28)
LENGTH, RADIUS, FORCE = 0.64, 10.0, 100.0  # Of the grid, mm; of the sphere, mm; on it, N.
# The columns of the tables, and how their cells are printed.
PRODUCTS = {"device": "", "n": "", "error": ".1e", "product, ms": ".3g"}
PRODUCTS |= {"of its transforms": ".0%", "of bare ones": ".0%", "iterations": ""}
PRODUCTS |= {"on NumPy": "", "solve, s": ".2g", "bytes an unknown": ".0f"}
AREAS = {"device": "", "n": "", "unknowns": ",", "iterations": "", "on NumPy": ""}
AREAS |= {"set-up, s": ".2g", "set-up on NumPy, s": ".2g"}
AREAS |= {"solve, s": ".2g", "solve on NumPy, s": ".2g"}
PRESSED = {"device": "", "n": "", "first time, s": ".2g", "s": ".2g", "on NumPy, s": ".2g"}
PRESSED |= {"products": "", "on NumPy": "", "elements that differ": "", "bytes an element": ".0f"}
BLOCKS = {"device": "", "n": "", "solve, s": ".2g", "solve on NumPy, s": ".2g", "cg, s": ".2g"}
BLOCKS |= {"cg on NumPy, s": ".2g", "gradient, s": ".2g", "gradient on NumPy, s": ".2g"}


class Device:
    """A library of arrays, and the device on which it makes them."""

    def __init__(self, library: str) -> None:
        self.library = library
        self.module: Any = import_module(library)
        self.xp = self.module.numpy if library == "jax" else self.module
        if library == "jax":
            self.module.config.update("jax_enable_x64", True)

    @property
    def has_gpu(self) -> bool:
        """Whether arrays are made on a GPU."""
        if self.library == "torch":
            return bool(self.module.cuda.is_available())
        if self.library == "jax":
            return bool(self.module.devices()[0].platform == "gpu")
        return self.library == "cupy"

    @property
    def name(self) -> str:
        """What it runs on, for a table."""
        if not self.has_gpu:
            return f"{self.library} on a CPU, no GPU: {platform.machine()}"
        if self.library == "torch":
            return f"torch on {self.module.cuda.get_device_name()}"
        if self.library == "jax":
            return f"jax on {self.module.devices()[0].device_kind}"
        properties = self.module.cuda.runtime.getDeviceProperties(0)
        return f"cupy on {properties['name'].decode()}"

    def put(self, array: Array) -> Any:
        """Return an array on the device."""
        options = {"device": "cuda" if self.has_gpu else "cpu"} if self.library == "torch" else {}
        return self.xp.asarray(array, **options)

    def get(self, array: Any) -> Array:
        """Return an array of NumPy's."""
        if self.library == "cupy":
            return np.asarray(array.get())
        return np.from_dlpack(array.cpu() if self.library == "torch" else array)

    def wait(self, array: Any) -> None:
        """Wait until an array is computed."""
        if self.library == "jax":
            array.block_until_ready()
        elif self.has_gpu:
            cuda = self.module.cuda
            cuda.synchronize() if self.library == "torch" else cuda.Device().synchronize()

    @contextmanager
    def peak(self) -> Iterator[Callable[[], int | None]]:
        """Yield what tells the most bytes held since; None where nobody counts them."""
        gc.collect()  # What earlier problems have left.
        if self.library == "torch" and self.has_gpu:
            self.module.cuda.reset_peak_memory_stats()
            yield lambda: int(self.module.cuda.max_memory_allocated())
        elif self.library == "cupy":
            pool = self.module.get_default_memory_pool()  # It gives nothing back by itself.
            pool.free_all_blocks()
            yield pool.total_bytes
        elif self.library == "jax" and self.has_gpu:
            device = self.module.devices()[0]
            yield lambda: int(device.memory_stats()["peak_bytes_in_use"])  # Since the start.
        elif self.library == "array_api_strict":
            tracemalloc.start()
            yield lambda: tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
        else:
            yield lambda: None

    def time(self, call: Callable[[], Any]) -> float:
        """Return the median of the seconds that a call takes, after a first one."""
        seconds = [time_call(lambda: self.wait(call()))[1] for _ in range(RUNS + 1)]
        return median(seconds[1:])


def coefficients(n: int) -> Array:
    """Return the first column for a square surface of n x n elements."""
    x, y = halfspace.offsets((n, n), ELEMENT)
    return halfspace.influence_zz(x, y, ELEMENT, G=82000.0, nu=0.28)


def transforms(device: Device, n: int) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """Return the transforms of a product, all columns at once, as they are called and bare.

    A product extends one axis alone to twice its length, where n is a power of two.
    """
    ones = np.ones((n, 2 * n), np.complex128)
    lines, long = device.put(ones[:, :n].T.copy()), device.put(ones)
    fft, moveaxis = device.xp.fft, device.xp.moveaxis

    def called() -> Any:
        fft.fft(moveaxis(fft.fft(lines), -1, 0), n=2 * n)
        return fft.ifft(moveaxis(fft.ifft(long)[:, :n], 0, -1))

    def bare() -> Any:
        fft.fft(lines)
        fft.fft(long)
        fft.ifft(long)
        return fft.ifft(lines)

    return called, bare


def iterate(A: Any, b: Any, M: Any) -> tuple[Any, int]:
    """Return the solution, and the iterations that it took."""
    residuals: list[float] = []
    x, info = tmg.cg(A, b, M=M, rtol=1e-8, residuals=residuals)
    if info:
        raise RuntimeError(f"cg has not converged on {A!r}: info is {info}")
    return x, len(residuals) - 1


def measure(device: Device, n: int) -> Row:
    """Return what products and solves take."""
    c, x = coefficients(n), np.random.default_rng(0).standard_normal(n * n)
    row: Row = {"device": device.name, "n": f"{n} x {n}"}
    with device.peak() as peak:
        time_solve(device, c)
        if held := peak():
            row["bytes an unknown"] = held / n**2
    row["iterations"], row["solve, s"] = time_solve(device, c)
    A, v = tmg.ToeplitzOperator(device.put(c)), device.put(x)
    seconds = device.time(lambda: A @ v)
    if n <= COMPARED:
        expected = tmg.ToeplitzOperator(c) @ x
        row["error"] = float(np.abs(device.get(A @ v) - expected).max() / np.abs(expected).max())
        row["on NumPy"] = solve(c, np.ones(n * n))[1]
    called, bare = (device.time(call) for call in transforms(device, n))
    row |= {"of its transforms": called / seconds, "of bare ones": bare / seconds}
    return row | {"product, ms": 1e3 * seconds}


def solve(c: Any, b: Any) -> tuple[Any, int]:
    """Return the solution with the cosine preconditioner, and the iterations that it took."""
    A = tmg.ToeplitzOperator(c)
    return iterate(A, b, tmg.cosine_preconditioner(A))


def time_solve(device: Device, c: Array) -> tuple[int, float]:
    """Return the iterations from the coefficients to the solution, and the seconds."""
    there, b = device.put(c), device.put(np.ones(c.size))
    device.wait(b)
    start, (x, iterations) = perf_counter(), solve(there, b)
    device.wait(x)
    return iterations, perf_counter() - start


def measure_area(device: Device, n: int) -> Row:
    """Return what FSAI takes on 40 % of a rough surface, an area in fragments."""
    heights = contact.surfaces.rough((n, n), ELEMENT, rms=0.001, seed=1)
    c, mask = coefficients(n), heights < np.quantile(heights, 0.4)
    b = np.ones(int(mask.sum()))

    def solve_on(c: Any, b: Any, wait: Callable[[Any], None]) -> tuple[int, float, float]:
        start = perf_counter()
        A = tmg.MaskedOperator(tmg.ToeplitzOperator(c), mask)
        M = tmg.fsai_preconditioner(A)
        wait(M @ b)
        built = perf_counter()
        x, iterations = iterate(A, b, M)
        wait(x)
        return iterations, built - start, perf_counter() - built

    row: Row = {"device": device.name, "n": f"{n} x {n}", "unknowns": b.size}
    there = device.put(c), device.put(b)
    solve_on(*there, device.wait)  # Some libraries compile the first time.
    row["iterations"], row["set-up, s"], row["solve, s"] = solve_on(*there, device.wait)
    if n <= COMPARED:
        own = solve_on(c, b, lambda x: None)
        row["on NumPy"], row["set-up on NumPy, s"], row["solve on NumPy, s"] = own
    return row


def measure_contact(device: Device, n: int) -> Row:
    """Return what normal contact takes."""
    element = (LENGTH / n, LENGTH / n)
    gap = contact.surfaces.sphere((n, n), element, radius=RADIUS)
    press = partial(contact.normal_contact, element=element, material=STEEL, force=FORCE)
    row: Row = {"device": device.name, "n": f"{n} x {n}"}
    there = device.put(gap)
    with device.peak() as peak:
        result, row["first time, s"] = time_call(lambda: press(there))
        if held := peak():
            row["bytes an element"] = held / n**2
    row["s"], row["products"] = time_call(lambda: press(there))[1], result.products
    if n <= COMPARED:
        expected, row["on NumPy, s"] = time_call(lambda: press(gap))
        row["on NumPy"] = expected.products
        row["elements that differ"] = int((expected.contact ^ result.contact).sum())
    return row


def measure_blocks(device: Device, n: int) -> Row:
    """Return what README's blocks take for n² unknowns; of the likelihood with its gradient."""
    k, (i, j) = np.arange(float(n * n)), np.indices((n, n))
    mask, y = abs(i - j) > n // 20, np.random.default_rng(0).standard_normal(n * n)

    def masked(c: Any, b: Any) -> Any:
        A = tmg.MaskedOperator(tmg.ToeplitzOperator(c), mask)
        return iterate(A, b, tmg.default_preconditioner(A))[0]

    row: Row = {"device": device.name, "n": f"{n} x {n}"}
    for name, call, *given in (
        ("solve", tmg.solve_toeplitz, 1.0 / (1.0 + k), np.ones(n * n)),
        ("cg", masked, np.exp(-np.hypot(i, j) / 20.0), np.ones(int(mask.sum()))),
        ("gradient", lambda c, y: tmg.ToeplitzNormal(c).logpdf_and_grad(y)[1], 0.99**k, y),
    ):
        there = [device.put(array) for array in given]
        row[f"{name}, s"] = device.time(partial(call, *there))
        row[f"{name} on NumPy, s"] = time_call(partial(call, *given))[1]
    return row


arrange, arrange_areas, arrange_contact = (
    partial(report.format_rows, columns) for columns in (PRODUCTS, AREAS, PRESSED)
)


def run(folder: Path, *, libraries: Sequence[str], sizes: Sequence[int] = SIZES) -> None:
    """Measure everything with some libraries, a table at a time."""
    if missing := [library for library in libraries if find_spec(library) is None]:
        print(f"Not installed, and left out: {', '.join(missing)}")
    for title, name, columns, of_size, largest in (
        ("Products and solves, and the device", "gpu.csv", PRODUCTS, measure, max(sizes)),
        ("FSAI on areas in fragments", "gpu_areas.csv", AREAS, measure_area, CONTACT),
        ("Normal contact", "gpu_contact.csv", PRESSED, measure_contact, CONTACT),
        ("Blocks of README", "gpu_blocks.csv", BLOCKS, measure_blocks, COMPARED // 2),
    ):
        table = report.Table(title, folder / name, columns, {"device": 24, "n": 13})
        for library in filter(find_spec, libraries):
            device = Device(library)
            for n in sizes:
                if n <= largest:
                    with scipy.fft.set_workers(-1):
                        table.add(of_size(device, n))
