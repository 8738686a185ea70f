"""When and on what something is measured, in a sentence that stands below its table."""

import os
import platform
from datetime import date
from importlib.metadata import distributions, version
from pathlib import Path

CPUINFO = Path("/proc/cpuinfo")  # Linux alone has the name of the processor in a file.


def describe() -> str:
    """Return the date, the processor and the versions, as "2026-01-31: AMD EPYC, 2 cores; …"."""
    names = [name for name in ("numpy", "scipy", "mkl", "mkl_fft") if any(distributions(name=name))]
    versions = ", ".join(f"{name} {version(name)}" for name in names)
    cores = os.cpu_count() or 1
    return (
        f"{date.today()}: {_name_processor()}, {cores} core{'s' * (cores != 1)}; "
        f"Python {platform.python_version()}, {versions}"
    )


def _name_processor() -> str:
    if CPUINFO.exists():
        for line in CPUINFO.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
