"""Change the package in one place at a time, by chance, and see whether the tests notice.

``python .ci/mutants.py --seed 1 --number 100`` draws places of the package and a change of each
(cosmic-ray's operators: another sign, number, comparison, …), without those in messages and
annotations, and runs for each mutant tests that execute the line. Which these are is read from
`.coverage`, as ``pytest -n auto --cov=toeplitz_mg --cov-context=test`` writes it.
A mutant that no test notices is printed with its change: where an answer differs, a test is
missing.
"""

import argparse
import ast
import difflib
import os
import random
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from pathlib import Path

from cosmic_ray.ast import Visitor, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names
from coverage import CoverageData

ROOT = Path(__file__).parent.parent
COPIED = ("toeplitz_mg", "tests", "comparisons", "benchmarks", "examples", "docs", ".ci")
MOST_TESTS = 150  # Of those that execute a line, for one mutant.
ON_RANKS = "tests/slabs/test_on_ranks.py"
SECONDS = 600  # After which the tests of a mutant are ended, which kills it.


class Positions(Visitor):
    """Collects where operators change something, each with how often it has done so before."""

    def __init__(self):
        names = [name for name in operator_names() if "Variable" not in name]  # These take a name.
        self.operators = {name: get_operator(name)() for name in names}
        self.counts, self.found = dict.fromkeys(names, 0), {}

    def visit(self, node):
        """Take the positions of a node."""
        for name, operator in self.operators.items():
            for start, _ in operator.mutation_positions(node):
                self.found.setdefault(start, []).append((name, self.counts[name]))
                self.counts[name] += 1
        return node


def left_out(source):
    """Return the lines of messages, of annotations and of definitions of types."""
    lines = set()
    for node in ast.walk(ast.parse(source)):
        parts = []
        if isinstance(node, ast.Raise | ast.JoinedStr):
            parts = [node]
        elif isinstance(node, ast.AnnAssign):
            parts = [node.annotation]
        elif isinstance(node, ast.FunctionDef):
            arguments = [*node.args.args, *node.args.kwonlyargs, node.args.vararg, node.args.kwarg]
            parts = [node.returns, *(arg.annotation for arg in arguments if arg)]
        for part in filter(None, parts):
            lines.update(range(part.lineno, part.end_lineno + 1))
    return lines


@cache
def list_mutants(path):
    """Return, by the place of each change, the operators, each with how often it has occurred."""
    source = path.read_text()
    visitor, unwanted = Positions(), left_out(source)
    visitor.walk(get_ast(source))
    return {start: which for start, which in visitor.found.items() if start[0] not in unwanted}


def tests_of(data, path, line, rng):
    """Return some tests that execute a line, or, where it runs at import, others of its file."""
    if "slabs" in path.parts:
        return [ON_RANKS]  # Which lines these execute is not recorded.
    by_line = data.contexts_by_lineno(str(path))
    names = set(by_line.get(line, ())) or {name for names in by_line.values() for name in names}
    names = {name.rpartition("|")[0] for name in names if name} or {
        name.rpartition("|")[0] for names in by_line.values() for name in names if name
    }
    chosen = sorted(names)
    return rng.sample(chosen, MOST_TESTS) if len(chosen) > MOST_TESTS else chosen


def copy_tree(folder):
    """Copy what the tests need, so that the working tree is left alone."""
    for name in COPIED:
        ignored = shutil.ignore_patterns("__pycache__", "_build")
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    for path in (
        *ROOT.glob("*.md"),
        *ROOT.glob("*.toml"),
        *ROOT.glob("*.c*"),
        ROOT / "conftest.py",
    ):
        if path.is_file():
            shutil.copy(path, folder)


def run(folder, mutant):
    """Return the mutant, and whether its tests fail."""
    (path, start), source, mutated, tests = mutant
    there = folder / path.relative_to(ROOT)
    there.write_text(mutated)
    (folder / "arguments").write_text("".join(f"{test}\n" for test in sorted(tests)))
    try:
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-xq", "-p", "no:cacheprovider", "@arguments"],
            cwd=folder,
            env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            text=True,
            timeout=SECONDS,
            check=False,
        )
        killed = done.returncode != 0
        if "no tests ran" in done.stdout:
            print(done.stdout[-1000:])
    except subprocess.TimeoutExpired:
        killed = True
    finally:
        there.write_text(source)
    print(f"{'killed' if killed else 'LIVES '} {path.relative_to(ROOT)}:{start[0]}", flush=True)
    if not killed:
        changes = difflib.unified_diff(source.splitlines(), mutated.splitlines(), n=0, lineterm="")
        print("".join(f"    {line}\n" for line in [*changes][3:]), end="", flush=True)
    return killed


def main():
    """Draw mutants, run their tests, and print the share that is killed."""
    parser = argparse.ArgumentParser(prog="python .ci/mutants.py")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=100)
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    parser.add_argument("--only", default="", help="part of the names of the files to change")
    options = parser.parse_args()
    rng = random.Random(options.seed)
    data = CoverageData(str(ROOT / ".coverage"))
    data.read()
    paths = [p for p in (ROOT / "toeplitz_mg").rglob("*.py") if options.only in str(p)]
    paths = {path: len(path.read_text().splitlines()) for path in sorted(paths)}
    mutants, drawn = [], set()
    for _ in range(100 * options.number):
        if len(mutants) == options.number:
            break
        (path,) = rng.choices([*paths], [*paths.values()])
        places = list_mutants(path)
        start = rng.choice(sorted(places)) if places else None
        if start is None or (path, start) in drawn:
            continue
        drawn.add((path, start))
        name, occurrence = rng.choice(places[start])
        source = path.read_text()
        mutated = mutate_code(source, get_operator(name)(), occurrence)
        tests = tests_of(data, path, start[0], rng)
        if tests and mutated not in (None, source):
            mutants.append(((path, start), source, mutated, tests))
    with tempfile.TemporaryDirectory() as work, ThreadPoolExecutor(options.processes) as pool:
        shares = []
        for k in range(options.processes):
            folder = Path(work, str(k))
            folder.mkdir()
            copy_tree(folder)
            mine = mutants[k :: options.processes]
            shares.append(pool.submit(lambda f, m: [*map(partial(run, f), m)], folder, mine))
        killed = sum(sum(share.result()) for share in shares)
    print(f"{killed} of {len(mutants)} mutants are killed")


if __name__ == "__main__":
    main()
