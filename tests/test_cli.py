"""The command line: what it prints, writes and refuses."""

import json
import os
import subprocess
import sys
import warnings

import numpy as np
import pytest
import scipy.fft
from numpy.testing import assert_allclose
from scipy.linalg import toeplitz

import toeplitz_mg as tmg
from comparisons.systems import masks
from tests.cases import contact
from tests.command_line import assert_refused, main


@pytest.fixture
def folder(tmp_path):
    """A system of 300 unknowns in files."""
    np.save(tmp_path / "c.npy", contact(300))
    np.save(tmp_path / "b.npy", np.linspace(-1.0, 2.0, 300))
    np.save(tmp_path / "mask.npy", np.arange(300) % 50 < 40)
    return tmp_path


def solve(folder, *options, column="c.npy", rhs="b.npy", x="x.npy"):
    names = [str(folder / name) for name in (column, rhs)]
    return main(["solve", *names, "-o", str(folder / x), *options])


def figures(printed):
    """Iterations, factor and work units of a line `this run` or `the paper`."""
    lines = {line[:12].strip(): line[12:].split() for line in printed.splitlines()}
    return lines["this run"], lines.get("the paper")


def test_the_papers_problem_and_its_convergence(capsys):
    assert main(["-n", "65536"]) == 0
    printed = capsys.readouterr().out
    assert "<Multigrid V(0,1) RowSumModified  65536 > 32768" in printed
    ours, papers = figures(printed)
    assert int(ours[0]) <= 5
    assert papers == ["5", "0.0231"]
    shown = [float(line.split()[1]) for line in printed.splitlines() if line[:10].strip().isdigit()]
    assert shown == sorted(shown, reverse=True)
    assert shown[-1] <= 1e-8
    # The products of the display are not counted: at most 5 work units a cycle.
    assert 4.9 * int(ours[0]) <= float(ours[2]) <= 5 * int(ours[0])


def test_the_main_job_of_a_million_unknowns(capsys):
    assert main(["paper"]) == 0
    ours, papers = figures(capsys.readouterr().out)
    assert int(ours[0]) <= 4
    assert float(ours[2]) <= 20.0
    assert papers[:3] == ["4", "29", "20"]


@pytest.mark.parametrize(
    "options",
    [
        ["--test", "2"],
        ["--test", "3", "--solver", "richardson"],
        ["--solver", "cg"],
        ["--solver", "cg", "--preconditioner", "fft"],
        ["--solver", "cg", "--preconditioner", "fft-rsm", "--rtol", "1e-10"],
        ["--solver", "cg", "--preconditioner", "strang", "--test", "3"],
        ["--solver", "cg", "--preconditioner", "chan"],
        ["--solver", "cg", "--preconditioner", "cosine", "--test", "3"],
        ["--solver", "cg", "--preconditioner", "sine"],
        ["--solver", "cg", "--preconditioner", "spectral", "--test", "2"],
        ["--solver", "cg", "--preconditioner", "none", "--maxiter", "2000"],
        ["--cycle", "W(1,1)", "--seed", "3"],
        ["--cycle", "V(1, 0)", "--smoother", "fft-sd"],
        ["--solver", "richardson", "--preconditioner", "multigrid"],
    ],
    ids=" ".join,
)
def test_options(options, capsys):
    assert main(["-n", "500", *options]) == 0
    assert "converged: residual" in capsys.readouterr().out


def test_not_converged_is_status_one(capsys, folder):
    assert main(["-n", "500", "--maxiter", "1"]) == 1
    told = capsys.readouterr().out
    assert "NOT CONVERGED" in told
    assert "--maxiter 1 is used up: allow more iterations, or take another --precond" in told
    assert solve(folder, "--solver", "richardson", "--preconditioner", "fft") == 1
    assert not (folder / "x.npy").exists()


def test_solves_a_system_of_ones_own(folder):
    A = tmg.ToeplitzOperator(contact(300))
    b = np.linspace(-1.0, 2.0, 300)
    assert solve(folder, "--rtol", "1e-10") == 0
    assert_allclose(A @ np.load(folder / "x.npy"), b, atol=1e-8)
    assert sorted(p.name for p in folder.iterdir()) == ["b.npy", "c.npy", "mask.npy", "x.npy"]


