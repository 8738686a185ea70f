"""Every preconditioner, on symbols, on areas of every kind, on stretched elements."""
