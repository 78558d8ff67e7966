"""An installed wheel works as the checkout does."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
MAX_DATA_BYTES = 1_500_000  #: of studies, bench data and surrogates in a wheel


def test_wheel_brings_code_templates_studies_and_bench_data(tmp_path: Path) -> None:
    left = [line.strip("/") for line in (ROOT / ".gitignore").read_text().split()]
    source = tmp_path / "source"  # building leaves the checkout clean
    ignored = shutil.ignore_patterns(".git", *left)
    shutil.copytree(ROOT, source, symlinks=True, ignore=ignored)
    build = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--quiet", "--no-build-isolation"]
    subprocess.run([*build, "--wheel-dir", tmp_path, source], check=True, timeout=300)
    (wheel,) = tmp_path.glob("dogshape-*.whl")
    target = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(target)
        names = archive.namelist()
        data = [entry for entry in archive.infolist() if "/studies/" in entry.filename]
    assert any(name.endswith("entry_points.txt") for name in names)
    assert not any(name.startswith(("tests/", "dogshape/validation/")) for name in names)
    assert sum(entry.file_size for entry in data) <= MAX_DATA_BYTES
    # Only the unpacked wheel is on the path before the libraries, no hook leads to the checkout,
    # and the folder is empty.
    work = tmp_path / "work"
    work.mkdir()
    code = (
        "import sys; "
        "hooks = [f for f in sys.meta_path if 'Editable' not in getattr(f, '__name__', '')]; "
        "sys.meta_path[:] = hooks; "
        f"sys.path.insert(0, {str(target)!r}); import dogshape.pipeline.__main__ as c; "
        f"assert c.__file__.startswith({str(target)!r}); c.main()"
    )
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    for status, arguments in (
        (0, ["strength", "mq200_paper", "--no-simulate"]),
        (0, ["validate", "mq200_adams", "--help"]),
        (2, ["strength", "mq200_paper", "--no-simulate", "--fem"]),
        (2, ["blind", "run", "cases"]),
    ):
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments],
            cwd=work, env=environment, capture_output=True, text=True, timeout=120, check=False,
        )  # fmt: skip
        assert done.returncode == status, done.stderr
        assert ("needs a clone of the repository" in done.stderr) == (status == 2)
    kept = subprocess.run(
        [sys.executable, "-c", code, "compare", "mq200_paper#1", "mq200_paper#2"],
        cwd=work, env=environment, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert kept.returncode == 2
    where = "a clone of the repository has the kept result, in its folder studies/mq200_paper"
    assert where in " ".join(kept.stderr.split())
    shift = ["shift", "mq200_paper", "--mismatch-rpm", "100", "--force-N", "469"]
    shift += ["--angle-deg", "12", "--report", "a.html"]
    subprocess.run([sys.executable, "-c", code, *shift], cwd=work, env=environment, check=True)
    assert (work / "a.html").stat().st_size > 1_000_000
