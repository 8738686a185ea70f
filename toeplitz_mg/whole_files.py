"""Files that are written whole or not at all: beside the old one, which they then replace."""

import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO


def find_status(path: Path) -> os.stat_result | None:
    """Return what `path` is, behind its links; None where there is nothing yet."""
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def find_target(path: Path) -> Path:
    """Return where a link leads, so that it stays a link to what is written."""
    return Path(os.path.realpath(path))


def check_folder(path: Path) -> None:
    """Raise OSError where a regular file could not be written beside what is there, or replace it.

    It has to be in the same folder, as only there one file replaces another in a single step.
    """
    folder = find_target(path).parent
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder} is no folder, so {path.name} cannot be written")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(f"{folder} is not writable, so {path.name} cannot be written")
    if find_status(path) is not None and not os.access(path, os.W_OK):
        raise PermissionError(f"{path} is not writable")


def find_part(target: Path, token: str | None = None) -> Path:
    """Return the name of what is not yet whole, a new one unless a token is given."""
    return target.with_name(f".{token or secrets.token_hex(8)}.part")


@contextmanager
def new_part(part: Path, old: os.stat_result | None) -> Iterator[BinaryIO]:
    """Open a new file, never readable by more than the old one, whose owner and rights it gets."""
    mode = 0o666 if old is None else stat.S_IMODE(old.st_mode)
    with open(part, "xb", opener=lambda name, flags: os.open(name, flags, mode)) as file:
        if old is not None:
            with suppress(PermissionError, AttributeError):  # Only root may, and not on Windows.
                os.chown(part, old.st_uid, old.st_gid)
            part.chmod(mode)
        yield file
        complete(file)


@contextmanager
def new_whole(path: Path, *, replaces: bool = True) -> Iterator[BinaryIO]:
    """Open a file that takes the place of what is at `path` when it is whole, and else none.

    Where it must not replace another, and one has come in the meantime, FileExistsError is raised.
    """
    target = find_target(path)
    part = find_part(target)
    try:
        with new_part(part, find_status(path)) as file:
            yield file
        if not replaces:
            _claim(part, target)
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)


def _claim(part: Path, target: Path) -> None:
    """Take a name in one step, as two processes may want it, or raise FileExistsError."""
    try:
        os.link(part, target)
    except FileExistsError:
        raise
    except OSError:  # The file system has no links: the name is taken by an empty file.
        os.close(os.open(target, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))


def complete(file: BinaryIO) -> None:
    """Write what is not yet on the disk, which may be noticed to be full only here."""
    file.flush()
    os.fsync(file.fileno())
