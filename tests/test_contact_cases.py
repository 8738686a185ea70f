"""Contact against theory: errors are small, fall in order, and all conditions hold; and peers."""

import pytest

from comparisons import peers
from comparisons.harness import report
from comparisons.theory import cases

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("quick_processes")]


def test_errors_against_theory_are_small_and_all_conditions_hold(tmp_path, capsys):
    cases.main(["--quick", "--output", str(tmp_path)])
    printed = capsys.readouterr().out
    errors, costs = (report.read_csv(tmp_path / f"{name}.csv") for name in ("errors", "costs"))
    assert {row["case"] for row in costs} == set(cases.CASES)
    assert all(f"\n{case} " in printed for case in cases.CASES)
    for row in errors:
        # The edge of an area is known to an element only, 2/N of its radius, whose square the area
        # is; the creepage of bonded rollers goes with tractions that are singular there.
        power = 3.0 if row["case"].startswith("Bufler") else 2.0
        assert row["error"] < power * 2.0 / row["N"]
    for row in costs:
        if row["N"] != "order":  # Unlike materials are solved to 1e-6.
            assert row["violation"] <= (1e-6 if row["case"].startswith("Bonded") else 2e-8)
    theory = [case for case in cases.CASES if not case.startswith(("rough", "repeated"))]
    named = [case for case in theory if not case.startswith(cases.BELOW)]
    assert [line["case"] for line in cases.arrange_errors(errors)] == named
    line, *_ = cases.arrange_stresses(errors)
    assert len(line) == 1 + len(theory) - len(named)
    lines = {line["case"]: line for line in cases.arrange_products(costs)}
    assert set(named) < set(lines)
    assert all(line["N = 64"] for case, line in lines.items() if case.startswith("rough"))
    (line,) = cases.arrange_repeated(costs)
    assert list(line) == ["products", *(f"{share} %" for share in cases.REPEATED_LOADS)]
    known = report.read_csv(tmp_path / "printed.csv")
    off = [float(row["off"].rstrip("%")) for row in known if "off" in row]
    assert len(off) == 4 + 15
    assert max(off) <= 2.0
    assert len(cases.arrange_kalker(known)) == 15
    assert len(cases.arrange_printed(known)) == len(known) - 15


# Peers ------------------------------------------------------------------------------------------


def test_peers_that_are_not_installed_are_left_out(tmp_path, capsys):
    own = {"toeplitz-mg": peers.NORMAL["toeplitz-mg"]}
    missing = own | {"missing": ("a_package_that_is_missing", fails)}
    peers.main(["--quick", "--output", str(tmp_path)], normal=missing, friction=own)
    assert "rough, repeated, 99 %" in capsys.readouterr().out
    rows = report.read_csv(tmp_path / "peers.csv")
    assert len(rows) == len(peers.problems(64))
    assert {row["method"] for row in rows} == {"toeplitz-mg"}
    assert all(row["violation"] <= peers.TARGET for row in rows)


def test_the_ratio_to_the_faster_way_of_a_peer():
    row = {"problem": "rough, repeated, 2 %", "N": 64}
    seconds = {"toeplitz-mg": 1.0, "aspher, |q| by FFT": 4.0, "aspher, nested": 2.0, "tamaas": 0.1}
    rows = [row | {"method": method, "cpu_s": s} for method, s in seconds.items()]
    assert peers.arrange_repeated(rows) == [{"CPU over aspher's": "64²", "2 %": "0.50"}]


@pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")  # The grid is coarse.
def test_violations_are_measured():
    for problem in peers.problems(32):
        answer = peers.ours(problem, 1e-10)
        assert problem.violation(answer.traction, answer.bound) <= 1e-9
        assert problem.violation(1.01 * answer.traction, answer.bound) > 1e-4


def test_the_parameters_of_the_peers_are_just_good_enough():
    problem = peers.problems(16)[0]
    exact = peers.ours(problem, 1e-12)

    def halved(problem, iterations):
        return exact._replace(traction=exact.traction * (1.0 + 0.5**iterations))

    asked, answer = peers.fewest(halved, problem)
    assert problem.violation(answer.traction, None) <= peers.TARGET
    assert problem.violation(halved(problem, asked - 1).traction, None) > peers.TARGET
    asked, _ = peers.loosest(peers.ours, problem)
    assert 1e-9 <= asked <= 1e-4
    with pytest.raises(ArithmeticError, match="no tolerance is enough"):
        peers.loosest(lambda problem, _: halved(problem, 3), problem)


def fails(problem, tolerance):
    raise RuntimeError("it diverged")


def test_what_a_peer_cannot_do_is_noted():
    table = report.Table("peers", form=peers.FORMATS)
    peers.run(table, [peers.Problem("x", 64)], {"fails": ("numpy", fails)}, {})
    (row,) = table.rows
    assert row["method"] == "fails"
    assert "it diverged" in table.form(row)["note"]
