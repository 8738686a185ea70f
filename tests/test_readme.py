"""What the README shows runs."""

import re
from pathlib import Path

import pytest

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
    commands = {p.stem for p in folder.glob("*.py") if '__name__ == "__main__"' in p.read_text()}
    commands |= {p.parent.name for p in folder.glob("*/__main__.py")}
    assert set(re.findall(r"python -m comparisons\.(\w+)", README)) == commands
