"""Time, memory and work against what one writes by hand, SciPy, and other methods."""
