"""Output in the encoding of any terminal, and hints that the verb of a fault takes."""

from __future__ import annotations

import io
import sys

import pytest

from dogshape.cli import entry

TEXT = "tip ≥ 1.5 mm ± 2 %, −3 µm at 15°, Δω → 0, Meßwert Bänk ﬁt 10² 漢"  # noqa: RUF001
PRINTED = {
    "utf-8": TEXT,
    "latin-1": "tip >= 1.5 mm ± 2 %, -3 µm at 15°, Domega -> 0, Meßwert Bänk fit 10² ?",
    "cp1252": "tip >= 1.5 mm ± 2 %, -3 µm at 15°, Domega -> 0, Meßwert Bänk fit 10² ?",
    "ascii": "tip >= 1.5 mm +/- 2 %, -3 um at 15 deg, Domega -> 0, Messwert Bank fit 10^2 ?",
}


@pytest.mark.parametrize("encoding", PRINTED)
@pytest.mark.parametrize("errors", ["strict", "surrogateescape"])
def test_signs_that_an_encoding_lacks_are_replaced(
    monkeypatch: pytest.MonkeyPatch, encoding: str, errors: str
) -> None:
    streams = [io.TextIOWrapper(io.BytesIO(), encoding, errors) for _ in range(2)]
    monkeypatch.setattr(sys, "stdout", streams[0])
    monkeypatch.setattr(sys, "stderr", streams[1])
    entry._print_in_any_encoding()
    for stream in streams:
        stream.write(TEXT)
        stream.flush()
        assert stream.buffer.getvalue().decode(encoding) == PRINTED[encoding]  # type: ignore[attr-defined]


def test_every_sign_has_words_in_ascii_and_bytes_of_paths_stay() -> None:
    assert all(words.isascii() and words for words in entry.SPELLINGS.values())
    entry._print_in_any_encoding()
    name = b"M\xe4rz.csv".decode("ascii", "surrogateescape")
    for encoding in ("ascii", "utf-8", "cp1252"):
        assert name.encode(encoding, entry.REPLACEMENT_HANDLER) == b"M\xe4rz.csv"


@pytest.mark.parametrize(("verb", "hints"), [(["report", "x"], False), (["check", "mq200"], True)])
def test_a_hint_names_only_options_that_the_verb_has(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    verb: list[str], hints: bool,
) -> None:  # fmt: skip
    for option, value in (
        ("--set" if not hints else "--sets", "record.sense=known"),
        ("--chamfer-deg", "14"),
    ):
        monkeypatch.setattr(sys, "argv", ["dogshape", *verb, option, value])
        assert entry._run() == 2
        text = capsys.readouterr().err
        assert "Traceback" not in text
        assert ("--set dog.chamfer_deg=14" in text) == (hints and option == "--chamfer-deg")
        assert "--set contact.set" not in text
