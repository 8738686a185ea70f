"""The house stands as `docs/architecture.md` draws it."""

import ast
import importlib
import inspect
import pkgutil
import re
from graphlib import TopologicalSorter
from pathlib import Path
from types import ModuleType

import pytest

import toeplitz_mg
from tests import public_api

ROOT = Path(toeplitz_mg.__file__).parent
PAGE = (Path(__file__).parent.parent / "docs" / "architecture.md").read_text()
ROOMS = [
    name.strip("`/")
    for row in re.findall(r"(?m)^\| (`.*?) \|", PAGE)
    for name in re.findall(r"`[\w/]+`", row)
]
MODULES = [
    module.name
    for module in pkgutil.walk_packages(toeplitz_mg.__path__, "toeplitz_mg.")
    if module.name != "toeplitz_mg.__main__"  # which runs when it is imported
]


def imported_names(node, *, for_types=True):
    """What a piece of code imports, also inside functions, and for annotations alone or not."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom) and node.module:
        yield from (f"{node.module}.{alias.name}" for alias in node.names)
    for child in ast.iter_child_nodes(node):
        if for_types or not (isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test)):
            yield from imported_names(child, for_types=for_types)


def rooms_that_are_imported(source):
    for name in imported_names(ast.parse(source)):
        package, *rest = name.split(".")
        if package == "toeplitz_mg" and rest and rest[0] in ROOMS:
            yield rest[0]


def test_the_page_names_every_room():
    there = {path.stem for path in ROOT.iterdir() if path.suffix == ".py" or path.is_dir()}
    assert there - {"__init__", "__main__", "__pycache__", "startup"} == set(ROOMS)


@pytest.mark.parametrize("room", ROOMS)
def test_no_room_imports_from_one_above_it(room):
    files = [*(ROOT / room).rglob("*.py")] or [ROOT / f"{room}.py"]
    for path in files:
        for imported in rooms_that_are_imported(path.read_text()):
            assert ROOMS.index(imported) <= ROOMS.index(room), f"{path} imports {imported}"


def test_no_files_import_each_other_in_a_circle():
    imports = {}
    for file in MODULES:
        code = ast.parse(inspect.getsource(importlib.import_module(file)))
        names = imported_names(code, for_types=False)
        imports[file] = {n if n in MODULES else n.rpartition(".")[0] for n in names} - {file}
    TopologicalSorter(imports).prepare()  # Its CycleError names the files.


def test_no_module_is_hidden_by_a_function_of_its_name():
    for name in MODULES:
        module = importlib.import_module(name)
        namespace = {}
        exec(f"import {name} as m", namespace)
        assert isinstance(namespace["m"], ModuleType), name
        assert namespace["m"] is module


def test_the_page_names_files_that_exist():
    for name in re.findall(r"`([\w/]+\.py)`", PAGE):
        assert (ROOT / name).exists() or (ROOT.parent / name).exists(), name


# Tests --------------------------------------------------------------------------------------------

TESTS = Path(__file__).parent
OUTSIDE = [path for path in sorted(TESTS.rglob("*.py")) if "inside" not in path.parts]
PUBLIC = {f"toeplitz_mg.{name}" for name in ("paper",)}
PUBLIC |= {line.split(":")[0].split("(")[0].rpartition(".")[0] for line in public_api.describe()}


def inner_modules(source):
    """The modules of the package that a file imports, and that are not public."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names = {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            whole = {f"{node.module}.{alias.name}" for alias in node.names}
            names = {node.module} | (whole & {*MODULES})
        else:
            continue
        yield from {n for n in names if n.split(".")[0] == "toeplitz_mg"} - PUBLIC


def test_tests_speak_through_public_names():
    inner = {path.name: [*inner_modules(path.read_text())] for path in OUTSIDE}
    assert not any(inner.values()), "what is inner is tested in tests/inside"


def test_few_files_look_inside():
    assert len(list((TESTS / "inside").rglob("*[!_].py"))) <= 25
