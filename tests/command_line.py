"""The command line as a function, by the name that `pyproject.toml` gives to the script."""

import importlib
import tomllib
from pathlib import Path

PROJECT = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())["project"]
MODULE, FUNCTION = PROJECT["scripts"]["toeplitz-mg"].split(":")

main = getattr(importlib.import_module(MODULE), FUNCTION)
