"""What the README shows runs."""

import inspect
import re
from pathlib import Path

import pytest

from toeplitz_mg.preconditioners import choice as default

README = (Path(__file__).parent.parent / "README.md").read_text()


@pytest.mark.parametrize("block", re.findall(r"```python\n(.*?)```", README, re.DOTALL))
def test_examples(block):
    exec(compile(block, "README.md", "exec"), {})


def test_names_files_that_exist():
    root = Path(__file__).parent.parent
    for name in re.findall(r"`((?:toeplitz_mg|comparisons)/[\w/]+\.py)`", README):
        assert (root / name).exists(), name


def test_names_comparisons_that_exist_and_all_of_them():
    folder = Path(__file__).parent.parent / "comparisons"
    runnable = [p for p in folder.rglob("*.py") if '__name__ == "__main__"' in p.read_text()]
    paths = [p.parent if p.stem == "__main__" else p for p in runnable]
    commands = {".".join(p.relative_to(folder).with_suffix("").parts) for p in paths}
    assert set(re.findall(r"python -m comparisons\.([\w.]+\w)", README)) == commands


def test_quotes_the_rules_of_default_preconditioner():
    assert f"```py\n{inspect.getsource(default._candidates)}```" in README
