"""A PostgreSQL server for tests, and Dask clusters as processes on this machine."""

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

from tests.conftest import require_program

ROOT = Path(__file__).parents[1]


def free_port() -> int:
    """Return a free port of this machine."""
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
        """Run a program of the server, as another user where root is refused; return its output."""
        command = [str(self.tools / tool), *arguments]
        if os.geteuid() == 0:
            command = ["runuser", "-u", "postgres", "--", *command]
        log = self.folder / "out.txt"
        with log.open("w") as out:  # the server inherits it, so no pipe
            result = subprocess.run(
                command, stdout=out, stderr=out, cwd="/", timeout=60, check=False
            )
        assert result.returncode == 0, log.read_text()
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
        """Run a query; return its lines."""
        connection = [
            "-h",
            "127.0.0.1",
            "-p",
            str(self.port),
            "-U",
            "postgres",
            "-At",
            "-c",
            question,
        ]
        return self.call("psql", *connection).splitlines()


@contextmanager
def postgres() -> Iterator[Server]:
    """Run a server in a temporary folder."""
    programs = [*Path("/usr/lib/postgresql").glob("*/bin/initdb"), shutil.which("initdb")]
    require_program(programs[0] is not None, "postgresql")
    folder = Path(tempfile.mkdtemp(prefix="dogshape-pg-"))
    folder.chmod(0o700)
    if os.geteuid() == 0:
        shutil.chown(folder, "postgres", "postgres")
    server = Server(Path(programs[0] or "").parent, folder, free_port())
    try:
        server.call("initdb", "-D", str(folder / "data"), "-U", "postgres", "-A", "trust", "-N")
        server.start()
        yield server
        server.stop()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def command_of(verb: str, *arguments: str) -> list[str]:
    """Return the command line of a verb for a new process."""
    return [sys.executable, "-m", "dogshape.pipeline", verb, *arguments]


def start_command(command: list[str], cwd: Path = ROOT) -> subprocess.Popen[str]:
    """Start a command in a new session that Ctrl-C ends.

    A shell starts background jobs with Ctrl-C ignored, and children inherit that.
    """
    pipe = subprocess.PIPE
    return subprocess.Popen(
        command,
        cwd=cwd,
        stdout=pipe,
        stderr=pipe,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
    )


@dataclass
class Cluster:
    """A Dask scheduler with workers of one thread each, all processes on loopback."""

    address: str
    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]]
    log: Path

    def read_log(self) -> str:
        """Read the log of the processes."""
        return self.log.read_text(errors="replace")


@contextmanager
def dask_cluster(workers: int, preload_code: str = "") -> Iterator[Cluster]:
    """Run a cluster; ``prepared`` is Python that each worker runs first."""
    address = f"tcp://127.0.0.1:{free_port()}"
    processes: list[subprocess.Popen[bytes]] = []
    with tempfile.TemporaryDirectory(prefix="dogshape-dask-") as folder:
        log = Path(folder) / "log.txt"
        preload = Path(folder) / "worker.py"
        preload.write_text(preload_code)
        host = ["--no-dashboard", "--host", "127.0.0.1"]
        worker_options = ["--nthreads", "1", "--no-nanny", "--local-directory", folder]
        worker_options += ["--preload", str(preload)]
        try:
            with log.open("wb") as out:
                port = address.rpartition(":")[2]
                processes.append(_start_program(out, "dask_scheduler", *host, "--port", port))
                for _ in range(workers):
                    processes.append(
                        _start_program(out, "dask_worker", address, *host, *worker_options)
                    )
            yield Cluster(address, processes[0], processes[1:], log)
        finally:
            for process in processes:
                process.kill()
                process.wait()


def _start_program(out: IO[bytes], program: str, *arguments: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", f"distributed.cli.{program}", *arguments]
    return subprocess.Popen(command, cwd=ROOT, stdout=out, stderr=out)
