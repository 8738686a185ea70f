"""Products and solves on arrays of other libraries, as on a GPU, against those on NumPy's.

For each size of a square grid of a half-space: the error of a product against NumPy's, and its time
beside that of its four transforms. These are timed twice: as they are called, on fields that they
extend by zeros and whose axes they exchange; and bare, of what lies as they like it best, which
only a product of nothing but transforms could reach. Then the iterations of CG with the cosine
preconditioner beside those on NumPy, the seconds from the coefficients to the solution, and the
most bytes an unknown that are held meanwhile. On an area in fragments iterations with FSAI, and the
seconds in which it is built and the system solved. And of normal contact of a sphere the products
beside those on NumPy, and the seconds from the gap to the result, also of the first time, when some
libraries compile. NumPy's arrays have all threads of the processor. It says on what it ran: figures
of a CPU say nothing about a GPU.
"""

import gc
import platform
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
import scipy.fft

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.report import Row
from toeplitz_mg import contact, halfspace
from toeplitz_mg._typing import Array
from toeplitz_mg.engine.lengths import embedding_lengths
from toeplitz_mg.engine.library import library_of

LIBRARIES = ("jax", "cupy", "torch", "array_api_strict")
SIZES = (256, 512, 1024, 2048, 4096, 8192, 16384)
QUICK_SIZES = (64, 128)
COMPARED = 2048  # Side of the largest grid that is multiplied and solved on NumPy's arrays too.
RUNS = 7  # Of which the median is taken.
RTOL = 1e-8
ELEMENT = (0.01, 0.01)
FORMATS = {"device": "", "n": "", "error": ".1e", "product": ".3g", "of_called": ".0%"}
FORMATS |= {"of_bare": ".0%", "iterations": "", "iterations_numpy": "", "seconds": ".2g"}
FORMATS |= {"bytes_an_unknown": ".0f"}
HEADINGS = ["device", "n", "error", "product, ms", "of its transforms", "of bare ones"]
HEADINGS += ["iterations", "on NumPy", "solve, s", "bytes an unknown"]
CONTACT_FORMATS = {"device": "", "n": "", "first_seconds": ".2g", "seconds": ".2g"}
CONTACT_FORMATS |= {"seconds_numpy": ".2g", "products": "", "products_numpy": ""}
CONTACT_FORMATS |= {"elements_that_differ": "", "bytes_an_element": ".0f"}
CONTACT_HEADINGS = ["device", "n", "first time, s", "s", "on NumPy, s", "products", "on NumPy"]
CONTACT_HEADINGS += ["elements that differ", "bytes an element"]
AREA_FORMATS = {"device": "", "n": "", "unknowns": ",", "iterations": "", "iterations_numpy": ""}
AREA_FORMATS |= {"setup_seconds": ".2g", "setup_seconds_numpy": ".2g"}
AREA_FORMATS |= {"seconds": ".2g", "seconds_numpy": ".2g"}
AREA_HEADINGS = ["device", "n", "unknowns", "iterations", "on NumPy"]
AREA_HEADINGS += ["set-up, s", "set-up on NumPy, s"]
AREA_HEADINGS += ["solve, s", "solve on NumPy, s"]
STEEL = contact.Material(E=210000.0, nu=0.28)
LENGTH, RADIUS, FORCE = 0.64, 10.0, 100.0  # Of the grid, mm; of the sphere, mm; on it, N.


class Device:
    """A library of arrays, and the device on which it makes them."""

    def __init__(self, library: str) -> None:
        self.library = library
        self.module: Any = import_module(library)
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
        if self.library == "torch":
            return self.module.asarray(array, device="cuda" if self.has_gpu else "cpu")
        return (self.module.numpy if self.library == "jax" else self.module).asarray(array)

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
            with count_bytes(self.module) as held:
                yield held
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
        seconds = []
        for _ in range(RUNS + 1):
            start = perf_counter()
            self.wait(call())
            seconds.append(perf_counter() - start)
        return median(seconds[1:])


