"""The one fact about a machine that `solve_toeplitz` chooses by: a ratio of two times.

Where n is between some 256 and 2048, Levinson's recursion, which is compiled and takes n² steps,
and CG in the DCT domain, which takes some hundred calls of Python and few numbers each, take about
as long. Which is faster depends on the machine, and so on its ratio.
"""

import os
from functools import cache
from time import perf_counter

import numpy as np

from toeplitz_mg.solvers.cosine_cg import CosineSolver
from toeplitz_mg.solvers.cosine_form import CosineForm
from toeplitz_mg.solvers.levinson import levinson

VARIABLE = "TOEPLITZ_MG_COSINE_OVER_LEVINSON"  # The environment variable that fixes the ratio.
WINDOW = 512  # Unknowns of the system whose times are compared.
TURNS = 9  # Turns of the two, of which the shortest times count: some milliseconds in all.


def cosine_over_levinson() -> float:
    """Return the time of CG in the DCT domain over that of Levinson's recursion, n = 512.

    It is what the environment variable says, or else measured once in a process.

    Raises
    ------
    ValueError
        Where the environment variable is not a positive number.
    """
    fixed = os.environ.get(VARIABLE)
    if not fixed:  # As for most programs, an empty one is none.
        return _measure()
    try:
        ratio = float(fixed)
    except ValueError:
        ratio = np.nan
    if not 0.0 < ratio < np.inf:
        raise ValueError(
            f"the environment variable {VARIABLE} is {fixed!r}, but must be a positive number: the "
            f"time of CG in the DCT domain over that of Levinson's recursion, n = {WINDOW}"
        )
    return ratio


@cache
def _measure() -> float:
    c = 1.0 / np.arange(1.0, WINDOW + 1)
    lags = np.concatenate([c[:0:-1], c])
    b = np.cos(np.arange(WINDOW) ** 2)  # As good as random.
    size = float(lags.sum())
    times = []
    for _ in range(TURNS):
        start = perf_counter()
        form = CosineForm(c)
        form.multiply(CosineSolver(form, size).solve(b, 1e-12)[0])
        middle = perf_counter()
        levinson(lags, b)
        times.append((middle - start, perf_counter() - middle))
    return min(t for t, _ in times) / min(t for _, t in times)
