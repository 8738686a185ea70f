"""The tables of the pages are written from what was measured, and say when and on what."""

import re
import sys

import numpy as np
import pytest

from comparisons import pages
from comparisons.harness import machine, report

NAMED = {
    name: page
    for page in sorted(pages.DOCS.glob("*.md"))
    for name in re.findall(r"<!-- table: (\w+) -->", page.read_text())
}


def test_every_table_has_its_place_and_every_place_its_table():
    assert {name: pages.DOCS / table.page for name, table in pages.TABLES.items()} == NAMED


def test_every_table_says_when_and_by_what_it_was_measured():
    for name, page in NAMED.items():
        (inside,) = re.findall(
            rf"<!-- table: {name} -->\n(.*?)<!-- end -->", page.read_text(), re.DOTALL
        )
        command = pages.TABLES[name].command
        assert re.search(rf"\nMeasured by `python -m comparisons\.{command}` on \d{{4}}-", inside)


def test_the_machine_is_described():
    text = machine.describe()
    assert re.fullmatch(r"\d{4}-\d\d-\d\d: .+, \d+ cores?; Python [\d.]+, numpy .+, scipy .+", text)
    assert np.__version__ in text


def test_a_table_takes_the_place_of_the_last_one(tmp_path, monkeypatch, capsys):
    page = tmp_path / "benchmarks.md"
    page.write_text("# Head\n\n<!-- table: drop_in -->\nold\n<!-- end -->\n\nTail\n")
    folder = tmp_path / "results" / "speed" / "drop_in"
    folder.mkdir(parents=True)
    row = {"symbol": "contact", "n": 1000, "columns": 1, "seconds": 0.0012, "scipy_seconds": None}
    report.write_csv(folder / "drop_in.csv", [row | {"ratio": 0.987}])
    (folder / report.MEASURED).write_text("2026-01-31: a machine\n")
    options = ["--results", str(tmp_path / "results"), "--docs", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", ["pages", *options])
    for _ in range(2):
        pages.main()
        text = page.read_text()
        assert "old" not in text
        (line,) = (x for x in text.splitlines() if "1 right-hand side: this package" in x)
        assert [cell.strip() for cell in line.split("|")[1:-1] if cell.strip()][1:] == ["1.2 ms"]
        assert " 0.99 " in text
        where = "`python -m comparisons.speed.drop_in` on 2026-01-31: a machine."
        assert text.startswith("# Head\n\n<!-- table: drop_in -->\n|")
        assert text.endswith(f"\nMeasured by {where}\n<!-- end -->\n\nTail\n")
    assert "products: " in capsys.readouterr().out  # It says what is not there.


def test_a_page_without_the_table_is_refused(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("nothing\n")
    with pytest.raises(ValueError, match="has 0 tables with the name x, but must have one"):
        pages.write_table(page, "x", [{"n": 1}], "Measured.")


def test_what_is_written_is_read_again(tmp_path):
    rows = [{"n": 3, "x": 0.1, "what": "a, b", "done": True}, {"n": 4, "x": float("inf")}]
    report.write_csv(tmp_path / "t.csv", rows)
    assert report.read_csv(tmp_path / "t.csv") == rows


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(3.2e-5, "32 µs"), (0.001, "1 ms"), (0.0216, "22 ms"), (1.46, "1.5 s"), (95.0, "95 s")],
)
def test_times_have_the_unit_that_suits_them(seconds, text):
    assert report.format_seconds(seconds) == text
    assert report.format_seconds(None) == ""
