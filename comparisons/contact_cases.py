"""Contact problems with a known answer, rough surfaces, and the peers that solve the same.

Hertz (line, sphere, ellipse), Cattaneo and Mindlin (line, sphere), Carter and Kalker's coefficients:
the errors against theory over the number N of elements across the grid, with the order that is
observed; pictures of the tractions and of the areas of stick and slip beside the analytic curves;
products, iterations between two changes of the areas, and CPU time. All contacts are those of a
sphere or cylinder of radius 1 and of E* = 1, of half width 0.6, on grids [-1, 1].

Against `aspher` and `tamaas`, where they are installed, see `contact_peers`.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import nan
from multiprocessing import set_forkserver_preload
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipe, ellipk
from tqdm import tqdm

import toeplitz_mg as tmg
from comparisons import contact_peers, report
from comparisons.contact_figures import convergence, picture, rough_picture
from comparisons.report import Row
from toeplitz_mg.contact import ContactResult, friction, normal_contact, rolling, surfaces

Array = NDArray[Any]

A, C, MU = 0.6, 0.4, 0.3  # half width of contact, of stick, and friction
UNIT = (0.7, 0.3)  # E* = G/(1-ν) = 1
KALKER = {"C11": 4.12, "C22": 3.67, "C23": 1.47}  # circle, ν = 1/4; Kalker (1990)
CREEPAGE = 1e-3
LINES, QUICK_LINES = (64, 128, 256, 512, 1024, 2048, 4096), (64, 128, 256)
SURFACES, QUICK_SURFACES = (32, 64, 128, 256, 512), (32, 64)
ROLLING, QUICK_ROLLING = (32, 64, 128, 256), (32, 64)
ROUGH, QUICK_ROUGH = (256, 512, 1024), (64,)
LOADS = (0.006, 0.0123, 0.06, 0.2, 0.31)  # 1 to 40 % of contact


@dataclass
class Solved:
    """A problem that was solved.

    Attributes
    ----------
    results : list of ContactResult
        One, or for Kalker's coefficients three.
    errors : dict
        Relative ones, against theory, by quantity.
    theory : ndarray or None
        The traction, along x where it is tangential.
    """

    results: list[ContactResult]
    errors: dict[str, float]
    theory: Array | None = None


def semi_ellipse(r: Array, a: float) -> Array:
    """√(1 - r²/a²), zero outside."""
    return np.sqrt(np.maximum(0.0, 1.0 - (r / a) ** 2))


def rms(result: ContactResult, theory: Array) -> float:
    """The root mean square of the error of the traction, relative to that of the traction."""
    q = result.traction[0] if result.traction.ndim > result.contact.ndim else result.traction
    return float(np.linalg.norm(q - theory) / np.linalg.norm(theory))


def hertz_line(N: int) -> Solved:
    """A cylinder in plane strain, by its force."""
    h, force, reference = 2.0 / N, np.pi * A**2 / 4.0, 4.0
    gap = surfaces.cylinder(N, h, radius=1.0)
    result = normal_contact(gap, h, material=UNIT, force=force, reference=reference)
    approach = 2.0 * force / np.pi * (np.log(2.0 * reference / A) + 0.5)
    theory = A / 2.0 * semi_ellipse(surfaces.centres(N, h)[0], A)
    errors = {
        "a": result.area / (2.0 * A) - 1.0,
        "p₀": 2.0 * result.traction.max() / A - 1.0,
        "δ": result.rigid / approach - 1.0,
        "traction": rms(result, theory),
    }
    return Solved([result], errors, theory)


def hertz_sphere(N: int) -> Solved:
    """A sphere, by its force."""
    h = 2.0 / N
    gap = surfaces.sphere((N, N), (h, h), radius=1.0)
    result = normal_contact(gap, (h, h), material=UNIT, force=4.0 / 3.0 * A**3)
    theory = 2.0 * A / np.pi * semi_ellipse(np.hypot(*surfaces.centres((N, N), (h, h))), A)
    errors = {
        "a": np.sqrt(result.area / np.pi) / A - 1.0,
        "p₀": result.traction.max() * np.pi / (2.0 * A) - 1.0,
        "δ": result.rigid / A**2 - 1.0,
        "traction": rms(result, theory),
    }
    return Solved([result], errors, theory)


def hertz_ellipse(N: int) -> Solved:
    """An ellipsoid, by its approach (Johnson, Contact Mechanics, §4.2)."""
    a, b, p0, h = A, A / 2.0, 0.2, 2.0 / N
    e2 = 1.0 - (b / a) ** 2
    K, E = ellipk(e2), ellipe(e2)
    common = 2.0 * p0 * b / (e2 * a**2)
    radii = 1.0 / (common * (K - E)), 1.0 / (common * ((a / b) ** 2 * E - K))
    shape = (N, N // 2)
    gap = surfaces.ellipsoid(shape, (h, h), radii=radii)
    result = normal_contact(gap, (h, h), material=UNIT, approach=p0 * b * K)
    x, y = surfaces.centres(shape, (h, h))
    theory = p0 * semi_ellipse(np.hypot(x / a, y / b), 1.0)
    errors = {
        "area": result.area / (np.pi * a * b) - 1.0,
        "p₀": result.traction.max() / p0 - 1.0,
        "F": result.force / (2.0 / 3.0 * np.pi * a * b * p0) - 1.0,
        "traction": rms(result, theory),
    }
    return Solved([result], errors, theory)


def cattaneo_line(N: int) -> Solved:
    """A shift of a line contact, by its force."""
    h = 2.0 / N
    (x,) = surfaces.centres(N, h)
    g = MU * A / 2.0 * semi_ellipse(x, A)
    force = (1.0 - (C / A) ** 2) * MU * np.pi * A**2 / 4.0
    result = friction(g, h, material=UNIT, force=force)
    theory = g - MU * C / 2.0 * semi_ellipse(x, C)
    assert result.stick is not None
    errors = {
        "c": result.stick.sum() * h / (2.0 * C) - 1.0,
        "traction": rms(result, theory),
    }
    return Solved([result], errors, theory)


def cattaneo_sphere(N: int, nu: float = 0.0) -> Solved:
    """A shift of a sphere, by its displacement (Mindlin's traction is exact for ν = 0 alone)."""
    h = 2.0 / N
    r = np.hypot(*surfaces.centres((N, N), (h, h)))
    g = MU * 2.0 * A / np.pi * semi_ellipse(r, A)
    shift = MU * (A**2 - C**2) * (2.0 - nu) / (2.0 * (1.0 - nu))
    result = friction(g, (h, h), material=(1.0 - nu, nu), shift=(shift, 0.0))
    theory = g - MU * 2.0 * C / np.pi * semi_ellipse(r, C)
    assert result.stick is not None
    errors = {
        "c": np.sqrt(result.stick.sum() * h**2 / np.pi) / C - 1.0,
        "F": result.force[0] / (MU * 4.0 / 3.0 * (A**3 - C**3)) - 1.0,
        "traction": rms(result, theory),
    }
    return Solved([result], errors, theory)


def mindlin_sphere(N: int) -> Solved:
    """The same with the two directions coupled."""
    return cattaneo_sphere(N, 0.28)


def carter(N: int) -> Solved:
    """A cylinder that drives, and sticks in 0.6 of its contact."""
    h, part = 2.0 / N, 0.6
    (x,) = surfaces.centres(N, h)
    g = MU * A / 2.0 * semi_ellipse(x, A)
    result = rolling(g, h, material=UNIT, longitudinal=-MU * A * (1.0 - part))
    theory = g - MU * A / 2.0 * part * semi_ellipse(x - (1.0 - part) * A, part * A)
    assert result.stick is not None
    errors = {
        "a′": result.stick.sum() * h / (2.0 * part * A) - 1.0,
        "F": result.force / ((1.0 - part**2) * MU * np.pi * A**2 / 4.0) - 1.0,
        "traction": rms(result, theory),
    }
    return Solved([result], errors, theory)


def kalker(N: int) -> Solved:
    """The linear creepage coefficients of a circle, ν = 1/4, from bonded rolling."""
    h = 2.0 / N
    r = np.hypot(*surfaces.centres((N, N), (h, h)))
    g = np.where(r < A, np.inf, 0.0)
    names = ("longitudinal", "lateral", "spin")
    results = [rolling(g, (h, h), material=(1.0, 0.25), **{name: CREEPAGE}) for name in names]
    # F_x = -G a² C11 ξ, F_y = -G a² (C22 η + a C23 φ)
    forces = results[0].force[0], results[1].force[1], results[2].force[1] / A
    errors = {
        name: -force / (CREEPAGE * A**2) / exact - 1.0
        for (name, exact), force in zip(KALKER.items(), forces, strict=True)
    }
    return Solved(results, errors)


CASES: dict[str, tuple[Callable[[int], Solved], Sequence[int], Sequence[int]]] = {
    "Hertz, line": (hertz_line, LINES, QUICK_LINES),
    "Hertz, sphere": (hertz_sphere, SURFACES, QUICK_SURFACES),
    "Hertz, ellipse": (hertz_ellipse, SURFACES, QUICK_SURFACES),
    "Cattaneo, line": (cattaneo_line, LINES, QUICK_LINES),
    "Cattaneo and Mindlin, ν = 0": (cattaneo_sphere, SURFACES, QUICK_SURFACES),
    "Cattaneo and Mindlin, ν = 0.28": (mindlin_sphere, SURFACES, QUICK_SURFACES),
    "Carter": (carter, LINES, QUICK_LINES),
    "Kalker": (kalker, ROLLING, QUICK_ROLLING),
}


def rough(N: int, load: float) -> Solved:
    """A rough surface with wavelengths from 0.5 to 1/32, or to four elements."""
    h = 2.0 / N
    gap = contact_peers.rough_gap(N)
    result = normal_contact(gap, (h, h), material=UNIT, force=load)
    assert result.gap is not None
    return Solved([result], {"F": result.force / load - 1.0})


def solved(case: str, N: int, solve: Callable[[], Solved]) -> tuple[Solved, Row]:
    """Solve, and return what it cost."""
    start = process_time()
    with tmg.count_products():
        answer = solve()
    seconds = process_time() - start
    results = answer.results
    return answer, {
        "case": case,
        "N": N,
        "products": " + ".join(str(r.products) for r in results),
        "work": " + ".join(f"{r.work:.1f}" for r in results),
        "iterations": "; ".join(" ".join(map(str, r.iterations)) for r in results),
        "violation": max(r.residual for r in results),
        "cpu_s": seconds,
    }


def order(errors: Sequence[float], sizes: Sequence[int]) -> float:
    """The power of 1/N by which errors fall, by least squares."""
    known = [(np.log(n), np.log(abs(e))) for n, e in zip(sizes, errors, strict=True) if e != 0.0]
    return -float(np.polyfit(*zip(*known, strict=True), 1)[0]) if len(known) > 1 else nan


def analytic(quick: bool, folder: Path) -> None:
    """Solve every case with a known answer on every grid."""
    costs: list[Row] = []
    errors: list[Row] = []
    orders: list[Row] = []
    for case, (solve, full, few) in tqdm(CASES.items(), unit="case"):
        sizes = few if quick else full
        solve(sizes[0])  # what the first call loads is not its time
        found: dict[str, list[float]] = {}
        for N in sizes:
            answer, cost = solved(case, N, lambda N=N, solve=solve: solve(N))  # type: ignore[misc]
            costs.append(cost)
            for quantity, error in answer.errors.items():
                found.setdefault(quantity, []).append(float(error))
                errors.append({"case": case, "quantity": quantity, "N": N, "error": float(error)})
        picture(answer.results, answer.theory, f"{case}, N = {N}", folder / f"{solve.__name__}.png")
        for quantity, values in found.items():
            row: Row = {"case": case, "quantity": quantity}
            row |= {f"N = {n}": v for n, v in zip(sizes, values, strict=True) if n in sizes[::2]}
            orders.append(row | {"order": order(values, sizes)})
    convergence(errors, folder / "convergence.png")
    report.write_csv(folder / "errors.csv", errors)
    report.write_csv(folder / "costs.csv", costs)
    report.write_csv(folder / "orders.csv", orders)
    for case in CASES:
        table = [{k: readable(k, v) for k, v in r.items()} for r in orders if r["case"] == case]
        report.show(f"{case}: errors against theory", table)
    table = [{k: readable(k, v) for k, v in r.items()} for r in costs]
    report.show("Products, iterations between changes of the areas, CPU time", table)


def rough_surfaces(quick: bool, folder: Path) -> None:
    """Solve rough surfaces at several loads."""
    rows: list[Row] = []
    for N in QUICK_ROUGH if quick else ROUGH:
        answers: list[ContactResult] = []
        for load in LOADS:
            answer, row = solved("rough", N, lambda N=N, load=load: rough(N, load))  # type: ignore[misc]
            (result,) = answer.results
            assert result.gap is not None
            row |= {"load": load, "contact": f"{result.contact.mean():.2%}"}
            row |= {"force error": abs(answer.errors["F"])}
            row |= {"least pressure": result.traction.min(), "least gap": result.gap.min()}
            rows.append(row)
            answers.append(result)
        rough_picture(answers, N, folder / f"rough_{N}.png")
    report.write_csv(folder / "rough.csv", rows)
    table = [{k: readable(k, v) for k, v in r.items()} for r in rows]
    report.show("Rough surfaces", table)


def readable(key: str, value: Any) -> Any:
    """Return a cell as it is printed."""
    formats = {"order": ".2f", "cpu_s": ".3f", "load": "g", "contact": "s", "work": "s"}
    return format(value, formats.get(key, ".2e")) if isinstance(value, float) else value


def main() -> None:
    """Run the comparison."""
    os.environ["OMP_NUM_THREADS"] = "1"  # read where a process imports BLAS, or a peer
    set_forkserver_preload(["comparisons.contact_peers"])
    arguments = report.options("contact_cases", "Contact problems: theory, rough surfaces, peers.")
    analytic(arguments.quick, arguments.output)
    rough_surfaces(arguments.quick, arguments.output)
    rows = contact_peers.run(quick=arguments.quick)
    report.write_csv(arguments.output / "peers.csv", rows)
    for problem in dict.fromkeys(row["problem"] for row in rows):
        table = [contact_peers.readable(r) for r in rows if r["problem"] == problem]
        report.show(f"{problem}: each as accurate as {contact_peers.TARGET:g} takes", table)


if __name__ == "__main__":
    main()
