"""Multilevel sparse approximate inverse, for masks however fragmented.

P = Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G approximates A⁻¹ without any transform: two levels with a factorised
sparse approximate inverse (FSAI) G as smoother, a tentative prolongator W, and the coarse Galerkin
matrix E. It is built in four steps.

**Local factor.** G is lower triangular. Its row of a cell is supported on the cell itself and on
the 12 cells before it where the kernel is largest, as far as they are active (on a grid of square
cells half of a 5 x 5 neighbourhood, on a line a band). With S the matrix A - τ 11ᵀ of these cells
and e the unit vector of the cell itself, the row is S⁻¹e/√(eᵀS⁻¹e): this is the factorised sparse
approximate inverse (Kolotilina and Yeremin; in statistics Vecchia's approximation), and G S Gᵀ has
the diagonal 1. A constant that the whole neighbourhood feels cannot be resolved in it. Where the
kernel is nearly constant (the logarithm of a line contact) it would make each row nearly a
difference, whose load is none. So τ, the coefficient twice as far as the neighbours are, is taken
off, and is left to the coarse level. A smoother kernel needs more neighbours, 24 or 40; how many is
found on a trial problem (module `neighbours`).

**Why the slow vectors of G A Gᵀ are G times smooth ones.** GᵀG inverts A for what changes from
cell to cell. It is too large for what changes slowly, for which A is much larger than S: there
lie the large eigenvalues of G A Gᵀ. If G A Gᵀ z = λ z, then z = G s with s = A (Gᵀz)/λ, the
displacement by the load Gᵀz; far from its load a displacement is smooth, across gaps too. So on
each aggregate J of 16 cells w_J = (G 1)_J/‖(G 1)_J‖ stands for them, and the tentative prolongator
W = [w_J] is orthonormal, as aggregates are disjoint.

**Why the coarse part replaces.** In the span of W the inverse is E⁻¹, with the coarse Galerkin
matrix E = Wᵀ G A Gᵀ W. There GᵀG is too large already, and adding E⁻¹ to it could only make it
larger: so W Wᵀ is first taken out. P is then A⁻¹ exactly if G A Gᵀ is the identity on the
complement of W, and does not couple the two.

**E without products of A.** E is the matrix of A between the loads Gᵀ w_J. Its entries are
c_J K(J-L) c_L: c_J is the total of a load, in units of that of an aggregate that is all active,
and K(J-L) the mean of A over two blocks, which is exact, for aggregates that are all active, for
blocks that are near. The diagonal must not be taken so: the load of an aggregate of few cells is
more concentrated than that of a full one, and acts most on itself. The diagonal of E is
w_Jᵀ G A Gᵀ w_J, and that is computed for each aggregate: it is near 1.15 for half-space kernels, as
G S Gᵀ has the diagonal 1 and τ adds to it.

**Recursion.** E is a Toeplitz matrix of smooth kernel again, but for the weights c and the
diagonal. So the same construction for E takes the place of E⁻¹, down to some hundreds of unknowns,
which are solved for directly.

P is positive definite if the pivots eᵀS⁻¹e, and with them the diagonal of G, and the last matrix
are: by induction E⁻¹ is, and I - W Wᵀ + W E⁻¹ Wᵀ with it.

The modules, from below: `cellgrid` (cells, neighbours and blocks by their places), `rows` (rows of
G), `stencil` (what the kernel alone determines on a level), `levels` (the levels and their
application), `aggregates` (W, and the weights and the diagonal of E), `build` (all levels for a
mask), `line` (the levels of a whole line, where all rows of G are alike), `coupled` (two components
together), `neighbours` (how many a kernel needs), `preconditioner` (the public function).
"""
