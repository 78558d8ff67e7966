"""Tables as stands, loggers and spreadsheets write them: read rightly and said, or refused."""

from __future__ import annotations

import csv
import hashlib
import re
import shutil
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from dogshape.bench.bench_data import Reading, load_bench
from dogshape.bench.stand_file import BenchRecord
from dogshape.bench.table import NEAR, Row, joined_rows
from dogshape.cli import dialogue
from dogshape.cli.app import app
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import build_study, load_study
from dogshape.pipeline.diagnose.study_keys import study_of
from dogshape.sim.clutch_tables import validate
from dogshape.sim.units import RPM
from tests.benches import GOOD
from tests.conftest import Call, CommandResult, set_options


class Bench:
    """What ``init bench`` makes of a text."""

    def __init__(self, call: Call) -> None:
        self.call = call

    def said(self, text: str, *options: str, coding: str = "utf-8") -> CommandResult:
        Path("m.csv").write_text(text, coding)
        shutil.rmtree("b", ignore_errors=True)
        return self.call("init", "bench", "m.csv", "--json", "--out", "b", *options)

    def refused(self, text: str, *options: str, words: Sequence[str]) -> str:
        found = self.said(text, *options)
        assert found.status == 2, found.out
        assert not Path("b").exists()
        for word in words:
            assert word in found.err
        return found.err

    def read(self, text: str, *options: str, coding: str = "utf-8") -> list[Reading]:
        found = self.said(text, *options, coding=coding)
        assert found.status == 0, found.err
        self.json = found.json
        return list(load_bench("b").readings)

    def numbers(self, text: str, *options: str) -> list[list[float]]:
        """Mismatch in 1/min, force in N and time in ms of each row."""
        return [
            [round(r.point.mismatch / RPM, 6), round(r.point.profile.force, 6),
             round(1e3 * r.time, 6) if r.time is not None else np.nan]
            for r in self.read(text, *options)
        ]  # fmt: skip

    @property
    def assumed(self) -> str:
        return " ".join(self.json["assumed"])

    @property
    def left_out(self) -> str:
        left = self.json["left_out"]
        return " | ".join(f"{one.get('row', one.get('column'))}: {one['reason']}" for one in left)


@pytest.fixture
def bench(dogshape: Call) -> Bench:
    return Bench(dogshape)


PLAIN = [[50.0, 469.0, 116.2], [100.0, 469.0, 103.7], [149.0, 642.0, 98.3], [50.0, 642.0, 95.2]]
HEAD = "dn [1/min];F [N];Schaltzeit [ms]"
ROWS = "50;469;116,2\n100;469;103,7\n149;642;98,3\n50;642;95,2\n"
POINTS = ROWS.replace(",", ".").replace(";", ",")
NUMBERED = "".join(f"{k};{row}\n" for k, row in enumerate(ROWS.splitlines(), start=1))
CLOCKED = "".join(f"{k},14:0{k}:30,{row}\n" for k, row in enumerate(POINTS.splitlines()))
LVM = """\
LabVIEW Measurement\t
Separator\tTab
Decimal_Separator\t,
***End_of_Header***\t
\t
Channels\t3\t\t\t
Samples\t2\t2\t2\t
X0\t0\t0\t0\t
***End_of_Header***\t\t\t\t
X_Value\tdn (1/min)\tF_shift (N)\tt_shift (ms)\tComment
""" + "".join(f"\t{row}\tok\n" for row in ROWS.replace(";", "\t").splitlines())
#: Texts that have the plain rows, and words of what is left out.
READ = {
    "sum without a word": (f"{HEAD}\n{ROWS}349;2222;413,4\n", "6: sum or mean"),
    "sum below a number": (f"Nr;{HEAD}\n{NUMBERED};349;2222;413,4\n", "6: sum or mean"),
    "two foreign words": (f"Nr;{HEAD}\n{NUMBERED}平均;87;555;103\n偏差;47;99;9\n", "7: word where"),
    "named statistics": (f"Nr;{HEAD}\n{NUMBERED}Min;50;469;95\n25%;50;469;97\n", "('25%')"),
    "last words": (f"Nr;{HEAD}\n{NUMBERED}Ende der Messung;;;\n", "has no number"),
    "units in a row": (f"Logger 7\nNO.,Time,dn,F_shift,t_shift\n-,h,1/min,N,ms\n{CLOCKED}", "NO."),
    "units in some cells": (f"steps,1 ms\nNr,Zeit,dn,F,t\n,,[1/min],[N],[ms]\n{CLOCKED}", "above"),
    "comments in a head": (f"# stand 7\ndn,F,t\n# units\n1/min,N,ms\n{POINTS}", "3: stands above"),
    "strokes": ("dn|F|t\n# first\n" + ROWS.replace(";", "|"),
                "2: stands above the table ('# first')"),
    "labview": (LVM, "X_Value: empty"),
    "head again": (f"{HEAD}\n{ROWS[:13]}{HEAD}\n{ROWS[13:]}", "3: repeats the head"),
    "names twice": ("time;dn;time;F;time;t_shift\n" + "".join(
        f"{k}.5;{a};{k}.6;{b};{k}.7;{c}\n" for k, (a, b, c) in enumerate(PLAIN)), "time: no quant"),
    "running number": ("Versuch;" + HEAD + "\n" + NUMBERED, "Versuch: numbers the rows; --column"),
    "units in cells": ("dn;F;t_shift\n50 1/min;469 N;116,2 ms\n100 1/min;0,469 kN;103,7 ms\n"
                       "149 1/min;642 N;98,3 ms\n50 rpm;642 N;0,0952 s\n", ""),
    "elapsed time": ("t [s];dn;F;Dauer [ms]\n" + "".join(
        f"{12.4 * k};{a};{b};{c}\n" for k, (a, b, c) in enumerate(PLAIN)), "t [s]: clock; --col"),
}  # fmt: skip


