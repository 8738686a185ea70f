"""The comparisons of speed write what they measure, row by row, and their answers are right."""

import pytest
from numpy.testing import assert_allclose

from comparisons import baselines, drop_in
from comparisons.harness import report
from comparisons.machines import parts as machines
from comparisons.machines import ranks, transforms
from tests.slabs.ranks import with_ranks

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("quick_processes")]


def run(command, folder, capsys, *options, **extent):
    """Run a command with ``--quick``, and return what it prints."""
    command.main(["--quick", "--output", str(folder), *options], **extent)
    printed = capsys.readouterr().out
    assert str(folder) in printed
    assert (folder / report.MEASURED).exists()
    return printed


def test_baselines(tmp_path, capsys):
    run(baselines, tmp_path, capsys, "--sizes", "256")
    assert (tmp_path / "baselines.png").read_bytes().startswith(b"\x89PNG")
    rows = report.read_csv(tmp_path / "baselines.csv")
    assert [row["method"] for row in rows] == [method.name for method in baselines.METHODS]
    assert all("note" not in row and row["residual"] <= 1.01e-8 for row in rows)
    iterations = {row["method"]: row.get("iterations") for row in rows}
    # As its users would set it up, not as it comes.
    assert 2 * iterations["CG + pyamg by pairs"] < iterations["CG + pyamg SA"]
    table = baselines.arrange(rows)
    assert [line["method"] for line in table] == [method.name for method in baselines.METHODS]
    assert all(line["n = 256"] for line in table)


def test_drop_in(tmp_path, capsys):
    printed = run(drop_in, tmp_path, capsys, "--sizes", "1", "5", "300")
    assert "The largest ratios" in printed
    rows = report.read_csv(tmp_path / "drop_in.csv")
    assert {row["symbol"] for row in rows} == set(drop_in.SYMBOLS)
    assert all(row["residual"] <= 1e-8 for row in rows)
    assert all(row["ratio"] > 0.0 for row in rows)
    assert {row["n"] for row in rows if "by_hand_seconds" in row} == {300}


def test_arrays_of_another_library(tmp_path, capsys):
    """On a library of the processor, so that nothing is said about a GPU."""
    pytest.importorskip("array_api_strict")
    options = "--parts", "gpu", "--library", "array_api_strict"
    printed = run(machines, tmp_path, capsys, *options, quick={"gpu": {"sizes": (32,)}})
    assert "array_api_strict on a CPU, no GPU" in printed
    (row,) = report.read_csv(tmp_path / "gpu.csv")
    assert row["error"] <= 1e-14
    assert row["iterations"] == row["on NumPy"]
    assert min(row["of its transforms"], row["of bare ones"], row["bytes an unknown"]) > 0.0
    (row,) = report.read_csv(tmp_path / "gpu_areas.csv")
    assert row["unknowns"] == round(0.4 * 32**2)
    assert row["iterations"] == row["on NumPy"]
    (row,) = report.read_csv(tmp_path / "gpu_blocks.csv")
    assert all(seconds > 0.0 for name, seconds in row.items() if name.endswith(", s"))
    (row,) = report.read_csv(tmp_path / "gpu_contact.csv")
    assert row["products"] == row["on NumPy"]
    assert row["elements that differ"] == 0
    assert row["bytes an element"] > 0.0


@with_ranks
def test_ranks(tmp_path, capsys):
    options = "--parts", "ranks", "--nodes", "2", "--model", "1", "8"
    quick = {"ranks": {"side": 64, "strong": 64, "memory": 64}}
    printed = run(machines, tmp_path, capsys, *options, quick=quick)
    rows = report.read_csv(tmp_path / "scaling.csv")
    kinds = [(row["kind"], row["ranks"], row["n"]) for row in rows]
    assert kinds == [("weak", 2, 96), ("strong", 2, 64)]
    for row in rows:
        assert "note" not in row
        assert row["product bytes"] == 16.0
        assert row["model s"] > 0.0
        assert row["FSAI info"] == row["cosine info"] == 0
    memory = [row["what"] for row in report.read_csv(tmp_path / "memory.csv")]
    assert memory == ["serial FSAI", "FSAI", "serial cosine", "cosine"]
    nodes = report.read_csv(tmp_path / "model.csv")
    assert [row["nodes"] for row in nodes] == [1, 8]
    assert str(nodes[1]["CG + FSAI s"]) in printed


def test_a_launcher_that_fails_is_noted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for launcher, note in (("false", "status 1"), ("no-such-launcher", "No such file")):
        assert note in ranks.measure(launcher, 2, 64, "times")["note"]


def test_transforms(tmp_path, capsys):
    quick = {"transforms": {"shapes": ((300,), (20, 30)), "turns": 2}}
    run(machines, tmp_path, capsys, "--parts", "transforms", quick=quick)
    rows = report.read_csv(tmp_path / "transforms.csv")
    assert [row["grid"] for row in rows if row["transforms"] == "scipy"] == [300, "20 x 30"]
    assert all(row["of_scipy"] == 1.0 for row in rows if row["transforms"] == "scipy")
    assert all(min(row["of_hand"], row["of_bare"]) > 0.0 for row in rows)
    assert [line["grid"] for line in transforms.arrange(rows)] == [300, "20 x 30"]


def test_threads(tmp_path, capsys):
    quick = {"threads": {"sides": (384,), "turns": 1}}
    printed = run(machines, tmp_path, capsys, "--parts", "threads", quick=quick)
    assert "Load of the machine" in printed
    rows = report.read_csv(tmp_path / "threads.csv")
    assert {row["workers"] for row in rows} == {1, 2}
    assert all(row["speed_up"] == 1.0 for row in rows if row["workers"] == 1)
    bare = [row["of_bare"] for row in rows if row["task"] == "bare transforms"]
    assert_allclose(bare, 1.0, rtol=1e-12)
