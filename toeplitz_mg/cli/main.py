"""The command line: dispatch to subcommands, errors and exit status."""

import io
import sys
import warnings
from collections.abc import Callable, Sequence
from contextlib import nullcontext, redirect_stdout, suppress
from functools import partial
from typing import Any

import numpy as np
from scipy import fft

from toeplitz_mg import startup
from toeplitz_mg.cli import contact, linear, report
from toeplitz_mg.cli.arguments import parser, take_threads

BROKEN_PIPE = 141  # Exit status: 128 plus the number of SIGPIPE, as for other programs.
COMMANDS: dict[str, Callable[..., tuple[int, dict[str, Any]]]] = {
    "paper": linear.run_paper,
    "solve": linear.run_solve,
    "contact": contact.run,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        ``sys.argv[1:]`` by default.

    Returns
    -------
    int
        0 if it converged, 1 if it did not, 2 for errors, 130 if interrupted, 141 if the reader of
        the report has stopped.
    """
    try:
        startup.raise_again()
        report.print_any_character()
        given = parser().parse_command(arguments)
        if not any(value is not None for value in vars(given).values()):  # No arguments.
            parser().print_help()
            return 0
        is_json = vars(given).get("json", False)
        writes_files = getattr(given, "output", None) or getattr(given, "plot", None)
        with report.outlasting_its_reader(bool(writes_files)) as reader:
            with warnings.catch_warnings(), fft.set_workers(take_threads(given)):
                warnings.showwarning = partial(_print_warning, warnings.showwarning)
                with redirect_stdout(io.StringIO()) if is_json else nullcontext():
                    status, figures = COMMANDS[given.command or "paper"](given)
            if is_json:
                print(report.write_json(figures))
            print(end="", flush=True)  # Raises an error for a full disk here, not at exit.
        return status if reader.is_there else status or BROKEN_PIPE
    except BrokenPipeError:  # The reader has stopped, as `head` does.
        report.drop_output()
        return BROKEN_PIPE
    except OSError as error:
        said = (error.filename, error.strerror)
        return _fail(f"toeplitz-mg: error: {': '.join(map(str, said)) if all(said) else error}")
    except (ValueError, TypeError, np.linalg.LinAlgError) as error:
        return _fail(f"toeplitz-mg: error: {error}")
    except MemoryError:
        return _fail("toeplitz-mg: error: not enough memory for this system")
    except KeyboardInterrupt:
        return _fail(startup.MESSAGE, startup.STATUS)


def _print_warning(
    show: Any, message: Warning | str, category: type[Warning], *place: Any, **options: Any
) -> None:
    """Print a warning on one line; warnings for programmers are shown in full."""
    if issubclass(category, DeprecationWarning | FutureWarning):
        show(message, category, *place, **options)
        return
    print(f"toeplitz-mg: warning: {' '.join(str(message).splitlines())}", file=sys.stderr)


def _fail(message: str, status: int = 2) -> int:
    """Print an error on one line, and return the exit status."""
    with suppress(OSError):  # If this cannot be printed either, the status tells.
        print(" ".join(message.splitlines()), file=sys.stderr)
    try:
        print(end="", flush=True)
    except OSError:
        report.drop_output()
    return status
