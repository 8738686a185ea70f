"""What the solvers are for: contact of elastic half-spaces."""

from toeplitz_mg.contact import problems

__all__ = ["problems"]
