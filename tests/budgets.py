"""Budgets of products, iterations and work units: what was measured, and what a test may take.

A test calls `assert_within_budget` with a case and what it has counted. A budget is 1.3 times what
was measured when the table was written, and at least 3 more, so that rounding on another processor
does not fail a test, but a method that has become worse does.

``python -m tests.budgets`` runs the tests that have budgets, writes the table anew, and prints each
budget that has grown; with names of test files it does so for the cases of these files alone.
"""

import ast
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

RECORD = "TOEPLITZ_MG_BUDGETS"  # Names the folder into which tests write what they measure.
TESTS = Path(__file__).parent
# fmt: off
TABLE = [  # Case, measure, what was measured, budget.
    ("1/(1 + k²/100), rtol = 1e-8", "iterations", 11, 14.3),
    ("1/(1 + k²/100), rtol = 1e-8", "work_units", 18.6783, 24.28),
    ("CG with M, tests 1 and 2", "iterations", 6, 9),
    ("CG with V(1,1) of coupled components", "iterations", 8, 11),
    ("CG with V(1,1), any kernel of a line", "cycles_of_set_up", 9.47477, 12.47),
    ("CG with V(1,1), any kernel of a line", "iterations", 5, 8),
    ("CG with V(1,1), any mask", "cycles_of_set_up", 5.1173, 8.12),
    ("CG with V(1,1), any mask", "iterations", 6, 9),
    ("CG with V(1,1), no coarse grid", "cycles_of_set_up", 8.45306, 11.45),
    ("CG with V(1,1), no coarse grid", "iterations", 5, 8),
    ("CG with V(1,1), odd grids", "iterations", 6, 9),
    ("CG with V(1,1), punch of 64 to 256 squared", "iterations", 7, 10),
    ("CG with V(1,1), rediscretised", "iterations", 6, 9),
    ("CG with V(1,1), small grids of two axes", "iterations", 8, 11),
    ("CG with V(1,1), tests 1 to 3", "iterations", 3, 6),
    ("CG with V(1,1), three axes", "iterations", 6, 9),
    ("CG, a zero on two axes", "iterations", 10, 13),
    ("CG, symbol with a zero", "iterations", 11, 14.3),
    ("FSAI of coupled components, any area", "iterations", 11, 14.3),
    ("FSAI of coupled components, any grid", "iterations", 11, 14.3),
    ("FSAI with 5 neighbours", "iterations", 8, 11),
    ("FSAI, 10,000 islands of a line", "iterations", 9, 12),
    ("FSAI, a whole line", "iterations", 8, 11),
    ("FSAI, any area", "iterations", 9, 12),
    ("FSAI, any area of a line", "iterations", 9, 12),
    ("FSAI, any grid", "iterations", 9, 12),
    ("FSAI, any kernel of a half-space", "iterations", 11, 14.3),
    ("FSAI, areas of 512 squared", "iterations", 9, 12),
    ("FSAI, covariances that it takes", "iterations", 16, 20.8),
    ("FSAI, covariances with a large nugget", "iterations", 12, 15.6),
    ("FSAI, very long elements", "iterations", 14, 18.2),
    ("Gaussian covariances, rtol = 1e-8", "iterations", 18, 23.4),
    ("Gaussian covariances, rtol = 1e-8", "work_units", 52.3334, 68.03),
    ("Gaussians by low rank", "iterations", 3, 6),
    ("Hermitian matrices, rtol = 1e-8", "iterations", 14, 18.2),
    ("Hermitian matrices, rtol = 1e-8", "work_units", 23, 29.9),
    ("Schur algorithm, n = 2^14", "work_units", 15, 19.5),
    ("V(0,1), rediscretised", "iterations", 18, 23.4),
    ("Westergaard's wave, n = 512", "products", 10, 13),
    ("a chirp that decays", "iterations", 10, 13),
    ("a leading block nearly singular", "iterations", 5, 8),
    ("a simple zero, n = 100", "iterations", 3, 6),
    ("a sphere in 35 steps", "iterations", 6, 9),
    ("a step of cg with a cycle", "work_units", 8.99951, 12),
    ("a step of richardson with a cycle", "work_units", 4.99976, 8),
    ("a symbol that is zero at a sample", "iterations", 28, 36.4),
    ("chan_preconditioner, general matrices", "iterations", 8, 11),
    ("chan_preconditioner, on an area with holes", "iterations", 11, 14.3),
    ("chan_preconditioner, on an interval", "iterations", 7, 10),
    ("cosine_preconditioner, rough symbols, n = 2^14", "iterations", 10, 13),
    ("covariances of processes, rtol = 1e-8", "iterations", 12, 15.6),
    ("covariances of processes, rtol = 1e-8", "work_units", 21.8803, 28.44),
    ("cycles on stretched elements, 32 x 32", "iterations", 6, 9),
    ("cycles, n = 1 to 17", "iterations", 6, 9),
    ("cycles, symbol 2 + 2 cos θ", "iterations", 12, 15.6),
    ("cycles, symbol 2 - 2 cos θ", "iterations", 12, 15.6),
    ("cycles, symbol |θ|", "iterations", 8, 11),
    ("cycles, symbol |θ|^1.5", "iterations", 14, 18.2),
    ("cycles, symbol θ²", "iterations", 22, 28.6),
    ("default, 0.9^k, n = 2^14", "work_units", 8.75, 11.75),
    ("default, 131 x 131", "work_units", 10.4733, 13.62),
    ("default, 132 x 132", "work_units", 17.375, 22.59),
    ("default, a large circle", "work_units", 10.0638, 13.08),
    ("default, a mask in three axes", "work_units", 32.5625, 42.33),
    ("default, any mask", "iterations", 15, 19.5),
    ("default, areas of 96 x 96", "iterations", 13, 16.9),
    ("default, as wide as the matrix", "work_units", 11.25, 14.62),
    ("default, complex lines", "iterations", 4, 7),
    ("default, coupled", "work_units", 18.625, 24.21),
    ("default, coupled, on a mask", "work_units", 18.231, 23.7),
    ("default, exponential, 131 x 131", "work_units", 8.6499, 11.65),
    ("default, not even, on a mask", "work_units", 45.25, 58.83),
    ("default, slow decay, n = 2^14", "work_units", 11.395, 14.81),
    ("default, slow decay, n = 900", "work_units", 20.75, 26.98),
    ("default, stretched elements", "work_units", 24.875, 32.34),
    ("default, strongly coupled, on a mask", "work_units", 19.8559, 25.81),
    ("default, test 3", "work_units", 13.7072, 17.82),
    ("default, three axes", "work_units", 15.6875, 20.39),
    ("default, wide exponential", "work_units", 23.625, 30.71),
    ("default, wide exponential, on a mask", "work_units", 28.2881, 36.77),
    ("default, zero at an end, n = 900", "work_units", 5.75, 8.75),
    ("default, zero at π, n = 900", "work_units", 5.75, 8.75),
    ("default, θ², n = 900", "work_units", 14.75, 19.18),
    ("definite matrices, rtol = 1e-8", "iterations", 10, 13),
    ("definite matrices, rtol = 1e-8", "work_units", 24.1039, 31.34),
    ("definite systems, rtol = 1e-12", "iterations", 15, 19.5),
    ("fft_preconditioner, on an area with holes", "iterations", 9, 12),
    ("fft_preconditioner, on an interval", "iterations", 5, 8),
    ("fft_preconditioner, rough symbols, n = 2^14", "iterations", 9, 12),
    ("fft_preconditioner, smooth symbols, n = 2^14", "iterations", 5, 8),
    ("fft_rsm_preconditioner, on an area with holes", "iterations", 12, 15.6),
    ("fft_rsm_preconditioner, on an interval", "iterations", 9, 12),
    ("friction by a force just below the bound", "products", 8, 11),
    ("friction in a circle, nu = 0.0, n = 128", "products", 17, 22.1),
    ("friction in a circle, nu = 0.0, n = 128", "work_units", 23.1452, 30.09),
    ("friction in a circle, nu = 0.0, n = 256", "products", 14, 18.2),
    ("friction in a circle, nu = 0.0, n = 256", "work_units", 18.9688, 24.66),
    ("friction in a circle, nu = 0.28, n = 128", "products", 23, 29.9),
    ("friction in a circle, nu = 0.28, n = 128", "work_units", 31.0421, 40.35),
    ("friction in a circle, nu = 0.28, n = 256", "products", 21, 27.3),
    ("friction in a circle, nu = 0.28, n = 256", "work_units", 27.832, 36.18),
    ("friction in full contact that repeats", "products", 4, 7),
    ("friction in line contact, n = 2048", "products", 12, 15.6),
    ("friction in line contact, n = 512", "products", 10, 13),
    ("friction in line contact, n = 8192", "products", 18, 23.4),
    ("friction on a rough surface, nu = 0.0", "products", 30, 39),
    ("friction on a rough surface, nu = 0.28", "products", 50, 65),
    ("friction where almost all slides, 0 decades", "products", 9, 12),
    ("friction where almost all slides, 10 decades", "products", 11, 14.3),
    ("friction, a bound that falls far, 1 axes", "products", 11, 14.3),
    ("friction, a bound that falls far, 2 axes", "products", 17, 22.1),
    ("indefinite matrices, rtol = 1e-8", "iterations", 13, 16.9),
    ("indefinite matrices, rtol = 1e-8", "work_units", 22, 28.6),
    ("large rough surface", "products", 25, 32.5),
    ("near full contact at the hardness", "products", 26, 33.8),
    ("no symbol, a column and a correction", "work_units", 6.25, 9.25),
    ("nonsymmetric matrices, rtol = 1e-8", "iterations", 8, 11),
    ("nonsymmetric matrices, rtol = 1e-8", "work_units", 14.2521, 18.53),
    ("nonuniform Fourier, rtol = 1e-8", "iterations", 30, 39),
    ("nonuniform Fourier, rtol = 1e-8", "work_units", 47, 61.1),
    ("one element by loads, and a moment", "products", 2, 5),
    ("one element in any slip", "products", 2, 5),
    ("pressure on long elements", "products", 69, 89.7),
    ("rising friction 0.01", "products", 29, 37.7),
    ("rising friction 1e-05", "products", 48, 62.4),
    ("rollers of unlike materials", "iterations", 3, 6),
    ("rolling by force, elements that bear next to nothing", "products", 24, 31.2),
    ("rolling of a circle, n = 256", "products", 13, 16.9),
    ("rolling of a circle, n = 256", "work_units", 58.3821, 75.9),
    ("rolling of a line in pieces", "products", 27, 35.1),
    ("rolling of a line, n = 1229", "products", 9, 12),
    ("rolling of rough surfaces, n = 192", "products", 28, 36.4),
    ("rolling to 1 % on coarser grids first, 6 cases", "products", 30, 39),
    ("rolling, long and narrow", "products", 78, 101.4),
    ("rolling, narrow and sticking nearly everywhere", "products", 270, 351),
    ("rough profile", "products", 63, 81.9),
    ("rough surface that repeats, n = 1024", "products", 41, 53.3),
    ("rough surface that repeats, n = 1024", "work_units", 81.6895, 106.2),
    ("rough surface that repeats, n = 256", "products", 35, 45.5),
    ("rough surface that repeats, n = 256", "work_units", 68.6406, 89.23),
    ("rough surface, 10% in contact", "products", 21, 27.3),
    ("rough surface, 2% in contact", "products", 15, 19.5),
    ("rough surface, 28% in contact", "products", 25, 32.5),
    ("select, a line", "work_units", 4.25, 7.25),
    ("set-up of default, a trial", "work_units", 12.125, 15.76),
    ("set-up of default, half-space", "work_units", 0.125, 3.12),
    ("set-up of multigrid, fft_rsm_preconditioner", "work_units", 7.49951, 10.5),
    ("set-up of multigrid, jacobi_preconditioner", "work_units", 0.9375, 3.94),
    ("set-up of spectral, general, n = 2^14", "work_units", 9, 12),
    ("short systems in the DCT domain", "iterations", 6, 9),
    ("sinc, rtol = 1e-8", "iterations", 2, 5),
    ("sinc, rtol = 1e-8", "work_units", 29.5, 38.35),
    ("sine and cosine, several axes", "iterations", 9, 12),
    ("sine_preconditioner, zero symbols, n = 2^14", "iterations", 9, 12),
    ("spectral, Hermitian", "iterations", 8, 11),
    ("spectral, n = 64 to 500", "iterations", 6, 9),
    ("spectral, nonsymmetric", "iterations", 3, 6),
    ("spectral_preconditioner, rough symbols, n = 2^14", "iterations", 5, 8),
    ("spectral_preconditioner, smooth symbols, n = 2^14", "iterations", 2, 5),
    ("sphere with a hardness, n = 256", "products", 9, 12),
    ("sphere, n = 512", "products", 15, 19.5),
    ("sphere, n = 512", "work_units", 20.4961, 26.64),
    ("strang_preconditioner, on an area with holes", "iterations", 11, 14.3),
    ("strang_preconditioner, on an interval", "iterations", 7, 10),
    ("tangential, M of each component, constant side", "iterations", 13, 16.9),
    ("tangential, M of each component, random side", "iterations", 16, 20.8),
    ("tangential, M, constant side", "iterations", 11, 14.3),
    ("tangential, M, random side", "iterations", 14, 18.2),
    ("tangential, cosines, constant side", "iterations", 12, 15.6),
    ("tangential, cosines, random side", "iterations", 14, 18.2),
    ("toeplitz_inverse, n = 2^16", "work_units", 15.5, 20.15),
    ("toeplitz_logdet, lines, n = 2048", "work_units", 31.25, 40.62),
    ("toeplitz_logdet, n = 2^16", "work_units", 19.6904, 25.6),
    ("wide Gaussian, rtol = 1e-8", "iterations", 15, 19.5),
    ("wide Gaussian, rtol = 1e-8", "work_units", 32, 41.6),
    ("τ of variable fractional diffusion", "iterations", 11, 14.3),
]
# fmt: on


