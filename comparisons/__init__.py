"""One script a table, figure or benchmark: ``python -m comparisons.NAME --help``."""
