"""``toeplitz-mg``: a problem of the paper, and what the paper has in its place."""

import argparse

from toeplitz_mg.cli import linear
from toeplitz_mg.cli.arguments import complete
from toeplitz_mg.cli.linear import System
from toeplitz_mg.paper import published
from toeplitz_mg.paper.problems import TESTS


def run(given: argparse.Namespace) -> int:
    """Run the command, and return the exit status."""
    options = complete(given)
    problem = TESTS[options.test](options.n)
    title = f"Test {options.test} of the paper with {options.n} elements"
    system = System(title, problem.A, problem.b, problem.x)
    return linear.run(system, options, lambda label: _format_published(label, options))


def _format_published(label: str, options: argparse.Namespace) -> str:
    """Return what the paper has in the place of the last line, as far as it is legible."""
    log_n = options.n.bit_length() - 1
    if options.n != 2**log_n or options.rtol != 1e-8 or options.solver == "cg":
        return ""
    is_solver = options.solver == "richardson" and label == "fft-rsm"
    key = (options.test, "solver" if is_solver else label)
    table = {"fft-rsm": published.ROW_SUM, "fft-sd": published.DEFLATION}.get(options.smoother, {})
    cell = (published.SOLVER[options.test] if is_solver else table.get(key, {})).get(log_n)
    at_the_end = log_n == 20 and (is_solver or options.smoother == "fft-rsm")
    units = published.WORK_UNITS.get(key) if at_the_end else None
    seconds = published.CPU_SECONDS.get(key) if at_the_end else None
    if cell is None and units is None:
        return ""
    if cell is not None:
        iterations, factor = str(cell.iterations), f"{cell.factor:.4f}"
    else:  # The cell is illegible, but Table VI gives it away.
        factor, a_step = "", 2 if is_solver else published.UNITS_PER_CYCLE[label]
        iterations = str((units or 0) // a_step)
    line = f"{'the paper':12s}{iterations:>10s}   {factor:>6s}   {units or '':>10}"
    return line + (f"   {seconds:>7}   in Matlab, at 3.17 GHz" if seconds else "")