def test_solves_on_a_mask(folder):
    mask = np.load(folder / "mask.npy")
    A = tmg.MaskedOperator(tmg.ToeplitzOperator(contact(300)), mask)
    b = np.linspace(-1.0, 2.0, 300)
    options = ["--mask", str(folder / "mask.npy"), "--solver", "cg"]
    assert solve(folder, *options) == 0
    x = np.load(folder / "x.npy")
    assert x.shape == (300,)
    assert not x[~mask].any()
    assert_allclose(A @ x[mask], b[mask], atol=1e-7)
    np.save(folder / "short.npy", b[mask])
    assert solve(folder, *options, rhs="short.npy", x="y.npy") == 0
    assert np.array_equal(np.load(folder / "y.npy"), x[mask])


@pytest.mark.parametrize(
    "command",
    [["-n", "300"], ["solve", "c.npy", "b.npy", "-o", "x.npy"], ["contact", "hertz", "-n", "16"]],
)
def test_threads_are_those_asked_for_or_all_cores(command, monkeypatch):
    seen, set_workers = [], scipy.fft.set_workers
    monkeypatch.setattr(scipy.fft, "set_workers", lambda n: seen.append(n) or set_workers(n))
    for options, expected in (
        (["--threads", "3", *command], 3),
        ([*command, "--threads", "2"], 2),
        (command, len(os.sched_getaffinity(0))),
    ):
        seen.clear()
        main(options)
        assert seen[0] == expected
    assert scipy.fft.get_workers() == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["-n", "0"], "n is 0, but must be at least 1"),
        (["--rtol", "0"], "--rtol is 0.0"),
        (["--rtol", "nan"], "--rtol is nan"),
        (["--maxiter", "0"], "--maxiter is 0"),
        (["--cycle", "X"], "--cycle is X, but must be like V(0,1)"),
        (["--cycle", "V(99999999999999,1)"], "of at most 999 steps each"),
        (["--cycle", "V(1000,1)", "--solver", "cg"], "of at most 999 steps each"),
        (["-n", "1" + 30 * "0"], f"-n is {10**30}, but must be at most {2**40}"),
        (["--cycle", "V(0,0)"], "must smooth at least once"),
        (["--solver", "cg", "--cycle", "V(0,1)"], "cg needs a symmetric preconditioner"),
        (["--solver", "cg", "--preconditioner", "fft-sd"], "cg needs a symmetric"),
        (["--preconditioner", "fft"], "--preconditioner is for --solver richardson and cg"),
        (["--plot", "/nowhere/x.png"], "/nowhere is no folder"),
        (["--plot", "picture"], "picture does not end in one of"),
        (["--plot", "picture.foo"], "picture.foo does not end in one of"),
        (["--seed", "-1"], "--seed is -1"),
        (["--threads", "0"], "--threads is 0, but must be 1 to 1024"),
        (["--threads", "1025"], "--threads is 1025, but must be 1 to 1024"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_refusals_are_one_line_and_status_two(options, message, capsys):
    assert_refused(main(["-n", "300", *options]), message, capsys)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("c.npy", None, "No such file"),
        ("c.npy", b"", "is not a NumPy file of numbers"),
        ("c.npy", b"\x80\x04K\x01.", "is not a NumPy file of numbers"),  # A pickle.
        ("c.npy", b"1.0, 2.0\n", "text is read from .txt, .csv, .dat"),
        ("c.npy", b"PK\x03\x04 and no more", "is not a NumPy file of numbers"),
        ("b.npy", b"PK\x03\x04 and no more", "is not a NumPy file of numbers"),
        ("mask.npy", b"PK\x03\x04 and no more", "is not a NumPy file of numbers"),
        ("c.npy", np.array([1.0, np.nan]), "c.npy has the value nan at (1,), but must be finite"),
        ("c.npy", np.array([1.0, 2j]), "complex128"),
        ("c.npy", np.array([object()]), "is not a NumPy file of numbers"),
        ("c.npy", np.array([1.0] + 299 * [2.0]), "is not positive definite"),
        ("c.npy", np.array([1.0] + 299 * [2.0]), "the command line has the preconditioners"),
        ("b.npy", np.ones(299), "has shape (299,), but the unknowns are 240"),
        ("b.npy", np.ones((3, 100)), "has shape (3, 100)"),
        ("b.npy", np.full(300, np.inf), "b.npy has the value inf at (0,)"),
        ("b.npy", np.full(300, "text"), "has dtype <U4, but must be of real numbers"),
        ("mask.npy", np.full(300, 2.0), "has the value 2, but must be of 0 and 1"),
        ("mask.npy", np.zeros(300, dtype=bool), "nowhere true"),
        ("mask.npy", np.ones(7, dtype=bool), "has shape (7,)"),
    ],
)
def test_bad_files_are_one_line_and_status_two(folder, name, content, message, capsys):
    path = folder / name
    path.unlink()
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        np.save(path, content, allow_pickle=True)
    told = assert_refused(solve(folder, "--mask", str(folder / "mask.npy")), message, capsys)
    assert "pickle" not in told  # Nobody is told to unpickle.
    assert not (folder / "x.npy").exists()


