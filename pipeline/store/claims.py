"""Claims of runs on trials, so that several machines can share one search.

Each run that shares a PostgreSQL database holds a lock of the server's under a number of its own
and writes the number into the trials it asks for. The server lets go of the lock when the run
ends, however it ends: at once where the process dies, within a minute where its machine or the
network does. So a trial that is running is left alone as long as the lock of its worker is held,
and taken over afterwards, whatever any clock says. A second lock makes sure that one run at a
time takes trials over or asks for new ones; together they then ask for no more than are wanted.

A folder or an SQLite file belongs to one run at a time.
"""

from __future__ import annotations

import fcntl
import secrets
import time
import zlib
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path

from sqlalchemy import URL, Connection, NullPool, create_engine, text

from dogshape.sim.errors import StorageError

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
