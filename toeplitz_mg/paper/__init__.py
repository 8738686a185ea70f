"""The test problems of the paper, and its published numbers."""