@pytest.mark.parametrize("value", [np.float16(3000), np.float64(1e200), np.float64(1e-200), 7])
def test_right_hand_sides_whose_squares_over_or_underflow(folder, value):
    np.save(folder / "b.npy", np.full(300, value))
    assert solve(folder) == 0
    x = np.load(folder / "x.npy") / float(value)
    assert_allclose(tmg.ToeplitzOperator(contact(300)) @ x, 1.0, rtol=1e-6)


def test_a_mask_in_fragments_is_solved_by_default(folder):
    """CG with default_preconditioner solves it: the V(0,1) cycle would not converge."""
    c = contact(64, 64)
    mask = masks.rough(0.3, 64)
    np.save(folder / "c.npy", c)
    np.save(folder / "b.npy", np.ones(np.count_nonzero(mask)))
    np.save(folder / "mask.npy", mask)
    assert solve(folder, "--mask", str(folder / "mask.npy"), "--maxiter", "12") == 0


def test_a_table_may_be_marked_as_unicode_and_an_archive_is_no_column(folder, capsys):
    np.savez(folder / "c.npz", c=np.ones(3))
    assert_refused(solve(folder, column="c.npz"), "holds several arrays", capsys)
    (folder / "c.csv").write_text("\n".join(map(str, contact(300))), encoding="utf-8-sig")
    assert solve(folder, column="c.csv") == 0


@pytest.mark.filterwarnings("default::UserWarning")
def test_a_warning_is_one_line(folder, capsys):
    np.save(folder / "dense.npy", toeplitz(contact(20)))
    np.save(folder / "b.npy", np.ones(20))
    assert solve(folder, column="dense.npy") == 2
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith("toeplitz-mg: warning: c has shape (20, 20) and is constant along")
    assert second.startswith("toeplitz-mg: error:")


def test_a_column_in_single_precision_is_solved_to_the_usual_residual(folder):
    np.save(folder / "c.npy", contact(300).astype(np.float32))
    assert solve(folder) == 0
    assert np.load(folder / "x.npy").dtype == np.float64


def test_options_count_on_both_sides_of_the_command(folder, capsys):
    names = [str(folder / name) for name in ("c.npy", "b.npy")]
    command = ["solve", *names, "-o", str(folder / "x.npy"), "--overwrite"]
    assert main(["--solver", "cg", "--rtol", "1e-3", *command]) == 0
    assert "CG with" in capsys.readouterr().out
    assert main(["--maxiter", "1", *command, "--rtol", "1e-12", "--solver", "cg"]) in (0, 1)
    assert main(["--test", "3", *command]) == 2
    assert "choose a problem of the paper" in capsys.readouterr().err


def test_the_solution_is_kept_where_drawing_fails(folder, monkeypatch, capsys):
    def fail(*_, **__):
        raise OSError("no ink")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", fail)
    assert solve(folder, "--plot", str(folder / "x.png")) == 2
    assert "no ink" in capsys.readouterr().err
    assert (folder / "x.npy").exists()


