"""Flat punches on a half-space, in three dimensions: every method, and the peers that solve them.

A rigid punch with a flat face is pressed on the half-space, or bonded to it and shifted sideways:
the displacement of its area is 1, the tractions are asked for, to a relative residual of 1e-8 from
a zero guess. The areas are rectangles, a circle, an annulus and a rough patch, N elements across.
The problems are normal (A_zz), tangential without the coupling of the two directions (A_xx), and
coupled. The material is one half-space of shear modulus G = 1 and Poisson's ratio 0.28. The forces
for N to infinity are in `punch_limits`, stretched elements and grids in `stretched`.

The peers, `aspher` and `tamaas`, are measured where they are installed; they prescribe the force,
which is another system with the same solution. `aspher`'s tolerance is of another measure: it is
asked for the loosest one, in half decades, whose true residual is at most 1e-8. Its coupled time is
that of making a `FrictionSolver` and of a whole step, which also looks at what slips: nothing.
P M is not here: it is not symmetric, no preconditioner for conjugate gradients.

CPU time is all that a user waits for: the coefficients and the transforms of the matrix, which are
`matrix_s`, the set-up and the solution; of a peer the construction of its solver, and the solution.
Memory is the rise of a process's peak by set-up and solution, above libraries and matrix; a peer
makes its own matrix, which is counted.
"""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from functools import partial
from importlib.util import find_spec
from math import isnan, log, nan
from time import process_time
from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator
from tqdm import tqdm

import toeplitz_mg as tmg
from comparisons.contact import punch_peers as peers
from comparisons.harness import report
from comparisons.harness.measuring import (
    PRECONDITIONERS,
    TOLERANCE,
    Choice,
    Run,
    nothing,
    solve,
    time_call,
)
from comparisons.harness.processes import peak_bytes, prepare, row_or_note
from comparisons.harness.report import Row
from comparisons.systems.masks import AREAS
from comparisons.systems.punch import KINDS, Punch
from toeplitz_mg._typing import Array
from toeplitz_mg.engine.products import FOURIER, DiagonalisedProduct
from toeplitz_mg.operators.diagonalised import DiagonalisedOperator
from toeplitz_mg.operators.structure import restrict, unwrap

MAXITER = 600  # Iterations after which a method has not converged.
SECONDS = 600.0  # Time after which a method is given up on a punch.
SIZES = (64, 128, 256, 512, 1024, 2048)
SMALL_SIZES = (8, 16, 32)
QUICK_SIZES = (32, 64)
TABULATED = 1024  # The size in the table of the page.
ASKED = [10.0 ** (-k / 2) for k in range(10, 22)]  # Tolerances that `aspher` is asked for.
GROWTH = 1.25  # Growth of the time that is allowed, over that of n log n.


def circulant_of_q(A: LinearOperator) -> LinearOperator:
    """Return the circulant without padding whose eigenvalues are those of the continuum, |q|."""
    full, mask = unwrap(A)
    *_, n1, n2 = full.grid_shape
    q = np.hypot(np.fft.fftfreq(n1)[:, None], np.fft.rfftfreq(n2)[None, :])
    q[0, 0] = 0.5 * min(1.0 / n1, 1.0 / n2)
    circulant = DiagonalisedOperator(
        DiagonalisedProduct(q, (n1, n2), (n1, n2), np.float64, FOURIER), "|q|"
    )
    return restrict(circulant, mask)


single = np.float32
SHARED = ("Strang", "T. Chan", "cosine", "sine", "FSAI", "M", "M̄", "V(1,1)", "default")
METHODS: dict[str, Choice] = {
    "CG": nothing,
    "CG + |q| circulant": tmg.componentwise(circulant_of_q),
    **{f"CG + {name}": PRECONDITIONERS[name] for name in SHARED},
    "CG + cosine, float32": partial(tmg.cosine_preconditioner, dtype=single),
    "CG + M by component": tmg.componentwise(tmg.fft_preconditioner),
}
# The iteration in float32 too, inside a residual correction in float64.
INNER: dict[str, Choice] = {
    "float32 CG + cosine": partial(tmg.cosine_preconditioner, dtype=single),
    "float32 CG + FSAI": partial(tmg.fsai_preconditioner, dtype=single),
    "float32 CG + M": partial(tmg.fft_preconditioner, dtype=single),
}


def measure(method: str, punch: Punch, A: LinearOperator) -> Row:
    """Set a method up for the matrix of a punch, and solve; in a process of its own."""
    warm = Punch(punch.area, punch.kind, 16)
    solve_by(method, warm.operator(), warm.displacement(), maxiter=3)
    before = peak_bytes()
    run = solve_by(method, A, punch.displacement())
    row: Row = {"iterations": run.iterations, "units": run.units}
    row["peak_mb"] = (peak_bytes() - before) / 1e6
    _, row["matrix_s"] = time_call(punch.operator, process_time)
    row["cpu_s"] = row["matrix_s"] + run.seconds
    return row | summary(punch, run.x, A)


def solve_by(method: str, A: LinearOperator, b: Array, maxiter: int = MAXITER) -> Run:
    """Solve a system by CG with the preconditioner of a method."""
    solver = cg_in_single if method in INNER else tmg.cg
    return solve(A, b, (METHODS | INNER)[method], solver=solver, maxiter=maxiter)