@pytest.mark.parametrize("kind", READ)
def test_layouts_are_read(bench: Bench, kind: str) -> None:
    text, left = READ[kind]
    assert bench.numbers(text) == PLAIN
    assert left in bench.left_out


@pytest.mark.parametrize("words", ["1 2 2b 3", "1 2 3 4", "io nio A Max_Muster"])
def test_shifts_that_only_look_like_sums_stay(bench: Bench, words: str) -> None:
    rows = zip(words.split(), ((50, 110), (100, 100), (150, 90), (100, 104)), strict=True)
    text = "".join(f"{word.replace('_', ' ')};{n};469;{t}\n" for word, (n, t) in rows)
    assert len(bench.numbers(f"Nr;{HEAD}\n{text}")) == 4


#: Cells of forces, separator, and the first of them in N.
CELLS = [
    ("1\N{NARROW NO-BREAK SPACE}200,5 800", ";", 1200.5), ("1.200,5 800", ";", 1200.5),
    ("1\N{RIGHT SINGLE QUOTATION MARK}200 800", ";", 1200.0), ("1.200 800,5", ";", 1200.0),
    ("12E+2 800", ";", 1200.0), ("+_1200 800", ";", 1200.0), ("469.000 800.125", ",", 469.0),
    ('"1,200" 800.5', ",", 1200.0),
]  # fmt: skip


@pytest.mark.parametrize(("cells", "separator", "value"), CELLS)
def test_numbers(bench: Bench, cells: str, separator: str, value: float) -> None:
    one, other = (cell.replace("_", " ") for cell in cells.split(" "))
    text = f"dn;F [N];t_shift [ms]\n50;{one};96\n\N{MINUS SIGN} 100;{other};103\n"
    (row, second) = bench.numbers(text.replace(";", separator))
    assert (row[1], second[0]) == (value, -100.0)
    text = "dn;F [kN];shift time [s]\n50;1,120;0,116\n100;1,250;0,104\n149;1,469;0,098\n"
    assert [row[1] for row in bench.numbers(text)] == [1120.0, 1250.0, 1469.0]


