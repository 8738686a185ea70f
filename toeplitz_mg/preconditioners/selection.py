"""What may be taken for a matrix, as data: candidates, with the reasons for them."""

from collections.abc import Callable
from dataclasses import dataclass, field

from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.preconditioners.trial import STEPS

Make = Callable[..., LinearOperator]


@dataclass(frozen=True)
class Candidate:
    """A preconditioner that may be taken.

    Attributes
    ----------
    name : str
        Of the function of this package that makes it, or what it is.
    reason : str
        Why it stands where it does.
    make : callable
        ``make(A, dtype=dtype)`` returns it, or raises a LinAlgError where it is refused.
    is_exact : bool
        Whether it is the inverse itself, which needs no trial.
    """

    name: str
    reason: str
    make: Make = field(repr=False)
    is_exact: bool = False

    @classmethod
    def of(cls, function: Make, reason: str, make: Make | None = None) -> "Candidate":
        """Return that of a public function; `make` is a quicker way to the same."""
        return cls(function.__name__, reason, make or function)


@dataclass(frozen=True, repr=False)
class Selection:
    """What `default_preconditioner` takes of a matrix, and why, without building it.

    Attributes
    ----------
    candidates : tuple of Candidate
        The first that is not refused is taken, unless there is a trial.
    others : tuple of Candidate
        Those that a trial compares with it, and with none.
    needs_trial : bool
        Whether there is a trial of what is not exact, or only where all candidates are refused.
    components : tuple of Selection
        Where there are several, and all candidates are refused: those of each by itself.
    """

    candidates: tuple[Candidate, ...]
    others: tuple[Candidate, ...] = ()
    needs_trial: bool = False
    components: tuple["Selection", ...] = ()

    def __repr__(self) -> str:
        lines = [f"{candidate.name}: {candidate.reason}" for candidate in self.candidates]
        lines = [("if refused, " if k else "") + line for k, line in enumerate(lines)]
        if self.others:
            names = ", ".join(candidate.name for candidate in self.others)
            when = "and then" if self.needs_trial else "if all are refused,"
            names = f"it, {names}" if self.needs_trial else names
            lines.append(f"{when} the best of {names} and none, by a trial of {STEPS} steps of CG")
        if self.components:
            lines.append(("if refused, " if lines else "") + "each component by itself:")
            # Most often it is the same for all.
            for text in dict.fromkeys(map(repr, self.components)):
                lines += [f"    {line}" for line in text.splitlines()]
        return "\n".join(lines)
