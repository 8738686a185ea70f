"""The first column of the inverse of a Toeplitz matrix, and of general ones the first row too.

All of the inverse follows from them, by the formula of Gohberg and Semencul. `first_column` finds
them: approximately for a preconditioner, or as exactly as double precision allows for the inverse
and its determinant.
"""
