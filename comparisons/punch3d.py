"""Flat punches on a half-space, in three dimensions: every method, and the peers that solve them.

A rigid punch with a flat face is pressed on the half-space, or bonded to it and shifted sideways:
the displacement of its area is 1, the tractions are asked for, to a relative residual of 1e-8 from
a zero guess. The areas are rectangles, a circle, an annulus and a rough patch, N elements across.
The problems are normal (A_zz), tangential without the coupling of the two directions (A_xx), and
coupled. The peers, `aspher` and `tamaas`, are measured where they are installed; they prescribe the
force, which is another system with the same solution.

The forces are those of one half-space of shear modulus G = 1 and Poisson's ratio 0.28; extrapolated
to N = infinity from the last three sizes, by the order that is observed there.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from math import log2, nan
from multiprocessing import set_forkserver_preload
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve
from scipy.sparse.linalg import LinearOperator
from tqdm import tqdm

import toeplitz_mg as tmg
from comparisons import peers, report
from comparisons.masks import AREAS
from comparisons.measuring import in_a_fresh_process
from comparisons.report import Row
from toeplitz_mg import halfspace
from toeplitz_mg.operators.convolution import FOURIER, DiagonalisedProduct
from toeplitz_mg.operators.diagonalised import DiagonalisedOperator

Array = NDArray[Any]
Preconditioner = Callable[[LinearOperator], LinearOperator | None]

TOLERANCE = 1e-8
MAXITER = 600
SECONDS = 300.0  # after which a run is given up
G, NU = 1.0, 0.28
SIZES = (64, 128, 256, 512, 1024, 2048)
QUICK_SIZES = (32, 64)


@dataclass(frozen=True)
class Punch:
    """A rigid area on a half-space.

    Attributes
    ----------
    area : str
        One of `AREAS`.
    kind : str
        Normal, tangential or coupled.
    N : int
        Elements across the longer side.
    nu : float
        Poisson's ratio.
    """

    area: str
    kind: str
    N: int
    nu: float = NU

    @property
    def mask(self) -> Array:
        """The elements under the punch, on the grid."""
        return AREAS[self.area](self.N)

    @property
    def h(self) -> float:
        """The side of an element; the shorter half side of the grid is 1."""
        return 2.0 / int(min(self.mask.shape))

    def operator(self) -> LinearOperator:
        """The influence of the tractions on the displacements, for one half-space."""
        mask, element = self.mask, (self.h, self.h)
        even, odd = halfspace.lags(mask.shape, element), halfspace.all_lags(mask.shape, element)
        # The coefficients are those of two half-spaces: one of G has as much as two of 2 G.
        material = {"G": 2.0 * G, "nu": self.nu}
        full: LinearOperator
        if self.kind == "normal":
            full = tmg.ToeplitzOperator(halfspace.influence_zz(*even, element, **material))
        elif self.kind == "tangential":
            full = tmg.ToeplitzOperator(halfspace.influence_xx(*even, element, **material))
        else:
            xx, yy = (
                tmg.ToeplitzOperator(a(*even, element, **material))
                for a in (halfspace.influence_xx, halfspace.influence_yy)
            )
            xy = halfspace.influence_xy(*odd, element, **material)
            between = tmg.ToeplitzOperator.from_lags(xy)
            full = tmg.CoupledOperator([[xx, between], [between, yy]])
        return full if mask.all() else tmg.MaskedOperator(full, mask)

    def displacement(self) -> Array:
        """The rigid displacement, of the unknowns."""
        u = np.ones(int(self.mask.sum()))
        return np.concatenate([u, np.zeros_like(u)]) if self.kind == "coupled" else u

    def force(self, tractions: Array) -> float:
        """F/(E* b δ), or F/(G b δ) if it is tangential, b the shorter half side."""
        first = tractions[: int(self.mask.sum())]
        modulus = 2.0 * G / (1.0 - self.nu) if self.kind == "normal" else G
        return float(first.sum()) * self.h**2 / modulus

    def residual(self, tractions: Array) -> float:
        """‖u - A p‖/‖u‖, by a convolution that is not the one under test."""
        A = self.operator()
        full = getattr(A, "full", A)
        blocks = full.blocks if isinstance(full, tmg.CoupledOperator) else ((full,),)
        fields = np.zeros((len(blocks), *self.mask.shape))
        fields[:, self.mask] = tractions.reshape(len(blocks), -1)
        u = [
            sum(fftconvolve(a.lags, p, "valid") for a, p in zip(row, fields, strict=True))
            for row in blocks
        ]
        error = np.concatenate([v[self.mask] for v in u]) - self.displacement()
        return float(np.linalg.norm(error)) / float(np.linalg.norm(self.displacement()))


def circulant_of_q(A: LinearOperator) -> LinearOperator:
    """Return the circulant without padding whose eigenvalues are those of the continuum, |q|."""
    full = getattr(A, "full", A)
    *_, n1, n2 = full.grid_shape
    q = np.hypot(np.fft.fftfreq(n1)[:, None], np.fft.rfftfreq(n2)[None, :])
    q[0, 0] = 0.5 * min(1.0 / n1, 1.0 / n2)
    circulant = DiagonalisedOperator(
        DiagonalisedProduct(q, (n1, n2), (n1, n2), np.float64, FOURIER), "|q|"
    )
    return circulant if full is A else tmg.MaskedOperator(circulant, A.mask)


single = np.float32
METHODS: dict[str, Preconditioner] = {
    "CG": lambda A: None,
    "CG + |q| circulant": tmg.componentwise(circulant_of_q),
    "CG + T. Chan": tmg.chan_preconditioner,
    "CG + cosine": tmg.cosine_preconditioner,
    "CG + cosine, float32": partial(tmg.cosine_preconditioner, dtype=single),
    "CG + sine": tmg.sine_preconditioner,
    "CG + FSAI": tmg.fsai_preconditioner,
    "CG + M": tmg.fft_preconditioner,
    "CG + M by component": tmg.componentwise(tmg.fft_preconditioner),
    "CG + M̄": tmg.fft_rsm_preconditioner,
    "CG + V(1,1)": tmg.componentwise(tmg.multigrid),
}


def solve(method: str, punch: Punch) -> Row:
    """Set a method up and solve; in a process of its own."""
    A, b = punch.operator(), punch.displacement()
    warm = Punch(punch.area, punch.kind, 16)
    small = warm.operator()
    tmg.cg(small, warm.displacement(), M=METHODS["CG + cosine"](small), maxiter=3)
    steps: list[int] = []
    with tmg.count_products() as work:
        start = process_time()
        M = METHODS[method](A)
        x, _ = tmg.cg(
            A, b, M=M, rtol=TOLERANCE, maxiter=MAXITER, callback=lambda _: steps.append(1)
        )
        seconds = process_time() - start
    units = work.units(A.shape[0] if getattr(A, "full", A) is A else A.full.shape[0])
    return summary(punch, x, len(steps), units, seconds)


def solve_by_peer(name: str, punch: Punch) -> Row:
    """Let a peer solve; in a process of its own."""
    x, iterations, products, seconds = peers.PEERS[name](punch)
    return summary(punch, x, iterations, products, seconds)


def summary(punch: Punch, x: Array, iterations: int, units: float, seconds: float) -> Row:
    """What is told of a run."""
    residual = punch.residual(x)
    return {
        "iterations": iterations,
        "units": round(units, 2),
        "cpu_s": seconds,
        "residual": residual,
        "force": punch.force(x),
        "note": "" if residual <= 1.1 * TOLERANCE else "not converged",
    }


def run(sizes: Sequence[int], areas: Sequence[str], kinds: Sequence[str]) -> list[Row]:
    """Measure every method on every punch."""
    installed = [name for name in peers.PEERS if find_spec(name)]
    jobs: list[tuple[str, Callable[[str, Punch], Row]]] = [(name, solve) for name in METHODS]
    jobs += [(name, solve_by_peer) for name in installed]
    punches = [Punch(a, k, N) for a in areas for k in kinds for N in sizes]
    rows: list[Row] = []
    with tqdm(total=len(punches) * len(jobs), unit="run") as progress:
        for punch in punches:
            for name, function in jobs:
                progress.set_postfix_str(f"{punch.kind}, {punch.area}, {punch.N}, {name}")
                row: Row = {"problem": punch.kind, "area": punch.area, "N": punch.N, "method": name}
                try:
                    row |= in_a_fresh_process(partial(function, name, punch), SECONDS)
                except TimeoutError:
                    row |= {"cpu_s": nan, "note": f"over {SECONDS:.0f} s"}
                except ArithmeticError as error:
                    row |= {"cpu_s": nan, "note": str(error)[:60]}
                rows.append(row)
                progress.update()
    return rows


def extrapolated(rows: Sequence[Row]) -> list[Row]:
    """The forces for N to infinity: Richardson's extrapolation, by the observed order."""
    table: list[Row] = []
    for key in dict.fromkeys((row["problem"], row["area"]) for row in rows):
        own = [r for r in rows if (r["problem"], r["area"], r["method"]) == (*key, "CG + cosine")]
        forces = [row.get("force", nan) for row in own]
        limit, order = (nan, nan) if len(forces) < 3 else limit_and_order(forces[-3:])
        table.append(
            {"problem": key[0], "area": key[1], "force at the largest N": f"{forces[-1]:.5f}"}
            | {"order": f"{order:.2f}", "N to infinity": f"{limit:.5f}"}
        )
    return table


