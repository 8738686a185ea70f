"""Files of the command line: whole or untouched, and never one in the place of another."""

import io
import os
import socket
import stat
import subprocess
import sys
import threading
import tty
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from comparisons.harness import report
from tests.command_line import MODULE, assert_refused, main

STANDARD_OUTPUT = 1
N = 300  # Unknowns of a system whose solution has 2528 bytes, above the limit of LIMITED.


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder to work in, with a system that is solved at once."""
    monkeypatch.chdir(tmp_path)
    np.save("c.npy", np.r_[4.0, -1.0, np.zeros(N - 2)])
    np.save("b.npy", np.ones(N))
    return tmp_path


def solve(x, *options):
    return main(["solve", "c.npy", "b.npy", "-o", x, "--overwrite", *options])


def press(x, *options):
    return main(["contact", "hertz", "-n", "16", "-o", x, "--overwrite", *options])


def solution():
    A = 4.0 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1)
    return np.linalg.solve(A, np.ones(N))


# What is there already ------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664, 0o777])
def test_a_file_keeps_its_mode(folder, mode):
    path = folder / "x.npy"
    path.write_bytes(b"old")
    path.chmod(mode)
    assert solve("x.npy") == 0
    assert stat.S_IMODE(path.stat().st_mode) == mode
    assert np.load(path).shape == (N,)


def test_a_new_file_has_the_mode_of_any_new_file(folder):
    (folder / "any").write_bytes(b"")
    assert solve("x.npy") == 0
    assert (folder / "x.npy").stat().st_mode == (folder / "any").stat().st_mode


@pytest.mark.parametrize("is_there", [False, True])
def test_a_link_leads_to_what_is_written(folder, is_there):
    if is_there:
        (folder / "x.npy").write_bytes(b"old")
    (folder / "link.npy").symlink_to("x.npy")
    assert solve("link.npy") == 0
    assert os.readlink("link.npy") == "x.npy"
    assert np.load("x.npy").shape == (N,)


def test_a_pipe_is_written_into(folder):
    os.mkfifo("x.npy")
    got = []
    reader = threading.Thread(target=lambda: got.append((folder / "x.npy").read_bytes()))
    reader.daemon = True  # If it waits in vain the test fails and does not hang.
    reader.start()
    assert solve("x.npy") == 0
    assert stat.S_ISFIFO(os.stat("x.npy").st_mode)
    reader.join(10.0)
    assert not reader.is_alive()
    (folder / "y.npy").write_bytes(got[0])
    assert np.allclose(np.load("y.npy"), solution())


def test_a_device_is_written_into(folder):
    ours, theirs = os.openpty()
    try:
        tty.setraw(theirs)
        name = os.ttyname(theirs)
        assert solve(name) == 0
        assert stat.S_ISCHR(os.stat(name).st_mode)
        assert os.read(ours, 100).startswith(b"\x93NUMPY")
    finally:
        os.close(ours)
        os.close(theirs)


def test_a_full_device_is_an_error(folder, monkeypatch, capsys):
    monkeypatch.delattr(os, "replace")  # A failing test must not cost the machine its device.
    assert solve("/dev/full") == 2
    assert "/dev/full cannot be written: No space left on device" in capsys.readouterr().err
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


# What is refused before any work --------------------------------------------------------------


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


@pytest.mark.parametrize("name", ["c.npy", "b.npy", "m.npy", "./c.npy", "hard.npy", "soft.npy"])
def test_what_is_read_is_not_written_over(folder, name, capsys):
    np.save("m.npy", np.ones(N, dtype=bool))
    os.link("c.npy", "hard.npy")
    (folder / "soft.npy").symlink_to("b.npy")
    before = contents(folder)
    refused = f"{Path(name)} is the same file as "
    assert_refused(solve(name, "--mask", "m.npy"), refused, capsys)
    assert contents(folder) == before


def test_a_drawing_does_not_replace_what_is_read(folder, capsys):
    os.rename("c.npy", "c.png")
    command = ["solve", "c.png", "b.npy", "-o", "x.npy", "--plot", "c.png"]
    assert_refused(main(command), "c.png is the same file as c.png, but that one is read", capsys)


@pytest.mark.parametrize("linked", [None, "hard", "soft", "dangling"])
def test_solution_and_drawing_are_two_files(folder, linked, capsys):
    picture = "x.png"
    if linked is not None:
        picture = "y.png"
        if linked != "dangling":
            (folder / "x.png").write_bytes(b"old")
        if linked == "hard":
            os.link("x.png", picture)
        else:
            (folder / picture).symlink_to("x.png")
    message = f"{picture} is the same file as x.png, but each needs its own"
    assert_refused(solve("x.png", "--plot", picture), message, capsys)


def test_neither_a_socket_nor_a_folder_nor_a_link_in_a_circle_is_written(folder, capsys):
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("socket")
        assert_refused(solve("socket"), "socket is neither a file nor a pipe", capsys)
    assert_refused(solve("."), ". is a folder", capsys)
    (folder / "circle").symlink_to("circle")
    assert_refused(solve("circle"), "levels of symbolic links", capsys)
    assert_refused(solve("c.npy/x.npy"), "Not a directory", capsys)
    assert_refused(solve("nowhere/a\nb.npy"), "nowhere is no folder, so a b.npy cannot", capsys)
    (folder / "far").symlink_to("nowhere/x.npy")
    assert_refused(solve("far"), "nowhere is no folder", capsys)


@pytest.mark.parametrize("closed", ["folder", "x.npy"])
def test_what_may_not_be_written_is_refused(folder, closed, monkeypatch, capsys):
    (folder / "folder").mkdir()
    (folder / "folder" / "x.npy").write_bytes(b"old")
    (folder / "x.npy").symlink_to("folder/x.npy")
    # This is not done by chmod, as to root nothing is closed.
    access = os.access
    monkeypatch.setattr(os, "access", lambda p, how: not str(p).endswith(closed) and access(p, how))
    assert_refused(solve("x.npy"), f"{closed} is not writable", capsys)
    assert (folder / "folder" / "x.npy").read_bytes() == b"old"


@contextmanager
def printing_to(descriptor):
    """Redirect the standard output to a file, as a shell does."""
    kept = os.dup(STANDARD_OUTPUT)
    os.dup2(descriptor, STANDARD_OUTPUT)
    try:
        yield
    finally:
        os.dup2(kept, STANDARD_OUTPUT)
        os.close(kept)


def test_the_report_and_the_solution_are_two_files(folder, capsys):
    """Both ``-o /dev/stdout | …`` and ``-o x.npy > x.npy`` would mix them."""
    with open("x.npy", "wb") as file, printing_to(file.fileno()):
        status = solve("x.npy")
    assert_refused(status, "x.npy is the standard output", capsys)
    assert not (folder / "x.npy").read_bytes()
    out, into = os.pipe()
    try:
        with printing_to(into):
            status = solve("/dev/stdout")
        assert_refused(status, "is the standard output", capsys)
    finally:
        os.close(out)
        os.close(into)


# What fails on the way ------------------------------------------------------------------------


ROOT = os.getcwd()
LIMITED = f"""
import resource, signal, sys
from {MODULE} import main
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
codes = [main(line.split()) for line in sys.stdin.read().splitlines()]
assert codes == [2, 2], codes
"""


def test_a_full_disk_loses_no_file(folder):
    """What is longer than allowed is cut off by the system, in the middle of a file."""
    lines = [
        f"{c} --overwrite" for c in ("solve c.npy b.npy -o x.npy", "contact hertz -n 16 -o x.npz")
    ]
    for name in ("x.npy", "x.npz"):
        (folder / name).write_bytes(b"precious")
    before = contents(folder)
    result = subprocess.run(
        [sys.executable, "-c", LIMITED],
        input="\n".join(lines),
        capture_output=True,
        text=True,
        check=False,
        # It finds the packages where this process does.
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, [ROOT, *sys.path]))},
    )
    assert result.returncode == 0, result.stderr
    assert result.stderr.count("cannot be written: File too large\n") == 2
    assert result.stderr.count("\n") == 2
    assert contents(folder) == before


@pytest.mark.parametrize("step", ["fsync", "replace", "chmod"])
@pytest.mark.parametrize("error", [OSError("no more"), KeyboardInterrupt()], ids=repr)
@pytest.mark.parametrize(("command", "x"), [(solve, "x.npy"), (press, "x.npz")])
def test_a_step_that_fails_loses_no_file(folder, step, error, command, x, monkeypatch, capsys):
    (folder / x).write_bytes(b"precious")
    before = contents(folder)

    def fail(*_, **__):
        raise error

    monkeypatch.setattr(os, step, fail)
    assert command(x) == (130 if isinstance(error, KeyboardInterrupt) else 2)
    assert capsys.readouterr().err.count("\n") == 1
    assert contents(folder) == before


@pytest.mark.parametrize("x", ["x.npy", "x.npz", "x.png"])
def test_a_file_that_has_come_meanwhile_is_not_replaced(folder, x, monkeypatch, capsys):
    class Meanwhile(io.StringIO):
        def write(self, text):
            return (folder / x).write_bytes(b"his")

    case = "solve c.npy b.npy -o" if x == "x.npy" else "contact hertz -n 16 -o"
    monkeypatch.setattr(sys, "stdout", Meanwhile())
    assert main([*(case if x != "x.png" else "paper -n 64 --plot").split(), x]) == 2
    assert f"{x} is there already: --overwrite replaces it" in capsys.readouterr().err
    assert contents(folder)[x] == b"his"


@pytest.mark.parametrize("old", [True, False])
def test_tables_and_figures_of_comparisons_are_whole_or_not_there(tmp_path, old, monkeypatch):
    from matplotlib.figure import Figure

    def fail(*_):
        raise OSError("no more")

    for name in ("t.csv", "t.png") if old else ():
        (tmp_path / name).write_bytes(b"precious")
    before = contents(tmp_path)
    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="no more"):
        report.write_csv(tmp_path / "t.csv", [{"γ": 1}])
    with pytest.raises(OSError, match="no more"):
        report.write_figure(tmp_path / "t.png", Figure(), dpi=20)
    assert contents(tmp_path) == before


# What is read ---------------------------------------------------------------------------------


def npy(header):
    """A file of NumPy's, with this in its header."""
    line = header.encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + len(line).to_bytes(2, "little") + line


