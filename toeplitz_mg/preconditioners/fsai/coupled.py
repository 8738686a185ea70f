"""The kernel of two coupled components, for a multilevel sparse approximate inverse.

P = Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G as described in the package, for all unknowns together. Tangential
tractions on a half-space are coupled by A_xy, which is odd in both axes, equally on all scales.
Block diagonal preconditioners leave the eigenvalues 1 ± (ν/2)/(1 - ν/2) at every wavelength: 2/3
and 4/3 for ν = 1/2. So the coupling is included in each step and on each level.

**Local factor.** A row of G also uses two neighbours in the other component, those with the
strongest coupling: for square cells the two preceding cells on the diagonals. The eigenvalues of G
A Gᵀ for waves of 4 to 6 cells then lie between 0.86 and 1.15 (ν = 1/2), without them between 0.69
and 1.33. The constant τ is subtracted within each component. The coupling is odd and has no such
constant.

**Aggregates.** On an aggregate J a smooth displacement is nearly constant in each component, and G
times it is the sum of two vectors with parts in both components. These are the columns of U_J: (G
c)_J for the loads c in x and in y. W_J = U_J (U_JᵀU_J)^(-1/2) is the nearest orthonormal pair, in
which each vector still belongs to one component. Their loads are (U_JᵀU_J)^(1/2). Without the parts
in the other component fragmented areas take one more iteration.

**E.** The off-diagonal entries are c_J K(J-L) c_L with the mean of the kernel over two blocks. c_J
is the diagonal of the loads; the load on the other component is less than a tenth of it. The
diagonal, and the kernel for near blocks, also include only loads in their own component.

Both components have the same neighbours and aggregates, those of the mean of A_xx and A_yy.
"""

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.operators import CoupledOperator
from toeplitz_mg.preconditioners.fsai.neighbours import is_enough
from toeplitz_mg.preconditioners.fsai.stencil import NEIGHBOURS, Stencil

STRONG = 0.2  # Least coupling over the kernel (ν = 1/3) that is worth the set-up.
STRONGEST = 0.36  # Largest coupling (1/3 for ν = 1/2); a stronger one takes many iterations.
COARSE_NEIGHBOURS = 18  # Neighbours on coarse levels; 12 cost one more iteration.


def find_coupled_stencil(A: CoupledOperator) -> Stencil | None:
    """Return the stencil of two components together, or None if it would not help.

    The components must be strongly coupled, as on a half-space, and each must need few neighbours
    only.
    """
    if len(A.blocks) != 2 or not A.is_symmetric or A.dtype.kind == "c":
        return None
    (x, xy), (_, y) = A.blocks
    if x is None or y is None or xy is None or len(x.grid_shape) != 2:
        return None
    between = xy.lags
    odd = all(np.array_equal(between, -np.flip(between, axis)) for axis in (0, 1))
    if not (x.is_even and y.is_even and odd):
        return None
    n1, n2 = x.grid_shape
    between = between[n1 - 1 :, n2 - 1 :]
    return select_coupled_stencil(np.array([[x.c, between], [between, y.c]], np.float64))


def select_coupled_stencil(kernel: Array) -> Stencil | None:
    """Return the stencil for a kernel of two components, odd between them, or None."""
    stencil = Stencil(kernel, NEIGHBOURS, COARSE_NEIGHBOURS)
    if not STRONG < measure_coupling(stencil) < STRONGEST:
        return None
    try:
        return stencil if all(is_enough(Stencil.of_one(kernel[a, a])) for a in (0, 1)) else None
    except np.linalg.LinAlgError:
        # The error is raised when the component is preconditioned separately.
        return None


def measure_coupling(stencil: Stencil) -> float:
    """Return the largest coupling with a neighbour, divided by the mean of A_xx and A_yy there.

    On a half-space it is (ν/2)/(1 - ν/2), the distance to 1 of the eigenvalues with a block
    diagonal preconditioner. For elements of 1:8 or longer it is less, because no neighbour lies on
    a diagonal.
    """
    i, j = np.abs(stencil.grid.offsets.T)
    return float(np.abs(stencil.kernel[0, 1, i, j] / stencil.grid.kernel[i, j]).max())
