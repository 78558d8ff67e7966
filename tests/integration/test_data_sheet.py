"""The data sheet of a design prints on one page."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dogshape.designs import write_data_sheet
from dogshape.pipeline.reports.data_sheet import named_design
from tests.browser import Chromium

WHY = "a reason that goes on for more than one line: " + 30 * "why, "


@pytest.mark.parametrize("name", ["mq200_paper", "mq200"])
def test_a_data_sheet_prints_on_one_page(tmp_path: Path, name: str) -> None:
    page = write_data_sheet(named_design(name), tmp_path / "sheet.html", WHY)
    with Chromium(tmp_path / "profile") as browser:
        browser.look(page)
        assert re.findall(rb"/Count (\d+)", browser.print_pdf()) == [b"1"]