OPEN = "dn;F [N];t_shift [ms]\n50;1.200;96\n100;800;103\n149;900;98\n"
WORD = f"Nr;{HEAD}\n1;50;469;116,2\nWdh;100;469;103,7\n3;149;642;98,3\n4;50;642;95,2\n"
NAMELESS = "".join(f"{a:.7e};{b:.7e};{c:.7e}\n" for a, b, c in PLAIN)
TWICE = f"{HEAD}\n50;469;116\n100;469;104\n\nF [N];dn [1/min];t [ms]\n642;149;98\n"
COUNTED = "Number,dn,F,t_shift\n1,50,469,116\n2,100,469,104\n"
OMEGA = "domega;F [N];t_shift [ms]\n5.2;469;116\n10.4;469;104\n"
#: Texts and options that are refused, words of the sentence, and options that settle it.
REFUSED: dict[str, tuple[str, tuple[str, ...], list[str], tuple[str, ...]]] = {
    "point": (OPEN, (), ["can be read as 1200, --decimal ,", "or as 1.200"], ("--decimal", ",")),
    "comma": (OPEN.replace("1.200", '"1,200"').replace(";", ","), (), ["1200, --decimal ."],
              ("--decimal", ".")),
    "word": (WORD, (), ["row 3 has 'Wdh' where other rows have a number"], ("--rows", "2,4-5")),
    "empty": (WORD.replace("Wdh", ""), (), ["row 3 has '' where"], ("--rows", "2-5")),
    "rows": (WORD, ("--rows", "all"), ["--rows is 'all'"], ("--rows", "2-5")),
    "two tables": (TWICE, (), ["another table begins in row 5", "--rows 2-3"], ("--rows", "2-3")),
    "no names": (NAMELESS, (), ["no column looks like mismatch_rpm", "'column 1'"],
                 ("mismatch_rpm=column 1:1/min", "force_N=column 2", "shift_time_s=column 3:ms")),
    "blanks": ("dn F t\n" + NAMELESS.replace(";", "  "), (), ["with semicolons, tabs or"], ()),
    "name twice": (OPEN.replace("1.200", "700").replace("t_shift [ms]", "dn"), (),
                   ["mismatch_rpm may be", "column 1", "column 3"],
                   ("mismatch_rpm=column 1", "shift_time_s=column 3:ms")),
    "count": (COUNTED, (), ["'Number' numbers the rows"], ("order=Number",)),
    "two times": ("t1 time,dn,F,time t2\n9,50,469,116\n8,60,469,104\n", (),
                  ["shift_time_s may be the column", "say which"], ("shift_time_s=time t2",)),
    "only a clock": ("t [s],dn,F\n" + "".join(f"{k}.5,50,469\n" for k in range(5)), (),
                     ["grows from row to row as a clock does"], ()),
    "stamps": (COUNTED.replace("Number", "Zeitstempel"), (), ["'Zeitstempel:s' for numbers"],
               ("timestamp=Zeitstempel:s",)),
    "words": ("ok;dn;F;t\ngut;50;469;116\nhängt;100;469;\n", (), ["must be yes, no or empty"],
              ("engaged=ok:gut=yes,hängt=no",)),
    "below 0": ("dn,F,t [ms]\n50,469,-96\n60,469,103\n", (), ["is -96 ms, but must be a time"], ()),
    "hours": (OMEGA.replace("domega", "dn"), ("shift_time_s=t_shift:hours",),
              ["the unit of shift_time_s is 'hours'"], ()),
    "angular": (OMEGA, ("mismatch_rpm=domega",), ["revolutions or radians", "rad/s"],
                ("mismatch_rpm=domega:rad/s",)),
    "1/s": (OMEGA.replace("domega", "Δω [1/s]"), (), ["revolutions or radians"],
            ("mismatch_rpm=Δω:rad/s",)),
}  # fmt: skip


def _options(given: tuple[str, ...]) -> list[str]:
    """Put ``--column`` before what is no option."""
    return [*given] if given[:1] and given[0][0] == "-" else [
        word for one in given for word in ("--column", one)]  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_what_can_be_read_in_two_ways_is_refused_and_settled(bench: Bench, kind: str) -> None:
    text, options, words, settled = REFUSED[kind]
    bench.refused(text, *_options(options), words=words)
    if settled:
        assert bench.read(text, *_options(settled))


