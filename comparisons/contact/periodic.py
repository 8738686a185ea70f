"""Surfaces that repeat: rough ones beside `aspher` and `tamaas`, the area at light loads, friction.

Rough surfaces that touch on 2 to 99 % of their area: the products on the grid itself, the violation
of the conditions of contact, recomputed, and, where they are installed, the CPU time over that of
the faster of `aspher`'s ways, each at the loosest tolerance that is exact enough, taking turns in
one process, and the largest difference of the pressures from those of `aspher` and of `tamaas`.

κ = A E* g'/F at F = 0.01 E* g' A₀, of surfaces whose waves do not change while the elements do: by
all elements that touch, and by an area that is corrected for those at edges, which touch in part
(Yastrebov, Anciaux, Molinari, Tribology International 114 (2017)). It falls as the waves are of
more lengths, and so there are surfaces of two breadths of the spectrum.

Friction under half of the force that it can carry, along both axes or one: the products, the work
of one over that of a padded one, the violation of Coulomb's law, recomputed, and where ν = 0 the
largest difference from μ times that of two pressures (Ciavarella; Jäger).
"""

import warnings
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.signal import resample
from tqdm import tqdm

from comparisons.contact.methods import Answer, Problem, aspher, aspher_nested, ours, tamaas
from comparisons.contact.peers import TARGET
from comparisons.contact.theory import MU, UNIT
from comparisons.harness import report
from comparisons.harness.processes import prepare
from comparisons.harness.report import Row
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import ContactWarning, Material, friction, normal_contact, surfaces
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.tangential.coulomb import clip

SIZES, QUICK_SIZES = (256, 512, 1024), (64,)
LOADS = {2: 0.0123, 10: 0.06, 31: 0.2, 77: 0.7, 99: 1.6}  # Forces by the share in contact, %.
TURNS = 3  # Times that each method solves: the least CPU time counts.
WAYS: dict[str, Callable[[Problem, float], Answer]] = {
    "|q| by FFT": partial(aspher, "fourier-fft"),
    "nested": aspher_nested,
}
COMPARED = 256  # Most elements along an axis for which `tamaas` is waited for.
ITERATIONS = 1000  # Of `tamaas`: enough for six digits.
DRAWN = 4  # Elements in the shortest wave on which the surfaces for κ are drawn.
FINER, QUICK_FINER = (4, 8, 16), (4,)  # Those on which they are pressed.
# The period of the surfaces for κ, over their shortest wave: the longest is a quarter of it.
WAVES, QUICK_WAVES = (32, 64), (32,)
SEEDS = 12  # Surfaces whose mean κ is taken: that of one is 0.16 off.
SHIFTED, QUICK_SHIFTED = (64, 128, 256), (32,)


def exact_enough(
    method: Callable[[Problem, float], Answer], problem: Problem
) -> tuple[float, Answer]:
    """Return the loosest tolerance, in half decades, whose answer violates `TARGET` at most."""
    for k in range(14, 25):
        answer = method(problem, 10.0 ** (-k / 2))
        if problem.violation(answer.traction, answer.bound) <= TARGET:
            return 10.0 ** (-k / 2), answer
    raise ArithmeticError("no tolerance is enough")


def rough(N: int, share: int, force: float) -> Row:
    """Solve one rough surface by all that are installed."""
    problem = Problem(f"{share} %", N, force, is_rough=True, periodic=True)
    asked, answer = exact_enough(ours, problem)
    violation = problem.violation(answer.traction, None)
    row: Row = {"in contact": problem.name, "N": N, "products": int(answer.products)}
    row["violation"] = f"{violation:.1e}"
    row |= {"CPU over aspher's": "", "from aspher": "", "from tamaas": ""}
    if find_spec("aspher"):
        theirs = {way: exact_enough(method, problem) for way, method in WAYS.items()}
        seconds = dict.fromkeys((*WAYS, "ours"), np.inf)
        for _ in range(TURNS):
            seconds["ours"] = min(seconds["ours"], ours(problem, asked).seconds)
            for way, method in WAYS.items():
                seconds[way] = min(seconds[way], method(problem, theirs[way][0]).seconds)
        row["CPU over aspher's"] = f"{seconds['ours'] / min(seconds[way] for way in WAYS):.2f}"
        row["from aspher"] = difference(theirs["|q| by FFT"][1].traction, answer.traction)
    if find_spec("tamaas") and N <= COMPARED:
        row["from tamaas"] = difference(tamaas(problem, ITERATIONS).traction, answer.traction)
    return row


def difference(first: Array, second: Array) -> str:
    """Return the largest difference over the largest pressure."""
    return f"{np.abs(first - second).max() / second.max():.1e}"


def arrange_products(rows: Sequence[Row]) -> list[Row]:
    """Return the table of products, a row for each grid."""
    return _arrange(rows, "products", "d")


