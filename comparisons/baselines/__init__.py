"""Every method that is at hand for a Toeplitz system, on the same systems."""
