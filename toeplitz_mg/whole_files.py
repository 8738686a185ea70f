"""Write files completely or not at all: to a temporary file, which then replaces the old one."""

import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO


def find_status(path: Path) -> os.stat_result | None:
    """Return the status of the file at `path`, following links; None if there is none."""
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def find_target(path: Path) -> Path:
    """Return the target of a link, so that writing does not replace the link itself."""
    return Path(os.path.realpath(path))


def check_folder(path: Path) -> None:
    """Raise an OSError if a file cannot be written beside `path` or cannot replace it.

    It must be in the same folder, because only there can one file replace another atomically.
    """
    folder = find_target(path).parent
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder} is no folder, so {path.name} cannot be written")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(f"{folder} is not writable, so {path.name} cannot be written")
    if find_status(path) is not None and not os.access(path, os.W_OK):
        raise PermissionError(f"{path} is not writable")


def find_part(target: Path, token: str | None = None) -> Path:
    """Return the name of a temporary file, a new one unless a token is given."""
    return target.with_name(f".{token or secrets.token_hex(8)}.part")


@contextmanager
def new_part(part: Path, old: os.stat_result | None) -> Iterator[BinaryIO]:
    """Open a new file with the owner and rights of the old one, never readable by more users."""
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
    """Open a file that replaces the one at `path` when it is complete.

    Raises a FileExistsError if it must not replace another file, but one now exists.
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
    """Take a name atomically (another process may want it), or raise a FileExistsError."""
    try:
        os.link(part, target)
    except FileExistsError:
        raise
    except OSError:  # The file system has no links: an empty file takes the name.
        os.close(os.open(target, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))


def complete(file: BinaryIO) -> None:
    """Flush a file to the disk; an error such as a full disk may occur only here."""
    file.flush()
    os.fsync(file.fileno())
