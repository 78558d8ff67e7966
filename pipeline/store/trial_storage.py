"""Storage of trials: the folder's journal, an SQLite file, or a PostgreSQL database.

Messages show an address without its password: that is how SQLAlchemy prints one.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from optuna.exceptions import StorageInternalError
from optuna.storages import BaseStorage, JournalStorage, RDBStorage
from optuna.storages.journal import JournalFileBackend
from sqlalchemy import URL, NullPool, make_url
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from dogshape.pipeline.store.claims import KEEPALIVE, Claims, OneFile, Shared
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import drop_torn_line
from dogshape.sim.errors import StorageError
from dogshape.sim.files import naming

DRIVER = "postgresql+psycopg"  #: of the extra 'machines'


@contextmanager
def opening(
    folder: StudyFolder, url: str | None, study: str
) -> Iterator[tuple[BaseStorage, Claims]]:
    """Open the storage of a study, and hold off other runs while the block looks into it.

    The claims stay the caller's to close, except where the block fails. Raises StorageError
    where the storage cannot be opened.
    """
    if url is None:
        yield _journal(folder), Claims()
        return
    address = _address(url)
    with _opened(address), _claims(address, study) as claims:
        full = address.render_as_string(hide_password=False)
        if isinstance(claims, Shared):
            with claims.opening():
                settings = {"poolclass": NullPool, "connect_args": dict(KEEPALIVE)}
                yield RDBStorage(full, settings), claims
        else:
            yield RDBStorage(full), claims


@contextmanager
def _claims(address: URL, study: str) -> Iterator[Claims]:
    """Make claims, and close them where the block fails."""
    claims = Claims()  # of a database in memory
    if address.drivername == DRIVER:
        claims = Shared(address, study)
    elif address.database not in (None, "", ":memory:"):
        claims = OneFile(Path(str(address.database)))
    try:
        yield claims
    except BaseException:
        claims.close()
        raise


def _journal(folder: StudyFolder) -> BaseStorage:
    """Open the folder's journal; the folder is locked, so its leftovers are of a killed run."""
    path = folder.trials
    path.with_name(f"{path.name}.lock").unlink(missing_ok=True)
    if path.exists():
        drop_torn_line(path)
    try:
        return JournalStorage(_TrialsFile(path))
    except OSError:
        raise
    except Exception as error:
        raise StorageError(
            f"{path}{_first_bad_line(path)} is damaged; remove the file and run again with "
            "--resume: finished shifts are kept in shifts.jsonl and not simulated again"
        ) from error


class _TrialsFile(JournalFileBackend):
    """Optuna's journal file, which names itself where the disk is full."""

    def __init__(self, path: Path) -> None:
        super().__init__(str(path))
        self._path = path

    def append_logs(self, logs: list[dict[str, Any]]) -> None:
        """Append lines of the journal."""
        with naming(self._path):
            super().append_logs(logs)


def _first_bad_line(path: Path) -> str:
    for number, line in enumerate(path.read_bytes().splitlines(), start=1):
        try:
            json.loads(line)
        except ValueError:
            return f", line {number}"
    return ""


def _address(url: str) -> URL:
    """Return an address with the driver that we bring; refuse databases that we do not know."""
    try:
        address = make_url(url.replace("postgres://", "postgresql://", 1))
    except ArgumentError as error:
        raise StorageError(
            f"--storage is '{url}', which is not the address of a database; "
            "write for instance postgresql+psycopg://user@host/database"
        ) from error
    if address.drivername == "postgresql":
        address = address.set(drivername=DRIVER)
    if address.drivername not in (DRIVER, "sqlite"):
        raise StorageError(
            f"--storage is of '{address.drivername}', but a study is kept in {DRIVER} or sqlite; "
            "give such an address, or leave it out for a file in the study's folder"
        )
    return address


@contextmanager
def _opened(address: URL) -> Iterator[None]:
    """Turn what can be wrong with a database into one sentence."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise StorageError(
            f"the storage {address} needs {error.name}; install the extra: "
            "pip install -c constraints.txt '.[machines]'"
        ) from error
    except (SQLAlchemyError, StorageInternalError, RuntimeError, OSError) as error:
        raise StorageError(
            f"the storage {address} cannot be opened ({_reason(error)}); check the address and "
            "that its server runs"
        ) from error


@contextmanager
def kept(url: str | None, folder: StudyFolder) -> Iterator[None]:
    """Turn the loss of a database in mid-run into one sentence."""
    try:
        yield
    except (SQLAlchemyError, StorageInternalError) as error:
        where = "its file" if url is None else _address(url)
        raise StorageError(
            f"the storage {where} was lost ({_reason(error)}); finished shifts are kept in "
            f"{folder.root}, and --resume goes on when it is back"
        ) from error


def _reason(error: BaseException) -> str:
    if isinstance(error, StorageInternalError) and error.__cause__ is not None:
        error = error.__cause__
    return str(getattr(error, "orig", None) or error).strip().split("\n")[0]
