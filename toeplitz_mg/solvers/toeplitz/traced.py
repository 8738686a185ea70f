"""Toeplitz systems inside `jax.jit`, `jax.grad` and `jax.vmap`: a callback with derivatives."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array


def solve_traced(given: tuple[Any, ...], b: Any, on_numpy: Callable[..., Any]) -> Any:
    """Return the solution of a real system traced by JAX; NaN if there is none.

    Raises
    ------
    TypeError
        For complex numbers.
    ValueError
        For a batch, and for shapes that do not match.
    """
    import jax.numpy as jnp

    arrays = [jnp.asarray(array) for array in (given[0], given[-1], b)]
    dtype = jnp.result_type(*(array.dtype for array in arrays), float)
    c, r, b = (array.astype(dtype) for array in arrays)
    if jnp.iscomplexobj(b):
        raise TypeError("c, r or b is complex, but inside jit, grad and vmap all must be real")
    if c.ndim != 1 or c.shape != r.shape or b.ndim not in (1, 2) or len(b) != len(c):
        raise ValueError(
            f"c has shape {c.shape}, r {r.shape} and b {b.shape}, but inside jit, grad and vmap "
            "must have (n,), (n,) and (n,) or (n, k): for a batch use jax.vmap"
        )
    return _solver(on_numpy)(c, r, b)


@cache
def _solver(on_numpy: Callable[..., Any]) -> Any:
    """Return the solution as a function of c, r and b that JAX can differentiate."""
    import jax
    import jax.numpy as jnp

    def on_host(c: Any, r: Any, b: Any) -> Array:
        b = np.asarray(b)
        try:
            return on_numpy((np.asarray(c), np.asarray(r)), b).astype(b.dtype)
        except np.linalg.LinAlgError:  # An error in a callback would end the program.
            return np.full(b.shape, np.nan, b.dtype)

    @jax.custom_vjp
    def solve(c: Any, r: Any, b: Any) -> Any:
        shape: Any = jax.eval_shape(lambda: b)
        return jax.pure_callback(on_host, shape, c, r, b, vmap_method="sequential")

    def forward(c: Any, r: Any, b: Any) -> Any:
        x = solve(c, r, b)
        return x, (c, r, x)

    def backward(saved: Any, w: Any) -> Any:
        # With u = A⁻ᵀ w the derivative by an entry of A is -u xᵀ; sum it over each diagonal.
        c, r, x = saved
        u, n = solve(r.at[0].set(c[0]), c, w), c.shape[0]
        f, g = (jnp.fft.rfft(a.reshape(n, -1), 2 * n, axis=0) for a in (x, u))
        sums = -jnp.fft.irfft((g * f.conj()).sum(axis=1), 2 * n)
        by_r = jnp.append(jnp.zeros(1, r.dtype), sums[:n:-1]).astype(r.dtype)
        return sums[:n].astype(c.dtype), by_r, u

    solve.defvjp(forward, backward)
    return solve
