"""The drop-in for `scipy.linalg.solve_toeplitz`: methods for one axis, and the choice of one."""