@pytest.mark.parametrize(
    ("cells", "form"),
    [
        (("31.05.2024 14:05:09,5", "31.05.2024 14:05:39,5", "01.06.2024 14:05:09,5"), ""),
        (("2024/05/31 14:05:09", "2024/05/31 14:05:39", "2024/06/01 14:05:09"), ""),
        (("05/31/2024 2:05:09 PM", "05/31/2024 2:05:39 PM", "06/01/2024 2:05:09 PM"),
         ":%m/%d/%Y %I:%M:%S %p"),
    ],
)  # fmt: skip
def test_dates(bench: Bench, cells: tuple[str, str, str], form: str) -> None:
    rows = "".join(f"{c};{a};{b};{t}\n" for c, (a, b, t) in zip(cells, PLAIN[:3], strict=True))
    text, options = f"When;dn;F;t_shift\n{rows}", ("--column", f"timestamp=When{form}")
    if form:
        words = [f"has '{cells[0]}', which is no date and time as", "%d/%m/%Y %H:%M:%S'"]
        bench.refused(text, words=words)
        assert [r.place for r in bench.read(text, "--column", "timestamp=-")] == [None] * 3
    places = [r.place or 0.0 for r in bench.read(text, *options if form else ())]
    assert [b - a for a, b in pairwise(places)] == pytest.approx([30.0, 86_370.0], abs=0.02)
    (said,) = (c for c in bench.json["columns"] if c["quantity"] == "timestamp")
    assert said["first"].startswith("2024-05-31T14:05:09")


def test_clocks_go_on_after_midnight(bench: Bench) -> None:
    rows = "When;dn;F;t_shift\n23:59:30;50;469;116\n23:59:59;100;469;104\n00:00:30;149;642;98"
    places = [r.place for r in bench.read(rows)]
    assert np.diff(np.array(places, dtype=float)).tolist() == [29.0, 31.0]


@pytest.mark.parametrize("times", ["0.116 1.0 0.098 0.1", "0.116 0.5 0.098 0.5", "0.1 2 2 0.2"])
def test_time_outs_that_are_written_as_times(bench: Bench, times: str) -> None:
    rows = "".join(f"{25 * k + 25},469,{t}\n" for k, t in enumerate(times.split()))
    text, most = f"dn,F,shift time [s]\n{rows}", max(map(float, times.split()))
    bench.refused(text, words=[f"say --set timeout_s={most:g} where these shifts did not engage"])
    found = bench.read(text, "--set", f"timeout_s={most}")
    assert [r.engaged is False for r in found] == [float(t) == most for t in times.split()]
    assert "are shifts that did not engage" in bench.assumed
    longer = bench.read(text, "--set", f"timeout_s={3 * most}")
    assert [r.time for r in longer] == [float(t) for t in times.split()]


@pytest.mark.parametrize(
    ("head", "words", "option", "engaged"),
    [
        ("eingelegt", "io|nio|ja|-", "engaged=eingelegt", [True, False, True, None]),
        ("eingelegt", "x|-|x|x", "engaged=eingelegt:empty=no", [True, False, True, True]),
        ("eingelegt", "gut|klemmt|gut|gut", "engaged=eingelegt:gut=yes,klemmt=no",
         [True, False, True, True]),
        ("Bewertung", "i.O.|n. i. O.|i.O.|i.O.", "", [True, False, True, True]),
        ("Klaue drin", "ja|nein|ja|ja", "", [True, False, True, True]),
        ("Klaue drin;Bewertung", "ja;i.O.|nein;n.i.O.|ja;i.O.|ja;i.O.", "",
         [True, False, True, True]),
        ("Urteil", "OK|NOK|OK|OK", "", [True, False, True, True]),
        ("Rückmeldung", "1|0|1|1", "engaged=Rückmeldung", [True, False, True, True]),
        ("Fehler", "nein|ja|nein|nein", "engaged=Fehler:ja=no,nein=yes",
         [True, False, True, True]),
    ],
)  # fmt: skip
def test_words_for_engaged(
    bench: Bench, head: str, words: str, option: str, engaged: list[bool | None]
) -> None:
    lines = zip(words.split("|"), engaged, PLAIN, strict=True)
    rows = "".join(f"{w};{a};{b};{'' if e is not True else c}\n" for w, e, (a, b, c) in lines)
    text, first = f"{head};dn;F;t\n{rows}", re.split("[|;]", words)[0].lower()
    if option and head != "eingelegt":
        bench.refused(text, words=[f"say --column engaged='{head}'"])
    assert [r.engaged for r in bench.read(text, *_options((option,) if option else ()))] == engaged
    (said,) = (c["why"] for c in bench.json["columns"] if c["quantity"] == "engaged")
    assert f"{first} = yes" in said


