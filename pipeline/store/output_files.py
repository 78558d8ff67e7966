"""Files that a command is to write, tried before the work that fills them."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

from dogshape.sim.errors import StorageError


def require_targets(
    targets: Mapping[str, Path | None], endings: Mapping[str, tuple[str, ...]] | None = None,
    *, folders: bool = False,
) -> None:  # fmt: skip
    """Raise StorageError unless the files that options name can be written; None is not asked for.

    ``endings`` are those that the name of an option's file may have; a device may have any. No file
    that is there changes; ``folders`` makes folders that are missing. A disk that has room now may
    be full later.
    """
    for option, path in targets.items():
        if path is not None:
            fit = (endings or {}).get(option, (path.suffix.lower(),))
            if path.suffix.lower() not in fit and (path.is_file() or not path.exists()):
                raise StorageError(f"{option} is {path}, but its file must end in {fit[0]}; "
                                   f"write for instance {path.with_suffix(fit[0])}")  # fmt: skip
            _require_target(option, path, folders)


def _require_target(option: str, path: Path, folders: bool) -> None:
    if path.is_dir():
        raise StorageError(f"{option} is {path}, which is a folder; name a file")
    try:
        if path.is_file():
            path.open("ab").close()
        elif not path.exists():  # a device or a pipe is left alone
            if folders:
                path.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=path.parent):
                pass
    except FileNotFoundError as error:
        raise StorageError(
            f"{option} is {path}, but there is no folder {path.parent}; make it or name another "
            "file"
        ) from error
    except OSError as error:
        raise StorageError(
            f"{option} is {path}, which cannot be written ({error.strerror}); name another file"
        ) from error
