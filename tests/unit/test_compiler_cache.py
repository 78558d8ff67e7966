"""Compiled code on disk follows a change of any file of the engine."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from dogshape.sim.kernel import compiler

CALLEE = "from kernel.compiler import inlined\n\n@inlined\ndef slope(x):\n    return {} * x\n"
CALLER = (
    "from kernel.callee import slope\nfrom kernel.compiler import compiled\n"
    "from kernel_layout import OFFSET\n\n@compiled\ndef line(x):\n    return slope(x) + OFFSET\n"
)
PROGRAM = "from kernel.caller import line; print(line(1.0), *line.stats.cache_hits.values())"


def _run(folder: Path) -> list[float]:
    """Evaluate the compiled line at 1; its value, and 1 if its code came from the disk."""
    command = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return [float(word) for word in done.stdout.split()]


def test_code_of_a_caller_follows_its_callee_and_the_layout(tmp_path: Path) -> None:
    folder = tmp_path / "kernel"
    folder.mkdir()
    shutil.copy(compiler.__file__, folder / "compiler.py")
    (folder / "__init__.py").touch()
    (folder / "callee.py").write_text(CALLEE.format("2.0"))
    (folder / "caller.py").write_text(CALLER)
    (tmp_path / "kernel_layout.py").write_text("OFFSET = 1.0\n")
    assert _run(tmp_path) == [3.0]
    assert _run(tmp_path) == [3.0, 1.0]
    (folder / "callee.py").write_text(CALLEE.format("10.0"))
    assert _run(tmp_path) == [11.0]
    (tmp_path / "kernel_layout.py").write_text("OFFSET = 0.25\n")
    assert _run(tmp_path) == [10.25]
    assert _run(tmp_path) == [10.25, 1.0]
