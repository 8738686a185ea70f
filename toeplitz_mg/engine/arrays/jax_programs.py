"""Methods that JAX compiles as a whole: operation by operation each would be waited for."""

from collections.abc import Callable
from functools import cache, wraps
from typing import Any


def compile_as_a_whole(*arrays: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator of a method of an array, for objects of a library that compiles.

    Parameters
    ----------
    *arrays : str
        The attributes that have arrays, which are handed to the program, so that it keeps none of
        them. All others tell programs apart, and have a hash.
    """

    def decorate(method: Callable[..., Any]) -> Callable[..., Any]:
        @cache
        def program() -> Any:
            import jax

            def run(kind: type, others: tuple[tuple[str, Any], ...], own: Any, X: Any) -> Any:
                whole: Any = object.__new__(kind)
                whole.__dict__.update(others, **own)
                return method(whole, X)

            return jax.jit(run, static_argnums=(0, 1))

        @wraps(method)
        def multiply(self: Any, X: Any, out: Any = None) -> Any:
            if not self.library.compiles:
                return method(self, X)
            own = {name: self.__dict__[name] for name in arrays}
            others = tuple((name, a) for name, a in self.__dict__.items() if name not in own)
            return program()(type(self), others, own, X)

        return multiply

    return decorate
