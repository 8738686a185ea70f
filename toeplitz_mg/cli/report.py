"""What is printed: by any terminal, and a line for each step of an iteration."""

import io
import sys
from collections.abc import Callable
from math import inf

EXIT_STATUS = "Exit status: 0 converged, 1 not converged, 2 not possible, 130 interrupted."


def print_any_character() -> None:
    """Print what the terminal does not have as its number, so that no result is lost at a "²"."""
    failing = ("strict", "surrogateescape")  # Any other was asked for, as by PYTHONIOENCODING.
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors in failing:
        sys.stdout.reconfigure(errors="backslashreplace")


def print_step(count: int, error: float) -> None:
    """Print how far an iteration is, and how far from its end."""
    print(f"{count:10d}   {error:.3e}", flush=True)


def step_printer() -> Callable[[int, float], None]:
    """Return what prints a step of a contact problem where it is told of another violation.

    It is told after each product, and with none on coarser grids, which are not printed.
    """
    last = inf

    def tell(products: int, violation: float) -> None:
        nonlocal last
        if products and violation != last:
            print_step(products, violation)
            last = violation

    return tell
