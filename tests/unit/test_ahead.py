"""Compilation of the engine while a user answers questions."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from dogshape.pipeline.simulate import ahead


def test_the_engine_is_compiled_by_a_process_of_its_own_unless_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[Any] = []
    monkeypatch.setattr(ahead.subprocess, "Popen", lambda command, **_: started.append(command))
    cache = tmp_path / "__pycache__"
    monkeypatch.setattr(ahead, "CACHE", cache)
    ahead.compile_ahead()
    assert started == [[sys.executable, "-m", "dogshape.pipeline", "check", "mq200"]]
    cache.mkdir()
    (cache / "motion.advance-639.py311.nbi").touch()
    assert ahead.compile_ahead() is None
    assert len(started) == 1


def test_the_cache_has_the_file_that_is_looked_for() -> None:
    """By the names of numba's cache, once anything was simulated here."""
    from dogshape.sim.kernel.motion import advance

    index = Path(advance._cache._cache_file._index_path)
    assert index.match(ahead.COMPILED)
    assert ahead.CACHE.parent.samefile(Path(advance.py_func.__code__.co_filename).parent)
