"""Every preconditioner on areas of every kind, on symbols, and on sums with diagonals."""
