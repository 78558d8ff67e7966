"""The data sheet of a decision prints on one page."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dogshape.pipeline.reports.decision import workshop
from tests.browser import print_pdf
from tests.kept import kept_folder


@pytest.mark.parametrize("name", ["mq200_paper", "mq200"])
def test_a_data_sheet_prints_on_one_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(workshop, "cad_available", lambda: False)
    folder = kept_folder(tmp_path / name, name)
    best = folder.stored_result()["best"]["trial"]
    workshop.choose(folder, best, "a reason that goes on for more than one line: " + 30 * "why, ")
    printed = print_pdf(folder.root / "decision" / "datasheet.html", tmp_path)
    assert re.findall(rb"/Count (\d+)", printed) == [b"1"]
