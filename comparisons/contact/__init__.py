"""Contact problems and flat punches, against theory and against other packages."""
