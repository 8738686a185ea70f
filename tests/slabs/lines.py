"""One axis on slabs: products, preconditioners and solves are those of one process."""

import numpy as np
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from comparisons.systems import masks
from tests.slabs.products import assert_rows, tolerance
from tests.slabs.solves import NAMES, RTOL, residuals_of
from toeplitz_mg import slabs
from toeplitz_mg.paper.problems import test1

# 2 · 33000 - 1 is fast; of 65537, a prime, M inverts a longer circulant, and L = 65550 is even.
LENGTHS = (33000, 65537)
KERNELS = {
    "a tail that is summed": lambda k: 1.0 / (1.0 + 0.01 * k) ** 2,
    "one that is continued": lambda k: 1.0 / (1.0 + k) ** 0.5,
}


def both(comm, n, kernel, dtype=np.float64):
    slab, c = slabs.Slab(comm, (n,)), KERNELS[kernel](np.arange(float(n)))
    c[0] += 3.0  # So that the inverse is well conditioned: rounding is told from errors.
    c = c.astype(dtype)
    return tmg.ToeplitzOperator(c), slabs.ToeplitzOperator(c[slab.rows], slab)


def test_preconditioners_of_long_lines(comm):
    for n in LENGTHS:
        x = np.random.default_rng(0).random(n)
        for kernel in KERNELS:
            serial, A = both(comm, n, kernel)
            assert_rows(A.slab, A @ x[A.slab.rows], serial @ x, 1e-14)
            for name in NAMES:
                for dtype in (np.float64, np.float32)[: 1 + (n == LENGTHS[0])]:
                    M, W = (
                        getattr(tmg, name)(serial, dtype=dtype),
                        getattr(slabs, name)(A, dtype=dtype),
                    )
                    y = W @ x[A.slab.rows].astype(dtype)
                    assert y.dtype == dtype
                    assert_rows(A.slab, y, M @ x, tolerance(dtype))


def test_a_tail_that_begins_late(comm):
    """Its law, a power, has no value at the lag zero: where that is asked for, one rank warns."""
    n = 301
    k = np.arange(float(n))
    c = 1e-3 / (1.0 + np.maximum(k - 150.0, 1e-3 * k)) ** 2
    c[0], x = 2.0, np.random.default_rng(0).random(n)
    slab, serial = slabs.Slab(comm, (n,)), tmg.ToeplitzOperator(c)
    A = slabs.ToeplitzOperator(c[slab.rows], slab)
    for name in NAMES[1:]:
        assert_rows(
            slab, getattr(slabs, name)(A) @ x[slab.rows], getattr(tmg, name)(serial) @ x, 1e-14
        )


def with_other_rounding(A, seed):
    """A, whose products have other rounding errors, as those of ranks may have."""
    rng = np.random.default_rng(seed)

    def multiply(x):
        y = A @ x.ravel()
        return y + 1e-14 * np.abs(y).max() * rng.standard_normal(len(y))

    return LinearOperator(A.shape, matvec=multiply, dtype=A.dtype)


def test_cg_takes_the_iterations_of_one_process_on_every_line(comm):
    """Where rounding alone does not change how many these are: there one has no other number."""
    n = 2048
    full = test1(n).A
    slab = slabs.Slab(comm, (n,))
    on_ranks = slabs.ToeplitzOperator(full.c[slab.rows], slab)
    compared = set()
    areas = masks.ON_A_LINE | {"all": lambda n: np.ones(n, bool)}
    for name, area in areas.items():
        mask = area(n)
        serial, own = tmg.MaskedOperator(full, mask), mask[slab.rows]
        A = slabs.MaskedOperator(on_ranks, own)
        b = np.where(mask, np.random.default_rng(0).standard_normal(n), 0.0)
        for method in [None, *NAMES, "fsai_preconditioner"]:
            M, W = (method and getattr(package, method) for package in (tmg, slabs))
            M, W = M and M(serial), W and W(A)
            x, residuals = residuals_of(A, b[slab.rows][own], M=W)
            expected, before = residuals_of(serial, b[mask], M=M)
            counts = {len(before)}
            for seed in range(5):
                B, P = (K and with_other_rounding(K, seed) for K in (serial, M))
                counts.add(len(residuals_of(B, b[mask], M=P)[1]))
            if len(counts) == 1:
                assert {len(residuals)} == counts, (name, method)
                compared.add((name, method))
            # Each iteration makes rounding errors some ten times as large here.
            np.testing.assert_allclose(residuals[:6], before[:6], rtol=1e-6)
            whole = np.zeros(n)
            whole[mask] = expected
            error = np.abs(x - whole[slab.rows][own]).max(initial=0.0)
            assert error <= 10 * RTOL * np.abs(expected).max()
    assert {(name, "fsai_preconditioner") for name in areas} <= compared


def test_rows_that_ranks_share(comm):
    """Ranks may begin anywhere, and some may have no row of the matrix that a line becomes."""
    for n, unit in ((4, 1), (9, 2), (1009, 7)):
        if -(-n // unit) < comm.size:
            continue
        slab, c = slabs.Slab(comm, (n,), unit=unit), 0.7 ** np.arange(n)
        x, serial = np.random.default_rng(0).random(n), tmg.ToeplitzOperator(c)
        A = slabs.ToeplitzOperator(c[slab.rows], slab)
        for M, W in (
            (serial, A),
            *((getattr(tmg, f)(serial), getattr(slabs, f)(A)) for f in NAMES),
        ):
            assert_rows(slab, W @ x[slab.rows], M @ x, 1e-14)
        assert_rows(slab, A.astype(np.float32) @ x[slab.rows], serial @ x, 2e-6)
