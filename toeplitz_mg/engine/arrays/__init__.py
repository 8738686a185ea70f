"""Products for arrays of other libraries, such as CuPy, torch and JAX on a GPU.

`library` finds the library of an array and implements, for NumPy, the functions that depend on the
library. `plain` implements them for the others, with passes over whole arrays (`passes`), cosine
transforms via Fourier transforms (`transforms`), and compilation with JAX (`jax_programs`).
"""
