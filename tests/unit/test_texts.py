"""Tables and settings as spreadsheets and editors save them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dogshape.bench.bench_data import load_bench
from dogshape.bench.texts import read_table
from dogshape.pipeline.config.study_file import load_study
from dogshape.sim.errors import DataError, InputError
from dogshape.sim.versions import bundled_root
from tests.benches import good_set

Save = Callable[[str], bytes]


def german(text: str) -> str:
    """As German Excel saves a table."""
    return text.replace(",", ";").replace(".", ",").replace(",csv", ".csv")


SAVED: dict[str, Save] = {
    "byte-order mark": lambda t: t.encode("utf-8-sig"),
    "semicolons, decimal commas": lambda t: german(t).encode(),
    "Windows, semicolons": lambda t: german(t).replace("\n", "\r\n").encode("cp1252"),
    "UTF-16, tabs, decimal commas": lambda t: german(t).replace(";", "\t").encode("utf-16"),
    "Excel's own line": lambda t: b"sep=;\r\n" + german(t).encode(),
    "blanks, empty rows and columns": lambda t: (
        t.replace(",", " , ").replace("\n", ",,\n") + ",,,,,,,,\n"
    ).encode(),
}


@pytest.mark.parametrize("how", SAVED)
def test_a_data_set_is_the_same_however_it_was_saved(tmp_path: Path, how: str) -> None:
    def read() -> list[Any]:
        return [
            (r.point, r.n, r.time, r.engaged, r.trace and r.trace.displacement.tolist())
            for r in load_bench(folder).readings
        ]

    folder = good_set(tmp_path)
    plain = read()
    for path in [folder / "shifts.csv", *(folder / "traces").glob("*.csv")]:
        path.write_bytes(SAVED[how](path.read_text()))
    assert read() == plain


def test_settings_with_a_byte_order_mark(tmp_path: Path) -> None:
    text = (bundled_root() / "mq200_paper" / "study.toml").read_text()
    for coding in ("utf-8-sig", "utf-16"):
        (tmp_path / "study.toml").write_bytes(text.encode(coding))
        assert load_study(tmp_path).config_hash == load_study("mq200_paper").config_hash
    (tmp_path / "study.toml").write_bytes(b"\x00\x01\xb4\xff")
    with pytest.raises(InputError, match=r"study.toml is not valid TOML: .*save it as UTF-8"):
        load_study(tmp_path)


@pytest.mark.parametrize(
    ("raw", "words"),
    [
        (b"", "is not a table of comma separated values: it is empty; save it as CSV (UTF-8)"),
        (b"\x00\x01\xb4\xff", "it is no text; save it as CSV (UTF-8)"),
        (
            b"a,b\n1,2,x\n",
            "row 2 has 3 cells for 2 columns: 'x' stands beyond the last column, 'b'",
        ),
        (b"a;b\n1,5;2.5\n", "a comma ('1,5', row 2) and with a point ('2.5', row 2), which can be"),
    ],
)
def test_what_is_no_table_says_what_to_save(tmp_path: Path, raw: bytes, words: str) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(raw)
    with pytest.raises(DataError) as refused:
        read_table(path, ("a", "b"))
    assert words in str(refused.value)


def test_only_numbers_of_numeric_columns_get_a_point(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("a;note\n1,5;1,5\n-,5e3;x.y\n1.234,5;\n")
    table = read_table(path, ("a",))
    assert table.column("a") == ["1.5", "-.5e3", "1.234,5"]
    assert table.column("note") == ["1,5", "x.y", ""]
    path.write_text('a,note\n"1,5",x\n')
    assert read_table(path, ("a",)).column("a") == ["1,5"]


def test_all_faults_of_a_head_are_told_at_once(tmp_path: Path) -> None:
    folder = good_set(tmp_path)
    table = folder / "shifts.csv"
    table.write_text("dn_rpm,FORCE_N,force_rise_s,n_shift,shift_time_s,force_rise_s\n")
    with pytest.raises(DataError) as refused:
        load_bench(folder)
    for words in ("4 mistakes", "did you mean 'n_shifts'?", "'mismatch_rpm' is missing", "twice"):
        assert words in str(refused.value)