@pytest.mark.parametrize(
    "content",
    [
        npy("-" * 3000 + "1"),
        npy("-" * 9000 + "1"),
        npy("(" * 3000),
        npy("'''"),
        npy("{'descr': '<f8', 'fortran_order': False, 'shape': (1" + 30 * "0" + ",)}"),
        npy("{'descr': '<f8', 'fortran_order': False, 'shape': (-3,)}"),
        npy("{'descr': '|O', 'fortran_order': False, 'shape': (3,)}"),
        npy("{'descr': '<f8', 'fortran_order': False, 'shape': (3,)}") + b"too short",
        b"\x80\x04N.",
        b"\x93NUMPY\x09\x00",
    ],
    ids=lambda content: repr(content[10:30]),
)
def test_no_file_is_more_than_one_line(folder, content, capsys):
    (folder / "c.npy").write_bytes(content)
    assert_refused(solve("x.npy"), "c.npy ", capsys)


def test_names_of_any_bytes_are_solved_printed_and_drawn(folder, capsys):
    for name in (os.fsdecode(b"\xff"), "a$b^^$"):
        os.link("c.npy", f"{name}.npy")
        command = ["solve", f"{name}.npy", "b.npy", "-o", "x.npy", "--plot", "x.png"]
        assert main([*command, "--overwrite"]) == 0, capsys.readouterr().err