@contextmanager
def count_bytes(cupy: Any) -> Iterator[Callable[[], int]]:
    """Yield what tells the most bytes of CuPy's arrays and plans since, what its pool keeps not."""
    now = peak = cupy.get_default_memory_pool().used_bytes()

    class Hook(cupy.cuda.MemoryHook):
        def malloc_postprocess(self, *, mem_size: int, **others: int) -> None:
            nonlocal now, peak
            now += mem_size
            peak = max(peak, now)

        def free_postprocess(self, *, mem_size: int, **others: int) -> None:
            nonlocal now
            now -= mem_size

    with Hook():
        yield lambda: peak


def coefficients(n: int) -> Array:
    """Return the first column for a square surface of n x n elements."""
    x, y = halfspace.offsets((n, n), ELEMENT)
    return halfspace.influence_zz(x, y, ELEMENT, G=82000.0, nu=0.28)


def transforms(device: Device, n: int) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """Return the transforms of a product, all columns at once, as they are called and bare."""
    rows, columns = embedding_lengths((n, n))
    ones = np.ones((columns, rows), np.complex128)
    lines, long = device.put(ones[:, :n].T.copy()), device.put(ones)
    xp = library_of(long).xp
    fft = xp.fft

    def called() -> Any:
        fft.fft(xp.moveaxis(fft.fft(lines), -1, 0), n=rows)
        return fft.ifft(xp.moveaxis(fft.ifft(long)[:, :n], 0, -1))

    def bare() -> Any:
        fft.fft(lines)
        fft.fft(long)
        fft.ifft(long)
        return fft.ifft(lines)

    return called, bare


def solve(c: Any, b: Any) -> tuple[Any, int]:
    """Return the solution with the cosine preconditioner, and the iterations that it took."""
    A = tmg.ToeplitzOperator(c)
    return iterate(A, b, tmg.cosine_preconditioner(A))


def iterate(A: Any, b: Any, M: Any) -> tuple[Any, int]:
    """Return the solution, and the iterations that it took."""
    residuals: list[float] = []
    x, info = tmg.cg(A, b, M=M, rtol=RTOL, residuals=residuals)
    if info:
        raise RuntimeError(f"cg has not converged on {A!r}: info is {info}")
    return x, len(residuals) - 1


def measure(device: Device, n: int) -> Row:
    """Return a row of the table."""
    c, x = coefficients(n), np.random.default_rng(0).standard_normal(n * n)
    row: Row = {"device": device.name, "n": f"{n} x {n}", "error": None, "iterations_numpy": None}
    if n <= COMPARED:
        expected = tmg.ToeplitzOperator(c) @ x
        y = tmg.ToeplitzOperator(device.put(c)) @ device.put(x)
        y = library_of(y).to_numpy(y)
        row["error"] = float(np.abs(y - expected).max() / np.abs(expected).max())
        row["iterations_numpy"] = solve(c, np.ones(n * n))[1]
    with device.peak() as peak:
        row["first_seconds"] = time_solve(device, c)[1]
        held = peak()
    row["bytes_an_unknown"] = None if held is None else held / n**2
    row["iterations"], row["seconds"] = time_solve(device, c)
    row["product_seconds"] = time_product(device, c, x)
    for name, call in zip(("called", "bare"), transforms(device, n), strict=True):
        row[f"{name}_seconds"] = device.time(call)
        row[f"of_{name}"] = row[f"{name}_seconds"] / row["product_seconds"]
    return row


def time_product(device: Device, c: Array, x: Array) -> float:
    """Return the seconds of a product."""
    A, v = tmg.ToeplitzOperator(device.put(c)), device.put(x)
    return device.time(lambda: A @ v)


