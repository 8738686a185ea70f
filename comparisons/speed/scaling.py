r"""Slabs of rows on several ranks: time, bytes and memory over ranks and unknowns, and the model.

Weak scaling has as many unknowns for each rank, on grids near side · √ranks; strong scaling the
same grid for all. Each number of ranks is a job of its own, started by the launcher: of this
environment by default, on a cluster its own, with a rank a node, as

    python -m comparisons.speed.scaling --nodes 1 2 4 8 --side 16384 \
        --launcher "srun --nodes {ranks} --ntasks {ranks} --cpus-per-task 64"

The model takes the rates of a rank (transforms, memory, network) as measured in the same job, all
ranks at once. For the node counts of ``--model`` there is no measurement: it takes those given by
``--gigaflops``, ``--memory_rate`` and ``--network_rate``, in 10⁹ flop/s and bytes/s.
"""

import argparse
import json
import os
import shlex
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

from tqdm import tqdm

from comparisons.harness import report
from comparisons.harness.report import Row
from comparisons.speed.scaling_model import Node, predict

STEP = 32  # Sides of grids are multiples of it, so that their transforms are fast.
LIMIT = 3600.0  # Seconds after which a job is given up.
WORKER = "from comparisons.speed.scaling_rank import main; main()"
MPIEXEC = Path(sysconfig.get_path("scripts")) / "mpiexec"

TIMES = {
    "kind": "",
    "ranks": "",
    "n": "",
    "product CPU ns": ".1f",
    "product s": ".3g",
    "model s": ".3g",
    "product bytes": ".2f",
    "FSAI bytes": ".2f",
    "FSAI iterations": "",
    "FSAI solve s": ".3g",
    "FSAI model s": ".3g",
    "cosine iterations": "",
    "cosine solve s": ".3g",
    "cosine model s": ".3g",
    "efficiency": ".2f",
    "note": "",
}
MEMORY = {
    "what": "",
    "ranks": "",
    "n": "",
    "MB": ".0f",
    "bytes an unknown": ".0f",
    "over serial / P": ".2f",
}


def main(sides: tuple[int, int, int] | None = None) -> None:
    """Run the jobs, print tables and write them."""
    arguments = report.options(
        "speed.scaling",
        "Time, bytes and memory on slabs, over ranks and unknowns.",
        nodes=[1, 2, 4],
        model=[1, 8, 128, 512, 8192],
        launcher=f"{MPIEXEC} -n {{ranks}}",
        side=1440,
        strong=2048,
        memory=4096,
        gigaflops=500,
        memory_rate=250,
        network_rate=10,
    )
    weak, strong, memory = sides or (arguments.side, arguments.strong, arguments.memory)
    if arguments.quick and sides is None:
        weak, strong, memory = 256, 256, 256
    sizes = {ranks: STEP * round(weak * ranks**0.5 / STEP) for ranks in arguments.nodes}
    jobs = [("weak", ranks, n) for ranks, n in sizes.items()]
    jobs += [("strong", ranks, strong) for ranks in arguments.nodes]
    times = [
        {"kind": kind, **judge(run(arguments.launcher, ranks, n, "times"))}
        for kind, ranks, n in tqdm(jobs, disable=None)
    ]
    compare(times)
    report.show("Times of all ranks", [report.format_cells(row, TIMES) for row in times])
    report.write_csv(arguments.output / "scaling.csv", times)
    rows = []
    for name in ("FSAI", "cosine"):
        serial = run(arguments.launcher, 1, memory, f"serial {name}")
        of_ranks = [run(arguments.launcher, ranks, memory, name) for ranks in arguments.nodes]
        for row in (serial, *of_ranks):
            if "MB" in row:
                row["bytes an unknown"] = row["MB"] * 1e6 * row["ranks"] / memory**2
                row["over serial / P"] = row["MB"] * row["ranks"] / serial.get("MB", float("nan"))
            rows.append(row)
    report.show("Memory of a rank", [report.format_cells(row, MEMORY) for row in rows])
    report.write_csv(arguments.output / "memory.csv", rows)
    rows = table_of_model(arguments)
    report.show("The model", rows)
    report.write_csv(arguments.output / "model.csv", rows)


def run(launcher: str, ranks: int, n: int, what: str) -> Row:
    """Return what a job measures, or a note why there is none."""
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as folder:
        result = Path(folder) / "result.json"  # A folder that all nodes see.
        start = shlex.split(launcher.format(ranks=ranks))
        command = [*start, sys.executable, "-m", "mpi4py", "-c", WORKER, str(n), what, str(result)]
        environment = {"OMP_NUM_THREADS": "1", **os.environ}
        note = {"ranks": ranks, "n": n, "what": what}
        try:
            job = subprocess.run(
                command, env=environment, capture_output=True, text=True, timeout=LIMIT
            )
        except subprocess.TimeoutExpired:
            return {**note, "note": f"over {LIMIT:.0f} s"}
        except OSError as error:
            return {**note, "note": f"{start[0]}: {error.strerror}"}
        if job.returncode or not result.exists():
            reason = (job.stderr or job.stdout).strip().splitlines() or ["it printed nothing"]
            return {**note, "note": f"status {job.returncode}: {reason[-1][:100]}"}
        measured: Row = json.loads(result.read_text())
        return measured


def judge(row: Row) -> Row:
    """Return a row with the model beside what was measured."""
    if "note" in row:
        return row
    node = Node(*(row[f"{name}/s"] for name in ("flop", "memory B", "network B")))
    model = predict(node, row["ranks"], row["n"])
    row |= {"model s": model.product, "model exchange s": model.exchange}
    for name, seconds in (("FSAI", model.fsai), ("cosine", model.cosine)):
        row[f"{name} model s"] = seconds * row[f"{name} iterations"]
    row["product CPU ns"] = row["product CPU s"] / row["n"] ** 2 * 1e9
    return row


def compare(rows: list[Row]) -> None:
    """Add the efficiency by CPU time of each row: of a product, for each unknown, by the first."""
    for kind in ("weak", "strong"):
        measured = [row for row in rows if row["kind"] == kind and "product CPU ns" in row]
        for row in measured:
            row["efficiency"] = measured[0]["product CPU ns"] / row["product CPU ns"]


def table_of_model(arguments: argparse.Namespace) -> list[Row]:
    """Return the model for numbers of nodes, of 2^27 unknowns each; a single one has twice that."""
    node = Node(
        *(1e9 * getattr(arguments, f) for f in ("gigaflops", "memory_rate", "network_rate"))
    )
    rows = []
    for nodes in arguments.model:
        n = round((2.0**27 * max(nodes, 2)) ** 0.5)
        p = predict(node, nodes, n)
        cells: dict[str, Any] = {"nodes": nodes, "n": n, "rows a node": n // nodes}
        cells["GB a node"] = f"{p.memory / 1e9:.0f}"
        cells["message MB"] = f"{p.message / 1e6:.2g}" if nodes > 1 else ""
        cells["product s"] = f"{p.product:.2f}"
        cells["of it messages s"] = f"{p.exchange:.2f}"
        cells["CG + FSAI s"] = f"{10 * p.fsai:.0f}"
        cells["CG + cosine s"] = f"{20 * p.cosine:.0f}"
        rows.append(cells)
    return rows


if __name__ == "__main__":
    main()
