"""Solvers: iterations, inverses, least squares, and the drop-in for scipy.linalg.solve_toeplitz."""
