"""The normal distribution for arrays of other libraries, also inside `jax.jit`."""

from functools import cache
from inspect import ismethod
from typing import Any

import numpy as np

from toeplitz_mg.engine.arrays.library import library_of
from toeplitz_mg.gaussian.conditional import Conditional
from toeplitz_mg.gaussian.fitting import NormalFit
from toeplitz_mg.values import is_foreign, is_traced


class ArrayNormal:
    """A `ToeplitzNormal` whose covariances are an array of CuPy, torch or JAX.

    It has the methods of `ToeplitzNormal` for series of the same library. They run on the CPU;
    returned arrays are on the device of the covariances. Inside `jax.grad`, `jax.jit` and
    `jax.vmap`, `logpdf` is a callback with derivatives by c, y and mean, and NaN if c is not
    positive definite. `on_numpy` is the class of the distribution for NumPy arrays.
    """

    def __init__(self, on_numpy: Any, c: Any, mean: Any = 0.0, noise: Any = None) -> None:
        self._on_numpy, self.c, self.mean, self.noise = on_numpy, c, mean, noise
        self.shape = tuple(c.shape)
        if not is_traced(c, mean, noise):
            self._on_host()  # Raises errors of the arguments now.

    def _on_host(self) -> Any:
        """Return the distribution with NumPy arrays."""
        return self._on_numpy(*map(_to_host, (self.c, self.mean, self.noise)))

    def logpdf(self, y: Any, observed: Any = None) -> Any:
        """Return the logarithm of the probability density (see `ToeplitzNormal.logpdf`)."""
        if not is_traced(self.c, y, self.mean):
            return self.__getattr__("logpdf")(y, observed)
        if observed is not None or self.noise is not None:
            raise TypeError("inside jit and grad all of y is observed, and without noise")
        if np.shape(y)[-len(self.shape) :] != self.shape:
            raise ValueError(
                f"y has shape {np.shape(y)}, but its last axes must be those of c, {self.shape}"
            )
        return _traced(self._on_numpy)(self.c, y - self.mean)

    def __getattr__(self, name: str) -> Any:
        """Return a method that converts arrays to NumPy and back."""
        if name.startswith("_") or not callable(getattr(self._on_numpy, name, None)):
            raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
        library = library_of(self.c)

        def method(*args: Any, **kwargs: Any) -> Any:
            if args and name != "rvs":
                library.read("y", args[0])  # Raises an error for arrays of other libraries.
            return getattr(Returned(self._on_host(), library), name)(*args, **kwargs)

        return method


class Returned:
    """A result whose arrays, including those that its methods return, are of another library."""

    def __init__(self, result: Any, library: Any) -> None:
        self._result, self._library = result, library

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # Copying and pickling ask for these before it is initialised.
            raise AttributeError(name)
        return self._take(getattr(self._result, name))

    def __repr__(self) -> str:
        return repr(self._result)

    def _take(self, a: Any) -> Any:
        """Return arrays as arrays of the library, and wrap objects that contain arrays."""
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
    """Return an array of another library as a NumPy array; return anything else unchanged."""
    return library_of(a).to_numpy(a) if is_foreign(a) else a


@cache
def _traced(on_numpy: Any) -> Any:
    """Return the log-density as a function of c and y - mean that JAX can differentiate."""
    import jax
    import jax.numpy as jnp

    def on_host(c: Any, y: Any) -> Any:
        c, y = np.asarray(c), np.asarray(y)
        try:
            found = on_numpy(c).logpdf_and_grad(y)
        except np.linalg.LinAlgError:  # An exception in a callback would abort the program.
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
