"""Root and inverse of a surrogate's process: kept between calls, refused if they do not belong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dogshape.surrogate import kept_matrices
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.fitting import Effort
from dogshape.surrogate.kept_matrices import PLACE, cache_folder
from dogshape.surrogate.learning import fit
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.references import reference_of
from dogshape.surrogate.store import Stored, load, save
from dogshape.surrogate.validation import validate
from tests.unit.test_surrogate import MIX, made


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A stored surrogate, with a folder of kept matrices beside it that takes small ones too."""
    monkeypatch.setattr(kept_matrices, "LEAST", 0)
    monkeypatch.setenv(PLACE, str(tmp_path / "kept"))
    surrogate = fit(made(30), effort=Effort(rows=100, steps=5))
    reference = reference_of(made(10, seed=5, grid=True), MIX)
    save(tmp_path / "surrogate.json", Stored(surrogate, validate(surrogate, MIX, reference)))
    return tmp_path / "surrogate.json"


def _asked(file: Path) -> tuple[Surrogate, list[float]]:
    """Ask a surrogate for all that needs the root or the inverse."""
    surrogate = load(file).surrogate
    x = surrogate.data.designs[0] + 0.01
    expected = surrogate.expected(x, MIX)
    variance = surrogate.times.predict(surrogate.crossed(x[None, :], MIX.points))[1]
    return surrogate, [expected.time, expected.error, *variance.tolist()]


def _kept(file: Path) -> dict[str, Path]:
    return {one.stem.rpartition("-")[2]: one for one in (file.parent / "kept").glob("*.npy")}


def _count_work(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Write down each root and inverse that is worked out."""
    worked: list[str] = []
    for name in ("cholesky", "inv"):
        one = getattr(np.linalg, name)

        def counted(matrix: Array, name: str = name, one: object = one) -> Array:
            worked.append(name)
            return one(matrix)  # type: ignore[operator,no-any-return]

        monkeypatch.setattr(np.linalg, name, counted)
    return worked


def test_a_second_call_takes_what_the_first_kept(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    worked = _count_work(monkeypatch)
    first = _asked(file)[1]
    assert worked == ["cholesky", "inv"]
    assert set(_kept(file)) == {"root", "inverse"}
    assert _asked(file)[1] == first
    assert worked == ["cholesky", "inv"]
    monkeypatch.setenv(PLACE, "off")
    assert _asked(file)[1] == first
    assert worked == ["cholesky", "inv"] * 2


@pytest.mark.parametrize("harm", ["value", "short", "text", "size", "another's"])
@pytest.mark.parametrize("name", ["root", "inverse"])
def test_what_does_not_belong_is_worked_out_anew(file: Path, name: str, harm: str) -> None:
    surrogate, first = _asked(file)
    path = _kept(file)[name]
    matrix = np.load(path)
    if harm == "value":
        changed = matrix.copy()
        changed[-1, 3] += 1e-3 * np.abs(matrix).max()
        np.save(path, changed)
    elif harm == "short":
        path.write_bytes(path.read_bytes()[:-100])
    elif harm == "text":
        path.write_text("not a matrix")
    elif harm == "size":
        np.save(path, matrix[:-1, :-1])
    else:
        other = matrix + 0.1 * np.eye(len(matrix))
        np.save(path, other)
    assert _asked(file)[1] == first
    assert (np.load(path) == matrix).all()
    assert len(surrogate.times.inputs) == len(matrix)


def test_without_a_folder_all_goes_as_before(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = _asked(file)[1]
    (file.parent / "blocked").write_text("")
    monkeypatch.setenv(PLACE, str(file.parent / "blocked"))
    assert _asked(file)[1] == first
    for nowhere in ("", "off"):
        monkeypatch.setenv(PLACE, nowhere)
        assert cache_folder() is None
    assert _asked(file)[1] == first


def test_few_files_are_kept_and_no_others_touched(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept_matrices, "KEPT", 2)
    folder = file.parent / "kept"
    folder.mkdir()
    (folder / "mine.txt").write_text("")
    for number in range(3):
        np.save(folder / f"old{number}-root.npy", np.eye(2))
    _asked(file)
    assert set(_kept(file)) == {"root", "inverse"}
    assert len(list(folder.iterdir())) == 3


def test_the_usual_folder_is_the_users(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv(PLACE, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "dogshape"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "dogshape"
