"""Products on slabs of arrays of other libraries, as on a cluster of GPUs.

The transforms are those of the library, on the device of each rank, and mpi4py moves the rows.
"""

from typing import Any

import numpy as np

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
        library, slab, passes = self.library, self.slab, self._passes
        fields = (passes.grid_shape[0], *slab.local)
        Z = passes.rows_in(library.cast(library.xp.reshape(x, (1, *fields)), passes.dtype))
        # The rows go through the memory of the processor, which any MPI can read.
        parts = library.to_numpy(Z)[0]
        C = library.from_numpy(np.stack([slab.to_columns(part) for part in parts]))
        columns = library.to_numpy(passes.columns(C[None, ...], 0))[0]
        back = np.empty((*fields[:-1], passes.lengths[-1]), columns.dtype)
        for part, own in zip(back, columns, strict=True):
            slab.to_rows(own, part)
        return library.xp.reshape(passes.rows_out(library.from_numpy(back)[None, ...]), x.shape)
