"""What README and the pages in docs show runs, and what they name exists."""

import importlib
import re
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from comparisons.__main__ import COMMANDS

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
BUILT = {"_build", "api", "gallery"}  # Folders that the build of the site writes.
PAGES = [
    README,
    *(
        page
        for page in sorted((ROOT / "docs").rglob("*.md"))
        if not BUILT & set(page.relative_to(ROOT / "docs").parts)
    ),
]
EXAMPLES = [
    (page.name, block)
    for page in PAGES
    for block in re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL)
]
# What another package does, and what this one does in its place.
PAIRS = [
    pytest.param(there, here, id=re.search(r"(?:import|from) (?!numpy|torch)(\w+)", there)[1])
    for page in PAGES
    for there, here in re.findall(
        r"```py\n(.*?)```\s+```python\n(.*?)```", page.read_text(), re.DOTALL
    )
]
each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


@pytest.mark.parametrize(("name", "block"), EXAMPLES)
def test_examples(name, block):
    exec(compile(block, name, "exec"), {})


@pytest.mark.parametrize(("there", "here"), PAIRS)
def test_another_package_finds_the_same(there, here, request):
    pytest.importorskip(request.node.callspec.id)
    found = {}
    exec(compile(there, "there", "exec"), found)
    exec(compile(here, "here", "exec"), found)
    largest = np.abs(found["there"]).max()
    assert_allclose(found["here"], found["there"], rtol=0.0, atol=1e-6 * largest)


@each_page
def test_names_files_that_exist(page):
    for name in re.findall(r"`((?:toeplitz_mg|comparisons)/[\w/]+\.py)`", page.read_text()):
        assert (ROOT / name).exists(), name


@each_page
def test_links_to_files_that_exist(page):
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text()):
        assert (page.parent / target).exists(), target


def test_pages_and_docstrings_name_the_ten_commands_and_no_others():
    name = re.compile(r"\bcomparisons\.(\w+(?:\.\w+)*)")
    folders = ("toeplitz_mg", "examples", "benchmarks")
    sources = [ROOT / "CHANGELOG.md", *(p for f in folders for p in (ROOT / f).rglob("*.py"))]
    assert {found for page in PAGES for found in name.findall(page.read_text())} == set(COMMANDS)
    assert {found for path in sources for found in name.findall(path.read_text())} <= set(COMMANDS)
    for command in COMMANDS:
        stem = ROOT / "comparisons" / command
        assert stem.with_suffix(".py").exists() or (stem / "__main__.py").exists(), command


def public_names():
    """What has a page in the API of the site; the names of a cluster need an MPI."""
    names = []
    packages = [tmg, tmg.contact, tmg.contact.surfaces, tmg.contact.problems]
    packages += [tmg.halfspace, tmg.fractional, tmg.covariances]
    if find_spec("mpi4py"):
        packages.append(importlib.import_module("toeplitz_mg.slabs"))
    for package in packages:
        for name, value in vars(package).items():
            home = str(getattr(value, "__module__", ""))
            is_public = name in getattr(package, "__all__", ()) or home == package.__name__
            if is_public and home.startswith("toeplitz_mg.") and not name.startswith("_"):
                names.append(pytest.param(value, id=f"{package.__name__}.{name}"))
    return names


@pytest.mark.parametrize("value", public_names())
def test_every_public_name_says_what_to_see_also(value):
    assert "See Also\n" in value.__doc__


def test_readme_is_one_page():
    assert len(README.read_text().splitlines()) <= 130


def test_each_page_of_the_guide_starts_with_code_and_all_stay_short():
    names = re.findall(r"^\w+$", (ROOT / "docs" / "guide.md").read_text(), re.MULTILINE)
    pages = [(ROOT / "docs" / f"{name}.md").read_text() for name in names]
    assert all("```" in "\n".join(page.splitlines()[:40]) for page in pages)
    assert sum(len(page.split()) for page in pages) <= 25_000


def test_every_page_is_in_the_contents_of_the_site():
    """A page that no table of contents has is a warning of the build, and so an error."""
    found = {
        (page.parent / f"{name}.md").resolve()
        for page in PAGES
        for block in re.findall(r"```{toctree}\n(.*?)```", page.read_text(), re.DOTALL)
        for name in re.findall(r"^(?:.* <)?([\w/]+)>?$", block, re.MULTILINE)
    }
    missing = {page.resolve() for page in PAGES} - found - {README, ROOT / "docs" / "index.md"}
    assert not missing, "name it in docs/guide.md"


MEASURED = [
    page
    for page in PAGES
    if page.parent.name == "appendix" or page.name in ("benchmarks.md", "reproduce.md")
]


@each_page
def test_a_page_of_measurements_names_the_command_that_writes_them(page):
    text = page.read_text()
    if page in MEASURED and "|---" in text:
        assert re.search(r"python -m comparisons\.", text)
    if "![" in text:
        assert re.search(r"python (-m comparisons\.|docs/pictures\.py)", text)
