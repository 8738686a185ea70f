"""How a product is made: transforms, the memory and the threads they take, the meter of work.

The way of one ``A @ x``, from `operators.base`, which hands over x as rows:

1. `products.multiply_rows` counts the work (`work`), and finds or makes memory for the result.
2. A matrix of one axis is a `products.ToeplitzProduct`, one of several axes or components a
   `multilevel.MultilevelProduct`. Of few unknowns it is multiplied as a dense matrix.
3. Larger ones are embedded in a circulant, whose size is a fast transform length (`lengths`). Its
   eigenvalues were computed when the product was made (`embedding`).
4. `transforms` brings x to the frequencies, multiplies by the eigenvalues, and comes back: short
   rows many at once, a long one in the steps of `fourstep`, by panels that stay in the cache.
5. `workspace` gives the memory for it, the same again and again; `threads` shares the panels among
   as many threads as `scipy.fft.set_workers` says.

What a transform diagonalises without any embedding (circulants, trigonometric matrices) is a
product of `products` too. Iterations take their inner products and updates from `vectors`, and
those of vectors whose rows several processes share from their `ranks`. The arrays of other
libraries than NumPy have products of their own in `arrays`.
"""