def time_solve(device: Device, c: Array) -> tuple[int, float]:
    """Return the iterations from the coefficients to the solution, and the seconds."""
    there, b = device.put(c), device.put(np.ones(c.size))
    device.wait(b)
    start = perf_counter()
    solution, iterations = solve(there, b)
    device.wait(solution)
    return iterations, perf_counter() - start


def measure_area(device: Device, n: int) -> Row:
    """Return a row of the table of FSAI on an area in fragments."""
    c, mask = coefficients(n), area(n)
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
    row["iterations"], row["setup_seconds"], row["seconds"] = solve_on(*there, device.wait)
    if n <= COMPARED:
        own = solve_on(c, b, lambda x: None)
        row["iterations_numpy"], row["setup_seconds_numpy"], row["seconds_numpy"] = own
    return row


def area(n: int) -> Array:
    """Return a mask of n x n elements in fragments: 40 % of a rough surface."""
    heights = contact.surfaces.rough((n, n), ELEMENT, rms=0.001, seed=1)
    return heights < np.quantile(heights, 0.4)


def measure_contact(device: Device, n: int) -> Row:
    """Return a row of the table of normal contact."""
    element = (LENGTH / n, LENGTH / n)
    gap = contact.surfaces.sphere((n, n), element, radius=RADIUS)

    def press(gap: Any) -> tuple[contact.NormalResult, float]:
        start = perf_counter()
        result = contact.normal_contact(gap, element, material=STEEL, force=FORCE)
        return result, perf_counter() - start

    row: Row = {"device": device.name, "n": f"{n} x {n}"}
    there = device.put(gap)
    with device.peak() as peak:
        result, row["first_seconds"] = press(there)
        held = peak()
    row["bytes_an_element"] = None if held is None else held / n**2
    row["seconds"], row["products"] = press(there)[1], result.products
    expected, seconds = press(gap) if n <= COMPARED else (None, None)
    row["seconds_numpy"], row["products_numpy"] = seconds, expected and expected.products
    row["elements_that_differ"] = expected and int((expected.contact ^ result.contact).sum())
    return row


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of a page."""
    milliseconds = {name: f"{name}_seconds" for name in ("product", "called", "bare")}
    own = [row | {name: 1e3 * row[key] for name, key in milliseconds.items()} for row in rows]
    return put_under(HEADINGS, FORMATS, own)


def put_under(headings: list[str], formats: dict[str, str], rows: Sequence[Row]) -> list[Row]:
    """Return a table of a page, whose columns have other names than the figures."""
    cells = (report.format_cells(row, formats).values() for row in rows)
    return [dict(zip(headings, row, strict=True)) for row in cells]


arrange_areas = partial(put_under, AREA_HEADINGS, AREA_FORMATS)
arrange_contact = partial(put_under, CONTACT_HEADINGS, CONTACT_FORMATS)


def main(quick_sizes: Sequence[int] = QUICK_SIZES) -> None:
    """Run the comparison."""
    arguments = report.options(
        "speed.gpu",
        "Compare arrays on a GPU with NumPy's.",
        library=LIBRARIES,
        largest=4096,
        contact=4096,
    )
    sizes = quick_sizes if arguments.quick else [n for n in SIZES if n <= arguments.largest]
    rows, areas, pressed = [], [], []
    for library in arguments.library or LIBRARIES[:1]:
        device = Device(library)
        for n in sizes:
            with scipy.fft.set_workers(-1):
                rows.append(measure(device, n))
                if n <= arguments.contact:
                    areas.append(measure_area(device, n))
                    pressed.append(measure_contact(device, n))
            report.write_csv(arguments.output / "gpu.csv", rows)
            report.write_csv(arguments.output / "gpu_areas.csv", areas)
            report.write_csv(arguments.output / "gpu_contact.csv", pressed)
    report.show("Products and solves, and the device on which they ran", arrange(rows))
    report.show("FSAI on areas in fragments", arrange_areas(areas))
    report.show("Normal contact", arrange_contact(pressed))


if __name__ == "__main__":
    main()
