"""Revisions that are measured: where their files are, and the processes that run their jobs."""

import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

CHILD = Path(__file__).with_name("child.py")
START = "import runpy, sys; runpy.run_path(sys.argv[1])['serve'](*sys.argv[2:])"
# What says how many threads a library takes, and which code of BLAS runs.
THREADS = "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"
UNSET = "OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE", "PYTHONPATH"


class Tree:
    """A tree of files, and so many processes from which its runs are forked."""

    def __init__(self, folder: Path, jobs: Path, threads: int, processes: int) -> None:
        environment = {key: value for key, value in os.environ.items() if key not in UNSET}
        self._environment = environment | dict.fromkeys(THREADS, str(threads))
        arguments = CHILD, folder, jobs, threads
        self._command = [sys.executable, "-c", START, *map(str, arguments)]
        self._processes: list[subprocess.Popen[str] | None] = [None] * processes

    def __enter__(self) -> "Tree":
        return self

    def __exit__(self, *error: object) -> None:
        for process in self._processes:
            if process is not None:
                process.kill()
                process.communicate()

    def run(self, job: int, turn: int) -> dict[str, Any]:
        """Return the seconds and the answer of a job in a new process, or its error."""
        process, line = self._process(turn % len(self._processes)), ""
        assert process.stdin is not None
        assert process.stdout is not None
        with suppress(BrokenPipeError):
            process.stdin.write(f"{job}\n")
            process.stdin.flush()
            line = process.stdout.readline()
        if not line:
            raise SystemExit("a process has ended; its reason stands above")
        answer: dict[str, Any] = pickle.loads(bytes.fromhex(line))
        return answer

    def _process(self, number: int) -> "subprocess.Popen[str]":
        process = self._processes[number]
        if process is None:
            process = self._processes[number] = subprocess.Popen(
                self._command,
                env=self._environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                start_new_session=True,  # Ctrl-C is for the command, which ends them.
            )
        return process


@contextmanager
def worktree(root: Path, revision: str) -> Iterator[Path]:
    """Yield a folder in which a revision of a clone is checked out, and remove it afterwards."""

    def git(*arguments: str) -> None:
        subprocess.run(["git", "-C", str(root), *arguments], check=True, capture_output=True)

    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        try:
            git("worktree", "add", "--detach", str(tree), revision)
        except subprocess.CalledProcessError as error:
            raise SystemExit(f"{revision}: {error.stderr.decode().strip()}") from None
        try:
            yield tree
        finally:
            git("worktree", "remove", "--force", str(tree))