def arrange_peers(rows: Sequence[Row]) -> list[Row]:
    """Return the table of CPU times over those of `aspher`, a row for each grid."""
    return _arrange(rows, "CPU over aspher's", ".2f")


def _arrange(rows: Sequence[Row], figure: str, spec: str) -> list[Row]:
    table: dict[int, Row] = {}
    for row in rows:
        line = table.setdefault(row["N"], {figure: f"{row['N']}²"})
        line |= {row["in contact"]: report.format_cells(row, {figure: spec})[figure]}
    return list(table.values())


def area_over_force(waves: int, elements: int) -> Row:
    """Return κ by all that touches and corrected, with so many elements in the shortest wave."""
    N, drawn, found = elements * waves, DRAWN * waves, []
    h = 1.0 / N
    for seed in range(SEEDS):
        gap = surfaces.rough(
            (drawn, drawn),
            (1.0 / drawn, 1.0 / drawn),
            rms=5e-4,
            longest=0.25,
            shortest=1.0 / waves,
            seed=seed,
        )
        for axis in (0, 1):  # The same waves, on more elements.
            gap = resample(gap, N, axis=axis)
        q = 2.0 * np.pi * np.fft.fftfreq(N, h)
        power = np.abs(np.fft.fft2(gap) / gap.size) ** 2
        slope = float(np.sqrt(((q[:, None] ** 2 + q**2) * power).sum()))
        result = normal_contact(gap, (h, h), material=UNIT, force=0.01 * slope, periodic=True)
        C = result.contact
        edges = h * sum(np.count_nonzero(C ^ np.roll(C, 1, axis)) for axis in (0, 1))
        excess = (np.pi - 1.0 + np.log(2.0)) / 24.0 * edges * h
        found.append(np.array([result.area, result.area - excess]) * slope / result.force)
    (plain, corrected), error = (
        np.mean(found, axis=0),
        np.std(found, axis=0)[1] / (SEEDS - 1) ** 0.5,
    )
    row: Row = {"period over shortest wave": waves, "elements in it": elements, "N": N}
    return row | {"κ": f"{plain:.3f}", "κ, corrected": f"{corrected:.3f} ± {error:.2f}"}


def shifted(N: int, nu: float, periodic: bool | tuple[bool, bool]) -> Row:
    """Shift rough surfaces under half of the force that friction carries."""
    h, material = 2.0 / N, Material.from_shear(1.0 - nu, nu)  # E* = 1.
    options: Any = {"material": material, "periodic": periodic}
    gap = surfaces.rough((N, N), (h, h), rms=0.01, longest=0.5, shortest=4.0 * h, seed=1)
    pressed = normal_contact(gap, (h, h), force=0.2, **options)
    half = 0.5 * MU * pressed.force
    result = friction(pressed, mu=MU, force=(half, 0.0))
    A = Grid.of(gap.shape, (h, h), material, None, periodic).tangential()
    q, a0 = result.traction, float(A.component(0).c.flat[0])
    s = (A @ q.ravel()).reshape(q.shape) - np.reshape(result.shift, (2, 1, 1))
    wrong = a0 * np.abs(q - clip(q - s / a0, MU * pressed.pressure)).max()
    row: Row = {"repeats along": periodic, "ν": nu, "N": N, "products": result.products}
    row |= {
        "work of one": f"{A.work:.2f}",
        "violation": f"{wrong / np.abs(result.shift).max():.1e}",
    }
    if nu:
        return row | {"from theory": ""}
    before = normal_contact(gap, (h, h), force=pressed.force - half / MU, **options)
    return row | {"from theory": difference(q[0] / MU, pressed.pressure - before.pressure)}


def main() -> None:
    """Run the comparison."""
    prepare()
    arguments = report.options("contact.periodic", "Surfaces that repeat.")
    warnings.simplefilter("ignore", ContactWarning)  # Small spots are coarse.
    sizes = QUICK_SIZES if arguments.quick else SIZES
    cases = [(N, share, force) for N in sizes for share, force in LOADS.items()]
    rows = [rough(*case) for case in tqdm(cases, unit="surface")]
    report.show("Rough surfaces", rows)
    report.write_csv(arguments.output / "rough.csv", rows)
    rows = [
        area_over_force(waves, elements)
        for waves in (QUICK_WAVES if arguments.quick else WAVES)
        for elements in (QUICK_FINER if arguments.quick else FINER)
    ]
    report.show("Area over force", rows)
    report.write_csv(arguments.output / "areas.csv", rows)
    rows = [
        shifted(N, nu, periodic)
        for periodic in (True, (True, False))
        for nu in (0.0, 0.28)
        for N in (QUICK_SHIFTED if arguments.quick else SHIFTED)
    ]
    report.show("Friction", rows)
    report.write_csv(arguments.output / "friction.csv", rows)


if __name__ == "__main__":
    main()
