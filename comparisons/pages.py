"""Write the tables of the pages in docs from what was measured.

A comparison leaves its figures and `measured.txt`, which says when and on what machine, in a folder
of results; ``python -m comparisons.pages`` takes both into the pages. A table stands there between
two comments, of which the first has its name, and ends in what measured it.
"""

import argparse
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from comparisons.contact import cases, growth, periodic, punch3d, small
from comparisons.gaussian import likelihood
from comparisons.harness import report
from comparisons.harness.report import Row
from comparisons.paper import tables
from comparisons.preconditioners import (
    areas,
    fractional_diffusion,
    general_symbols,
    symbols,
)
from comparisons.speed import baselines, by_hand_tables, drop_in, gpu
from toeplitz_mg.cli import files

DOCS = Path(__file__).parent.parent / "docs"


@dataclass(frozen=True)
class Table:
    """A table of a page.

    Attributes
    ----------
    page : str
        The file in docs.
    command : str
        The module in `comparisons` that measures it, like "speed.drop_in".
    figures : str
        The file with its figures, among the results of the command.
    arrange : callable
        Makes the rows of the table of those of the figures.
    """

    page: str
    command: str
    figures: str
    arrange: Callable[[Sequence[Row]], list[Row]]


TABLES = {
    "drop_in": Table("benchmarks.md", "speed.drop_in", "drop_in.csv", drop_in.arrange),
    "products": Table(
        "benchmarks.md", "speed.by_hand", "products.csv", by_hand_tables.arrange_products
    ),
    "solves": Table("benchmarks.md", "speed.by_hand", "solves.csv", by_hand_tables.arrange_solves),
    "baselines": Table("benchmarks.md", "speed.baselines", "baselines.csv", baselines.arrange),
    "gpu": Table("machines.md", "speed.gpu", "gpu.csv", gpu.arrange),
    "gpu_areas": Table("machines.md", "speed.gpu", "gpu_areas.csv", gpu.arrange_areas),
    "gpu_contact": Table("machines.md", "speed.gpu", "gpu_contact.csv", gpu.arrange_contact),
    "general_symbols": Table(
        "which_method.md",
        "preconditioners.general_symbols",
        "general_symbols.csv",
        general_symbols.arrange,
    ),
    "fractional_diffusion": Table(
        "which_method.md",
        "preconditioners.fractional_diffusion",
        "fractional_diffusion.csv",
        fractional_diffusion.arrange,
    ),
    "fractional_diffusion_growing": Table(
        "which_method.md",
        "preconditioners.fractional_diffusion",
        "growing.csv",
        fractional_diffusion.arrange_growing,
    ),
    "likelihood_errors": Table(
        "gaussian_processes.md", "gaussian.likelihood", "errors.csv", likelihood.arrange_errors
    ),
    "likelihood_times": Table(
        "gaussian_processes.md", "gaussian.likelihood", "times.csv", likelihood.arrange_times
    ),
    "likelihood_gaps": Table(
        "gaussian_processes.md", "gaussian.likelihood", "gaps.csv", likelihood.arrange_gaps
    ),
    "likelihood_noise": Table(
        "gaussian_processes.md", "gaussian.likelihood", "noise.csv", likelihood.arrange_noise
    ),
    "symbols": Table("which_method.md", "preconditioners.symbols", "symbols.csv", symbols.arrange),
    "paper": Table("reproduce.md", "paper.tables", tables.CELLS, tables.arrange),
    "cases_errors": Table("contact.md", "contact.cases", "errors.csv", cases.arrange_errors),
    "cases_products": Table("contact.md", "contact.cases", "costs.csv", cases.arrange_products),
    "cases_stresses": Table("stresses.md", "contact.cases", "errors.csv", cases.arrange_stresses),
    "growth": Table("rolling.md", "contact.growth", "growth.csv", growth.arrange),
    "small": Table("rolling.md", "contact.small", "small.csv", small.arrange),
    "periodic_products": Table(
        "periodic.md", "contact.periodic", "rough.csv", periodic.arrange_products
    ),
    "periodic_peers": Table("periodic.md", "contact.periodic", "rough.csv", periodic.arrange_peers),
    "punch3d": Table("three_dimensions.md", "contact.punch3d", "punch3d.csv", punch3d.arrange),
    "areas": Table("masks.md", "preconditioners.areas", "areas.csv", areas.arrange),
}


def write_table(page: Path, name: str, rows: Sequence[Row], origin: str) -> None:
    """Put a table, and where it comes from, in the place of the one that a page has.

    Raises
    ------
    ValueError
        Where the page has no table of that name, or several.
    """
    text = page.read_text()
    pattern = rf"(<!-- table: {name} -->\n).*?(?=<!-- end -->)"
    inside = f"{report.draw_markdown(rows)}\n\n{origin}\n"
    text, count = re.subn(pattern, lambda found: found[1] + inside, text, flags=re.DOTALL)
    if count != 1:
        raise ValueError(f"{page} has {count} tables with the name {name}, but must have one")
    files.write(page, text.encode())


def main() -> None:
    """Write every table whose figures are there."""
    parser = argparse.ArgumentParser(
        prog="python -m comparisons.pages", description="Write the tables of the pages in docs."
    )
    parser.add_argument("--results", type=Path, default=Path("results"), metavar="FOLDER")
    parser.add_argument("--docs", type=Path, default=DOCS, metavar="FOLDER")
    arguments = parser.parse_args()
    for name, table in TABLES.items():
        folder = arguments.results.joinpath(*table.command.split("."))
        if not (folder / table.figures).exists():
            print(f"{name}: {folder / table.figures} is not there: run comparisons.{table.command}")
            continue
        rows = table.arrange(report.read_csv(folder / table.figures))
        measured = (folder / report.MEASURED).read_text().strip()
        origin = f"Measured by `python -m comparisons.{table.command}` on {measured}."
        write_table(arguments.docs / table.page, name, rows, origin)
        print(f"{name}: written to {arguments.docs / table.page}")


if __name__ == "__main__":
    main()
