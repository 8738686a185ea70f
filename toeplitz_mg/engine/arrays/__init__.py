"""Products for the arrays of other libraries, as those of CuPy, torch and JAX on a GPU.

`library` says whose arrays some are, and has what code that takes the arrays of any library needs
of NumPy's; `plain` has the same for the others: passes over whole arrays (`passes`), cosine
transforms by Fourier transforms (`transforms`), and the programs of JAX (`jax_programs`).
"""
