"""Products on slabs of arrays of other libraries, as on a cluster of GPUs.

The transforms are those of the library, on the device of each rank, and mpi4py moves the rows.
"""

from typing import Any

from toeplitz_mg.engine.plain import Plain, PlainProduct
from toeplitz_mg.slabs.slab import Slab


class PlainSlabProduct:
    """Multiplication of this rank's rows, as `operators.SlabProduct`, of any library's arrays.

    Parameters
    ----------
    library : Plain
    slab : Slab
    product : SlabProduct
        Its eigenvalues are brought to the device.
    """

    def __init__(self, library: Plain, slab: Slab, product: Any) -> None:
        self.library, self.slab = library, slab
        # Its inverse transforms divide by nothing, and those of the library by the lengths.
        spectra = [
            [None if s is None else [library.from_numpy(s * product.points)] for s in row]
            for row in product.spectra
        ]
        shape = (len(spectra), *slab.shape)
        self._passes = PlainProduct(library, shape, product.dtype, spectra)

    def multiply(self, x: Any, y: Any = None) -> Any:
        """Return the product with a vector."""
        xp, slab, passes = self.library.xp, self.slab, self._passes
        components = passes.grid_shape[0]
        Z = self.library.cast(xp.reshape(x, (1, components, *slab.local)), passes.dtype)
        Z = passes.rows_in(Z)
        C = xp.stack([slab.exchange_columns(Z[0, i, ...], self.library) for i in range(components)])
        C = passes.columns(C[None, ...], 0)
        n = passes.lengths[-1]
        R = [slab.exchange_rows(C[0, i, ...], n, self.library) for i in range(components)]
        return xp.reshape(passes.rows_out(xp.stack(R)[None, ...]), x.shape)
