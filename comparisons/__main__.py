"""List the ten commands, or write their tables into the pages of docs."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from comparisons import pages

# What a command shows, and how long it takes on one core; with --quick a minute at most.
COMMANDS = {
    "paper": ("the paper's tables beside its legible cells, and its figures", "4 minutes"),
    "baselines": ("every method beside pyamg, dense, Levinson and circulants", "a minute"),
    "drop_in": ("solve_toeplitz beside SciPy's and a circulant by hand", "1 hour"),
    "theory": ("contact, friction, rolling and stresses against theory", "10 minutes"),
    "peers": ("a contact problem by aspher, tamaas and ContactMechanics", "20 minutes"),
    "gaussian": ("log-likelihoods against dense matrices and Schur's algorithm", "4 minutes"),
    "reliability": ("random problems by the thousand: what is silently wrong", "10 minutes"),
    "machines": ("threads, ranks and a GPU", "20 minutes"),
    "preconditioners": ("every preconditioner on areas and on symbols", "3 hours"),
    "workloads": ("jobs as users have them, beside another revision", "10 minutes"),
}


def main(argv: Sequence[str] | None = None) -> None:
    """List the commands; with ``--pages`` write their tables."""
    parser = argparse.ArgumentParser(prog="python -m comparisons", description=__doc__)
    parser.add_argument("--pages", action="store_true", help="write the tables of the pages")
    parser.add_argument("--results", type=Path, default=Path("results"), metavar="FOLDER")
    parser.add_argument("--docs", type=Path, default=pages.DOCS, metavar="FOLDER")
    arguments = parser.parse_args(argv)
    if arguments.pages:
        pages.write(arguments.results, arguments.docs)
        return
    for name, (shown, time) in COMMANDS.items():
        print(f"python -m comparisons.{name:15}  {shown} ({time})")
    print("\nEach with --help and --quick. `python -m comparisons --pages` writes their tables.")


if __name__ == "__main__":
    main()
