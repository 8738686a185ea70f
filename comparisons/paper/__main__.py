"""Tables I to IX of the paper beside its legible cells, and its figures."""

from collections.abc import Sequence

from comparisons.harness import report
from comparisons.paper import figures, tables


@report.interruptible
def main(argv: Sequence[str] | None = None) -> None:
    """Draw the figures, which takes seconds, and run the tables."""
    arguments = report.options("paper", "The paper's tables and figures.", argv=argv)
    figures.run(arguments.output)
    sizes = range(10, 12) if arguments.quick else range(15, 21)
    tables.run(arguments.output, sizes)


if __name__ == "__main__":
    main()
