"""The command line as a function, by the name that `pyproject.toml` gives to the script."""

import importlib
import tomllib
from pathlib import Path

PROJECT = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())["project"]
MODULE, FUNCTION = PROJECT["scripts"]["toeplitz-mg"].split(":")

main = getattr(importlib.import_module(MODULE), FUNCTION)


def assert_refused(status, message, capsys):
    """Assert that a command ended with status 2 and one line that says why, which is returned."""
    captured = capsys.readouterr()
    assert status == 2
    assert message in captured.err
    assert captured.err.count("\n") == 1
    assert not captured.out
    return captured.err
