"""Durable files: atomic writes, and frames that spreadsheets open safely.

A rename may reach the disk before the content does, and a new name after it: the content is forced
to the disk, then the name is exchanged, then the folder is forced.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pandas import DataFrame


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file atomically: a kill or a power cut leaves the old or the new content.

    Text is written as UTF-8. Raises OSError, which names the file.
    """
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    data = content.encode() if isinstance(content, str) else content
    with name_file_in_errors(path):
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
        if error.errno != errno.EINVAL:  # some network file systems cannot do it
            raise
    finally:
        os.close(descriptor)


@contextmanager
def name_file_in_errors(path: Path) -> Iterator[None]:
    """Set the file name of any OSError to ``path``; that of a full disk has none."""
    try:
        yield
    except OSError as error:
        error.filename = str(path)
        raise


def without_formulas(frame: DataFrame) -> DataFrame:
    """Put an apostrophe before texts that a spreadsheet would run as formulas.

    Numbers with a sign stay. A name such as ``=HYPERLINK(...)`` would run in a spreadsheet.
    """

    def escape(cell: Any) -> Any:
        return f"'{cell}" if isinstance(cell, str) and is_formula(cell) else cell

    text_columns = [name for name in frame.columns if frame[name].dtype.kind not in "biufc"]
    escaped_columns = {name: frame[name].map(escape) for name in text_columns}
    escaped_names = {name: escape(name) for name in frame.columns}
    return frame.assign(**escaped_columns).rename(columns=escaped_names)


def is_formula(text: str) -> bool:
    """Test whether a spreadsheet would run ``text`` as a formula."""
    if len(text) < 2 or text[0] not in "=+-@\t\r":
        return False
    try:
        float(text)
    except ValueError:
        return True
    return False


def write_frame(frame: DataFrame, path: Path, digits: int = 9) -> None:
    """Write a frame as a workbook (``.xlsx``), else as CSV with ``digits`` significant digits."""
    safe_frame = without_formulas(frame)
    with name_file_in_errors(path):
        if path.suffix.lower() == ".xlsx":
            safe_frame.to_excel(path, index=False)
            return
        number_format = f"%.{digits}g"
        safe_frame.to_csv(path, index=False, float_format=number_format, lineterminator="\n")
