"""What is imported, Ctrl-C meanwhile, and a terminal that cannot print everything."""

import errno
import io
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

import toeplitz_mg as tmg
from tests.command_line import MODULE, main

ROOT = os.getcwd()
# Instead of NumPy: it interrupts its own import, and swallows what an exception could do.
NUMPY = """
import os, signal
try:
    os.kill(os.getpid(), signal.SIGINT)
    print("goes on")
except BaseException as error:
    print(type(error).__name__)
raise SystemExit(7)
"""
SCRIPT = f"import sys\nfrom {MODULE} import main\nsys.exit(main())\n"


def environment(*folders):
    """That of a program which finds this package, and before it what is in these folders."""
    return os.environ | {"PYTHONPATH": os.pathsep.join([*folders, ROOT, *filter(None, sys.path)])}


def interrupted(folder, *command):
    (folder / "numpy").mkdir(exist_ok=True)
    (folder / "numpy" / "__init__.py").write_text(NUMPY)
    return subprocess.run(
        [sys.executable, *command],
        capture_output=True,
        text=True,
        check=False,
        env=environment(str(folder)),
        # A job in the background, as CI may be, has its programs ignore the signal.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


ROOMS = ["contact", "covariances", "fractional", "halfspace", "paper", "slabs"]
SLOW = {"scipy.optimize", "scipy.stats", "matplotlib", "mpi4py", "array_api_compat", "xarray"}


@pytest.mark.parametrize(
    ("then", "waits"),
    [
        ("tmg.solve_toeplitz([2.0, 1.0], [1.0, 1.0])", {f"toeplitz_mg.{x}" for x in ROOMS} | SLOW),
        ("[getattr(tmg, name) for name in dir(tmg)]", SLOW),
        ("from toeplitz_mg import *; contact, ToeplitzNormal", SLOW),
    ],
)
def test_what_is_slow_to_import_waits_until_it_is_needed(then, waits):
    program = f"import sys, toeplitz_mg as tmg; {then}; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert not waits & set(done.stdout.split())


def test_what_is_shown_is_public_and_all_of_it():
    assert set(dir(tmg)) == {*tmg.__all__, *ROOMS, "__version__"}
    for package in (tmg.contact, tmg.contact.surfaces):
        assert dir(package) == sorted(package.__all__)
    assert "Material" in dir(tmg.contact)
    assert "wavy" in dir(tmg.contact.surfaces)
    with pytest.raises(AttributeError, match="has no attribute 'contct'"):
        tmg.contct  # noqa: B018


@pytest.mark.parametrize("how", [["-m", "toeplitz_mg"], ["-mtoeplitz_mg"], ["toeplitz-mg"]])
def test_interrupting_the_imports_is_one_line_and_status_130(how, tmp_path):
    (tmp_path / "toeplitz-mg").write_text(SCRIPT)
    how = [str(tmp_path / name) if name == "toeplitz-mg" else name for name in how]
    result = interrupted(tmp_path, *how, "-n", "300")
    assert (result.returncode, result.stdout) == (130, "")
    assert result.stderr == "toeplitz-mg: interrupted\n"


@pytest.mark.parametrize(
    "how",
    [["-m", "other"], ["other.py"], ["-c", "import toeplitz_mg"], ["-m", "package", "toeplitz_mg"]],
)
def test_in_any_other_program_ctrl_c_is_an_exception(how, tmp_path):
    """`python -m package` imports it while it still looks for the module to run."""
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "__main__.py").write_text("")
    for name in ("other.py", "package/__init__.py"):
        (tmp_path / name).write_text("import toeplitz_mg")
    how = [str(tmp_path / name) if name == "other.py" else name for name in how]
    result = interrupted(tmp_path, *how)
    assert (result.returncode, result.stdout) == (7, "KeyboardInterrupt\n")


@pytest.mark.parametrize("closed", [">&-", "2>&-"])
def test_a_result_is_written_where_nothing_can_be_printed(closed, tmp_path):
    """A daemon starts programs so."""
    np.save(tmp_path / "c.npy", np.array([2.0, -1.0, 0.0]))
    np.save(tmp_path / "b.npy", np.ones(3))
    command = f'"{sys.executable}" -m toeplitz_mg solve c.npy b.npy -o x.npy {closed}'
    subprocess.run(["bash", "-c", command], cwd=tmp_path, env=environment(), check=True)
    np.testing.assert_allclose(np.load(tmp_path / "x.npy"), [1.5, 2.0, 1.5])


