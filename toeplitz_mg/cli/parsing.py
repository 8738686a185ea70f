"""How the command line is read: numbers as people write them, and the usage that concerns them."""

import argparse
import re
import sys
from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import Any, NoReturn

DPI = 150  # Dots an inch of a picture, where none are given.
MOST_DPI = 1200  # Dots an inch: more than any journal asks for.
# A number and no option: argparse itself does not know that one may have an exponent.
NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")


def whole_number(text: str) -> int:
    """Read a whole number, also one like 1e5.

    Raises
    ------
    ValueError
        Where it is none; argparse then says which option has it.
    """
    try:
        return int(text)
    except ValueError:
        value = float(text)
    if not value.is_integer():
        raise ValueError(f"{text} is no whole number")
    return int(value)


whole_number.__name__ = "whole number"  # What argparse calls it where it refuses one.


def check_dpi(given: Mapping[str, Any]) -> None:
    """Refuse dots an inch that are none, too many, or of no picture."""
    if "dpi" not in given:
        return
    if "plot" not in given:
        raise ValueError("--dpi is of the picture that --plot draws, which is not given")
    if not 10 <= given["dpi"] <= MOST_DPI:
        raise ValueError(f"--dpi is {given['dpi']}, but must be 10 to {MOST_DPI}")


class Parser(argparse.ArgumentParser):
    """A parser without abbreviations, whose errors show the usage of the command that was given.

    Without defaults an option counts wherever it stands, and a stray one is seen. There are no
    abbreviations: --n would be taken for --nu.
    """

    def __init__(self, **options: Any) -> None:
        bare: dict[str, Any] = {"argument_default": argparse.SUPPRESS, "allow_abbrev": False}
        super().__init__(**(bare | options))
        self._negative_number_matcher: re.Pattern[str] = NEGATIVE
        self.commands: dict[str, Parser] = {}

    def parse_command(self, arguments: Sequence[str] | None = None) -> argparse.Namespace:
        """Return what is given; an argument that nothing takes is an error of its command."""
        words = sys.argv[1:] if arguments is None else arguments
        for word in takewhile(lambda word: word not in self.commands, words):
            # argparse would take what follows for a command, and refuse that.
            if word.startswith("--") and word.partition("=")[0] not in self._option_string_actions:
                self.error(f"unrecognized arguments: {word}")
        given, rest = self.parse_known_args(words)
        if rest:
            self._refuse(given, rest)
        return given

    def _refuse(self, given: argparse.Namespace, rest: Sequence[str]) -> NoReturn:
        command = self.commands.get(getattr(given, "command", None) or "", self)
        command.error(f"unrecognized arguments: {' '.join(rest)}")