def test_two_speeds_are_a_mismatch_by_formula(bench: Bench) -> None:
    rows = "".join(f"{a:.9g};{b * np.pi / 30.0:.9g};469;{116 - k}\n" for k, (a, b) in
                   enumerate([(1450.0, 1500.0), (1450.0, 1550.0), (1461.0, 1610.0)]))  # fmt: skip
    text = f"n_in [1/min];n-out [rad/s];F [N];t_shift [ms]\n{rows}"
    bench.refused(text, words=["mismatch_rpm may be", "n-out - n_in", "docs/scope.md"])
    formulas = {
        "n-out - n_in": 1.0, "(n_in - n-out)/2": -0.5, "-1 * 'n_in' + 'n-out'": 1.0,
        "-(`n-out [rad/s]`:rad/s - n_in)": -1.0, "'n_in' * -0.5 + 0.5 * n-out": 0.5,
    }  # fmt: skip
    for formula, factor in formulas.items():
        found = bench.numbers(text, "--column", f"mismatch_rpm={formula}")
        known = [factor * one for one in (50.0, 100.0, 149.0)]
        assert [row[0] for row in found] == pytest.approx(known, abs=1e-4)
    (said,) = (c for c in bench.json["columns"] if c["quantity"] == "mismatch_rpm")
    assert "sign is that of the formula" in said["why"]
    bench.refused(text, "--column", "mismatch_rpm=n2 - n3", words=["no such column"])
    for wrong in (
        "n_in -",
        "n_in / 0",
        "n_in(n-out)",
        "n_out2 - n_in",
        "n_in if n_in else 0",
        "n_in - 'n-out",
    ):
        words = ["is no formula", "write columns, numbers, + - * / and brackets"]
        bench.refused(text, "--column", f"mismatch_rpm={wrong}", words=words)


@pytest.mark.parametrize("rises", [True, False])
def test_measured_values_get_the_set_values_of_the_origin(bench: Bench, rises: bool) -> None:
    draw = np.random.default_rng(1)
    points = [(n, f) for n in (25, 50, 100, 149) for f in (235.2, 469.0) for _ in range(5)]
    cells = np.array([(n + draw.normal(0.0, 1.2), f * (1.0 + draw.normal(0.0, 0.01)))
                      for n, f in points]).round(1)  # fmt: skip
    text = "n_diff [1/min];F [N];" + ("t_rise [s];" if rises else "") + "t_shift [ms]\n"
    text += "".join(
        f"{n};{f};" + (f"{0.25 if f < 300 else 0.177};" if rises else "") + f"{90.0 + k}\n"
        for k, (n, f) in enumerate(cells)
    )
    found = bench.read(text, "--from", "mq200_stand")
    read = [(r.point.mismatch / RPM, r.point.profile.force) for r in found]
    assert np.array(read) == pytest.approx(np.array(points))
    errors = load_bench("b").errors.each_point
    off = cells - np.array(points)
    scatter = np.sqrt((off**2).mean(axis=0)), np.sqrt(((off / points) ** 2).mean(axis=0))
    assert errors.mismatch_rpm == pytest.approx(scatter[0][0], rel=0.1)
    assert errors.sizes[0] == pytest.approx(scatter[1][1], rel=0.1)
    assert "mismatch is measured" in bench.assumed
    bench.call("init", "study", "--out", "m", "--yes", "--set", "operating.mismatch_rpm=[700.0]")
    words = ["measured in place of set values", "name with --from"]
    bench.refused(text, "--from", "m", words=words)


def test_set_values_stay_as_they_are(bench: Bench) -> None:
    for values in ("45 50 100 149", "100 105 110 115", "25 26 50 52", "141 149 199"):
        rows = "".join(f"{n};469;{100 + k}\n" for n in values.split() for k in range(3))
        found = bench.numbers(f"{HEAD}\n{rows}")
        assert sorted({row[0] for row in found}) == sorted(map(float, values.split()))


