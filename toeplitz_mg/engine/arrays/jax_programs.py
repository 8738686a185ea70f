"""Methods that JAX compiles as a whole, because single operations would be slow to dispatch."""

from collections.abc import Callable
from functools import cache, wraps
from typing import Any


def compile_as_a_whole(*arrays: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator for a method with an array argument, compiled if the library compiles.

    Parameters
    ----------
    *arrays : str
        The attributes that contain arrays. They are arguments of the compiled program, so that it
        holds no reference to them. All other attributes are static arguments, thus hashable.
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
