"""On every area of two axes iterations are those of one process, many to the bits of one rank."""

import numpy as np
from mpi4py import MPI

import toeplitz_mg as tmg
from comparisons.systems import masks
from tests.slabs.solves import NAMES, RTOL, N, area_and_its_rows, residuals_of
from toeplitz_mg import slabs

FIRST = 9  # Residuals that rounding does not reach.
EXACT = [None, "cosine_preconditioner", "sine_preconditioner"]  # On ranks they are the same bits.


def test_cg_takes_the_iterations_of_one_process_on_every_area(comm):
    for k, (name, area) in enumerate(masks.FRAGMENTED.items()):
        mask = area(N)
        serial, A, own = area_and_its_rows(comm, mask, is_balanced=k % 2 == 1)
        _, of_one_rank, _ = area_and_its_rows(MPI.COMM_SELF, mask)
        b = np.where(mask, np.random.default_rng(0).standard_normal(mask.shape), 0.0)
        rows = b[A.slab.rows][own]
        for method in [None, *NAMES]:
            M, W = (method and getattr(package, method) for package in (tmg, slabs))
            expected, before = residuals_of(serial, b[mask], M=M and M(serial))
            x, residuals = residuals_of(A, rows, M=W and W(A))
            assert abs(len(residuals) - len(before)) <= 2, (name, method)
            np.testing.assert_allclose(residuals[:FIRST], before[:FIRST], rtol=1e-6)
            whole = np.zeros(mask.shape)
            whole[mask] = expected
            error = np.abs(x - whole[A.slab.rows][own]).max(initial=0.0)
            assert error <= 10 * RTOL * np.abs(expected).max()
            if method in EXACT:
                whole[mask], before = residuals_of(of_one_rank, b[mask], M=W and W(of_one_rank))
                assert len(residuals) == len(before), (name, method)
                ours = whole[A.slab.rows][own]
                np.testing.assert_array_equal(x, ours, err_msg=f"{name}, {method}")
