"""Multilevel sparse approximate inverse, for masks however fragmented.

P = Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G approximates A⁻¹ without transforms. It has two levels: a factorised
sparse approximate inverse (FSAI) G is the smoother, W a tentative prolongator, and E the coarse
Galerkin matrix. It is built in four steps.

**Local factor.** G is lower triangular. Its row for a cell has entries at the cell itself and at
those of the 12 preceding cells with the largest kernel that are active (on a grid of square cells
half of a 5 x 5 neighbourhood, on a line a band). Let S be the matrix A - τ 11ᵀ of these cells and e
the unit vector of the cell itself. The row is S⁻¹e/√(eᵀS⁻¹e): the factorised sparse approximate
inverse (Kolotilina and Yeremin; in statistics Vecchia's approximation). So G S Gᵀ has the diagonal
1. Within a neighbourhood a constant cannot be resolved. If the kernel is nearly constant there (the
logarithm of a line contact), it would make each row nearly a difference, with hardly any load.
Therefore τ, the coefficient at twice the distance of the neighbours, is subtracted and left to the
coarse level. A smoother kernel needs more neighbours, 24 or 40; a trial problem finds how many
(module `neighbours`).

**Why the slow vectors of G A Gᵀ are G times smooth ones.** GᵀG inverts A for vectors that vary from
cell to cell. For smooth vectors, for which A is much larger than S, it is too large: they have the
large eigenvalues of G A Gᵀ. If G A Gᵀ z = λ z, then z = G s with s = A (Gᵀz)/λ, the displacement by
the load Gᵀz. Far from its load a displacement is smooth, across gaps too. So on each aggregate J of
16 cells the vector w_J = (G 1)_J/‖(G 1)_J‖ represents them. The tentative prolongator W = [w_J] is
orthonormal, because aggregates are disjoint.

**Why the coarse part replaces.** On the span of W the inverse is E⁻¹, with the coarse Galerkin
matrix E = Wᵀ G A Gᵀ W. GᵀG is already too large there, and adding E⁻¹ would make it larger; so W Wᵀ
is subtracted first. P equals A⁻¹ if G A Gᵀ is the identity on the complement of W and does not
couple it to W.

**E without products with A.** E is the matrix of A between the loads Gᵀ w_J. Its entries are c_J
K(J-L) c_L. Here c_J is the total load of an aggregate relative to that of a fully active one, and
K(J-L) is the mean of A over two blocks; for near blocks it is exact for fully active aggregates.
The diagonal needs another formula, because an aggregate of few cells has a more concentrated load,
which acts most on itself. So w_Jᵀ G A Gᵀ w_J is computed for each aggregate. It is near 1.15 for
half-space kernels, because G S Gᵀ has the diagonal 1 and τ adds to it.

**Recursion.** Except for the weights c and the diagonal, E is again a Toeplitz matrix with a smooth
kernel. So the same construction replaces E⁻¹, down to some hundreds of unknowns, which are solved
for directly.

P is positive definite if the pivots eᵀS⁻¹e (hence the diagonal of G) and the last matrix are: by
induction E⁻¹ is positive definite, and so is I - W Wᵀ + W E⁻¹ Wᵀ.

The modules, from below: `cellgrid` (cells, neighbours and blocks by their places), `rows` (rows of
G), `stencil` (what depends only on the kernel), `levels` (the levels and their application),
`aggregates` (W, and the weights and the diagonal of E), `build` (all levels for a mask), `line`
(the levels of a whole line, where all rows of G are equal), `coupled` (two components together),
`neighbours` (how many a kernel needs), `preconditioner` (the public function).
"""
