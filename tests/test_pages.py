"""The tables of the pages are written from what was measured, and say when and on what."""

import re

import numpy as np
import pytest

from comparisons import pages
from comparisons.__main__ import main
from comparisons.harness import machine, report

NAMED = {
    name: page
    for page in sorted(pages.DOCS.rglob("*.md"))
    for name in re.findall(r"<!-- table: (\w+) -->", page.read_text())
}


def test_every_table_has_its_place_and_every_place_its_table():
    assert {name: pages.DOCS / table.page for name, table in pages.TABLES.items()} == NAMED
    assert all(callable(table.arrange) for table in pages.TABLES.values())


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


def test_a_table_takes_the_place_of_the_last_one(tmp_path, capsys):
    page = tmp_path / "appendix" / "statistics.md"
    page.parent.mkdir()
    page.write_text("# Head\n\n<!-- table: likelihood_noise -->\nold\n<!-- end -->\n\nTail\n")
    folder = tmp_path / "results" / "gaussian"
    folder.mkdir(parents=True)
    rows = [{"covariance": "θ²", "spread of log d": s, "default": 7 * s} for s in (1, 2)]
    report.write_csv(folder / "noise.csv", rows)
    (folder / report.MEASURED).write_text("2026-01-31: a machine\n")
    for _ in range(2):
        main(["--pages", "--results", str(tmp_path / "results"), "--docs", str(tmp_path)])
        text = page.read_text()
        assert "old" not in text
        (line,) = (x for x in text.splitlines() if "θ²" in x)
        assert [cell.strip() for cell in line.split("|")[1:-1]] == ["θ²", "7", "14"]
        where = "`python -m comparisons.gaussian` on 2026-01-31: a machine."
        assert text.startswith("# Head\n\n<!-- table: likelihood_noise -->\n|")
        assert text.endswith(f"\nMeasured by {where}\n<!-- end -->\n\nTail\n")
    assert "drop_in: " in capsys.readouterr().out  # It says what is not there.


def test_a_page_without_the_table_is_refused(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("nothing\n")
    with pytest.raises(ValueError, match="has 0 tables with the name x, but must have one"):
        pages.write_table(page, "x", [{"n": 1}], "Measured.")


def test_what_is_written_is_read_again(tmp_path):
    rows = [{"n": 3, "x": 0.1, "what": "a, b", "done": True}, {"n": 4, "x": float("inf")}]
    report.write_csv(tmp_path / "t.csv", rows)
    assert report.read_csv(tmp_path / "t.csv") == rows


def test_a_table_is_printed_and_kept_row_by_row(tmp_path, capsys):
    """Columns have the width of the first row, or the room that they are given."""
    table = report.Table("Title", tmp_path / "t.csv", lambda row: row | {"n": -row["n"]}, {"b": 9})
    table.add({"n": 1, "b": "x"})
    assert capsys.readouterr().out == "\nTitle\n\nn       b\n------  ---------\n-1      x\n"
    assert report.read_csv(tmp_path / "t.csv") == [{"n": 1, "b": "x"}]
    table.extend([{"n": 2, "b": None}, {"n": 3, "b": "y", "note": "new"}])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "-2"
    assert lines[1].split() == ["n", "b", "note"]  # A column more, and so a new heading.
    assert lines[3].split() == ["-3", "y", "new"]
    assert len(report.read_csv(tmp_path / "t.csv")) == len(table.rows) == 3


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(3.2e-5, "32 µs"), (0.001, "1 ms"), (0.0216, "22 ms"), (1.46, "1.5 s"), (95.0, "95 s")],
)
def test_times_have_the_unit_that_suits_them(seconds, text):
    assert report.format_seconds(seconds) == text
    assert report.format_seconds(None) == ""
