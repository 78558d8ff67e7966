"""A PostgreSQL server of the tests' own, and Dask clusters as processes on this machine."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from tests.conftest import needed

ROOT = Path(__file__).parents[1]


def free_port() -> int:
    """Return a port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@dataclass
class Server:
    """A PostgreSQL server on loopback."""

    tools: Path
    folder: Path
    port: int

    @property
    def url(self) -> str:
        """Address of its database for Optuna."""
        return f"postgresql+psycopg://postgres@127.0.0.1:{self.port}/postgres"

    def call(self, tool: str, *arguments: str) -> str:
        """Run one of the server's programs, which refuse to run as root."""
        command = [str(self.tools / tool), *arguments]
        if os.geteuid() == 0:
            command = ["runuser", "-u", "postgres", "--", *command]
        log = self.folder / "out.txt"
        with log.open("w") as out:  # the server inherits it, so no pipe
            done = subprocess.run(command, stdout=out, stderr=out, cwd="/", timeout=60, check=False)
        assert done.returncode == 0, log.read_text()
        return log.read_text()

    def start(self) -> None:
        """Start the server and wait until it answers."""
        data = str(self.folder / "data")
        options = f"-p {self.port} -c listen_addresses=127.0.0.1 -c fsync=off -k {self.folder}"
        self.call("pg_ctl", "-D", data, "-o", options, "-w", "-l", f"{data}/log", "start")

    def stop(self) -> None:
        """Stop the server at once, as a power cut would."""
        self.call("pg_ctl", "-D", str(self.folder / "data"), "-m", "immediate", "-w", "stop")

    def ask(self, question: str) -> list[str]:
        """Return the lines that a query gives."""
        where = ["-h", "127.0.0.1", "-p", str(self.port), "-U", "postgres", "-At", "-c", question]
        return self.call("psql", *where).splitlines()


@contextmanager
def postgres() -> Iterator[Server]:
    """Run a server in a folder of its own."""
    found = [*Path("/usr/lib/postgresql").glob("*/bin/initdb"), shutil.which("initdb")]
    needed(found[0] is not None, "postgresql")
    folder = Path(tempfile.mkdtemp(prefix="dogshape-pg-"))
    folder.chmod(0o700)
    if os.geteuid() == 0:
        shutil.chown(folder, "postgres", "postgres")
    server = Server(Path(found[0] or "").parent, folder, free_port())
    try:
        server.call("initdb", "-D", str(folder / "data"), "-U", "postgres", "-A", "trust", "-N")
        server.start()
        yield server
        server.stop()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def command_of(verb: str, *arguments: str) -> list[str]:
    """Return the command line of a verb for a process of its own."""
    return [sys.executable, "-m", "dogshape.pipeline", verb, *arguments]


def started(command: list[str], cwd: Path = ROOT) -> subprocess.Popen[str]:
    """Start a command in a session of its own, which Ctrl-C ends.

    A shell starts background jobs with Ctrl-C ignored, and children inherit that.
    """
    pipe = subprocess.PIPE
    return subprocess.Popen(
        command, cwd=cwd, stdout=pipe, stderr=pipe, text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
    )  # fmt: skip


@dataclass
class Cluster:
    """A Dask scheduler with workers of one thread each, all processes on loopback."""

    address: str
    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]]
    log: Path

    def said(self) -> str:
        """Return the log of its processes."""
        return self.log.read_text(errors="replace")


@contextmanager
def dask_cluster(workers: int, prepared: str = "") -> Iterator[Cluster]:
    """Run a cluster; ``prepared`` is Python that each worker runs first."""
    address = f"tcp://127.0.0.1:{free_port()}"
    started: list[subprocess.Popen[bytes]] = []
    with tempfile.TemporaryDirectory(prefix="dogshape-dask-") as folder:
        log, preload = Path(folder) / "said.txt", Path(folder) / "worker.py"
        preload.write_text(prepared)
        host = ["--no-dashboard", "--host", "127.0.0.1"]
        working = ["--nthreads", "1", "--no-nanny", "--local-directory", folder]
        working += ["--preload", str(preload)]
        try:
            with log.open("wb") as out:
                port = address.rpartition(":")[2]
                started.append(_begun(out, "dask_scheduler", *host, "--port", port))
                for _ in range(workers):
                    started.append(_begun(out, "dask_worker", address, *host, *working))
            yield Cluster(address, started[0], started[1:], log)
        finally:
            for process in started:
                process.kill()
                process.wait()


def _begun(out: IO[bytes], program: str, *arguments: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", f"distributed.cli.{program}", *arguments]
    return subprocess.Popen(command, cwd=ROOT, stdout=out, stderr=out)