def test_plots_need_matplotlib_and_say_so_before_the_work(monkeypatch, capsys, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib", None)  # As if it were not installed.
    status = main(["-n", "300", "--plot", str(tmp_path / "x.png")])
    assert_refused(status, "pip install 'toeplitz-mg[plot]'", capsys)


def test_solves_and_plots_on_a_grid_of_two_axes(folder):
    np.save(folder / "c2.npy", contact(20, 30))
    np.save(folder / "b2.npy", np.ones((20, 30)))
    options = ["--plot", str(folder / "x.svg")]
    assert solve(folder, *options, column="c2.npy", rhs="b2.npy") == 0
    A = tmg.ToeplitzOperator(contact(20, 30))
    assert_allclose(A @ np.load(folder / "x.npy"), 1.0, atol=1e-6)
    drawn = (folder / "x.svg").read_text()
    for label in ("first axis", "second axis", "solution", "iteration"):
        assert f"<!-- {label} -->" in drawn


def width_of(picture):
    """The pixels across a PNG file, as its header says."""
    return int.from_bytes(picture.read_bytes()[16:20], "big")


@pytest.mark.parametrize("command", [["-n", "300"], ["contact", "hertz", "-n", "16"]])
def test_pictures_have_the_dots_that_are_asked_for(command, tmp_path):
    picture = tmp_path / "x.png"
    assert main([*command, "--plot", str(picture), "--dpi", "40"]) == 0
    few = width_of(picture)
    assert main([*command, "--plot", str(picture), "--dpi", "80", "--overwrite"]) == 0
    assert width_of(picture) == 2 * few


@pytest.mark.parametrize("command", [["-n", "300"], ["contact", "hertz"]])
def test_dots_of_no_picture_are_refused(command, tmp_path, capsys):
    plot = "--plot", str(tmp_path / "x.png")
    assert_refused(main([*command, "--dpi", "100"]), "--dpi is given, but no --plot", capsys)
    assert_refused(main([*command, *plot, "--dpi", "5"]), "--dpi is 5, but must be 10 to", capsys)


def test_interruption_writes_nothing(folder, monkeypatch, capsys):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(tmg, "cg", interrupt)
    assert solve(folder) == 130
    assert "interrupted" in capsys.readouterr().err
    assert not (folder / "x.npy").exists()


def test_runs_as_a_module():
    command = [sys.executable, "-m", "toeplitz_mg", "-n", "300"]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "converged" in result.stdout
    version = subprocess.run(
        [*command[:3], "--version"], capture_output=True, text=True, check=True
    )
    assert version.stdout == f"toeplitz-mg {tmg.__version__}\n"


# As people write it ----------------------------------------------------------------------------


def test_whole_numbers_may_have_an_exponent(capsys):
    assert main(["-n", "3e2", "--maxiter", "1e2"]) == 0
    assert "with 300 elements" in capsys.readouterr().out
    for wrong in ("3.5", "1e-2", "many"):
        with pytest.raises(SystemExit) as caught:
            main(["-n", wrong])
        assert caught.value.code == 2
        assert f"argument -n: invalid whole number value: '{wrong}'" in capsys.readouterr().err


def test_a_mask_of_zeros_and_ones(folder):
    mask = np.load(folder / "mask.npy")
    options = ["--mask", str(folder / "mask.npy")]
    assert solve(folder, *options) == 0
    for dtype in (int, float, np.uint8):
        np.save(folder / "mask.npy", mask.astype(dtype))
        assert solve(folder, *options, "--overwrite", x="y.npy") == 0
        assert np.array_equal(np.load(folder / "x.npy"), np.load(folder / "y.npy"))


@pytest.mark.parametrize("on_mask", [False, True])
def test_a_zero_right_hand_side_has_a_zero_solution(folder, on_mask, capsys):
    np.save(folder / "b.npy", np.zeros(300))
    options = ["--mask", str(folder / "mask.npy")] if on_mask else []
    assert solve(folder, *options, "--plot", str(folder / "x.png")) == 0
    assert "converged" in capsys.readouterr().out
    assert np.array_equal(np.load(folder / "x.npy"), np.zeros(300))


@pytest.mark.parametrize(
    ("ending", "mark"), [("csv", ","), ("csv", ";"), ("txt", " "), ("dat", "\t")]
)
def test_files_of_text(folder, ending, mark):
    assert solve(folder) == 0
    for name in ("c", "b"):
        np.savetxt(folder / f"{name}.{ending}", np.load(folder / f"{name}.npy"), delimiter=mark)
    out = f"x.{ending}"
    assert solve(folder, column=f"c.{ending}", rhs=f"b.{ending}", x=out) == 0
    assert np.array_equal(np.loadtxt(folder / out), np.load(folder / "x.npy"))
    np.savetxt(folder / f"c2.{ending}", contact(12, 10), delimiter=mark)
    np.savetxt(folder / f"b2.{ending}", np.ones((12, 10)), delimiter=mark)
    assert solve(folder, "--overwrite", column=f"c2.{ending}", rhs=f"b2.{ending}", x=out) == 0
    assert np.loadtxt(folder / out).shape == (120,)


NO_TABLE = "is not a table of numbers with points for decimals"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *((text, "holds no numbers") for text in ("", " \n", "# A heading and no more\n")),
        *((text, NO_TABLE) for text in ("1 2\n3\n", "one\n", "\udcff")),
        ("0,5;0,3\n0,1;0,2\n", NO_TABLE),  # Decimal commas would be two numbers each.
        ("# a, b\n1,2,3\n4,x,6\n", "line 3 has 'x' in column 2"),
        ("1,2,\n", "line 1 has nothing in column 3"),
        ("1;2;3\n\n4;5\n", "line 3 has 2 numbers, but above are 3"),
    ],
)
def test_text_that_is_no_table_is_refused_in_one_line(folder, text, message, capsys):
    (folder / "c.csv").write_bytes(text.encode(errors="surrogateescape"))
    with warnings.catch_warnings(action="error"):
        assert_refused(solve(folder, column="c.csv"), message, capsys)