# What can be printed --------------------------------------------------------------------------


class Terminal(io.RawIOBase):
    """A terminal that takes what is printed until there is a word in it."""

    def __init__(self, last=None):
        self.printed, self.last = b"", last

    def writable(self):
        return True

    def write(self, data):
        if self.last is not None and self.last in bytes(data):
            raise OSError(errno.ENOSPC, "No space left on device")
        self.printed += bytes(data)
        return len(data)


@pytest.fixture
def terminal(monkeypatch):
    """Put an ASCII terminal in the place of the standard output."""
    connected = []

    def connect(last=None):
        buffer = io.BufferedWriter(Terminal(last))
        connected.append(io.TextIOWrapper(buffer, "ascii", line_buffering=True))
        monkeypatch.setattr(sys, "stdout", connected[-1])
        return buffer.raw

    yield connect
    for stream in connected:  # It is to be closed without a complaint.
        stream.buffer.raw.last = None
        stream.close()


@pytest.mark.parametrize(
    "command",
    ["-n 300", "contact hertz -n 16", "contact rolling --line -n 16"],
)
def test_an_ascii_terminal_loses_no_result(command, terminal, tmp_path, capsys):
    there = terminal()
    files = ["-o", str(tmp_path / "Γ.npz")] if "contact" in command else []
    assert main([*command.split(), *files, "--plot", str(tmp_path / "Γ.png")]) == 0
    assert not capsys.readouterr().err
    assert b"drawn in" in there.printed
    assert (b"mm\\xb2" in there.printed) == ("contact" in command)
    assert len(list(tmp_path.iterdir())) == 1 + bool(files)


@pytest.mark.parametrize("command", [[], ["solve"], ["contact"]])
def test_an_ascii_terminal_shows_the_help(command, terminal):
    there = terminal()
    with pytest.raises(SystemExit) as caught:
        main([*command, "--help"])
    sys.stdout.flush()
    assert caught.value.code == 0
    assert b"usage: toeplitz-mg" in there.printed


@pytest.mark.parametrize("last", [b"seconds", b"this run"])
def test_the_result_is_written_even_where_the_report_cannot_be(last, terminal, tmp_path, capsys):
    """A full disk of the log costs nothing but the log."""
    np.save(tmp_path / "c.npy", np.array([2.0, -1.0, 0.0]))
    np.save(tmp_path / "b.npy", np.ones(3))
    names = [str(tmp_path / name) for name in ("c.npy", "b.npy")]
    for command in (["solve", *names], ["contact", "hertz", "-n", "16"]):
        path = tmp_path / ("x.npy" if "solve" in command else "x.npz")
        terminal(last)
        assert main([*command, "-o", str(path)]) == 2
        assert path.exists()
        captured = capsys.readouterr().err
        assert "No space left on device" in captured
        assert captured.count("\n") == 1


@pytest.mark.parametrize(
    ("command", "written"),
    [
        ("solve c.npy b.npy -o x.npy --plot x.png", {"x.npy", "x.png"}),
        ("contact hertz -n 32 -o x.npz", {"x.npz"}),
        ("-n 300 --plot x.png", {"x.png"}),
        ("-n 300", set()),
    ],
)
def test_files_are_written_though_the_reader_of_the_report_has_left(command, written, tmp_path):
    """As in ``toeplitz-mg solve … -o x.npy | head -1``."""
    np.save(tmp_path / "c.npy", 1.0 / (1.0 + np.arange(300)))
    np.save(tmp_path / "b.npy", np.ones(300))
    before = set(os.listdir(tmp_path))
    with subprocess.Popen(
        [sys.executable, "-m", "toeplitz_mg", *command.split()],
        cwd=tmp_path,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        process.stdout.close()  # Before anything is printed.
        assert not process.stderr.read()
    assert process.returncode == 141
    assert set(os.listdir(tmp_path)) - before == written


def test_a_report_that_nobody_reads_is_one_line(tmp_path):
    """There is no traceback of the interpreter, which tries again at exit."""
    with open("/dev/full", "w") as full:
        result = subprocess.run(
            [sys.executable, "-m", "toeplitz_mg", "-n", "300"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert result.returncode == 2
    assert result.stderr == "toeplitz-mg: error: [Errno 28] No space left on device\n"
