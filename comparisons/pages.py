"""Write the tables of the pages in docs from what was measured.

A comparison leaves its figures and `measured.txt`, which says when and on what machine, in a folder
of results; ``python -m comparisons --pages`` takes both into the pages. A table stands there
between two comments, of which the first has its name, and ends in what measured it.
"""

import re
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from comparisons.harness import report
from comparisons.harness.inside import files
from comparisons.harness.report import Row

DOCS = Path(__file__).parent.parent / "docs"


class Table(NamedTuple):
    """A table of a page."""

    page: str  # The file in docs.
    command: str  # What measures it.
    figures: str  # The file with its figures, among the results of the command.
    function: str  # What makes its rows of those of the figures: "module:name".

    @property
    def arrange(self) -> Callable[[Sequence[Row]], list[Row]]:
        """The function."""
        module, name = self.function.split(":")
        return getattr(import_module(f"comparisons.{module}"), name)


_LIKELIHOOD = "appendix/statistics.md", "gaussian"
_CONTACT = "appendix/contact.md"
_COSTS = "theory", "costs.csv"
_GPU = "appendix/machines.md", "machines"
_AREAS = "preconditioners", "areas.csv"
_METHODS = "appendix/preconditioners.md", "preconditioners"
TABLES = {
    "drop_in": Table("benchmarks.md", "drop_in", "drop_in.csv", "drop_in:arrange"),
    "baselines": Table("benchmarks.md", "baselines", "baselines.csv", "baselines:arrange"),
    "transforms": Table(
        "benchmarks.md", "machines", "transforms.csv", "machines.transforms:arrange"
    ),
    "gpu": Table(*_GPU, "gpu.csv", "machines.gpu:arrange"),
    "gpu_areas": Table(*_GPU, "gpu_areas.csv", "machines.gpu:arrange_areas"),
    "gpu_contact": Table(*_GPU, "gpu_contact.csv", "machines.gpu:arrange_contact"),
    "symbols": Table(*_METHODS, "symbols.csv", "preconditioners.symbols:arrange"),
    "general_symbols": Table(*_METHODS, "symbols.csv", "preconditioners.symbols:arrange_general"),
    "likelihood_errors": Table(*_LIKELIHOOD, "errors.csv", "gaussian:arrange_errors"),
    "likelihood_times": Table(*_LIKELIHOOD, "times.csv", "gaussian:arrange_times"),
    "likelihood_gaps": Table(*_LIKELIHOOD, "gaps.csv", "gaussian:arrange_gaps"),
    "likelihood_gap_gradients": Table(
        *_LIKELIHOOD, "gap_gradients.csv", "gaussian:arrange_gap_gradients"
    ),
    "likelihood_rivals": Table(*_LIKELIHOOD, "rivals.csv", "gaussian:arrange_rivals"),
    "likelihood_noise": Table(*_LIKELIHOOD, "noise.csv", "gaussian:arrange_noise"),
    "likelihood_fits": Table(*_LIKELIHOOD, "fits.csv", "fits:arrange"),
    "paper": Table("reproduce.md", "paper", "cells.csv", "paper.tables:arrange"),
    "cases_errors": Table(_CONTACT, "theory", "errors.csv", "theory.cases:arrange_errors"),
    "cases_products": Table(_CONTACT, *_COSTS, "theory.cases:arrange_products"),
    "cases_stresses": Table(_CONTACT, "theory", "errors.csv", "theory.cases:arrange_stresses"),
    "periodic_products": Table(_CONTACT, *_COSTS, "theory.cases:arrange_repeated"),
    "printed": Table(_CONTACT, "theory", "printed.csv", "theory.cases:arrange_printed"),
    "kalker": Table(_CONTACT, "theory", "printed.csv", "theory.cases:arrange_kalker"),
    "periodic_peers": Table(_CONTACT, "peers", "peers.csv", "peers:arrange_repeated"),
    "areas": Table("appendix/preconditioners.md", *_AREAS, "preconditioners.areas:arrange"),
    "areas_all": Table("appendix/areas.md", *_AREAS, "preconditioners.areas:arrange_all"),
    "coupled": Table(
        "appendix/preconditioners.md", *_AREAS, "preconditioners.areas:arrange_coupled"
    ),
}


def write_table(page: Path, name: str, rows: Sequence[Row], origin: str) -> None:
    """Put a table, and where it comes from, in the place of the one that a page has."""
    text = page.read_text()
    pattern = rf"(<!-- table: {name} -->\n).*?(?=<!-- end -->)"
    inside = f"{report.draw(rows)}\n\n{origin}\n"
    text, count = re.subn(pattern, lambda found: found[1] + inside, text, flags=re.DOTALL)
    if count != 1:
        raise ValueError(f"{page} has {count} tables with the name {name}, but must have one")
    files.write(page, text.encode())


def write(results: Path, docs: Path) -> None:
    """Write every table whose figures are there into the pages of a folder."""
    for name, table in TABLES.items():
        folder = results / table.command
        if not (folder / table.figures).exists():
            print(f"{name}: {folder / table.figures} is not there: run comparisons.{table.command}")
            continue
        rows = table.arrange(report.read_csv(folder / table.figures))
        measured = (folder / report.MEASURED).read_text().strip()
        origin = f"Measured by `python -m comparisons.{table.command}` on {measured}."
        write_table(docs / table.page, name, rows, origin)
        print(f"{name}: written to {docs / table.page}")
