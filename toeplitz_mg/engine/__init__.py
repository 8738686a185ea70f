"""Matrix-vector products: transforms, their memory and threads, and the count of work.

`operators.base` passes x as rows. The steps of one ``A @ x`` are then:

1. `products.multiply_rows` counts the work (`work`) and allocates the result if needed.
2. A matrix with one axis is a `products.ToeplitzProduct`; one with several axes or components is a
   `multilevel.MultilevelProduct`. If it has few unknowns, it is multiplied as a dense matrix.
3. A larger matrix is embedded in a circulant whose size is a fast transform length (`lengths`). The
   eigenvalues are computed when the product is constructed (`embedding`).
4. `transforms` transforms x, multiplies by the eigenvalues and transforms back. Short rows are
   transformed in batches, a long one by `fourstep`, in panels that stay in the cache.
5. `workspace` provides memory that is reused. `threads` distributes the panels among as many
   threads as `scipy.fft.set_workers` specifies.

Matrices that a transform diagonalises without embedding (circulants, trigonometric matrices) are in
`products` too. Iterations use the inner products and updates of `vectors`, or those of `ranks` if
several processes share the rows of a vector. Products for arrays of libraries other than NumPy are
in `arrays`.
"""
