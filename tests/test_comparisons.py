"""The comparisons run, print their rows as they are measured, and keep them where interrupted."""

import csv
import os
import signal
import subprocess
import sys
import time
from functools import partial
from importlib import import_module

import numpy as np
import pytest

from comparisons import gaussian
from comparisons.__main__ import COMMANDS
from comparisons.harness import report
from comparisons.harness.processes import in_a_fresh_process
from comparisons.paper import tables as paper_tables
from comparisons.paper.__main__ import main as paper
from comparisons.preconditioners import areas, symbols
from comparisons.preconditioners.__main__ import main as preconditioners
from comparisons.reliability import __main__ as reliability
from comparisons.systems import masks, random_matrices
from tests.budgets import assert_within_budget
from tests.test_docs import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("quick_processes")]


def run(main, folder, capsys, *options, **extent):
    main(["--quick", "--output", str(folder), *options], **extent)
    printed = capsys.readouterr().out
    assert str(folder) in printed
    return printed


def rows_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


# All of them ------------------------------------------------------------------------------------


def main_of(name):
    """The main function of a command, a module or a package."""
    module = import_module(f"comparisons.{name}")
    if hasattr(module, "__path__"):
        module = import_module(f"comparisons.{name}.__main__")
    return module.main


@pytest.mark.parametrize("name", COMMANDS)
def test_help(name, capsys):
    with pytest.raises(SystemExit) as caught:
        main_of(name)(["--help"])
    assert caught.value.code == 0
    assert f"comparisons.{name}" in capsys.readouterr().out


# What a command prints first, and the file that has that row.
FIRST = {
    "paper": "table_1.csv",
    "theory": "costs.csv",
    "peers": "peers.csv",
    "gaussian": "errors.csv",
    "reliability": "reliability.csv",
    "preconditioners": "areas.csv",
    "baselines": "baselines.csv",
    "drop_in": "drop_in.csv",
    "machines": "threads.csv",
}


@pytest.mark.parametrize("name", FIRST)
def test_who_interrupts_keeps_the_rows_so_far(name, tmp_path):
    """The first row is printed when it is measured, long before the last one."""
    command = [sys.executable, "-m", f"comparisons.{name}", "--quick", "--output", str(tmp_path)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    path = os.pathsep.join([str(ROOT), *sys.path])
    with subprocess.Popen(command, **pipes, env=os.environ | {"PYTHONPATH": path}) as process:
        lines = []
        while not (tmp_path / FIRST[name]).exists() or not lines or not lines[-1].strip():
            lines.append(process.stdout.readline())
            assert lines[-1], process.stderr.read()
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=120)
    assert process.returncode == report.INTERRUPTED, errors
    assert "Interrupted: the rows so far are above" in rest
    assert "Traceback" not in errors
    assert len(report.read_csv(tmp_path / FIRST[name])) >= 1


# Each by itself ---------------------------------------------------------------------------------


def test_paper(tmp_path, capsys):
    printed = run(paper, tmp_path, capsys)
    assert "Table I. Spectral radii" in printed
    figures = [f"figure_{k:02d}" for k in (3, 6, 7, 9, 10, 11, 12, 13)]
    assert sorted(p.stem for p in tmp_path.glob("*.png")) == figures
    assert sorted(p.stem for p in tmp_path.glob("figure*.csv")) == figures
    cells = report.read_csv(tmp_path / "cells.csv")
    assert {str(row["table"]) for row in cells} == set("2345789")
    assert all(row["converged"] for row in cells if row["table"] == 5)
    lines = paper_tables.arrange(cells)
    assert lines[0][""] == "RSM test 1 V(1,1), ours"
    assert sum(line[""].endswith("ours") for line in lines) == 3 * 3 + 3 + 2 * 3


def test_gaussian(tmp_path, capsys):
    run(gaussian.main, tmp_path, capsys)
    for row in rows_of(tmp_path / "errors.csv"):
        if float(row["condition"]) <= 1e6:
            assert float(row["error"]) <= 1e-12
            assert float(row["error of the gradient"]) <= 1e-9
    assert len(rows_of(tmp_path / "times.csv")) == len(gaussian.TIMED)
    assert all(row["value, one gap"] for row in rows_of(tmp_path / "gaps.csv"))
    assert all(float(row["error"]) <= 1e-10 for row in rows_of(tmp_path / "gap_gradients.csv"))
    assert all(float(row["difference"]) <= 1e-10 for row in rows_of(tmp_path / "rivals.csv"))
    assert all(int(row["default"]) < 1000 for row in rows_of(tmp_path / "noise.csv"))


def test_symbols(tmp_path, capsys):
    quick = {"symbols": {"sizes": (300, 2**12)}}
    names = "contact", "θ²", "Riesz, α = 1.5", "deconvolution + 0.1", "|θ - 1|"
    options = "--parts", "symbols", "--symbols", *names
    run(preconditioners, tmp_path, capsys, *options, quick=quick)
    rows = report.read_csv(tmp_path / "symbols.csv")
    assert len(rows) == 2 * (3 * len(symbols.METHODS) + 2 * len(symbols.ANY))
    for row in rows:
        if row["method"] in ("spectral", "V(1,1)", "solve_toeplitz", "SciPy"):
            assert row["residual"] <= 1.01e-8
        # What is missing has its reason.
        assert "note" in row or row["seconds"] > 0.0
    for line in symbols.arrange(rows, n=300)[:2]:
        iterations, work = line[line["least work"]].split(" / ")
        assert 0 < int(iterations) <= int(work)
        assert "none" not in line
    first, second = symbols.arrange_general(rows)
    iterations, *_ = first["solve_toeplitz, 2^12"].split(" / ")
    assert 0 < int(iterations) < int(second["T. Chan"]) < 100


