"""Toeplitz systems inside `jax.jit`, `jax.grad` and `jax.vmap`: a callback with derivatives."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array


def solve_traced(given: tuple[Any, ...], b: Any, on_numpy: Callable[..., Any]) -> Any:
    """Solve a real system of arrays that JAX traces; what has no solution is NaN.

    Raises
    ------
    TypeError
        For complex numbers.
    """
    import jax.numpy as jnp

    c, r = (jnp.asarray(array) for array in (given[0], given[-1]))
    if any(jnp.iscomplexobj(array) for array in (c, r, b)):
        raise TypeError("c, r or b is complex, but inside jit, grad and vmap all must be real")
    return _solver(on_numpy)(c, r, jnp.asarray(b))


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
        # With u = A⁻ᵀ w the derivative by an entry of A is -u xᵀ, to be summed over its diagonal.
        c, r, x = saved
        u, n = solve(r.at[0].set(c[0]), c, w), c.shape[0]
        f, g = (jnp.fft.rfft(a.reshape(n, -1), 2 * n, axis=0) for a in (x, u))
        sums = -jnp.fft.irfft((g * f.conj()).sum(axis=1), 2 * n)
        by_r = jnp.append(jnp.zeros(1, r.dtype), sums[:n:-1]).astype(r.dtype)
        return sums[:n].astype(c.dtype), by_r, u

    solve.defvjp(forward, backward)
    return solve
