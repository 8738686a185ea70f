"""The referee times the same jobs in two revisions: it finds what is slower, fails or differs."""

import ast
import subprocess
from math import inf
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import toeplitz_mg as tmg
from comparisons.workloads.__main__ import JOBS, main
from comparisons.workloads.jobs import JOBS as ALL
from comparisons.workloads.judging import Measurement, Result, differ

PACKAGE = """
from time import process_time

def burn(seconds):
    start = process_time()
    while process_time() - start < seconds:
        pass
    return {answer}

def work():
    return burn({seconds})

peer = lambda: burn(0.03)
"""
# One job, of the package of a tree.
JOB = """
from types import SimpleNamespace
import numpy as np
import toeplitz_mg

def prepare():
    return lambda: np.array([1.0, toeplitz_mg.work()])

def prepare_peer():
    return toeplitz_mg.peer

JOBS = [
    SimpleNamespace(
        family="tiny", name="one", prepare=prepare, tolerance=1e-8, limit=1.3, is_first=False,
        peer={peer},
    )
]
"""


@pytest.fixture
def repository(tmp_path):
    """Return what commits a package, and what runs the command in this tree."""
    root, jobs = tmp_path / "clone", tmp_path / "jobs.py"
    (root / "toeplitz_mg").mkdir(parents=True)
    author = "-c", "user.name=A", "-c", "user.email=a@example.org"

    def git(*arguments):
        command = ["git", *author, "-C", str(root), *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    def commit(answer="1.0", seconds=0.03):
        package = PACKAGE.format(answer=answer, seconds=seconds)
        (root / "toeplitz_mg" / "__init__.py").write_text(package)
        git("add", "-A")
        git("commit", "--allow-empty", "-m", "a revision")

    def run(*options, peer=None):
        jobs.write_text(JOB.format(peer=peer))
        status = main([*options, "--runs", "1"], root=root, path=jobs)
        assert len(git("worktree", "list").splitlines()) == 1
        return status

    git("init")
    return SimpleNamespace(commit=commit, run=run)


@pytest.mark.slow
def test_a_difference_of_answers_is_an_error(repository, capsys):
    repository.commit()
    repository.commit(answer="1.0 + 1e-9")
    assert repository.run("--against", "HEAD~1") == 0
    assert "Geometric mean of 1 ratios" in capsys.readouterr().out
    repository.commit(answer="1.1")
    assert repository.run("--against", "HEAD~1") == 1
    assert "FAILED tiny: one: answers differ by 9.1e-02" in capsys.readouterr().out


@pytest.mark.slow
def test_what_takes_longer_is_measured_again_and_an_error(repository, capsys):
    repository.commit()
    repository.commit(seconds=0.09)
    assert repository.run("--against", "HEAD~1") == 1
    printed = capsys.readouterr().out
    assert "takes more than 1.3 of the time of the other tree" in printed
    # The peer takes a third of it too.
    assert repository.run("--against", "HEAD~1", peer="prepare_peer") == 1
    assert "more than 1.1 of the time of the other tree and SciPy's" in capsys.readouterr().out
    # What was as slow before is none of the fault of this tree.
    assert repository.run("--against", "HEAD", peer="prepare_peer") == 0


def test_unknown_revisions_and_jobs_are_refused(repository, capsys):
    repository.commit()
    with pytest.raises(SystemExit, match="no-such-revision"):
        repository.run("--against", "no-such-revision")
    with pytest.raises(SystemExit):
        repository.run("--jobs", "no such job")
    assert "no job has no such job in its name" in capsys.readouterr().err


def test_jobs_use_public_names_alone():
    tree = ast.parse(Path(JOBS).read_text())
    modules = {"tmg": tmg, "contact": tmg.contact, "halfspace": tmg.halfspace}
    allowed = {"collections.abc", "functools", "typing", "numpy", "scipy.linalg", "toeplitz_mg"}
    used = 0
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            assert {alias.name for alias in node.names} <= allowed
        elif isinstance(node, ast.ImportFrom):
            assert node.module in allowed
            if node.module == "toeplitz_mg":
                assert {alias.name for alias in node.names} <= {"contact", "halfspace"}
        elif isinstance(node, ast.Attribute) and getattr(node.value, "id", None) in modules:
            assert node.attr in modules[node.value.id].__all__
            used += 1
    assert used > 20


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("family", sorted({job.family for job in ALL}))
def test_jobs_answer_with_numbers(family):
    for job in ALL:
        if job.family == family and "512²" not in job.name:
            answer = np.asarray(job.prepare()())
            assert answer.dtype.kind in "fc"
            assert answer.size <= 20_000
            assert np.isfinite(answer).all()
            assert np.abs(answer).max() > 0.0


@pytest.mark.parametrize(
    ("seconds", "faults", "is_settled"),
    [([1.2], 0, True), ([1.4], 1, False), ([1.4, 1.2], 0, False), ([1.4, 1.2, 1.4], 1, True)],
)
def test_two_ratios_of_three_decide(seconds, faults, is_settled):
    job = SimpleNamespace(peer=None, limit=1.3, tolerance=1e-8)
    result = Result(job, [Measurement(here=s, there=1.0) for s in seconds])
    assert len(result.faults) == faults
    assert result.is_settled == is_settled


def test_answers_differ_relative_to_the_largest_number():
    x = np.array([1.0, 100.0])
    assert differ(x, x) == 0.0
    assert differ(x, x + 1.0) == pytest.approx(1 / 101)
    assert differ(x, x[:1]) == inf
    assert differ(x, np.array([np.nan, 100.0])) == inf
    assert differ(np.zeros(2), np.zeros(2)) == 0.0
