"""What is said of the package: its version, how it is cited, what is published of it."""

import re
import tomllib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest

import toeplitz_mg as tmg

ROOT = Path(__file__).parent.parent
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text())
CITATION = (ROOT / "CITATION.cff").read_text()
README = (ROOT / "README.md").read_text()


def test_the_version_has_one_source():
    assert "version" in SETTINGS["project"]["dynamic"]
    assert "\nversion:" not in CITATION
    try:
        installed = version("toeplitz-mg")
    except PackageNotFoundError:
        return  # The tests run in the tree, without an installed package.
    assert installed == tmg.__version__


def test_the_paper_is_cited_alike_everywhere():
    address = SETTINGS["project"]["urls"]["Paper"]
    assert address in README
    assert f'url: "{address}"' in CITATION
    said = re.search(r"\*(Multigrid with FFT [\w ]+)\*", README)
    assert f"title: {said[1]}\n" in CITATION
    for name in ("Zhao", "Vollebregt", "Oosterlee"):
        assert name in README
        assert f"family-names: {name}\n" in CITATION


@pytest.mark.parametrize(
    "group", ["lint", "test-core", "typing", "docs", "peers", "benchmarks", "mutants", "release"]
)
def test_what_is_for_a_clone_only_is_no_extra(group):
    assert SETTINGS["dependency-groups"][group]
    assert group not in SETTINGS["project"]["optional-dependencies"]


def test_every_extra_is_named_in_readme():
    for extra in SETTINGS["project"]["optional-dependencies"]:
        assert f"`{extra}`" in README or f"[{extra}]" in README, extra


def test_the_long_description_needs_no_clone():
    """The substitutions leave neither pictures nor links to files of the tree."""
    text = README
    hook = SETTINGS["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]
    for change in hook["substitutions"]:
        text = re.sub(change["pattern"], change["replacement"].replace("\\1", r"\g<1>"), text)
    assert all(link.startswith("http") for link in re.findall(r"\]\(([^)]*)\)", text))


def test_all_that_a_source_distribution_needs_is_in_it():
    included = set(SETTINGS["tool"]["hatch"]["build"]["targets"]["sdist"]["include"])
    assert {"toeplitz_mg", "tests", "comparisons", "benchmarks", "examples", "docs"} <= included
    assert {"README.md", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff", "LICENSE"} <= included
    assert all((ROOT / name).exists() for name in included)


def test_the_core_needs_nothing_but_numpy_scipy_and_pytest():
    core = SETTINGS["dependency-groups"]["test-core"]
    assert core[:-1] == SETTINGS["project"]["dependencies"]
    assert core[-1].startswith("pytest>")
    files = (ROOT / "tests" / "core.txt").read_text().split()
    assert all((ROOT / name).is_file() for name in files)


def test_the_workflow_runs_what_a_clone_runs():
    workflow = ROOT / ".github" / "workflows" / "checks.yml"
    if not workflow.exists():
        pytest.skip("a source distribution is without it")
    text = workflow.read_text()
    for name in re.findall(r"(?<![\w/.])(?:\.ci|tests)/[\w.]+", text):
        assert (ROOT / name).exists(), name
    said = "\n".join(SETTINGS["project"]["classifiers"])
    assert set(re.findall(r'"(3\.\d+)"', text)) == set(re.findall(r"Python :: (3\.\d+)", said))
