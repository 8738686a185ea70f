"""What a user sees where something is wrong: no rank waits for ever for another."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import toeplitz_mg
from tests.slabs.ranks import LIMIT, ROOT, run_on_ranks, with_ranks

MESSAGES = re.compile("mpi4py|i?(all(gather|to|reduce)|send|recv|bcast|barrier)", re.IGNORECASE)
PACKAGE = Path(toeplitz_mg.__file__).parent


@with_ranks
@pytest.mark.parametrize("what", ["raises", "dies"])
def test_all_ranks_end_where_one_does(what):
    status, printed = run_on_ranks(2, "-m", "tests.slabs.failures", what)
    assert status != 0
    assert "done" not in printed
    assert what == "dies" or "RuntimeError: one rank has a bug" in printed


def run(program):
    command = [sys.executable, "-c", program]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT, check=False
    )
    return done.returncode, done.stdout + done.stderr


def test_without_mpi4py_the_extra_is_named():
    status, printed = run(
        "import sys; sys.modules['mpi4py'] = None\n"
        "from toeplitz_mg import slabs; slabs.Slab(None, (8, 8))"
    )
    assert status == 1
    assert "ImportError: toeplitz_mg.slabs needs mpi4py" in printed
    assert 'pip install "toeplitz-mg[mpi]"' in printed


def test_the_package_does_not_import_mpi4py():
    status, printed = run(
        "import sys, toeplitz_mg, toeplitz_mg.contact, toeplitz_mg.slabs\n"
        "print('mpi4py' in sys.modules)"
    )
    assert (status, printed) == (0, "False\n")


def test_a_program_runs_on_one_rank_without_mpiexec():
    pytest.importorskip("mpi4py")
    status, printed = run(
        "import sys; sys.argv[1:] = ['-']; import tests.slabs.failures as f; f.main()"
    )
    assert (status, printed) == (0, "done\n")


def test_only_one_file_knows_of_messages():
    files = set()
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text()
        for node in ast.walk(ast.parse(text)) if MESSAGES.search(text) else ():
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            elif isinstance(node, ast.Attribute):
                names = [node.attr]
            files |= {path.name for name in names if MESSAGES.match(name)}
    assert len(files) == 1, files
