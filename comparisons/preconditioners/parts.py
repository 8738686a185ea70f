"""Every preconditioner on areas, on symbols, and on fractional diffusion; pictures of areas.

`areas` are contact areas of every kind, `symbols` symmetric positive definite Toeplitz matrices,
`general` those that are nonsymmetric, Hermitian or indefinite, `fractional` the standard problems
of fractional diffusion, on which τ has rivals. ``--parts`` chooses among them.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from comparisons.harness import report
from comparisons.harness.measuring import PRECONDITIONERS
from comparisons.harness.processes import prepare
from comparisons.preconditioners import areas, fractional, general, pictures, symbols
from comparisons.systems.symbols import COLUMNS

Part = Callable[..., None]  # Takes the folder, and its sizes by name.
PARTS: dict[str, Part] = {
    "areas": areas.run,
    "symbols": symbols.run,
    "general": general.run,
    "fractional": fractional.run,
    "pictures": pictures.run,
}
FULL: dict[str, dict[str, Any]] = {part: {} for part in PARTS}
QUICK: dict[str, dict[str, Any]] = {
    "areas": {"sizes": (32,), "lines": (2048,), "methods": ("none", "cosine", "FSAI", "default")},
    "symbols": {"sizes": (2**8,)},
    "general": {"sizes": (2**10,)},
    "fractional": {
        "sizes": {1: (2**6 - 1,), 2: (2**4 - 1,)},
        "growing": {1: (2**8 - 1,), 2: (2**3 - 1,)},
        "levels": {1: 8, 2: 4},
    },
    "pictures": {"n": 16},
}


@report.interruptible
def main(argv: Sequence[str] | None = None, quick: Mapping[str, Mapping[str, Any]] = QUICK) -> None:
    """Run the comparison."""
    prepare("comparisons.preconditioners.parts")
    arguments = report.options(
        "preconditioners",
        "Every preconditioner on areas, on symbols, and on fractional diffusion.",
        argv=argv,
        parts=tuple(PARTS),
        areas=areas.AREAS,
        symbols=tuple(COLUMNS),
        methods=tuple(PRECONDITIONERS),
    )
    folder: Path = arguments.output
    for part in arguments.parts or PARTS:
        extent = dict((quick if arguments.quick else FULL)[part])
        if part == "areas":
            chosen = {"areas": arguments.areas, "methods": arguments.methods}
            extent |= {name: names for name, names in chosen.items() if names}
        if part == "symbols" and arguments.symbols:
            extent["symbols"] = arguments.symbols
        PARTS[part](folder, **extent)