def budget_of(measured):
    """Return what a test may take where this was measured."""
    return round(max(1.3 * measured, measured + 3), 2)


def assert_within_budget(case, **measures):
    """Check that each measure (products, iterations, work units, …) is within its budget.

    A case may be measured several times, as by several examples: the largest counts.
    """
    if folder := os.environ.get(RECORD):
        lines = [json.dumps([case, name, float(value)]) for name, value in measures.items()]
        with (Path(folder) / str(os.getpid())).open("a") as file:
            file.writelines(f"{line}\n" for line in lines)
        return
    budgets = {(name, measure): budget for name, measure, _, budget in TABLE}
    for measure, value in measures.items():
        assert (case, measure) in budgets, f"{case}, {measure}: run python -m tests.budgets"
        budget = budgets[case, measure]
        assert value <= budget, f"{case}: {value} {measure}, but at most {budget} are budgeted"


def measure(paths):
    """Run tests, the slow ones too, and return the largest of each measure of each case."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-n", "auto", *map(str, paths)],
            env={**os.environ, RECORD: folder},
            cwd=TESTS.parent,
            check=True,
        )
        found = {}
        for path in sorted(Path(folder).iterdir()):
            for case, name, value in map(json.loads, path.read_text().splitlines()):
                found[case, name] = max(value, found.get((case, name), value))
    return found


HEAD, TAIL = "budget.\n", "]\n# fmt: on\n"  # Stand before and after the rows of the table.


def write_table(rows):
    """Write these rows, in order, in the place of the table of this file."""
    before, rest = Path(__file__).read_text().split(HEAD, 1)
    after = rest.split(TAIL, 1)[1]
    lines = [
        f'    ({json.dumps(case, ensure_ascii=False)}, "{measure}", {value:g}, {budget:g}),\n'
        for case, measure, value, budget in rows
    ]
    Path(__file__).write_text(before + HEAD + "".join(lines) + TAIL + after)


def read_table():
    """Return the table as it stands in the file, which may have changed since it was imported."""
    text = Path(__file__).read_text().split(HEAD, 1)[1].split(TAIL, 1)[0]
    return ast.literal_eval(f"[{text}]")


def main(names):
    """Measure and rewrite the table, all of it or that of the files that are named."""
    users = [p for p in sorted(TESTS.rglob("*.py")) if "assert_within_budget(" in p.read_text()]
    users = [p for p in users if p != Path(__file__)]
    found = measure(map(Path, names) if names else users)
    before = {(case, name): (value, budget) for case, name, value, budget in read_table()}
    kept = before if names else {}
    rows = kept | {key: (value, budget_of(value)) for key, value in found.items()}
    write_table((*key, *rows[key]) for key in sorted(rows))
    for key in sorted(found):
        if key not in before:
            print(f"new: {', '.join(key)}: {rows[key][1]:g}")
        elif rows[key][1] > before[key][1]:
            print(f"GROWN: {', '.join(key)}: {before[key][1]:g} -> {rows[key][1]:g}")
    print(f"{len(found)} measured, {len(rows)} budgets in the table")


if __name__ == "__main__":
    main(sys.argv[1:])
