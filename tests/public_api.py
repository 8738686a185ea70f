"""Every public name, with what it takes: ``python -m tests.public_api`` writes `public_api.txt`.

A function stands there with its parameters and their defaults, a class with those of its
constructor and with its public methods, properties and fields. `test_public_api` compares the file
with the package, so that a change of what users have is a line of a diff.
"""

import dataclasses
import enum
import importlib
import inspect
from pathlib import Path

from scipy.sparse.linalg import LinearOperator

FILE = Path(__file__).parent / "public_api.txt"
PACKAGES = (
    "toeplitz_mg",
    "toeplitz_mg.covariances",
    "toeplitz_mg.fractional",
    "toeplitz_mg.halfspace",
    "toeplitz_mg.contact",
    "toeplitz_mg.contact.surfaces",
    "toeplitz_mg.paper.algorithm",
    "toeplitz_mg.paper.problems",
    "toeplitz_mg.paper.published",
    "toeplitz_mg.slabs",
)


def names_of(package):
    """Return the names that a package says are public, or else those that it defines."""
    if hasattr(package, "__all__"):
        return sorted(package.__all__)
    own = {n for n, x in vars(package).items() if getattr(x, "__module__", "") == package.__name__}
    return sorted(name for name in own if not name.startswith("_"))


def default_of(value):
    """Return a default as it is written, a function by its name."""
    if isinstance(value, enum.Enum) or not callable(value):
        return repr(value)
    return getattr(value, "__name__", type(value).__name__)


def parameters(function):
    """Return what a function takes, without annotations, which differ between versions of NumPy."""
    if inspect.isclass(function) and issubclass(function, Warning):
        return ""  # As any other.
    given = inspect.signature(function).parameters.values()
    empty = inspect.Parameter.empty
    shown, kinds = [], [p.kind for p in given]
    for p in given:
        if p.kind is p.KEYWORD_ONLY and "*" not in shown and p.VAR_POSITIONAL not in kinds:
            shown.append("*")
        stars = {p.VAR_POSITIONAL: "*", p.VAR_KEYWORD: "**"}.get(p.kind, "")
        default = "" if p.default is empty else f"={default_of(p.default)}"
        shown.append(f"{stars}{p.name}{default}")
    return f"({', '.join(shown)})"


def members(kind):
    """Yield a line for each public method, property and field that the package gives a class."""
    found = {}
    for base in reversed(kind.__mro__):
        if base.__module__.startswith("toeplitz_mg"):
            found |= vars(base)
    if dataclasses.is_dataclass(kind):
        found |= dict.fromkeys((field.name for field in dataclasses.fields(kind)), None)
    for name in sorted(name for name in found if not name.startswith("_")):
        if hasattr(LinearOperator, name) and issubclass(kind, LinearOperator):
            continue  # All operators have what SciPy's have.
        value = inspect.getattr_static(kind, name, None)
        value = getattr(value, "__func__", value)  # Of class and static methods.
        yield f"    .{name}{parameters(value) if inspect.isfunction(value) else ''}"


def describe():
    """Yield the lines of the file."""
    for package_name in PACKAGES:
        package = importlib.import_module(package_name)
        for name in names_of(package):
            value = getattr(package, name)
            if inspect.ismodule(value):
                yield f"{package_name}.{name}: module"
            elif inspect.isclass(value):
                yield f"{package_name}.{name}{parameters(value)}: class"
                yield from members(value)
            elif callable(value):
                yield f"{package_name}.{name}{parameters(value)}"
            else:
                yield f"{package_name}.{name}: {type(value).__name__}"


def main():
    """Write the file."""
    FILE.write_text("".join(f"{line}\n" for line in describe()), encoding="utf-8")
    print(f"written to {FILE}")


if __name__ == "__main__":
    main()
