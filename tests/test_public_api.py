"""Public names, their parameters and the fields of results are those of `public_api.txt`."""

from tests.public_api import FILE, describe


def test_what_is_public_is_in_the_file():
    there = FILE.read_text(encoding="utf-8").splitlines()
    assert list(describe()) == there, "if it is meant so, run python -m tests.public_api"
