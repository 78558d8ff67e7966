"""Storage of trials: the folder's journal, or a PostgreSQL database that machines share.

A folder belongs to one run, so a trial that is running there was cut off. Runs that share a
database (``Sharing``) record a heartbeat for each trial that they are at; a trial without one for
``SILENCE_S`` fails, and waits under another number with its parameters. One run at a time proposes.
"""

from __future__ import annotations

import os
import threading
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from optuna.exceptions import StorageInternalError
from optuna.storages import (
    BaseStorage,
    JournalStorage,
    RDBStorage,
    RetryHeartbeatStaleTrialCallback,
)
from optuna.storages.journal import JournalFileBackend
from sqlalchemy import URL, NullPool, create_engine, make_url, text
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from dogshape.pipeline.store.folder import StudyFolder
from dogshape.sim.errors import StorageError
from dogshape.sim.interface import argument

DRIVER = "postgresql+psycopg"  #: of the extra 'machines'
HEARTBEAT_S = 5  #: time between heartbeats of a trial, s
SILENCE_S = 60  #: time without a heartbeat after which a trial has failed, s
TABLE_LOCK = -1  #: key of the lock under which tables are made; keys of studies are not negative
#: Parameters of the driver: server and run notice within a minute that the other is gone.
KEEPALIVE = {
    "connect_timeout": 10,
    "keepalives_idle": 20,
    "keepalives_interval": 5,
    "keepalives_count": 4,
    "options": "-c tcp_keepalives_idle=20 -c tcp_keepalives_interval=5 -c tcp_keepalives_count=4",
}


class Sharing:
    """Heartbeats of the trials that this run is at, and its turn to propose; a context manager."""

    def __init__(self, storage: RDBStorage, study: str) -> None:
        self._storage = storage
        self._study = zlib.crc32(study.encode())
        self.trials: set[int] = set()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._beat, name="heartbeat", daemon=True)

    def __enter__(self) -> Sharing:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    @contextmanager
    def turn(self) -> Iterator[None]:
        """Wait for the right to propose, and hold it until the block or the run ends."""
        with self._storage.engine.begin() as connection:
            connection.execute(text("SELECT pg_advisory_xact_lock(:n)"), {"n": self._study})
            yield

    def add(self, trial_id: int) -> None:
        """Record heartbeats of a trial from now on."""
        self._storage.record_heartbeat(trial_id)
        self.trials.add(trial_id)

    def _beat(self) -> None:
        while not self._ended.wait(HEARTBEAT_S):
            for trial_id in list(self.trials):
                # A lost database ends the run itself, with a message.
                with suppress(SQLAlchemyError, StorageInternalError):
                    self._storage.record_heartbeat(trial_id)


def open_storage(folder: StudyFolder, url: str | None) -> BaseStorage:
    """Open the storage of a study at an address, or the folder's journal; StorageError."""
    if url is None:
        return _journal(folder.trials)
    address = address_of(url)
    settings: dict[str, Any] = {"poolclass": NullPool, "connect_args": KEEPALIVE}
    try:
        # One run at a time makes the tables, which the server refuses to two at once.
        with create_engine(address, **settings).begin() as connection:
            connection.execute(text("SELECT pg_advisory_xact_lock(:n)"), {"n": TABLE_LOCK})
            return RDBStorage(
                address.render_as_string(hide_password=False),
                settings,
                heartbeat_interval=HEARTBEAT_S,
                grace_period=SILENCE_S,
                heartbeat_stale_trial_callback=RetryHeartbeatStaleTrialCallback(),
            )
    except ImportError as error:
        name = getattr(error.__cause__, "name", None)
        remedy = "install the extra: pip install -c constraints.txt '.[machines]'"
        raise StorageError(f"the storage {address} needs {name or 'a driver'}; {remedy}") from error
    except (SQLAlchemyError, StorageInternalError, RuntimeError, OSError) as error:
        fault = f"the storage {address} cannot be opened ({_reason(error)})"
        raise StorageError(f"{fault}; check the address and that its server runs") from error


def _journal(path: Path) -> BaseStorage:
    """Open a folder's journal; the folder is locked, so its leftovers are of a killed run."""
    path.with_name(f"{path.name}.lock").unlink(missing_ok=True)
    if path.exists():
        os.truncate(path, path.read_bytes().rfind(b"\n") + 1)  # a line that a kill cut off
    try:
        return JournalStorage(JournalFileBackend(str(path)))
    except OSError:
        raise
    except Exception as error:
        raise StorageError(
            f"{path} is damaged; remove the file and run again with "
            f"{argument('resume', value=True)}: finished shifts are kept in shifts.jsonl and not "
            "simulated again"
        ) from error


def address_of(url: str) -> URL:
    """Parse the address of a database; StorageError unless it is of PostgreSQL."""
    try:
        address = make_url(url.replace("postgres://", "postgresql://", 1))
    except ArgumentError as error:
        fault = f"{argument('storage')} is '{url}', which is not the address of a database"
        remedy = "write for instance postgresql+psycopg://user@host/database"
        raise StorageError(f"{fault}; {remedy}") from error
    if address.drivername == "postgresql":
        address = address.set(drivername=DRIVER)
    if address.drivername != DRIVER:
        driver = f"'{address.drivername}', but a study is kept in {DRIVER}"
        fault = f"{argument('storage')} is of {driver}"
        remedy = "give such an address, or leave it out for a file in the study's folder"
        raise StorageError(f"{fault}; {remedy}")
    return address


@contextmanager
def guard_storage(url: str | None, folder: StudyFolder) -> Iterator[None]:
    """Turn the loss of a database into a StorageError; name the file in other OSErrors."""
    try:
        yield
    except OSError as error:  # of Optuna's journal where it names no other file
        error.filename = error.filename or str(folder.trials)
        raise
    except (SQLAlchemyError, StorageInternalError) as error:
        place = "its file" if url is None else address_of(url)
        resume = argument("resume", value=True)
        remedy = f"finished shifts are kept in {folder.root}, and {resume} goes on when it is back"
        raise StorageError(f"the storage {place} was lost ({_reason(error)}); {remedy}") from error


def _reason(error: BaseException) -> str:
    """Return the first line of a database error."""
    if isinstance(error, StorageInternalError) and error.__cause__ is not None:
        error = error.__cause__
    return str(getattr(error, "orig", None) or error).strip().split("\n")[0]
