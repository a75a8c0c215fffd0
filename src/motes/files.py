"""Files that appear whole or not at all: temporary name, fsync, rename.

Everything that motes writes goes through here, so a crash, a full disk or a killed process leaves
either the old file or the new one, and a fault of the file system is one clear line.
"""

from __future__ import annotations

import errno
import os
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from motes.errors import OutputError

PART = ".part"
"""Second to last suffix of a file that is being written: `.sheet.5f2a91c4.part.png`."""

STALE = 3600.0
"""Age after which a temporary file belongs to a process that is gone [s]."""


def fault(action: str, path: Path, error: OSError) -> OutputError:
    """The error for a file: `cannot write out/sheet.png: Permission denied.`"""
    reason = error.strerror or str(error) or type(error).__name__
    hint = " Free some space and run again." if error.errno == errno.ENOSPC else ""
    return OutputError(f"cannot {action} {path}: {reason}.{hint}")


@contextmanager
def finished(path: Path, lasting: bool = True) -> Iterator[Path]:
    """Give a temporary name in the same folder; rename it to `path` when the block succeeds.

    The name keeps the suffix of `path`, for encoders that choose the format by it. The folder is
    made where it does not exist. What is not `lasting` is not waited for until it is on the disk:
    it may be lost or torn when the power fails, so it must be checked when it is read.

    Raises:
        OutputError: the folder or the file cannot be written.
    """
    unique = f".{path.stem}.{secrets.token_hex(4)}{PART}{path.suffix}"
    temporary = path.with_name(unique)
    try:
        make_folder(path.parent)
        yield temporary
        if lasting:
            _sync(temporary)
        os.replace(temporary, path)
        if lasting and os.name == "posix":
            _sync(path.parent)
    except OSError as error:
        raise fault("write", path, error) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextmanager
def written_whole(path: Path, lasting: bool = True) -> Iterator[BinaryIO]:
    """Open a file for writing that appears under its name complete or not at all.

    `lasting` is that of `finished`.

    Raises:
        OutputError: the folder or the file cannot be written.
    """
    with finished(path, lasting) as temporary, open(temporary, "xb") as file:
        yield file


def make_folder(folder: Path) -> None:
    """Make a folder, and those around it, where they do not exist.

    Raises:
        OutputError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise fault("make the folder", folder, error) from error


def content(path: Path) -> bytes:
    """All bytes of a file.

    Raises:
        OutputError: the file cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise fault("read", path, error) from error


def sweep(folder: Path) -> None:
    """Remove temporary files that processes which were killed have left in a folder."""
    oldest = time.time() - STALE
    for leftover in folder.glob(f".*{PART}*"):
        with suppress(OSError):
            if leftover.stat().st_mtime < oldest:
                leftover.unlink()


def _sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    flags = os.O_RDONLY if path.is_dir() else os.O_RDWR
    handle = os.open(path, flags)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
