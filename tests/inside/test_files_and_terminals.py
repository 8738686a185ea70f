"""Files are written whole or not at all, whoever else writes; a terminal shows what takes long."""

import io
import os
import stat
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from toeplitz_mg.cli import report
from toeplitz_mg.whole_files import new_whole

# Files ------------------------------------------------------------------------------------------


def test_two_that_write_one_file_at_once_write_a_whole_one_each(tmp_path):
    path = tmp_path / "x"
    with new_whole(path) as one, new_whole(path) as other:
        one.write(b"one")
        other.write(b"other")
    assert path.read_bytes() == b"one"  # It is complete last.
    assert os.listdir(tmp_path) == ["x"]


def test_what_replaces_a_file_is_at_no_time_readable_by_more(tmp_path, monkeypatch):
    path = tmp_path / "x"
    path.write_text("his")
    path.chmod(0o600)
    before = []
    monkeypatch.setattr(
        Path, "chmod", lambda part, _: before.append(stat.S_IMODE(part.stat().st_mode))
    )
    with new_whole(path):
        pass
    assert before == [0o600]


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives files away"
)
def test_a_file_keeps_its_owner(tmp_path):
    path = tmp_path / "x"
    path.write_text("his")
    os.chown(path, 12345, 54321)
    with new_whole(path) as file:
        file.write(b"new")
    assert (path.stat().st_uid, path.stat().st_gid) == (12345, 54321)


def test_of_two_that_write_a_new_file_the_second_is_refused(tmp_path):
    """Neither has seen a file when it began."""
    path = tmp_path / "x"

    def write(text, then=lambda: None):
        with new_whole(path, replaces=False) as file:
            file.write(text)
            then()

    with pytest.raises(FileExistsError):
        write(b"one", then=partial(write, b"other"))
    assert path.read_bytes() == b"other"
    assert os.listdir(tmp_path) == ["x"]


def test_so_it_is_where_the_file_system_has_no_links(tmp_path, monkeypatch):
    def fail(*_):
        raise PermissionError("no links here")

    monkeypatch.setattr(os, "link", fail)
    test_of_two_that_write_a_new_file_the_second_is_refused(tmp_path)


# Terminals --------------------------------------------------------------------------------------


class Screen(io.StringIO):
    """A standard error that is a terminal, or is none."""

    def __init__(self, is_terminal):
        super().__init__()
        self.is_terminal = is_terminal

    def isatty(self):
        return self.is_terminal


@pytest.mark.parametrize("is_terminal", [True, False])
@pytest.mark.parametrize("patience", [0.0, 60.0])
def test_a_terminal_shows_what_takes_long_and_erases_it(is_terminal, patience, monkeypatch):
    screen = Screen(is_terminal)
    monkeypatch.setattr(sys, "stderr", screen)
    with report.Waiting("setting up", patience):
        if is_terminal and not patience:
            while not screen.getvalue():  # The thread has not come to it yet.
                time.sleep(0.01)
    shown = screen.getvalue()
    assert bool(shown) == (is_terminal and not patience)
    if shown:
        text = "setting up: 0 s"
        assert shown.startswith(f"\r{text}")
        assert shown.endswith(f"\r{' ' * len(text)}\r")


def test_lines_on_a_terminal_take_the_place_of_what_it_shows(monkeypatch):
    screen = Screen(True)
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(sys, "stdout", screen)
    with report.Waiting("pressing", 0.0) as waiting:
        while not screen.getvalue():  # The thread has not come to it yet.
            time.sleep(0.01)
        waiting.before_line()
        shown = screen.getvalue()
        assert shown.endswith(" \r")  # It is erased before the line comes.
    assert screen.getvalue() == shown


def test_zero_is_printed_as_zero():
    assert report.format_error(0.0, 2) == "0"
    assert report.format_error(1.25e-9, 2) == "1.25e-09"