def test_trials(tmp_path, capsys):
    run(preconditioners, tmp_path, capsys, "--parts", "trials", quick={"trials": {"sizes": (26,)}})
    for row in report.read_csv(tmp_path / "trials.csv"):
        # Ten iterations, and what it takes to make what is compared.
        assert_within_budget("set-up of default, a trial", work_units=row["trial"])
        assert row["default"] <= 4 * row["none"]


def test_areas(tmp_path, capsys):
    few = ("none", "FSAI", "default")
    names = ("full", "rough, 30 %", "checkerboard")
    options = ("--parts", "areas", "--methods", *few, "--areas", *names, *masks.ON_A_LINE)
    quick = {"areas": {"sizes": (24,), "lines": (600,)}}
    printed = run(preconditioners, tmp_path, capsys, *options, quick=quick)
    assert "\ncheckerboard " in printed
    rows = report.read_csv(tmp_path / "areas.csv")
    assert len(rows) == (len(names) + 2 + len(masks.ON_A_LINE)) * len(few)
    for row in rows:
        if row["method"] in ("FSAI", "default"):
            assert row["random"] <= 14
    lines = areas.arrange_all(rows)
    assert len(lines) == len(names) + len(masks.ON_A_LINE)
    # The fastest of each is bold.
    assert all(sum("**" in str(cell) for cell in line.values()) >= 1 for line in lines)


def test_areas_say_what_was_not_solved():
    rows = [
        {"method": "M", "random": "> 150", "random_s": 0.1, "note": ""},
        {"method": "sine", "random": 9, "random_s": 0.25, "note": ""},
        {"method": "M̄", "random_s": float("nan"), "note": "over 200 s"},
        {"method": "V(1,1)", "random_s": float("nan"), "note": "no element"},
    ]
    more = {"area": "full", "n": 512, "problem": "normal"}
    cells = {"M": "> 150 / 0.1", "sine": "9 / **0.25**", "M̄": "too long", "V(1,1)": "refused"}
    assert areas.arrange_all([row | more for row in rows]) == [{"area": "full", "n": 512} | cells]
    _, line, *_ = areas.arrange_coupled([row | more for row in rows])
    assert line == {"method": "sine", "normal, full": "9 / 0.25"}


def test_the_picture_of_areas_and_cycles(tmp_path, capsys):
    quick = {"picture": {"n": 16}, "cycles": {"lines": (100,), "squares": (8,)}}
    run(preconditioners, tmp_path, capsys, "--parts", "picture", "cycles", quick=quick)
    assert (tmp_path / "areas.png").read_bytes().startswith(b"\x89PNG")


def test_reliability(tmp_path, capsys):
    options = ("--trials", "2", "--processes", "1")
    with pytest.raises(SystemExit) as caught:
        run(reliability.main, tmp_path, capsys, *options)
    assert caught.value.code == 0
    rows = rows_of(tmp_path / "reliability.csv")
    assert sum(int(row["tried"]) for row in rows) == 2 * len(reliability.PARTS)
    assert {row["failed"] for row in rows} == {"0"}


def test_reliability_reports_what_fails(tmp_path, capsys):
    parts = {"wrong": (wrong, 1, 1)}
    with pytest.raises(SystemExit) as caught:
        run(reliability.main, tmp_path, capsys, "--first", "7", tried=parts)
    assert caught.value.code == 1
    assert "wrong, seed 7: ZeroDivisionError" in capsys.readouterr().out
    (row,) = rows_of(tmp_path / "failures.csv")
    assert (row["part"], row["seed"]) == ("wrong", "7")


def wrong(rng):
    return 1 / 0


def test_random_matrices_are_positive_definite_and_always_the_same():
    checked = 0
    for seed in range(40):
        A = random_matrices.random_matrix(seed)
        if A.shape[0] <= 700:
            dense = A.toarray()
            assert np.linalg.eigvalsh(dense)[0] > 0.0
            assert np.array_equal(dense, random_matrices.random_matrix(seed).toarray())
            checked += 1
    assert checked > 3


# How all of them measure ----------------------------------------------------------------------


def dies():
    os._exit(3)


def test_a_job_in_a_fresh_process_ends_in_a_result_an_error_or_time():
    assert in_a_fresh_process(partial(abs, -3), 60.0) == 3
    with pytest.raises(ArithmeticError, match="ValueError: could not convert"):
        in_a_fresh_process(partial(float, "x"), 60.0)
    with pytest.raises(ArithmeticError, match="the process died"):
        in_a_fresh_process(dies, 60.0)
    with pytest.raises(TimeoutError):
        in_a_fresh_process(partial(time.sleep, 60.0), 0.01)
