"""Files that last: what a power cut finds on the disk, and what cannot be written."""

from __future__ import annotations

import errno
import os
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import (
    ShiftJournal,
    append,
    read_json,
    read_lines,
    require_targets,
    write_json,
)
from dogshape.sim.errors import DogshapeError, StorageError
from dogshape.sim.files import write_whole
from dogshape.sim.statistics.blocks import even_blocks
from tests.conftest import Call

ROW = {"outcome": "engaged", "shift_time_s": 0.1, "landing_loads_N_mm": [0.0]}


def failing(number: int) -> Mock:
    """Make a call of the system that fails."""
    return Mock(side_effect=OSError(number, os.strerror(number)))


class Disk:
    """The order in which files are written, forced to the disk and renamed."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.calls: list[tuple[str, Path]] = []
        for what in ("fsync", "replace", "write"):
            monkeypatch.setattr(f"os.{what}", partial(self._noted, what, getattr(os, what)))

    def _noted(self, what: str, call: Any, file: Path | int, *more: Any) -> Any:
        path = Path(os.readlink(f"/proc/self/fd/{file}") if isinstance(file, int) else file)
        self.calls.append((f"{what} folder" if path.is_dir() else what, path))
        return call(file, *more)


@pytest.mark.parametrize(
    "write",
    [lambda path: write_json(path, {"a": 1}), lambda path: write_whole(path, "text")],
    ids=["json", "text"],
)
def test_content_is_on_the_disk_before_it_takes_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write: Any
) -> None:
    """Else a power cut may leave a name without content in the place of the old file."""
    disk, path = Disk(monkeypatch), tmp_path / "kept"
    write(path)
    part = disk.calls[0][1]
    assert part.parent == tmp_path
    assert part != path
    assert disk.calls == [("fsync", part), ("replace", part), ("fsync folder", tmp_path)]
    # A lock, which is empty and hidden, may stay beside it.
    assert [f.name for f in tmp_path.iterdir() if not f.name.startswith(".")] == ["kept"]


def test_a_file_that_cannot_be_forced_to_the_disk_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "kept"
    write_whole(path, "old")
    monkeypatch.setattr("os.fsync", failing(errno.ENOSPC))
    with pytest.raises(OSError, match="No space left on device") as refused:
        write_whole(path, "new")
    assert refused.value.filename == str(path)
    assert path.read_text() == "old"
    assert [file.name for file in tmp_path.iterdir()] == ["kept"]


def test_a_shift_counts_as_finished_once_it_is_on_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, small_study: Setup
) -> None:
    """Nothing rests on a shift that a power cut would take away."""
    path, row = tmp_path / "shifts.jsonl", {"key": "a", **ROW}
    journal, disk = ShiftJournal(path), Disk(monkeypatch)
    append(path, row)
    journal.sync()
    assert disk.calls == [("write", path), ("fsync", path), ("fsync folder", tmp_path)]
    append(path, {**row, "key": "b"})
    journal.sync()
    assert disk.calls[3:] == disk.calls[:3]
    monkeypatch.setattr("os.fsync", failing(errno.EIO))
    with pytest.raises(StorageError, match=r"shifts\.jsonl cannot be written \(Input/output error"):
        Executor(journal, 1).run(even_blocks(small_study.clutch, small_study.points[:1], 1, 1))


def test_shifts_kept_elsewhere_leave_the_journal_and_others_stay(tmp_path: Path) -> None:
    path = tmp_path / "shifts.jsonl"
    append(path, {"key": "a", **ROW}, {"key": "b", **ROW})
    journal = ShiftJournal(path)
    append(path, {"key": "c", **ROW})  # by another process
    journal.drop({"a"})
    assert set(journal.rows) == {"b"}
    assert set(ShiftJournal(path).rows) == {"b", "c"}


def test_a_read_only_journal_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "shifts.jsonl"
    append(path, {"key": "a", **ROW})
    monkeypatch.setattr("dogshape.pipeline.store.folder.os.open", failing(errno.EROFS))
    assert set(ShiftJournal(path).rows) == {"a"}


def test_a_full_disk_is_said_with_the_file(tmp_path: Path, dogshape: Call) -> None:
    (tmp_path / "full").symlink_to("/dev/full")
    said = dogshape("export", "mq200_paper", "--svg", "full")
    assert said.status == 2
    assert "No space left on device (full)" in said.err
    assert "Traceback" not in said.err


def test_targets_are_tried_and_left_as_they_are(tmp_path: Path) -> None:
    there = tmp_path / "there.html"
    there.write_text("old")
    before = there.stat().st_mtime_ns
    require_targets({"--html": there, "--trace": tmp_path / "new.csv", "--svg": None})
    require_targets({"--html": Path("/dev/null")})
    assert there.read_text() == "old"
    assert there.stat().st_mtime_ns == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["there.html"]
    for path, words in [
        (tmp_path, "--out is .*, which is a folder; name a file"),
        (tmp_path / "no" / "x.html", "but there is no folder .*/no; make it or name another file"),
        (there / "x.html", r"which cannot be written \(Not a directory\); name another file"),
        (Path("/proc/x.html"), "--out is /proc/x.html"),
    ]:
        with pytest.raises(StorageError, match=words):
            require_targets({"--out": path})


@pytest.mark.parametrize(
    ("module", "arguments"),
    [
        ("shift.engage", ["shift", "mq200_paper", "--mismatch-rpm", "50", "--force-N", "469",
                           "--angle-deg", "10", "--trace", "no/x.csv"]),
        ("sim.shift.mesh.to_stl",
         ["export", "mq200_paper", "--svg", "x.svg", "--stl", "no/x.stl"]),
        ("fitted.train", ["fit", "mq200_paper", "--out", "no/x.json"]),
    ],
)  # fmt: skip
def test_a_target_is_tried_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dogshape: Call, module: str,
    arguments: list[str],
) -> None:  # fmt: skip
    (tmp_path / "there").write_text("a file where a folder should be")
    monkeypatch.setattr(f"dogshape.{module}", Mock(side_effect=AssertionError("the work began")))
    said = dogshape(*arguments)
    assert arguments[-2] in said.sentence
    assert arguments[-1] in said.sentence
    assert not (tmp_path / "x.svg").exists()


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("deep.json", "[" * 200_000),
        ("deep object.json", '{"a":' * 200_000),
        ("digits.json", '{"format": ' + "9" * 10_000 + "}"),
        ("no object.json", "[1]"),
    ],
)
def test_hostile_json_is_refused_in_a_sentence(tmp_path: Path, name: str, content: str) -> None:
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(StorageError, match="damaged; take it away"):
        read_json(path, "take it away")
    path.write_text(f"{content}\n")
    with pytest.raises(StorageError, match="line 1 is not a shift"):
        list(read_lines(path, lambda row: row["key"], "a shift"))


@pytest.mark.parametrize("content", ["a = " + "[" * 100_000, "a" + ".a" * 20_000 + " = 1"])
def test_deep_toml_is_refused_in_a_sentence(tmp_path: Path, content: str) -> None:
    path = tmp_path / "study.toml"
    path.write_text(content)
    with pytest.raises(DogshapeError):
        load_study(path)


def test_files_and_lines_without_end_are_not_read_into_memory(tmp_path: Path) -> None:
    """Sparse files of a terabyte: their size is seen, and of a line its first megabytes."""
    path = tmp_path / "huge.json"
    with path.open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(StorageError, match="more than 256 MB; take it away"):
        read_json(path, "take it away")
    with pytest.raises(StorageError, match="line 1 is too long for a shift"):
        list(read_lines(path, lambda row: row["key"], "a shift"))
