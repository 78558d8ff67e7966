"""Files that last: written whole, and on the disk before anything rests on them.

A rename may reach the disk before the content does, and a new name after it: the content is forced
to the disk, then the name is exchanged, then the folder is forced. One writer holds a folder.
"""

from __future__ import annotations

import errno
import fcntl
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.sim.errors import StorageError

if TYPE_CHECKING:
    from pandas import DataFrame


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file so that a kill or a power cut leaves the old one or the new one, whole.

    Text is written as UTF-8. Raises OSError, which names the file.
    """
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    data = content.encode() if isinstance(content, str) else content
    with naming(path):
        try:
            with part.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.replace(part, path)
        except BaseException:
            part.unlink(missing_ok=True)
            raise
        sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Force the names in a folder to the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno != errno.EINVAL:  # some network file systems know no such thing
            raise
    finally:
        os.close(descriptor)


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Add the file to an OSError that names none, as a full disk raises, or another one."""
    try:
        yield
    except OSError as error:
        error.filename = str(path)
        raise


def without_formulas(frame: DataFrame) -> DataFrame:
    """Put an apostrophe before texts that a spreadsheet would take for formulas.

    Numbers with a sign stay. A name such as ``=HYPERLINK(...)`` would run in a spreadsheet.
    """

    def safe(cell: Any) -> Any:
        return f"'{cell}" if isinstance(cell, str) and is_formula(cell) else cell

    texts = [name for name in frame.columns if frame[name].dtype.kind not in "biufc"]
    columns = {name: safe(name) for name in frame.columns}
    return frame.assign(**{name: frame[name].map(safe) for name in texts}).rename(columns=columns)


def is_formula(text: str) -> bool:
    """Test that a spreadsheet would take a text for a formula."""
    if len(text) < 2 or text[0] not in "=+-@\t\r":
        return False
    try:
        float(text)
    except ValueError:
        return True
    return False


def write_frame(frame: DataFrame, path: Path, digits: int = 9) -> None:
    """Write a frame as a workbook where the path ends in ``.xlsx``, else as CSV with ``digits``."""
    with naming(path):
        if path.suffix.lower() == ".xlsx":
            without_formulas(frame).to_excel(path, index=False)
        else:
            frame = without_formulas(frame)
            frame.to_csv(path, index=False, float_format=f"%.{digits}g", lineterminator="\n")


PAUSE = 0.2  #: s between two tries to hold a folder


@contextmanager
def writing(
    root: Path, patience: float = 0.0, say: Callable[[str], None] | None = None
) -> Iterator[None]:
    """Hold a folder for writing, made where it is missing; another writer raises StorageError.

    That it does after ``patience`` s of waiting, of which ``say`` tells. The lock is the operating
    system's and ends with the process, killed or not.
    """
    until = time.monotonic() + patience
    try:
        root.mkdir(parents=True, exist_ok=True)
        handle = (root / ".lock").open("w")
    except OSError as error:
        raise StorageError(
            f"{root} cannot be written ({error.strerror}); choose another folder"
        ) from error
    with handle:
        while True:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except OSError:
                if time.monotonic() >= until:
                    raise StorageError(
                        f"{root} is in use by another run; wait for it or choose another folder"
                    ) from None
                if say is not None:
                    say(f"waiting for another run that uses {root}")
                    say = None
            time.sleep(PAUSE)
        yield
