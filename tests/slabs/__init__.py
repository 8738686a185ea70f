"""Tests of `toeplitz_mg.slabs`: each file but `test_*.py` has cases that run on several ranks."""
