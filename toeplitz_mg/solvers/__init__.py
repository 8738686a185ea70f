"""What finds x: iterations, inverses, and the drop-in for scipy.linalg.solve_toeplitz."""
