"""The first column and the first row of the inverse of a Toeplitz matrix.

They determine the whole inverse (Gohberg and Semencul). `find_columns` computes them: roughly for a
preconditioner, to double precision for the inverse and the determinant.
"""
