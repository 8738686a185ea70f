"""Regression benchmarks, for asv: ``asv run --python=same --quick`` in a clone."""
