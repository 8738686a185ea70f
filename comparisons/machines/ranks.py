"""Slabs of rows on several ranks: time, bytes and memory over ranks and unknowns, and the model.

Weak scaling has as many unknowns for each rank, on grids near side · √ranks; strong scaling the
same grid for all. Each number of ranks is a job of its own, of `rank`, started by the launcher.

The model says what operations should take, from the rates of a node: transforms, memory, network.
Flops are 5 L log₂ L of a complex transform of length L. A product has them of rows, of length n,
and of columns, of length 2 n, each way; and moves 32 bytes an unknown between ranks, less those
that stay. What moves between the processor and its memory was chosen before anything was measured;
it is not fitted. Beside a measurement it takes the rates of a rank as measured in the same job, all
ranks at once; for other numbers of nodes those of `NODE`.
"""

import json
import os
import shlex
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator, Sequence
from math import log2
from pathlib import Path
from typing import NamedTuple

from comparisons.harness import report
from comparisons.harness.report import Row

STEP = 32  # Sides of grids are multiples of it, so that their transforms are fast.
LIMIT = 3600.0  # Seconds after which a job is given up.
WORKER = "from comparisons.machines.rank import main; main()"
LAUNCHER = f"{Path(sysconfig.get_path('scripts')) / 'mpiexec'} -n {{ranks}}"
PRODUCT_BYTES = 300.0  # Bytes an unknown between processor and memory, of a product.
FSAI_BYTES = 420.0  # The same of the rest of an iteration with FSAI: its matrices, and vectors.
COSINE_BYTES = 155.0  # The same of an iteration with the cosine transform.
VECTORS = 20  # Vectors that a solve with a transform needs, of float64; 5 % more than measured.
TIMES = {"kind": "", "ranks": "", "n": "", "product CPU ns": ".1f", "product s": ".3g"}
TIMES |= {"model s": ".3g", "product bytes": ".2f", "FSAI bytes": ".2f", "FSAI iterations": ""}
TIMES |= {"FSAI solve s": ".3g", "FSAI model s": ".3g", "cosine iterations": ""}
TIMES |= {"cosine solve s": ".3g", "cosine model s": ".3g", "efficiency": ".2f", "note": ""}
MEMORY = {"what": "", "ranks": "", "n": "", "MB": ".0f", "bytes an unknown": ".0f"}
MEMORY |= {"over serial / P": ".2f", "note": ""}


class Node(NamedTuple):
    """The rates of a node, or of a rank: in flop/s, and bytes/s of memory and network."""

    flops: float
    memory: float
    network: float


NODE = Node(flops=500e9, memory=250e9, network=10e9)


class Prediction(NamedTuple):
    """Seconds of a product and of its messages, of iterations of CG; bytes of a node, a message."""

    product: float
    exchange: float
    fsai: float
    cosine: float
    memory: float
    message: float


def predict(node: Node, nodes: int, n: int) -> Prediction:
    """Return what a square grid of n x n unknowns takes on so many nodes."""
    own = n * n / nodes
    flops = (10.0 * log2(n) + 20.0 * log2(2 * n)) * own
    exchange = 32.0 * (1.0 - 1.0 / nodes) * own / node.network
    product = flops / node.flops + PRODUCT_BYTES * own / node.memory + exchange
    fsai = product + FSAI_BYTES * own / node.memory
    cosine = product + 10.0 * log2(n) * own / node.flops + COSINE_BYTES * own / node.memory
    cosine += exchange / 2.0
    return Prediction(product, exchange, fsai, cosine, 8.0 * VECTORS * own, 16.0 * own / nodes)


def run(
    folder: Path,
    *,
    launcher: str,
    nodes: Sequence[int],
    side: int,
    model: Sequence[int],
    strong: int = 2048,
    memory: int = 4096,
) -> None:
    """Run the jobs, and print their tables."""
    table = report.Table("Times of all ranks", folder / "scaling.csv", TIMES, {"kind": 6, "n": 6})
    table.extend(times(launcher, nodes, side, strong))
    table = report.Table("Memory of a rank", folder / "memory.csv", MEMORY, {"what": 13})
    table.extend(memories(launcher, nodes, memory))
    report.Table("The model", folder / "model.csv").extend(modelled(NODE, model))


def times(launcher: str, nodes: Sequence[int], side: int, strong: int) -> Iterator[Row]:
    """Yield what takes how long, as many unknowns for each rank, and the same for all."""
    for kind in ("weak", "strong"):
        first = None
        for ranks in nodes:
            n = STEP * round(side * ranks**0.5 / STEP) if kind == "weak" else strong
            row = {"kind": kind, **judge(measure(launcher, ranks, n, "times"))}
            if "note" not in row:
                first = first or row["product CPU ns"]
                row["efficiency"] = first / row["product CPU ns"]
            yield row


def memories(launcher: str, nodes: Sequence[int], n: int) -> Iterator[Row]:
    """Yield the memory of a rank, without slabs and on so many ranks."""
    for name in ("FSAI", "cosine"):
        serial = None
        for ranks, what in ((1, f"serial {name}"), *((ranks, name) for ranks in nodes)):
            row = measure(launcher, ranks, n, what)
            if "MB" in row:
                serial = serial or row["MB"]
                row["bytes an unknown"] = row["MB"] * 1e6 * ranks / n**2
                row["over serial / P"] = row["MB"] * ranks / serial
            yield row


def measure(launcher: str, ranks: int, n: int, what: str) -> Row:
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
    row["model s"] = model.product
    row["FSAI model s"] = model.fsai * row["FSAI iterations"]
    row["cosine model s"] = model.cosine * row["cosine iterations"]
    row["product CPU ns"] = row["product CPU s"] / row["n"] ** 2 * 1e9
    return row


def modelled(node: Node, model: Sequence[int]) -> Iterator[Row]:
    """Yield the model for numbers of nodes, of 2^27 unknowns each; a single one has twice that."""
    for nodes in model:
        n = round((2.0**27 * max(nodes, 2)) ** 0.5)
        p = predict(node, nodes, n)
        row: Row = {"nodes": nodes, "n": n, "rows a node": n // nodes}
        row |= {"GB a node": f"{p.memory / 1e9:.0f}"}
        row |= {"message MB": f"{p.message / 1e6:.2g}" if nodes > 1 else ""}
        row |= {"product s": f"{p.product:.2f}", "of it messages s": f"{p.exchange:.2f}"}
        row |= {"CG + FSAI s": f"{10 * p.fsai:.0f}"}
        yield row | {"CG + cosine s": f"{20 * p.cosine:.0f}"}
