"""The normal distribution on arrays of other libraries than NumPy's, and inside `jax.jit`."""

from functools import cache
from inspect import ismethod
from typing import Any

import numpy as np

from toeplitz_mg.engine.arrays.library import library_of
from toeplitz_mg.gaussian.conditional import Conditional
from toeplitz_mg.gaussian.fitting import NormalFit
from toeplitz_mg.values import is_foreign, is_traced


class ArrayNormal:
    """A `ToeplitzNormal` of covariances that are an array of CuPy, torch or JAX.

    Its methods are those of `ToeplitzNormal`, for series of the same library, and are computed on
    the processor; arrays of what they return lie where the covariances do. Inside `jax.grad`,
    `jax.jit` and `jax.vmap` `logpdf` is a callback with derivatives by c, y and mean; where c is
    not positive definite it is NaN. `on_numpy` is the class of the distribution on NumPy's arrays.
    """

    def __init__(self, on_numpy: Any, c: Any, mean: Any = 0.0, noise: Any = None) -> None:
        self._on_numpy, self.c, self.mean, self.noise = on_numpy, c, mean, noise
        self.shape = tuple(c.shape)
        if not is_traced(c, mean, noise):
            self._on_host()  # What is wrong is refused at once.

    def _on_host(self) -> Any:
        """Return the distribution on NumPy's arrays."""
        return self._on_numpy(*map(_to_host, (self.c, self.mean, self.noise)))

    def logpdf(self, y: Any, observed: Any = None) -> Any:
        """Return the logarithm of the probability density (see `ToeplitzNormal.logpdf`)."""
        if not is_traced(self.c, y, self.mean):
            return self.__getattr__("logpdf")(y, observed)
        if observed is not None or self.noise is not None:
            raise TypeError("inside jit and grad all of y is observed, and without noise")
        return _traced(self._on_numpy)(self.c, y - self.mean)

    def __getattr__(self, name: str) -> Any:
        """Return a method of the distribution on NumPy's arrays, between arrays of the library."""
        if name.startswith("_") or not callable(getattr(self._on_numpy, name, None)):
            raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
        library = library_of(self.c)

        def method(*args: Any, **kwargs: Any) -> Any:
            if args and name != "rvs":
                library.read("y", args[0])  # It refuses arrays of others.
            return getattr(Returned(self._on_host(), library), name)(*args, **kwargs)

        return method


class Returned:
    """A result whose arrays, and those of what its methods return, are of another library."""

    def __init__(self, result: Any, library: Any) -> None:
        self._result, self._library = result, library

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # As of what copies and pickles, which ask before it is built.
            raise AttributeError(name)
        return self._take(getattr(self._result, name))

    def __repr__(self) -> str:
        return repr(self._result)

    def _take(self, a: Any) -> Any:
        """Return arrays as those of the library, and what has arrays as such a result."""
        if isinstance(a, np.ndarray):
            return self._library.from_numpy(a)
        if isinstance(a, tuple):
            return getattr(a, "_make", tuple)(map(self._take, a))  # Named tuples have `_make`.
        if ismethod(a):
            return lambda *args, **kwargs: self._take(
                a(*map(_to_host, args), **{key: _to_host(x) for key, x in kwargs.items()})
            )
        return Returned(a, self._library) if isinstance(a, Conditional | NormalFit) else a


def _to_host(a: Any) -> Any:
    """Return an array of another library as one of NumPy's; all else as it is."""
    return library_of(a).to_numpy(a) if is_foreign(a) else a


@cache
def _traced(on_numpy: Any) -> Any:
    """Return the density as a function of c and y - mean that JAX can differentiate."""
    import jax
    import jax.numpy as jnp

    def on_host(c: Any, y: Any) -> Any:
        c, y = np.asarray(c), np.asarray(y)
        try:
            found = on_numpy(c).logpdf_and_grad(y)
        except np.linalg.LinAlgError:  # An error in a callback would end the program.
            lead = y.shape[: y.ndim - c.ndim]
            found = (np.full(shape, np.nan) for shape in (lead, y.shape, y.shape))
        return tuple(np.asarray(a, y.dtype) for a in found)

    def call(c: Any, y: Any) -> Any:
        shapes: Any = jax.eval_shape(lambda: (jnp.sum(y, tuple(range(-c.ndim, 0))), y, y))
        return jax.pure_callback(on_host, shapes, c, y, vmap_method="sequential")

    @jax.custom_vjp
    def logpdf(c: Any, y: Any) -> Any:
        return call(c, y)[0]

    def forward(c: Any, y: Any) -> Any:
        value, by_c, by_y = call(c, y)
        return value, (c, by_c, by_y)

    def backward(saved: Any, w: Any) -> Any:
        c, by_c, by_y = saved
        w = w[(..., *(None,) * c.ndim)]
        return (w * by_c).sum(tuple(range(by_c.ndim - c.ndim))).astype(c.dtype), w * by_y

    logpdf.defvjp(forward, backward)
    return logpdf
