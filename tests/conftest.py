"""How the tests run: with one thread of BLAS each, and the same random examples each time.

``pytest -n auto`` runs as many tests side by side as there are cores, for which threads of BLAS
would only wait for each other.

``pytest -m hypothesis --hypothesis-profile=random --hypothesis-seed=1`` draws other examples. A
failure that such a run finds is kept in the test, as an ``@example``.
"""

import multiprocessing
import os
from multiprocessing import forkserver
from pathlib import Path

import pytest

try:
    from hypothesis import settings
except ImportError:  # The core's tests do without.
    settings = None

# It is read where NumPy is imported, after this file.
os.environ.setdefault("OMP_NUM_THREADS", "1")

if settings:
    settings.register_profile("fixed", derandomize=True, deadline=None)
    settings.register_profile("random", database=None, deadline=None, print_blob=True)
    settings.load_profile("fixed")


@pytest.fixture(scope="session")
def quick_processes():
    """Comparisons measure in fresh processes: let these start from one that has imported all."""
    root = Path(__file__).parent.parent
    paths = sorted((root / "comparisons").rglob("[!_]*.py"))
    modules = [".".join(path.relative_to(root).with_suffix("").parts) for path in paths]
    multiprocessing.set_forkserver_preload(modules)
    forkserver.ensure_running()
