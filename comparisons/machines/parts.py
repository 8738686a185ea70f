r"""What more than one core gains, and other transforms: threads, ranks of MPI, a GPU, MKL.

``--parts`` chooses among `threads`, by `scipy.fft.set_workers`; `ranks`, slabs of rows in several
processes, beside a model; `transforms`, products by MKL, where it is installed; and `gpu`, the
arrays of other libraries, with ``--library`` on the processor too. On a cluster the launcher is its
own, with a rank a node, as

    python -m comparisons.machines --parts ranks --nodes 1 2 4 8 --side 16384 \
        --launcher "srun --nodes {ranks} --ntasks {ranks} --cpus-per-task 64"
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from comparisons.harness import report
from comparisons.machines import gpu, ranks, threads, transforms

Part = Callable[..., None]
PARTS: dict[str, Part] = {"threads": threads.run, "ranks": ranks.run, "gpu": gpu.run}
PARTS["transforms"] = transforms.run
USUAL = "threads", "ranks"  # The parts that every machine has.
RANKS = "launcher", "nodes", "side", "model"  # Options of `ranks`.
QUICK: dict[str, dict[str, Any]] = {
    "threads": {"sides": (512,), "turns": 2},
    "ranks": {"side": 256, "strong": 256, "memory": 256},
    "transforms": {"shapes": ((300,), (20, 30)), "turns": 2},
    "gpu": {"sizes": (64, 128)},
}


@report.interruptible
def main(argv: Sequence[str] | None = None, quick: Mapping[str, Mapping[str, Any]] = QUICK) -> None:
    """Run the comparison, of the extent `quick` with ``--quick``."""
    arguments = report.options(
        "machines",
        "What threads, ranks and the arrays of a GPU gain.",
        argv=argv,
        parts=tuple(PARTS),
        cores=2,
        nodes=[1, 2, 4],
        model=[1, 8, 128, 512, 8192],
        launcher=ranks.LAUNCHER,
        side=1440,
        library=gpu.LIBRARIES,
        largest=4096,
    )
    extents: dict[str, dict[str, Any]] = {
        "threads": {"cores": arguments.cores},
        "ranks": {name: getattr(arguments, name) for name in RANKS},
        "gpu": {
            "libraries": arguments.library or gpu.LIBRARIES[:1],
            "sizes": [n for n in gpu.SIZES if n <= arguments.largest],
        },
    }
    for part in arguments.parts or USUAL:
        extent = extents.get(part, {}) | dict(quick[part] if arguments.quick else {})
        PARTS[part](arguments.output, **extent)
