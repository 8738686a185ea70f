"""The kernel of two coupled components, for a multilevel sparse approximate inverse.

P = Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G as the package describes it, of all unknowns together. Tangential
tractions on a half-space act on each other by A_xy, odd in both axes, on all scales alike: block
diagonal preconditioners leave the eigenvalues 1 ± (ν/2)/(1 - ν/2) at every wavelength, 2/3 and 4/3
for ν = 1/2. So the coupling has a part in each of the steps, and on each level.

**Local factor.** A row of G sees two of the neighbours in the other component too, those of the
strongest coupling: where cells are square, the two before it on the diagonals. With these the
eigenvalues of G A Gᵀ for waves of 4 to 6 cells lie between 0.86 and 1.15 (ν = 1/2), without them
between 0.69 and 1.33. The constant τ is taken off within each component: of the coupling, which is
odd, there is none.

**Aggregates.** A displacement that is smooth is nearly a constant in each component on an aggregate
J, and G times it the sum of two vectors, with parts in both components. They are the columns of
U_J, (G c)_J for the loads c of x and for those of y; W_J = U_J (U_JᵀU_J)^(-1/2) is the orthonormal
pair nearest to them, each still that of one component. Their loads are (U_JᵀU_J)^(1/2). Without the
parts in the other component there is one iteration more on fragmented areas.

**E.** Off the diagonal it is c_J K(J-L) c_L, with the kernel's means over two blocks; c_J is the
diagonal of the loads, as what acts in the other component is less than a tenth. On the diagonal,
and in the kernel for near blocks, the loads of their own component only are taken, too.

The neighbours and aggregates are alike in both components: those of the mean of A_xx and A_yy.
"""

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.operators import CoupledOperator
from toeplitz_mg.preconditioners.fsai.neighbours import is_enough
from toeplitz_mg.preconditioners.fsai.stencil import NEIGHBOURS, Stencil

STRONG = 0.2  # Least coupling over the kernel, that of ν = 1/3: less is not worth its set-up.
STRONGEST = 0.36  # Largest coupling, 1/3 for ν = 1/2: a stronger one takes many iterations.
COARSE_NEIGHBOURS = 18  # Neighbours on coarse levels: 12, hardly cheaper, take one iteration more.


def find_coupled_stencil(A: CoupledOperator) -> Stencil | None:
    """Return the stencil of two components together, or None.

    It is for components that are strongly coupled, as on a half-space, and for each of which few
    neighbours are enough.
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
    """Return the stencil of a kernel of two components, odd between them, or None."""
    stencil = Stencil(kernel, NEIGHBOURS, COARSE_NEIGHBOURS)
    if not STRONG < measure_coupling(stencil) < STRONGEST:
        return None
    try:
        return stencil if all(is_enough(Stencil.of_one(kernel[a, a])) for a in (0, 1)) else None
    except np.linalg.LinAlgError:
        # What is wrong with a component is said where that is taken by itself.
        return None


def measure_coupling(stencil: Stencil) -> float:
    """Return the largest coupling with a neighbour, over the mean of A_xx and A_yy there.

    On a half-space it is (ν/2)/(1 - ν/2), by which the eigenvalues of a block diagonal
    preconditioner are off 1; less where elements are long, 1:8 or more, and no neighbours are on a
    diagonal.
    """
    i, j = np.abs(stencil.grid.offsets.T)
    return float(np.abs(stencil.kernel[0, 1, i, j] / stencil.grid.kernel[i, j]).max())
