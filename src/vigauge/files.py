"""Writing results: all or nothing, so that a killed run leaves no half file."""

from __future__ import annotations

import csv
import glob
import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from .errors import OutputError


@contextmanager
def atomic_path(target: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path beside ``target``, renamed onto it when the block ends well.

    The temporary name keeps the ending, which many writers look at. On an error the
    temporary file is removed and ``target`` is left as it was. What a killed process left
    behind under such a name is removed too.

    Raises OutputError where the operating system refuses: full disk, no permission. A block
    that wrote nothing is a defect of the caller: FileNotFoundError.
    """
    target = Path(target)
    temporary = target.with_name(f".{target.stem}.{os.getpid()}{target.suffix}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        remove_leftovers(target)
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        _remove(temporary)
        if isinstance(error, FileNotFoundError):
            raise
        raise OutputError(
            f"{target}: cannot be written: {error.strerror or error}; nothing was changed"
        ) from error
    except BaseException:
        _remove(temporary)
        raise


@contextmanager
def atomic_folder(target: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary folder beside ``target``, which takes its place when the block ends well.

    A folder that is there is replaced then; on an error it stays as it was. What a killed process left
    behind is removed.

    Raises OutputError where the operating system refuses: full disk, no permission.
    """
    target = Path(target)
    temporary, old = (
        target.with_name(f".{target.stem}{word}.{os.getpid()}{target.suffix}") for word in ("", ".old")
    )
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        remove_leftovers(target)
        temporary.mkdir()
        yield temporary
        if target.exists():
            target.rename(old)
        temporary.rename(target)
    except OSError as error:
        raise OutputError(
            f"{target}: cannot be written: {error.strerror or error}; nothing was changed"
        ) from error
    finally:
        for folder in (temporary, old):
            shutil.rmtree(folder, ignore_errors=True)


def _remove(temporary: Path) -> None:
    # A folder that may not be written is why the file could not be made: there is none then.
    with suppress(PermissionError, NotADirectoryError):
        temporary.unlink(missing_ok=True)


def remove_leftovers(target: Path) -> None:
    """Delete temporary files or folders of this target whose process is no longer there."""
    for file in target.parent.glob(f".{glob.escape(target.stem)}.*{glob.escape(target.suffix)}"):
        middle = file.name[len(target.stem) + 2 : len(file.name) - len(target.suffix)]
        if middle.isdigit() and not _runs(int(middle)):
            if file.is_dir():
                shutil.rmtree(file)
            else:
                file.unlink(missing_ok=True)


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def write_text(target: str | os.PathLike[str], text: str) -> None:
    """Write a text file, all or nothing; line ends stay as they are."""
    with atomic_path(target) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_json(target: str | os.PathLike[str], value: Any) -> None:
    """Write JSON with sorted keys, all or nothing; NaN is refused."""
    write_text(target, json.dumps(value, indent=2, sort_keys=True, allow_nan=False) + "\n")


def write_rows(target: str | os.PathLike[str], rows: Sequence[Mapping[str, object]]) -> None:
    """Write rows of equal keys as CSV, all or nothing. Floats keep all their digits."""
    with atomic_path(target) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, fieldnames=list(rows[0]) if rows else [], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def read_rows(source: str | os.PathLike[str]) -> list[dict[str, str]]:
    """The rows of a CSV file that :func:`write_rows` wrote, as text by column."""
    with Path(source).open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))