def cg_in_single(A: LinearOperator, b: Array, **options: Any) -> tuple[Array, int]:
    """Iterate in float32 inside a residual correction."""
    return tmg.cg(A, b, inner=A.astype(single), **options)


def measure_peer(name: str, punch: Punch, A: LinearOperator) -> Row:
    """Let a peer solve; in a process of its own."""
    row: Row = {}
    before = peak_bytes()

    def solve(tolerance: float) -> peers.Solution:
        solution = peers.PEERS[name](punch, tolerance)
        row.setdefault("peak_mb", (peak_bytes() - before) / 1e6)
        return solution

    def exact(tolerance: float) -> bool:
        return punch.residual(solve(tolerance)[0], A) <= TOLERANCE

    asked = ASKED if name == "aspher" else [TOLERANCE]
    loosest = asked[bisect_left(asked[:-1], True, key=exact)]
    x, row["iterations"], row["units"], row["cpu_s"] = solve(loosest)
    row |= summary(punch, x, A)
    if name == "aspher":
        step = ", a whole step" if punch.kind == "coupled" else ""
        row["note"] = f"asked {loosest:.1e}{step} {row['note']}".rstrip()
    return row


def summary(punch: Punch, x: Array, A: LinearOperator) -> Row:
    """Return what is told of a solution."""
    residual = punch.residual(x, A)
    note = "" if residual <= 1.1 * TOLERANCE else "not converged"
    return {"residual": residual, "force": punch.force(x), "note": note}


def run(punches: Sequence[Punch], names: Sequence[str]) -> Iterator[list[Row]]:
    """Measure methods and peers on every punch; yield the rows so far after each."""
    rows: list[Row] = []
    with tqdm(total=len(punches) * len(names), unit="run") as progress:
        for punch in punches:
            A = punch.operator()
            for name in names:
                progress.set_postfix_str(f"{punch.kind}, {punch.area}, {punch.N}, {name}")
                row: Row = {"problem": punch.kind, "area": punch.area, "N": punch.N, "method": name}
                function = measure_peer if name in peers.PEERS else measure
                row |= {"cpu_s": nan} | row_or_note(partial(function, name, punch, A), SECONDS)
                rows.append(row)
                progress.update()
                yield rows


def growth(rows: Sequence[Row]) -> list[Row]:
    """Return CPU time over that of half the N, and what is allowed, where an N is half another."""
    seconds = {(r["problem"], r["area"], r["method"], r["N"]): r["cpu_s"] for r in rows}
    sizes = {row["N"] for row in rows}
    larger = [N for N in sorted(sizes) if N // 2 in sizes]
    allowed = {f"N = {N}": f"{GROWTH * 4.0 * log(N) / log(N // 2):.1f}" for N in larger}
    table: list[Row] = [{"problem": "", "area": "", "method": "allowed"} | allowed]
    for key in dict.fromkeys(key[:3] for key in seconds):
        row: Row = dict(zip(("problem", "area", "method"), key, strict=True))
        for N in larger:
            ratio = seconds.get((*key, N), nan) / seconds.get((*key, N // 2), nan)
            row[f"N = {N}"] = "" if isnan(ratio) else f"{ratio:.1f}"
        table.append(row)
    return table if larger else []


def format_row(row: Row) -> Row:
    """Return a row as it is printed."""
    formats = {"iterations": "d", "units": ".1f", "matrix_s": ".3g", "cpu_s": ".3g"}
    formats |= {"peak_mb": ".0f", "residual": ".1e", "force": ".5f"}
    cells = report.format_cells(row, formats)
    return {"method": row["method"], **cells, "note": row["note"]}


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of iterations and CPU seconds, a row for each method."""
    table: dict[str, Row] = {}
    for row in rows:
        if row["N"] != TABULATED or row["problem"] == "tangential":
            continue
        line = table.setdefault(row["method"], {"method": row["method"].replace("|", r"\|")})
        cell = row.get("note", "")
        if "residual" in row and "not converged" not in cell:
            cell = f"{row['iterations']} / {report.format_seconds(row['cpu_s'])}"
        line[f"{row['problem']}, {row['area']}"] = cell
    return list(table.values())


def main() -> None:
    """Run the comparison."""
    prepare("comparisons.contact.punch3d")
    installed = [name for name in peers.PEERS if find_spec(name)]
    names = [*METHODS, *INNER, *installed]
    arguments = report.options(
        "contact.punch3d",
        "Flat punches: every method, and the peers.",
        sizes=SMALL_SIZES + SIZES,
        areas=tuple(AREAS),
        problems=KINDS,
        methods=names,
    )
    punches = [
        Punch(area, kind, N)
        for area in arguments.areas or AREAS
        for kind in arguments.problems or KINDS
        for N in arguments.sizes or (QUICK_SIZES if arguments.quick else SIZES)
    ]
    rows: list[Row] = []
    for rows in run(punches, arguments.methods or names):
        report.write_csv(arguments.output / "punch3d.csv", rows)
    for (problem, area, N), own in report.group(rows, "problem", "area", "N").items():
        report.show(f"{problem}, {area}, N = {N}", [format_row(row) for row in own])
    if ratios := growth(rows):
        report.show("CPU time over that of half the N; allowed is n log n, times 1.25", ratios)


if __name__ == "__main__":
    main()