def test_a_slip_is_settled_by_the_option_that_it_names(bench: Bench) -> None:
    text = f"mismatch_rpm,force_N,shift_time_s\n{POINTS}"
    said = bench.refused(text, words=["this looks like milliseconds"])
    option = said.partition("or --set '")[2].partition("' applies this")[0]
    assert bench.numbers(text, "--set", option) == PLAIN


def test_terminal_questions_take_options(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(dialogue, "may_ask", lambda yes=False: not yes)
    Path("m.csv").write_text(
        'Number,dn,F,t_shift\n1,50,469,116\n2,100,469,104\n3,"1,200",469,98\nWdh,149,642,97\n'
        "5,149,642,99\n"
    )
    said = ["--decimal=.", "--column order='Number'", "rows=2-4,6", "y", "", "", "", "y"]
    said += ["", "", "", "n"]
    done = CliRunner().invoke(app, ["init", "bench", "m.csv"], input="\n".join(said) + "\n")
    assert done.exit_code == 0, done.stderr
    assert "can be read as 1200" in done.stderr
    assert [round(r.point.mismatch / RPM) for r in load_bench("m").readings] == [50, 100, 1200, 149]
    assert [r.place for r in load_bench("m").readings] == [1.0, 2.0, 3.0, 5.0]


@pytest.mark.parametrize(
    "speeds",
    [
        [100.0, 101.0, 101.4],
        [50.0 * 1.008**k for k in range(12)],
        [50.0, 50.4, 50.9, 51.3, -50.0, -50.4, 149.0, 149.0],
        np.random.default_rng(3).normal(100.0, 1.5, 60).tolist(),
    ],
)
def test_joined_points_lie_beyond_their_limit(speeds: list[float]) -> None:
    rows = [Row(k, n, 469.0, 0.1766, 1 + k % 3, 0.1, True) for k, n in enumerate(speeds)]
    done = joined_rows(rows)
    joined = sorted({row.mismatch for row in done})
    assert all(abs(a - b) > NEAR * max(abs(a), abs(b)) for a, b in pairwise(joined))
    weights = np.array([row.n for row in rows], dtype=float)
    means = np.array([row.mismatch for row in done])
    assert weights @ means == pytest.approx(weights @ np.array(speeds))
    assert joined_rows(done) == done


def test_a_force_beyond_the_rise_times_is_said(bench: Bench) -> None:
    bench.read("dn;F;t [ms]\n50;469;190\n100;900;170\n")
    words = "(235.2 to 641.5 N); 900 N lie beyond and have the rise time of the nearest"
    assert words in bench.assumed


@pytest.mark.parametrize(
    ("title", "option"),
    [
        ("Kraftanstieg 150 ms", "--rise-s 0.15"),
        ("Stand 3, rise time of the force: 0.2 s", "--rise-s 0.2"),
        ("t_rise = 0,18 s", "--rise-s 0.18"),
        ("Stand 3, 150 ms", None),
        ("sunrise test 12, 150 N", None),
    ],
)
def test_a_rise_time_of_a_title_has_its_option(
    bench: Bench, title: str, option: str | None
) -> None:
    bench.read(f"{title}\ndn;F;t [ms]\n50;469;190\n100;469;170\n")
    words = f"which is not taken: {option} takes it for all rows without a rise time"
    assert (words in bench.assumed) == (option is not None)
    assert option is not None or "which is not taken" not in bench.assumed


def test_what_no_table_shows_is_unknown_until_it_is_stated(bench: Bench) -> None:
    text = "dn;F;t [ms]\n50;469;190\n5;469;\n"
    bench.read(text)
    assert "--set record.time_zero=command, or force, states it" in bench.assumed
    assert "--set record.displacement_at=sleeve, or actuator, states it" in bench.assumed
    assert "record.empty_cells says whether they were tried" in bench.assumed
    assert load_bench("b").record == BenchRecord(sense="unknown")
    stated = {"time_zero": "force", "displacement_at": "sleeve", "empty_cells": "failed",
              "sense": "known"}  # fmt: skip
    bench.read(text, *set_options([f"record.{key}={value}" for key, value in stated.items()]))
    assert "unknown" not in bench.assumed
    assert load_bench("b").record == BenchRecord(**stated)
    assert [cell.failed for cell in load_bench("b").cells] == [0, 1]


FOREIGN = """\
Prüfstand 7;;;;;
Datum;23.11.2026;;;;

Nr.;Drehzahldifferenz [1/min];F_shift (kN);t_shift ms;Anzahl;i.O.
1;50;0,469;190,5;10;ja
2;100;0,469;180;10;ja
3;149;0,6415;170,25;10;ja
4;249;0,6415;1000;10;nein
"""


@pytest.mark.parametrize("coding", ["utf-8-sig", "utf-16", "cp1252"])
def test_a_foreign_table_becomes_a_data_set(bench: Bench, dogshape: Call, coding: str) -> None:
    rows = [(r.point.mismatch / RPM, r.point.profile.force, r.point.profile.rise, r.n, r.time)
            for r in bench.read(FOREIGN, coding=coding)]  # fmt: skip
    assert rows == [
        (pytest.approx(50.0), 469.0, pytest.approx(0.1766), 10, pytest.approx(0.1905)),
        (pytest.approx(100.0), 469.0, pytest.approx(0.1766), 10, pytest.approx(0.18)),
        (pytest.approx(149.0), 641.5, pytest.approx(0.12614), 10, pytest.approx(0.17025)),
        (pytest.approx(249.0), 641.5, pytest.approx(0.12614), 10, None),
    ]
    found = load_bench("b")
    assert [r.engaged for r in found.readings] == [True, True, True, False]
    assert hashlib.sha256(Path("m.csv").read_bytes()).hexdigest()[:16] in found.source
    assert Path("b/as_measured/m.csv").read_bytes() == Path("m.csv").read_bytes()
    assert "rises in 0.12614 to 0.1766 s" in bench.assumed
    assert "left out (row 8)" in bench.assumed
    Path("b/notes.txt").write_text("mine")
    again = ("init", "bench", "m.csv", "--out", "b")
    assert "holds files already" in dogshape(*again).sentence
    assert dogshape(*again, "--force").status == 0
    assert Path("b/notes.txt").read_text() == "mine"


def test_every_fault_is_told_at_once(bench: Bench) -> None:
    text = "dn_rpm;F (kN);t_mean_ms;n;ok\n50;0,469;190;10;ja\nfifty;;180;2,5;vielleicht\n"
    said = bench.refused(f"{text}149;0.6415;170,25;10;nein\n", words=(
        "5 mistakes", "row 3: 'fifty'", "(force_N) is empty in row 3", "row 3: 2.5",
        "row 3: 'vielleicht'", "with a comma ('0,469', row 2) and with a point ('0.6415', row 4)",
    ))  # fmt: skip
    assert "Traceback" not in said
    assert [p.name for p in Path().iterdir()] == ["m.csv"]


POINT = ("mismatch_rpm", "force_N", "force_rise_s", "shift_time_s")


def traced_rows() -> list[dict[str, str]]:
    """List the rows of a good data set that have a trace."""
    lines = (GOOD / "shifts.csv").read_text().splitlines()
    return [row for row in csv.DictReader(lines) if row["trace"]]


def traced_table(*files: str) -> str:
    """Write a table of the first of these rows, each with another file of its trace."""
    rows = [
        ",".join([*(row[name] for name in POINT), file])
        for row, file in zip(traced_rows(), files, strict=False)
    ]
    return "\n".join(["dn_rpm,force_N,rise_s,t_s,Datei", *rows, ""])


def test_traces_of_a_foreign_table_come_along(bench: Bench) -> None:
    heads = {"t_s": "Zeit [s]", "displacement_mm": "Weg [m]", "force_N": "Kraft [kN]",
             "sliding_speed_rpm": "Antriebsdrehzahl [1/min]",
             "output_speed_rpm": "Abtriebsdrehzahl [1/min]"}  # fmt: skip
    trace = pd.read_csv(GOOD / traced_rows()[0]["trace"])[[*heads]]
    trace[["displacement_mm", "force_N"]] /= 1e3
    trace.rename(columns=heads).to_csv("t1.csv", index=False)
    readings = bench.read(traced_table("t1.csv"), "--from", str(GOOD)), load_bench(GOOD).readings
    found, wanted = (next(r.trace for r in rows if r.trace is not None) for rows in readings)
    assert found.displacement == pytest.approx(wanted.displacement, rel=1e-6, abs=1e-9)
    assert found.force == pytest.approx(wanted.force, rel=1e-6)


def test_traces_of_one_name_in_two_folders_stay_apart(bench: Bench) -> None:
    files = ["run1/trace.csv", "run2/trace.csv"]
    for file, row in zip(files, traced_rows(), strict=False):
        Path(file).parent.mkdir()
        shutil.copyfile(GOOD / row["trace"], file)
    found = [r.trace for r in bench.read(traced_table(*files), "--from", str(GOOD))]
    wanted = [r.trace for r in load_bench(GOOD).readings if r.trace is not None][:2]
    assert not np.array_equal(wanted[0].force, wanted[1].force)
    for trace, original in zip(found, wanted, strict=True):
        assert trace is not None
        assert trace.force == pytest.approx(original.force, rel=1e-6)


def test_a_fault_of_a_trace_names_the_file_and_row_of_the_user(bench: Bench) -> None:
    lines = (GOOD / traced_rows()[0]["trace"]).read_text().splitlines()
    lines[7] = ",".join([lines[5].split(",")[0], *lines[7].split(",")[1:]])
    Path("t1.csv").write_text("\n".join(["recorder 4", "", *lines]))
    said = bench.refused(
        traced_table("t1.csv"), "--from", str(GOOD), words=[" t1.csv, row 10, column t_s"]
    )
    assert "traces" not in said


def test_a_bench_from_a_study_has_its_contact_and_what_moves_with_the_ring(bench: Bench) -> None:
    bench.read(FOREIGN, "--from", "mq200")
    found, study = load_bench("b"), load_study("mq200")
    assert found.clutch.rings.mass == pytest.approx(0.3 + 0.3)
    assert replace(found.clutch.contact, name=study.clutch.contact.name) == study.clutch.contact
    assert "0.3 kg of the [mechanism] of 'mq200' move with the ring" in bench.assumed
    assert "friction, drag and linkage are left for the diagnosis" in bench.assumed
    again = build_study(validate(StudyFile, study_of(found, "back"), "back"))
    assert again.clutch.contact.stiffness == study.clutch.contact.stiffness
    assert again.clutch.contact.dissipation == study.clutch.contact.dissipation


SERIES = """\
Lfd. Nr.;Datum Uhrzeit;dn [1/min];F [N];Schaltzeit [ms];Standardabweichung [ms];Anzahl
2;31.05.2024 14:06:00;50;469;190,5;12,5;10
1;31.05.2024 14:05:00;100;469;180;9;10
3;31.05.2024 14:07:30;149;641,5;170,25;;1
"""


def test_spread_order_and_time_stamps_of_a_foreign_table_come_along(bench: Bench) -> None:
    readings = bench.read(SERIES)
    assert [r.sd for r in readings] == [pytest.approx(0.0125), pytest.approx(0.009), None]
    assert [r.place for r in readings] == [2.0, 1.0, 3.0]
    lines = Path("b/shifts.csv").read_text().splitlines()
    assert lines[0].endswith("trace,shift_time_sd_s,order,timestamp")
    assert lines[1].endswith(",0.0125,2,2024-05-31T14:06:00+00:00")
    assert "'Lfd. Nr.' is the order of the shifts" in bench.assumed
    taken = {row["quantity"]: row["unit"] for row in bench.json["columns"]}
    assert (taken["shift_time_sd_s"], taken["order"], taken["timestamp"]) == ("ms", None, None)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("31.05.2024 14:07:30", "14:07", "has '14:07', which is no date and time as"),
        ("31.05.2024 14:07:30", "", "column timestamp is '', but it must be filled"),
        ("31.05.2024 14:07:30", "5", "timestamp=- to leave it out"),
        ("\n3;", "\n2;", "has a number twice, so it is no place in the whole series"),
    ],
)
def test_what_cannot_be_read_of_a_series_is_asked_about(
    bench: Bench, old: str, new: str, words: str
) -> None:
    bench.refused(SERIES.replace(old, new), words=[words])
    readings = bench.read(SERIES.replace(old, new), *_options(("order=-", "timestamp=-")))
    assert [r.place for r in readings] == [None] * 3