@pytest.mark.parametrize(
    ("given", "usage", "message"),
    [
        (["--nonsense"], "", "unrecognized arguments: --nonsense"),
        (["--bogus", "5"], "", "unrecognized arguments: --bogus"),
        (["--bogus=5"], "", "unrecognized arguments: --bogus"),
        (["--bogus", "solve", "c.npy"], "", "unrecognized arguments: --bogus"),
        (["solve", "c.npy", "b.npy", "-o", "x.npy", "--nonsense"], "solve ", "s: --nonsense"),
        (
            ["contact", "hertz", "--nonsense"],
            "contact hertz ",
            "unrecognized arguments: --nonsense",
        ),
        (["contact"], "contact ", "required: CASE"),
    ],
)
def test_an_error_shows_the_usage_of_its_command(given, usage, message, capsys):
    with pytest.raises(SystemExit) as caught:
        main(given)
    assert caught.value.code == 2
    printed = capsys.readouterr().err
    assert printed.startswith(f"usage: toeplitz-mg {usage}[options]")
    assert printed.count("\n") == 3
    assert message in printed


def test_bare_it_shows_the_help_and_options_alone_are_of_the_paper(capsys):
    assert main([]) == 0
    assert "{paper,solve,contact}" in capsys.readouterr().out
    assert main(["-n", "300", "--json"]) == 0
    bare = json.loads(capsys.readouterr().out)
    assert main(["paper", "-n", "300", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["residuals"] == bare["residuals"]


def test_a_file_is_replaced_where_that_is_asked_for(folder, capsys):
    assert solve(folder) == 0
    capsys.readouterr()
    first = (folder / "x.npy").read_bytes()
    np.save(folder / "b.npy", np.ones(300))
    assert_refused(solve(folder), "is there already: --overwrite", capsys)
    assert (folder / "x.npy").read_bytes() == first
    assert solve(folder, "--overwrite") == 0
    assert (folder / "x.npy").read_bytes() != first


def test_without_a_file_the_solution_is_printed(folder, capsys):
    np.save(folder / "c.npy", [2.0, -1.0, 0.0])
    np.save(folder / "b.npy", np.ones(3))
    command = ["solve", str(folder / "c.npy"), str(folder / "b.npy")]
    assert main(command) == 0
    assert "[1.5 2.  1.5]" in capsys.readouterr().out
    assert main([*command, "--json"]) == 0
    assert_allclose(json.loads(capsys.readouterr().out)["solution"], [1.5, 2.0, 1.5])