def limit_and_order(values: Sequence[float]) -> tuple[float, float]:
    """Of three values with the error c h^p, h halved from one to the next."""
    first, second, third = values
    ratio = (second - first) / (third - second) if third != second else nan
    if not ratio > 1.0:
        return nan, nan
    return third + (third - second) / (ratio - 1.0), log2(ratio)


def readable(row: Row) -> Row:
    """Return a row as it is printed."""
    formats = {"iterations": "d", "units": ".1f", "cpu_s": ".3g", "residual": ".1e", "force": ".5f"}
    cells = {k: format(row[k], spec) if k in row else "" for k, spec in formats.items()}
    return {"method": row["method"], **cells, "note": row["note"]}


def main() -> None:
    """Run the comparison."""
    os.environ["OMP_NUM_THREADS"] = "1"  # read where a process imports BLAS, or a peer
    set_forkserver_preload(["comparisons.peers", "comparisons.measuring", "comparisons.masks"])
    arguments = report.options("punch3d", "Flat punches: every method, and the peers.")
    sizes = QUICK_SIZES if arguments.quick else SIZES
    rows = run(sizes, tuple(AREAS), ("normal", "tangential", "coupled"))
    report.write_csv(arguments.output / "punch3d.csv", rows)
    for key in dict.fromkeys((row["problem"], row["area"], row["N"]) for row in rows):
        table = [readable(r) for r in rows if (r["problem"], r["area"], r["N"]) == key]
        report.show(f"{key[0]}, {key[1]}, N = {key[2]}", table)
    report.show("Forces", extrapolated(rows))


if __name__ == "__main__":
    main()
