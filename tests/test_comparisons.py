"""The comparisons run, and write what they name."""

import csv
import os
import re
import sys
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import scipy.linalg

from comparisons.contact import punch3d, punch_limits
from comparisons.gaussian import likelihood
from comparisons.harness import report
from comparisons.harness.processes import in_a_fresh_process, take_turns
from comparisons.paper import figures as paper_figures
from comparisons.paper import tables as paper_tables
from comparisons.preconditioners import (
    areas,
    default_choice,
    fractional_diffusion,
    general_symbols,
    neighbours,
    stretched,
    symbols,
)
from comparisons.preconditioners import figures as area_figures
from comparisons.reliability import __main__ as reliability
from comparisons.speed import baselines, by_hand, columns, drop_in, gpu, scaling, scaling_model
from comparisons.speed import threads as speed_of_threads
from comparisons.systems import fractional, masks, matrices, random_matrices
from tests.slabs.ranks import with_ranks
from toeplitz_mg.fractional import grunwald_coefficients, riesz_coefficients

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("quick_processes")]


def run(comparison, folder, monkeypatch, capsys, *options, **extent):
    monkeypatch.setattr(sys, "argv", ["comparison", "--quick", "--output", str(folder), *options])
    comparison.main(**extent)
    printed = capsys.readouterr().out
    assert str(folder) in printed
    return printed


def rows_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_paper_tables(tmp_path, monkeypatch, capsys):
    printed = run(paper_tables, tmp_path, monkeypatch, capsys)
    names = ["cells.csv", "table_1.csv", "table_6.csv"]
    assert sorted(p.name for p in tmp_path.glob("*.csv")) == names
    for number in ("I", "II", "III", "IV", "V", "VI", "VII", "VIII", "IX"):
        assert f"Table {number}" in printed
    cells = rows_of(tmp_path / "cells.csv")
    assert {row["table"] for row in cells} == set("2345789")
    assert all(row["converged"] == "True" for row in cells if row["table"] == "5")
    lines = paper_tables.arrange(report.read_csv(tmp_path / "cells.csv"))
    assert lines[0][""] == "RSM test 1 V(1,1), ours"
    assert sum(line[""].endswith("ours") for line in lines) == 3 * 3 + 3 + 2 * 3


def test_likelihood(tmp_path, monkeypatch, capsys):
    run(likelihood, tmp_path, monkeypatch, capsys, quick_sizes=(1024,), quick_samples=2000)
    for row in rows_of(tmp_path / "errors.csv"):
        if float(row["condition"]) <= 1e6:
            assert float(row["error"]) <= 1e-12
            assert float(row["error of the gradient"]) <= 1e-10
    assert len(rows_of(tmp_path / "times.csv")) == len(likelihood.TIMED)
    assert all(row["value, one gap"] for row in rows_of(tmp_path / "gaps.csv"))
    # So many samples show an error in a covariance of some percent.
    assert all(float(row["p"]) > 1e-6 for row in rows_of(tmp_path / "samples.csv"))
    assert all(int(row["default"]) < 1000 for row in rows_of(tmp_path / "noise.csv"))


def test_paper_figures(tmp_path, monkeypatch, capsys):
    run(paper_figures, tmp_path, monkeypatch, capsys)
    names = [f"figure_{k:02d}" for k in (3, 6, 7, 9, 10, 11, 12, 13)]
    assert sorted(p.stem for p in tmp_path.glob("*.png")) == names
    assert sorted(p.stem for p in tmp_path.glob("figure*.csv")) == names


