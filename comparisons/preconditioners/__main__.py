"""Every preconditioner on areas and on symbols.

`areas` are contact areas of every kind, `symbols` Toeplitz matrices of one axis of every kind;
`trials` matrices of which a trial chooses the preconditioner; `cycles` has multigrid on any kernel;
`picture` draws pressures on the areas. ``--parts`` chooses among them.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from comparisons.harness import report
from comparisons.harness.measuring import PRECONDITIONERS
from comparisons.harness.processes import prepare
from comparisons.preconditioners import areas, cycles, symbols, trials

Part = Callable[..., None]  # Takes the folder, and its sizes by name.
PARTS: dict[str, Part] = {
    "areas": areas.run,
    "symbols": symbols.run,
    "trials": trials.run,
    "cycles": cycles.run,
    "picture": areas.draw,
}
QUICK: dict[str, dict[str, Any]] = {
    "areas": {"sizes": (32,), "lines": (2048,), "methods": ("none", "cosine", "FSAI", "default")},
    "symbols": {"sizes": (2**8,)},
    "trials": {"sizes": (32,)},
    "cycles": {"lines": (2**10,), "squares": (32,)},
    "picture": {"n": 16},
}


@report.interruptible
def main(argv: Sequence[str] | None = None, quick: Mapping[str, Mapping[str, Any]] = QUICK) -> None:
    """Run the comparison."""
    prepare("comparisons.preconditioners.areas", "comparisons.preconditioners.symbols")
    arguments = report.options(
        "preconditioners",
        "Every preconditioner on areas and on symbols.",
        argv=argv,
        parts=tuple(PARTS),
        areas=areas.AREAS,
        symbols=tuple(name for kind in symbols.KINDS.values() for name in kind),
        methods=tuple(PRECONDITIONERS),
    )
    folder: Path = arguments.output
    for part in arguments.parts or PARTS:
        extent = dict(quick[part] if arguments.quick else {})
        if part == "areas":
            chosen = {"areas": arguments.areas, "methods": arguments.methods}
            extent |= {name: names for name, names in chosen.items() if names}
        if part == "symbols" and arguments.symbols:
            extent["symbols"] = arguments.symbols
        PARTS[part](folder, **extent)


if __name__ == "__main__":
    main()
