"""The comparison contact.cases runs, writes what it names, and its errors are small."""

import csv
import sys

import numpy as np
import pytest

from comparisons.contact import cases, growth, methods, peers, rolling, small
from comparisons.harness import report

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("quick_processes")]


def rows_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where a quick run writes to."""
    monkeypatch.setattr(sys, "argv", ["comparison", "--quick", "--output", str(tmp_path)])
    return tmp_path


def test_quick_run_without_the_peers(folder, capsys):
    own = {"toeplitz-mg": methods.NORMAL["toeplitz-mg"]}  # The peers may be installed or not.
    small = {case: (solve, (), (64,)) for case, (solve, _, _) in cases.CASES.items()}
    cases.main(small, normal=own, friction=own)
    printed = capsys.readouterr().out
    for title in (*cases.CASES, "Rough surfaces", "CPU time", str(folder)):
        assert title in printed
    pictures = {p.stem for p in folder.glob("*.png")}
    functions = {solve.__name__ for solve, _, _ in cases.CASES.values()}
    assert pictures == functions | {"convergence", "rough_64"}
    for row in rows_of(folder / "errors.csv"):
        # The edge of an area is known to an element only, 2/N of its radius, whose square the area
        # is; the creepage of bonded rollers goes with tractions that are singular there.
        power = 3.0 if row["case"].startswith("Bufler") else 2.0
        assert float(row["error"]) < power * 2.0 / int(row["N"])
    for row in rows_of(folder / "costs.csv"):
        assert float(row["violation"]) <= 1e-8
    rough = [row for row in rows_of(folder / "costs.csv") if row["case"] == "rough"]
    assert len(rough) == len(cases.LOADS)
    for row in rough:
        assert float(row["force error"]) <= 1e-8
        assert float(row["least pressure"]) >= 0.0
        assert float(row["least gap"]) >= -1e-12
    errors, costs = (report.read_csv(folder / f"{name}.csv") for name in ("errors", "costs"))
    named = [case for case in cases.CASES if not case.startswith(cases.BELOW)]
    assert [line["case"] for line in cases.arrange_errors(errors)] == named
    (line,) = cases.arrange_stresses(errors)
    assert len(line) == 1 + len(cases.CASES) - len(named)
    lines = cases.arrange_products(costs)
    assert [line["case"] for line in lines[: len(named)]] == named
    assert all(line["case"].endswith(" %") for line in lines[len(named) :])
    assert all(line["N = 64"] for line in lines)
    found = rows_of(folder / "peers.csv")
    assert len(found) == len(peers.problems(64))
    for row in found:
        assert row["method"] == "toeplitz-mg"
        assert float(row["violation"]) <= peers.TARGET
        assert float(row["products"]) <= 40


@pytest.mark.parametrize(
    ("case", "quantity", "coarse", "fine", "least"),
    [
        ("Hertz, line", "p₀", 64, 512, 1.0),
        ("Westergaard", "traction", 64, 512, 0.9),
        ("Hertz, sphere", "δ", 32, 128, 1.5),
        ("Hertz, ellipse", "F", 32, 128, 1.5),
        ("Cattaneo, line", "traction", 64, 512, 0.9),
        ("Cattaneo and Mindlin, ν = 0", "F", 32, 128, 1.0),
        ("Carter", "F", 64, 1024, 0.9),
    ],
)
def test_the_order_of_convergence(case, quantity, coarse, fine, least):
    solve = cases.CASES[case][0]

    def error(N):
        return np.sqrt(np.mean([solve(n).errors[quantity] ** 2 for n in cases.grids(N)]))

    assert np.log(error(coarse) / error(fine)) / np.log(fine / coarse) > least


def test_rolling_as_it_is_asked_for(folder, monkeypatch, capsys):
    monkeypatch.setattr(rolling, "QUICK", ((11, 24), (64, 128), 16))
    monkeypatch.setattr(rolling, "KALKER", {(1.0, 0.25): rolling.KALKER[1.0, 0.25]})
    rolling.main()
    printed = capsys.readouterr().out
    for title in ("By the loads", "From rest, in 56 steps", "Carter's", "Kalker's", "falls"):
        assert title in printed
    for row in rows_of(folder / "loads.csv"):
        assert float(row["ratio"]) <= 2.5
        assert float(row["creepages off by"]) <= 1e-7
        assert float(row["violation"]) <= 1e-8
    *_, last = rows_of(folder / "from_rest.csv")
    assert last["step"] == "56"
    assert abs(float(last["over that of rolling"]) - 1.0) < 1e-3
    for row in rows_of(folder / "falling.csv")[1:]:
        assert float(row["violation"]) <= 2e-8


def test_the_order_of_a_power():
    assert cases.order([1.0, 0.25, 0.0625], [2, 4, 8]) == pytest.approx(2.0)
    assert np.isnan(cases.order([0.0, 0.1], [2, 4]))


@pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")  # The grid is coarse.
def test_violations_are_measured():
    for problem in peers.problems(32):
        answer = methods.ours(problem, 1e-10)
        assert problem.violation(answer.traction, answer.bound) <= 1e-9
        assert problem.violation(1.01 * answer.traction, answer.bound) > 1e-4


def test_the_parameters_of_the_peers_are_just_good_enough():
    problem = peers.problems(16)[0]
    exact = methods.ours(problem, 1e-12)

    def halved(problem, iterations):
        return exact._replace(traction=exact.traction * (1.0 + 0.5**iterations))

    asked, answer = peers.fewest(halved, problem)
    assert problem.violation(answer.traction, None) <= peers.TARGET
    assert problem.violation(halved(problem, asked - 1).traction, None) > peers.TARGET
    asked, _ = peers.loosest(methods.ours, problem)
    assert 1e-9 <= asked <= 1e-4
    with pytest.raises(ArithmeticError, match="no tolerance is enough"):
        peers.loosest(lambda problem, _: halved(problem, 3), problem)


def fails(problem, tolerance):
    raise RuntimeError("it diverged")


def test_what_a_peer_cannot_do_is_noted():
    normal = {"fails": ("numpy", fails), "missing": ("a_package_that_is_missing", fails)}
    friction = {"of friction": ("numpy", fails)}
    (row,) = peers.run([methods.Problem("x", 64)], normal, friction)
    assert row["method"] == "fails"
    assert "it diverged" in peers.format_row(row)["note"]


def test_help(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["comparison", "--help"])
    with pytest.raises(SystemExit) as caught:
        cases.main()
    assert caught.value.code == 0
    assert "--quick" in capsys.readouterr().out


def test_rolling_on_finer_grids(folder, capsys):
    growth.main()
    assert str(folder) in capsys.readouterr().out
    rows = rows_of(folder / "growth.csv")
    assert len(rows) == len(growth.MOTIONS) * len(growth.QUICK_SIZES)
    for row in rows:
        assert float(row["violation"]) <= 1e-8


def test_small_cases_of_rolling(folder, monkeypatch, capsys):
    monkeypatch.setattr(small, "REPEATED", 1)
    small.main()
    assert str(folder) in capsys.readouterr().out
    rows = rows_of(folder / "small.csv")
    assert {int(row["N"]) for row in rows} == {11, 25}
    # The largest violation in a direction is at most 1e-8: of both together, √2 times that.
    assert all(float(row["violation"]) <= 1.5e-8 for row in rows)
