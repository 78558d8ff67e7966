"""Storage of trials: the folder's journal, an SQLite file, or a PostgreSQL database.

Messages show an address without its password: that is how SQLAlchemy prints one.

**Claims** let several machines share one search. Each run that shares a PostgreSQL database holds a
lock of the server's under a number of its own and writes the number into the trials it asks for.
The server lets go of the lock when the run ends, however it ends: at once where the process dies,
within a minute where its machine or the network does. So a trial that is running is left alone as
long as the lock of its worker is held, and taken over afterwards, whatever any clock says. A second
lock makes sure that one run at a time takes trials over or asks for new ones; together they then
ask for no more than are wanted.

A folder or an SQLite file belongs to one run at a time.
"""

from __future__ import annotations

import fcntl
import json
import secrets
import time
import zlib
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

from optuna.exceptions import StorageInternalError
from optuna.storages import BaseStorage, JournalStorage, RDBStorage
from optuna.storages.journal import JournalFileBackend
from sqlalchemy import URL, Connection, NullPool, create_engine, make_url, text
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import drop_torn_line
from dogshape.sim.errors import StorageError
from dogshape.sim.files import naming

WAIT = 0.5  #: s between looks at what other machines do
TURN = 0  #: number of the lock of whose turn it is; workers have others
OPENING = -1  #: stands for all studies of a database
#: Settings of the server for our connections: a machine that is gone is noticed within a minute.
NOTICE = {
    "tcp_keepalives_idle": "20",
    "tcp_keepalives_interval": "5",
    "tcp_keepalives_count": "4",
    "idle_session_timeout": "0",
}
#: The same seen from here, as parameters of the driver.
KEEPALIVE = {
    "connect_timeout": 10,
    "keepalives_idle": 20,
    "keepalives_interval": 5,
    "keepalives_count": 4,
}


class Claims:
    """Claims of a run that has its storage for itself; subclasses know of other runs.

    ``worker`` is this run's number, None where no other run can be at the same search.
    """

    worker: int | None = None

    def turn(self) -> AbstractContextManager[None]:
        """Hold the right to take over trials and to ask for new ones."""
        return nullcontext()

    def living(self) -> set[int]:
        """List the numbers of all runs that are alive; any other that is running was cut off."""
        return set()

    def wait(self) -> None:
        """Wait a moment for other runs."""

    def close(self) -> None:
        """Release everything."""


class OneFile(Claims):
    """Claims of the only run at an SQLite file; a lock beside it keeps others off."""

    def __init__(self, database: Path) -> None:
        path = database.with_name(f"{database.name}.lock")
        self._handle = path.open("w")
        try:
            fcntl.flock(self._handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self._handle.close()
            raise StorageError(
                f"{database} is in use by another run, and SQLite serves one at a time; wait for "
                "it or share a PostgreSQL database"
            ) from error

    def close(self) -> None:
        """Release the file."""
        self._handle.close()


class Shared(Claims):
    """Claims of a run among several at one PostgreSQL database.

    Locks are of a session, so they need a connection of their own that lasts.
    """

    def __init__(self, url: URL, study: str) -> None:
        engine = create_engine(
            url, poolclass=NullPool, isolation_level="AUTOCOMMIT", connect_args=KEEPALIVE
        )
        self._connection: Connection = engine.connect()
        self._study = zlib.crc32(study.encode()) & 0x7FFFFFFF
        for name, value in NOTICE.items():  # an older server does not know them all
            self._connection.execute(
                text("SELECT set_config(name, :v, false) FROM pg_settings WHERE name = :n"),
                {"n": name, "v": value},
            )
        self.worker = 1 + secrets.randbelow(2**31 - 2)
        self._try(self._study, self.worker)

    def turn(self) -> AbstractContextManager[None]:
        """Hold the right to take over trials and to ask for new ones; wait for it."""
        return self._turn(self._study)

    def opening(self) -> AbstractContextManager[None]:
        """Hold the right to open any study of the database, of which the first makes tables."""
        return self._turn(OPENING)

    @contextmanager
    def _turn(self, what: int) -> Iterator[None]:
        while not self._try(what, TURN):
            self.wait()
        try:
            yield
        finally:
            self._connection.execute(
                text("SELECT pg_advisory_unlock(:s, :n)"), {"s": what, "n": TURN}
            )

    def living(self) -> set[int]:
        """List the numbers of all runs whose locks are held."""
        held = self._connection.execute(
            text(
                "SELECT objid FROM pg_locks WHERE locktype = 'advisory' AND granted AND "
                "classid = :s AND objsubid = 2 AND database = "
                "(SELECT oid FROM pg_database WHERE datname = current_database())"
            ),
            {"s": self._study},
        )
        return {int(number) for (number,) in held} - {TURN}

    def wait(self) -> None:
        """Wait a moment for other runs."""
        time.sleep(WAIT)

    def close(self) -> None:
        """Release all locks."""
        self._connection.close()

    def _try(self, what: int, number: int) -> bool:
        taken = self._connection.execute(
            text("SELECT pg_try_advisory_lock(:s, :n)"), {"s": what, "n": number}
        )
        return bool(taken.scalar())


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