def test_baselines(tmp_path, monkeypatch, capsys):
    run(baselines, tmp_path, monkeypatch, capsys, quick_sizes=(64,))
    assert (tmp_path / "baselines.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / report.MEASURED).exists()
    rows = rows_of(tmp_path / "baselines.csv")
    assert {row["system"] for row in rows} == {"test 1", "test 2", "test 3", "random"}
    for row in rows:
        if row["method"] in ("dense Cholesky", "CG + M", "M̄", "V(0,1)", "CG + V(1,1)"):
            assert float(row["residual"]) <= 1.01e-8
        # What is missing has its reason.
        assert row["converged"] == "True" or row["note"]


def test_the_picture_of_baselines_alone(tmp_path, monkeypatch, capsys):
    run(baselines, tmp_path, monkeypatch, capsys, "--picture", quick_sizes=(64,))
    assert (tmp_path / "baselines.png").read_bytes().startswith(b"\x89PNG")
    assert not (tmp_path / "baselines.csv").exists()
    assert {row["method"] for row in rows_of(tmp_path / "drawn.csv")} == set(baselines.DRAWN)


def test_symbols(tmp_path, monkeypatch, capsys):
    options = ("--symbols", "contact", "θ²")
    sizes = {"quick_sizes": (32, 1200)}
    printed = run(symbols, tmp_path, monkeypatch, capsys, *options, **sizes)
    assert "The choice of solve_toeplitz" in printed
    rows = rows_of(tmp_path / "symbols.csv")
    assert len(rows) == 2 * 2 * 2 * len(symbols.CONTENDERS)
    for row in rows:
        if row["method"] in ("sine", "spectral", "V(1,1)", "solve_toeplitz"):
            assert float(row["residual"]) <= 1.01e-8
        # What is missing has its reason.
        assert row["converged"] == "True" or row["note"]
    monkeypatch.setattr(symbols, "TABULATED", 1200)
    first, second = symbols.arrange(report.read_csv(tmp_path / "symbols.csv"))
    assert first["symbol, or coefficients"] == "contact"
    assert second["cosine"] == "–"  # It is refused: θ² has a zero.
    for line in (first, second):
        iterations, work = line[line["least work"]].split(" / ")
        assert 0 < int(iterations) <= int(work)
        assert "none" not in line


def test_general_symbols(tmp_path, monkeypatch, capsys):
    printed = run(general_symbols, tmp_path, monkeypatch, capsys, quick_sizes=(300,))
    assert "nonsymmetric, n = 300" in printed
    assert "indefinite, n = 300" in printed
    rows = rows_of(tmp_path / "general_symbols.csv")
    systems = sum(map(len, general_symbols.KINDS.values()))
    assert len(rows) == systems * len(general_symbols.METHODS)
    for row in rows:
        assert row["note"] or float(row["seconds"]) > 0.0
        if row["method"] in ("spectral", "inverse", "solve_toeplitz", "SciPy"):
            assert row["note"] or float(row["residual"]) <= 1.01e-8
        if row["method"] == "solve_toeplitz":
            assert not row["note"]


def test_drop_in(tmp_path, monkeypatch, capsys):
    printed = run(drop_in, tmp_path, monkeypatch, capsys, quick_sizes=(1, 5, 300))
    assert "The largest ratios" in printed
    assert (tmp_path / "drop_in.png").read_bytes().startswith(b"\x89PNG")
    rows = rows_of(tmp_path / "drop_in.csv")
    assert {row["method"] for row in rows} >= {
        "scipy.linalg.solve_toeplitz",
        "lu",
    }
    assert all(float(row["residual"]) <= 1e-8 for row in rows)
    ratios = [float(row[f"ratio{key}"]) for row in rows for key in ("", "_half", "_twice")]
    assert min(ratios) > 0.0


def test_drop_in_of_other_symbols(tmp_path, monkeypatch, capsys):
    options = ["--symbols", "|θ|", "contact", "--sizes", "311", "320", "--columns", "1"]
    options += ["--digits", "11"]
    run(drop_in, tmp_path, monkeypatch, capsys, *options)
    rows = rows_of(tmp_path / "drop_in.csv")
    assert {(row["symbol"], row["n"]) for row in rows} == {
        (name, n) for name in ("|θ|", "contact") for n in ("311", "320")
    }
    assert all(float(row["residual"]) <= 1e-11 for row in rows)


def test_columns(tmp_path, monkeypatch, capsys):
    run(columns, tmp_path, monkeypatch, capsys)
    rows = rows_of(tmp_path / "columns.csv")
    assert {row["columns"] for row in rows} == {"2", "16"}
    assert all(float(row[key]) > 0.0 for row in rows for key in (*columns.LIMITS, "SciPy"))
    assert {row["systems"] for row in rows_of(tmp_path / "batches.csv")} == {"100"}
    (dense,) = rows_of(tmp_path / "dense.csv")
    assert dense["method"] == "lu"
    assert float(dense["residual"]) <= 1e-10


def test_gpu(tmp_path, monkeypatch, capsys):
    """On a library of the processor, so that nothing is said about a GPU."""
    pytest.importorskip("array_api_strict")
    chosen = "--library", "array_api_strict"
    printed = run(gpu, tmp_path, monkeypatch, capsys, *chosen, quick_sizes=(24,))
    assert "array_api_strict on a CPU, no GPU" in printed
    (row,) = rows_of(tmp_path / "gpu.csv")
    assert float(row["error"]) <= 1e-14
    assert row["iterations"] == row["iterations_numpy"]
    assert float(row["of_called"]) > 0.0
    assert float(row["of_bare"]) > 0.0
    assert float(row["bytes_an_unknown"]) > 0.0
    (row,) = rows_of(tmp_path / "gpu_areas.csv")
    assert int(row["unknowns"]) == round(0.4 * 24**2)
    assert row["iterations"] == row["iterations_numpy"]
    (row,) = rows_of(tmp_path / "gpu_contact.csv")
    assert row["products"] == row["products_numpy"]
    assert row["elements_that_differ"] == "0"
    assert float(row["bytes_an_element"]) > 0.0


@with_ranks
def test_scaling(tmp_path, monkeypatch, capsys):
    options = "--nodes", "2", "--model", "1", "8"
    printed = run(scaling, tmp_path, monkeypatch, capsys, *options, sides=(64, 64, 64))
    rows = rows_of(tmp_path / "scaling.csv")
    kinds = [(row["kind"], row["ranks"], row["n"]) for row in rows]
    assert kinds == [("weak", "2", "96"), ("strong", "2", "64")]
    for row in rows:
        assert not row.get("note")
        assert float(row["product bytes"]) == 16.0
        assert float(row["model s"]) > 0.0
        assert row["FSAI info"] == row["cosine info"] == "0"
    memory = [row["what"] for row in rows_of(tmp_path / "memory.csv")]
    assert memory == ["serial FSAI", "FSAI", "serial cosine", "cosine"]
    nodes = rows_of(tmp_path / "model.csv")
    assert [row["nodes"] for row in nodes] == ["1", "8"]
    assert nodes[1]["CG + FSAI s"] in printed


def test_a_launcher_that_fails_is_noted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for launcher, note in (("false", "status 1"), ("no-such-launcher", "No such file")):
        assert note in scaling.run(launcher, 2, 64, "times")["note"]


def test_the_model_is_that_of_the_design():
    """A product of 2^28 unknowns on a node of 64 cores; its messages on eight are most of it."""
    node = scaling_model.Node(5e11, 2.5e11, 1e10)
    assert round(scaling_model.predict(node, 1, 2**14).product, 2) == 0.56
    eight = scaling_model.predict(node, 8, 2**15)
    assert round(eight.exchange, 2) == 0.38
    assert round(eight.product - eight.exchange, 2) == 0.29
    assert eight.message == 2**28


def test_speed_by_hand(tmp_path, monkeypatch, capsys):
    one = replace(by_hand.QUICK, products=(64,), solves=(64,), threaded=(64,), seconds=0.0)
    printed = run(by_hand, tmp_path, monkeypatch, capsys, quick=one)
    for title in ("One product", "physical limit", "peak memory", "Further right-hand sides"):
        assert title in printed
    names = ["axes.csv", "further.csv", "products.csv", "solves.csv", "two_threads.csv"]
    assert sorted(p.name for p in tmp_path.glob("*.csv")) == names
    assert len(list(tmp_path.glob("*.png"))) == 3
    for name in names:
        for row in rows_of(tmp_path / name):
            assert float(row["cpu_s"]) > 0.0 or row["note"]


def test_speed_of_threads(tmp_path, monkeypatch, capsys):
    one = speed_of_threads.Extent((384,), turns=1)
    printed = run(speed_of_threads, tmp_path, monkeypatch, capsys, quick=one)
    assert "Load of the machine" in printed
    rows = rows_of(tmp_path / "threads.csv")
    assert {row["workers"] for row in rows} == {"1", "2"}
    assert {"bare transforms", "bare triads"} < {row["task"] for row in rows}
    for row in rows:
        assert 0.0 <= float(row["serial_share"]) <= 1.0
        assert 1.0 <= float(row["on_16"]) <= float(row["on_64"]) <= 64.0
    assert "serial_share" in (tmp_path / "threads.md").read_text()


def test_punch3d(tmp_path, monkeypatch, capsys):
    problems, areas, sizes = ("normal", "tangential", "coupled"), ("4:1", "circle"), ("8", "16")
    methods = ("CG", "CG + |q| circulant", "CG + cosine", "CG + V(1,1)", "float32 CG + cosine")
    options = ("--problems", *problems, "--areas", *areas, "--sizes", *sizes, "--methods", *methods)
    printed = run(punch3d, tmp_path, monkeypatch, capsys, *options)
    assert "coupled, circle, N = 16" in printed
    rows = rows_of(tmp_path / "punch3d.csv")
    assert len(rows) == 3 * 2 * 2 * len(methods)
    assert all(float(row["residual"]) <= 1.1e-8 for row in rows)
    assert all(float(row["peak_mb"]) >= 0.0 for row in rows)
    # Coefficients count.
    assert all(0.0 < float(row["matrix_s"]) < float(row["cpu_s"]) for row in rows)
    monkeypatch.setattr(punch3d, "TABULATED", 16)
    lines = punch3d.arrange(report.read_csv(tmp_path / "punch3d.csv"))
    assert [line.pop("method").replace("\\|", "|") for line in lines] == list(methods)
    for line in lines:
        assert list(line) == [f"{k}, {a}" for a in areas for k in ("normal", "coupled")]
        assert all(re.fullmatch(r"\d+ / [\d.]+ m?s", cell) for cell in line.values())
    # Every method finds the same force.
    for key in {(row["problem"], row["area"], row["N"]) for row in rows}:
        own = [float(r["force"]) for r in rows if (r["problem"], r["area"], r["N"]) == key]
        assert max(own) - min(own) <= 1e-6 * max(own)


def test_punch3d_writes_after_every_run():
    punches = [punch3d.Punch("square", "normal", N) for N in (8, 16)]
    counts = [len(rows) for rows in punch3d.run(punches, ["CG", "CG + cosine"])]
    assert counts == [1, 2, 3, 4]


def test_growth_is_the_ratio_of_times():
    row = {"problem": "normal", "area": "square", "method": "CG"}
    seconds = {64: 1.0, 128: 4.5, 512: 30.0}
    allowed, ratios = punch3d.growth([row | {"N": N, "cpu_s": t} for N, t in seconds.items()])
    assert ratios == row | {"N = 128": "4.5"}
    assert allowed["N = 128"] == "5.8"  # It is 4 log(128²)/log(64²) · 1.25.


def test_an_unknown_area_is_refused(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["comparison", "--areas", "oval"])
    with pytest.raises(SystemExit):
        punch3d.main()
    assert "invalid choice: 'oval'" in capsys.readouterr().err


def test_the_force_of_a_square_punch_is_known():
    punch = punch3d.Punch("square", "normal", 64)
    force = punch3d.measure("CG + cosine", punch, punch.operator())["force"]
    assert force == pytest.approx(2.29235, abs=5e-6)


# The limits for N to infinity that are known, with one half-space and G = 1.
@pytest.mark.parametrize(
    ("area", "kind", "nu", "known", "near"),
    [
        ("square", "normal", 0.28, 2.30460, 5e-6),
        ("2:1", "normal", 0.28, 3.34214, 5e-6),
        ("4:1", "normal", 0.28, 5.08516, 5e-6),
        ("square", "tangential", 0.28, 5.36112, 5e-6),
        ("square", "coupled", 0.28, 5.36517, 5e-6),
        ("square", "coupled", 0.0, 4.60919, 5e-6),
        ("2:1", "coupled", 0.28, 7.60197, 5e-6),  # It is our own, as that of the annulus.
        ("circle", "normal", 0.28, 2.0, 5e-5),
        ("circle", "coupled", 0.28, 8.0 / (2.0 - 0.28), 5e-5),
        ("annulus", "normal", 0.28, 1.9621, 1e-4),
        ("annulus", "coupled", 0.28, 4.5652, 1e-4),
    ],
)
def test_forces_tend_to_the_known_limits(area, kind, nu, known, near):
    sizes = (32, 48, 64, 96, 128)
    if area in punch_limits.ROUND:
        sizes = [N for N in punch_limits.ROUND_SIZES if N <= 256]
    value, error = punch_limits.limit(area, sizes, punch_limits.forces(area, kind, sizes, nu))
    assert value == pytest.approx(known, rel=near)
    assert error <= near * known


def test_a_limit_needs_more_sizes_than_terms():
    with pytest.raises(ValueError, match="4 sizes are no more than the 4 terms"):
        punch_limits.limit("square", (8, 16, 32, 64), [1.0, 1.0, 1.0, 1.0])


def test_punch_limits(tmp_path, monkeypatch, capsys):
    options = ("--problems", "normal", "--areas", "square", "annulus")
    printed = run(punch_limits, tmp_path, monkeypatch, capsys, *options)
    assert "nan" not in printed
    for row in rows_of(tmp_path / "punch_limits.csv"):
        if row["reference"]:
            assert float(row["limit"]) == pytest.approx(float(row["reference"]), rel=5e-4)


def test_stretched(tmp_path, monkeypatch, capsys):
    methods = ("cosine", "M", "default")
    cases = ("square", "grid 1:64, elements 1:20", "circle, elements 1:20")
    options = ("--cases", *cases, "--methods", *methods, "--problems", "normal", "coupled")
    printed = run(stretched, tmp_path, monkeypatch, capsys, *options)
    assert "Iterations" in printed
    rows = rows_of(tmp_path / "stretched.csv")
    assert len(rows) == len(cases) * 2 * len(methods)
    assert all(row["random"] or row["note"] for row in rows)


@pytest.mark.parametrize("kind", ["normal", "tangential", "coupled"])
def test_stretched_grids_take_no_more_iterations_than_square_ones(kind):
    counts = {
        case: {r["constant"] for r in stretched.measure(case, kind, 64, ["default"])}.pop()
        for case in ("square", "square, elements 1:20", "grid 1:64")
    }
    assert max(counts.values()) <= 1.5 * counts["square"]


def test_areas(tmp_path, monkeypatch, capsys):
    few = ("none", "FSAI", "default")
    names = ("full", "rough, 30 %", "checkerboard")
    options = ("--methods", *few, "--areas", *names, *masks.ON_A_LINE)
    sizes = {"quick_sizes": (24,), "quick_lines": (600,)}
    printed = run(areas, tmp_path, monkeypatch, capsys, *options, **sizes)
    assert "checkerboard, n = 24" in printed
    rows = rows_of(tmp_path / "areas.csv")
    assert len(rows) == (len(names) + len(masks.ON_A_LINE)) * len(few)
    for row in rows:
        if row["method"] in ("FSAI", "default"):
            assert int(row["random"]) <= 14
    assert (tmp_path / "areas.png").exists()
    written = (tmp_path / "areas.md").read_text()
    assert written.count("| checkerboard") == written.count("\n## ") == 5
    # The fastest of each is bold.
    assert written.count("**") >= 4 * (len(names) + len(masks.ON_A_LINE))


def test_areas_say_what_was_not_solved():
    rows = [
        {"area": "a", "n": 8, "method": "M", "random": "> 150", "random_s": 0.1, "note": ""},
        {"area": "a", "n": 8, "method": "sine", "random": 9, "random_s": 0.25, "note": ""},
        {"area": "a", "n": 8, "method": "M̄", "random_s": float("nan"), "note": "over 200 s"},
        {"area": "a", "n": 8, "method": "V(1,1)", "random_s": float("nan"), "note": "no element"},
    ]
    table, *_ = areas.tables(rows).values()
    cells = {"M": "> 150 / 0.1", "sine": "9 / **0.25**", "M̄": "too long", "V(1,1)": "refused"}
    assert table == [{"area": "a", "n": 8} | cells]


def test_area_figures(tmp_path, monkeypatch, capsys):
    run(area_figures, tmp_path, monkeypatch, capsys, quick_n=16)
    assert sorted(p.stem for p in tmp_path.glob("*.png")) == ["convergence", "spectrum", "traction"]
    for row in rows_of(tmp_path / "spectrum.csv"):
        assert float(row["smallest"]) > 0.0


def test_fractional_diffusion(tmp_path, monkeypatch, capsys):
    problems = ("Riesz, steady", "two-sided constant, steady", "two-sided smooth, time step")
    options = ("--problems", *problems, "--orders", "1.5")
    extent = {"quick_sizes": {1: (63, 1023), 2: (31,)}, "quick_levels": {1: 8, 2: 4}}
    printed = run(fractional_diffusion, tmp_path, monkeypatch, capsys, *options, **extent)
    assert "for a constant load; 9 are allowed" in printed
    rows = rows_of(tmp_path / "fractional_diffusion.csv")
    assert len(rows) == 3 * 3 * len(fractional_diffusion.METHODS)
    for row in rows:
        assert float(row["residual"]) <= 1.1e-8
        assert (row["published"] == "≤ 15") == (row["problem"][:5] + row["method"] == "Riesztau")
    assert len(rows_of(tmp_path / "tau.csv")) == 2 * 2
    growing = rows_of(tmp_path / "growing.csv")
    assert len(growing) == 3 * (2 + 2)
    assert all(int(row["iterations"]) <= fractional_diffusion.MANY for row in growing)


def test_fractional_diffusion_fails_where_tau_takes_more(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(fractional_diffusion, "MOST", {"constant": 2, "random": 2})
    with pytest.raises(SystemExit, match="for a constant load, but 2 are allowed"):
        run(
            fractional_diffusion,
            tmp_path,
            monkeypatch,
            capsys,
            *("--problems", "Riesz, steady", "--orders", "1.5", "--methods", "tau"),
            quick_sizes={1: (63,)},
            quick_levels={1: 5},
        )


@pytest.mark.parametrize("axes", [1, 2])
def test_fractional_problems_are_their_definition(axes):
    """Kronecker products of dense matrices, between dense diagonal ones."""
    n, order = 7, 1.5
    x = np.arange(1, n + 1) / (n + 1)
    grids = [grid.ravel() for grid in np.meshgrid(*[x] * axes, indexing="ij")]
    G = scipy.linalg.toeplitz(*grunwald_coefficients(order, n))
    R = scipy.linalg.toeplitz(riesz_coefficients(order, n))
    lines = {
        1: [lambda T: T],
        2: [lambda T: np.kron(T, np.eye(n)), lambda T: np.kron(np.eye(n), T)],
    }[axes]
    time = (n + 1) ** -0.5 * np.eye(n**axes)
    flow = fractional.FLOWS["smooth"]
    two_sided = sum(
        np.diag(flow.left(x, order)) @ of_line(G) + np.diag(flow.right(x, order)) @ of_line(G.T)
        for x, of_line in zip(grids, lines, strict=True)
    )
    varied = np.diag(np.exp(2.0 * np.mean(grids, axis=0)))
    riesz = sum(of_line(R) for of_line in lines)
    for name, expected in (
        ("Riesz, steady", riesz),
        ("Riesz e^2x, time step", varied @ riesz + time),
        ("two-sided smooth, steady", two_sided),
        ("two-sided smooth, time step", two_sided + time),
    ):
        S = fractional.PROBLEMS[axes][name](order, n)
        assert np.allclose(S.toarray(), expected)


def test_reliability(tmp_path, monkeypatch, capsys):
    with pytest.raises(SystemExit) as caught:
        run(reliability, tmp_path, monkeypatch, capsys, "--trials", "2", "--processes", "1")
    assert caught.value.code == 0
    rows = rows_of(tmp_path / "reliability.csv")
    assert sum(int(row["tried"]) for row in rows) == 2 * len(reliability.PARTS)
    assert {row["failed"] for row in rows} == {"0"}


def test_reliability_reports_what_fails(tmp_path, monkeypatch, capsys):
    parts = {"wrong": (wrong, 1, 1)}
    with pytest.raises(SystemExit) as caught:
        run(reliability, tmp_path, monkeypatch, capsys, "--first", "7", tried=parts)
    assert caught.value.code == 1
    (row,) = rows_of(tmp_path / "failures.csv")
    assert (row["part"], row["seed"]) == ("wrong", "7")
    assert "ZeroDivisionError" in row["note"]


def wrong(rng):
    return 1 / 0


ALL = [
    reliability,
    area_figures,
    punch3d,
    punch_limits,
    stretched,
    paper_tables,
    paper_figures,
    baselines,
    symbols,
    general_symbols,
    drop_in,
    columns,
    by_hand,
    gpu,
    scaling,
    areas,
    neighbours,
    fractional_diffusion,
    likelihood,
]


@pytest.mark.parametrize("comparison", ALL)
def test_help(comparison, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["comparison", "--help"])
    with pytest.raises(SystemExit) as caught:
        comparison.main()
    assert caught.value.code == 0
    assert "--quick" in capsys.readouterr().out


def test_default_choice(tmp_path, monkeypatch, capsys):
    few = {"quick_random": 12, "quick_every": 40}
    printed = run(default_choice, tmp_path, monkeypatch, capsys, **few)
    assert "worse than none" in printed
    assert (tmp_path / "default_choice.md").read_text().startswith("# default_preconditioner")
    rows = rows_of(tmp_path / "default_choice.csv")
    assert len(rows) == 12 + 7
    assert {row["worse"] for row in rows} == {"False"}
    assert not any(row["note"] for row in rows)


def test_matrices_are_positive_definite_and_always_the_same():
    assert len(list(matrices.typical())) == 250
    checked = 0
    for case in random_matrices.random_ones(150):
        A = case.operator()
        if A.shape[0] <= 300:
            dense = A.toarray()
            assert np.linalg.eigvalsh(dense)[0] > 0.0
            assert np.array_equal(dense, case.operator().toarray())
            checked += 1
    assert checked > 10


# How all of them measure ----------------------------------------------------------------------


def dies():
    os._exit(3)


def counts_to(last):
    yield from range(last)
    raise ValueError("no more\nthan that")


def test_a_job_in_a_fresh_process_ends_in_a_result_an_error_or_time():
    assert in_a_fresh_process(partial(abs, -3), 60.0) == 3
    with pytest.raises(ArithmeticError, match="ValueError: could not convert"):
        in_a_fresh_process(partial(float, "x"), 60.0)
    with pytest.raises(ArithmeticError, match="the process died"):
        in_a_fresh_process(dies, 60.0)
    with pytest.raises(TimeoutError):
        in_a_fresh_process(partial(time.sleep, 60.0), 0.01)


def test_jobs_take_turns_until_each_has_done_enough():
    jobs = {"long": partial(counts_to, 5), "short": partial(counts_to, 2)}
    answers = take_turns(jobs, lambda items: len(items) == 4)
    assert answers == {"long": [0, 1, 2, 3], "short": "ValueError: no more"}
