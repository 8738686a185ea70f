"""What README and the pages in docs show runs, and what they name exists."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
PAGES = [README, *sorted((ROOT / "docs").glob("*.md"))]
EXAMPLES = [
    (page.name, block)
    for page in PAGES
    for block in re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL)
]
NO_FIGURES = {"architecture.md"}  # Its table has words only.
each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)


@pytest.mark.parametrize(("name", "block"), EXAMPLES)
def test_examples(name, block):
    exec(compile(block, name, "exec"), {})


@each_page
def test_names_files_that_exist(page):
    for name in re.findall(r"`((?:toeplitz_mg|comparisons)/[\w/]+\.py)`", page.read_text()):
        assert (ROOT / name).exists(), name


@each_page
def test_links_to_files_that_exist(page):
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text()):
        assert (page.parent / target).exists(), target


def test_names_comparisons_that_exist_and_all_of_them():
    def is_command(path):
        return path.name == "__main__.py" or '__name__ == "__main__"' in path.read_text()

    files = filter(is_command, (ROOT / "comparisons").rglob("*.py"))
    commands = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__main__")
        for path in files
    }
    named = {
        name
        for page in PAGES
        for name in re.findall(r"python -m (comparisons[\w.]*\w)", page.read_text())
    }
    assert named == commands


def test_readme_is_one_page():
    assert len(README.read_text().splitlines()) <= 150


def test_every_page_is_linked_from_another():
    linked = {
        (page.parent / target).resolve()
        for page in PAGES
        for target in re.findall(r"\]\(([^)#:]+\.md)", page.read_text())
    }
    assert {page.resolve() for page in PAGES} - linked <= {README}


def test_the_code_names_commands_that_exist():
    for path in (ROOT / "toeplitz_mg").rglob("*.py"):
        for name in re.findall(r"python -m (comparisons[\w.]*\w)", path.read_text()):
            stem = ROOT.joinpath(*name.split("."))
            assert stem.with_suffix(".py").exists() or (stem / "__main__.py").exists(), name


@each_page
def test_a_page_of_figures_names_the_command_that_writes_them(page):
    text = page.read_text()
    if "|---" in text or "![" in text or "| :" in text:
        assert "python -m comparisons." in text or page.name in NO_FIGURES
