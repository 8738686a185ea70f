"""Ctrl-C while the command line is still importing: one line and status 130, no traceback.

NumPy and SciPy take about a second to import before the command line runs. An exception that is
raised inside their extensions may be swallowed or turned into an ImportError. So the package
imports this module first. In a process started as the command line, Ctrl-C then ends it at once,
until `cli.main` takes over. Other processes are not affected.
"""

import os
import signal
import sys
from types import FrameType

STATUS = 130  # Exit status: 128 and the number of SIGINT, as shells report an interrupted command.
MESSAGE = "toeplitz-mg: interrupted"


def is_command_line() -> bool:
    """Tell whether this process is ``toeplitz-mg`` or ``python -m toeplitz_mg``."""
    program = os.path.basename(sys.argv[0]) if getattr(sys, "argv", None) else ""
    if program != "-m":
        return program.removesuffix(".exe") == "toeplitz-mg"
    # This runs while Python looks for the module, whose name precedes the arguments.
    module = sys.orig_argv[-len(sys.argv)]
    return module == "toeplitz_mg" or (module[0] == "-" and module.endswith("mtoeplitz_mg"))


def raise_again() -> None:
    """Let Ctrl-C raise KeyboardInterrupt, as usual."""
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _end(signum: int, frame: FrameType | None) -> None:
    os.write(2, f"{MESSAGE}\n".encode())
    os._exit(STATUS)  # Nothing has been printed or written yet.


# An ignored signal, as in a background job, stays ignored.
if is_command_line() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _end)
