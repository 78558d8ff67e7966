"""Tables as stands, loggers and spreadsheets write them: read rightly and said, or refused."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from dogshape.cli.app import app
from dogshape.cli.verbs import init as verbs
from dogshape.diagnosis.bench.bench_data import Reading, load_bench
from dogshape.diagnosis.bench.table import NEAR, Row, joined_rows
from dogshape.sim.units import RPM
from tests.conftest import Said

Call = Callable[..., Said]
Numbers = list[float]

HEAD = "dn [1/min];F [N];Schaltzeit [ms]"


class Bench:
    """What ``init bench`` makes of a text."""

    def __init__(self, call: Call) -> None:
        self.call = call

    def said(self, text: str, *options: str, name: str = "m.csv") -> Said:
        Path(name).write_text(text, encoding="utf-8")
        shutil.rmtree("b", ignore_errors=True)
        return self.call("init", "bench", name, "--json", "--out", "b", *options)

    def refused(self, text: str, *options: str, words: Sequence[str] = ()) -> str:
        found = self.said(text, *options)
        assert found.status == 2, found.out
        assert not Path("b").exists()
        for word in words:
            assert word in found.err
        return found.err

    def read(self, text: str, *options: str, name: str = "m.csv") -> list[Reading]:
        found = self.said(text, *options, name=name)
        assert found.status == 0, found.err
        self.json = found.json
        return list(load_bench("b").readings)

    def numbers(self, text: str, *options: str, name: str = "m.csv") -> list[Numbers]:
        """Mismatch in 1/min, force in N and time in ms of each row."""
        return [
            [
                round(r.point.mismatch / RPM, 6),
                round(r.point.profile.force, 6),
                round(1e3 * r.time, 6) if r.time is not None else np.nan,
            ]
            for r in self.read(text, *options, name=name)
        ]

    @property
    def left_out(self) -> str:
        return " | ".join(
            f"{one.get('row', one.get('column'))}: {one['reason']}" for one in self.json["left_out"]
        )


@pytest.fixture
def bench(dogshape: Call) -> Bench:
    return Bench(dogshape)


PLAIN = [[50.0, 469.0, 116.2], [100.0, 469.0, 103.7], [149.0, 642.0, 98.3], [50.0, 642.0, 95.2]]
ROWS = "50;469;116,2\n100;469;103,7\n149;642;98,3\n50;642;95,2\n"


@pytest.mark.parametrize(
    ("foot", "reason"),
    [
        ("Moyenne;87,25;555,5;103,35\n", "sum or mean of the rows above"),
        (";349;2222;413,4\n", "sum or mean of the rows above"),
        ("平均;87,25;555,5;103,35\n標準偏差;47,4;99,9;9,3\n", "a number ('平均')"),
        ("Min;50;469;95,2\nMax;149;642;116,2\n", "statistic of the rows above ('Max')"),
        ("count;4;4;4\n25%;50;469;97,5\n", "statistic of the rows above ('25%')"),
        ("\nGrenzwert;200;800;130\n", "word where other rows have a number ('Grenzwert')"),
        ("\nEnde der Messung;;;\n", "has no number ('Ende der Messung')"),
    ],
)
def test_rows_at_the_foot_are_no_shifts(bench: Bench, foot: str, reason: str) -> None:
    rows = "".join(f"{k};{row}\n" for k, row in enumerate(ROWS.splitlines(), start=1))
    assert bench.numbers(f"Nr;{HEAD}\n{rows}{foot}") == PLAIN
    assert reason in bench.left_out
    bare = foot.partition(";")[2] if foot.startswith((";", "Moy")) else ""
    assert bench.numbers(f"{HEAD}\n{ROWS}{bare}") == PLAIN


def test_statistics_within_a_table_have_their_name_or_are_a_question(bench: Bench) -> None:
    one = "V01;50;469;110\nV02;50;469;120\nMittel A;50;469;115\nStabw.;0;0;7,1\n"
    text = f"Probe;{HEAD}\n{one}V03;100;469;100\nref;100;469;104\nØ;100;469;102\n"
    assert [row[2] for row in bench.numbers(text)] == [110.0, 120.0, 100.0, 104.0]
    assert all(f"{row}: statistic" in bench.left_out for row in (4, 5, 8))
    for word in ("Wdh", ""):
        text = f"Nr;{HEAD}\n1;50;469;116,2\n{word};100;469;103,7\n3;149;642;98,3\n4;50;642;95,2\n"
        bench.refused(text, words=[f"row 3 has '{word}' where other rows have a number", "--rows"])
    assert len(bench.numbers(text, "--rows", "2-5")) == 4
    assert len(bench.numbers(text, "--rows", "2,4-5")) == 3
    assert "3: not among --rows" in bench.left_out
    bench.refused(text, "--rows", "all", words=["--rows is 'all'"])


@pytest.mark.parametrize(
    "rows",
    [
        "1;50;469;116,2\n2;100;469;103,7\n2b;100;469;105,1\n3;149;642;98,3\n",
        "1;50;469;110\n2;100;469;100\n3;150;469;90\n4;100;469;104\n",
        "io;50;469;110\nnio;100;469;100\nn;150;469;90\nMax Muster;100;469;104\n",
    ],
)
def test_shifts_that_only_look_like_sums_stay(bench: Bench, rows: str) -> None:
    found = bench.numbers(f"Nr;{HEAD}\n{rows}")
    assert len(found) == 4 - ("\nn;" in rows)


@pytest.mark.parametrize(
    ("cells", "value"),
    [
        (("1\N{NARROW NO-BREAK SPACE}200,5", "800"), 1200.5),
        (("1\N{RIGHT SINGLE QUOTATION MARK}200", "800"), 1200.0),
        (("1.200,5", "800"), 1200.5),
        (("1.200", "800,5"), 1200.0),
        (("12E+2", "800"), 1200.0),
        (("+ 1200", "800"), 1200.0),
    ],
)
def test_thousands(bench: Bench, cells: tuple[str, str], value: float) -> None:
    text = f"{HEAD}\n50;{cells[0]};96,2\n100;{cells[1]};103,7\n149;900;98,3\n"
    assert bench.numbers(text)[0][1] == value


@pytest.mark.parametrize(
    "text",
    [
        "dn;F [N];shift time [ms]\n50;1.200;96\n100;800;103\n149;900;98\n",
        'dn,F [N],shift time [ms]\n50,"1,200",96\n100,800,103\n149,900,98\n',
        "dn;F [N];shift time [ms]\n50;1.200;96\n100;1.120;103\n149;1.300;98\n",
    ],
)
def test_thousands_that_may_be_decimals_are_asked_about(bench: Bench, text: str) -> None:
    said = bench.refused(text, words=["can be read as 1200", "or as 1.200", "--decimal"])
    sign = "." if '"1,200"' in text else ","
    assert f"1200, --decimal {sign}" in said
    assert bench.numbers(text, "--decimal", sign)[0][1] == 1200.0
    point = 'dn,F [N],shift time [ms]\n50,"1,200",96.2\n100,800,103.7\n149,900,98.3\n'
    assert bench.numbers(point)[0][1] == 1200.0


def test_decimals_with_three_digits_are_no_thousands(bench: Bench) -> None:
    text = "dn;F [kN];shift time [s]\n50;1,120;0,116\n100;1,250;0,104\n149;1,469;0,098\n"
    assert [row[1] for row in bench.numbers(text)] == [1120.0, 1250.0, 1469.0]
    assert {c["decimals"] for c in bench.json["columns"]} == {"comma", None}
    text = "dn,F [N],shift time [ms]\n50.000,469.000,116.250\n100.000,469.000,104.125\n"
    assert bench.numbers(text)[0] == [50.0, 469.0, 116.25]


@pytest.mark.parametrize("minus", ["-", "\N{MINUS SIGN} ", "\N{EN DASH}"])
def test_signs_apart_and_of_other_letters(bench: Bench, minus: str) -> None:
    text = f"dn;F [N];shift time [ms]\n+ 50;469;116\n{minus}100;+ 469;104\n149;642;98\n"
    assert [row[0] for row in bench.numbers(text)] == [50.0, -100.0, 149.0]


@pytest.mark.parametrize(
    "head",
    [
        "NO.,Time,dn,F_shift,t_shift\n-,hh:mm,1/min,N,ms\n",
        "Nr,Zeit,dn,F_shift,t_shift\n,,[1/min],[N],[ms]\n",
        "Test,When,Input,,\nNo,Hour,dn,F_shift,t_shift\n,,1/min,N,ms\n",
    ],
)
def test_heads_of_two_lines_and_units_in_some_cells(bench: Bench, head: str) -> None:
    rows = "".join(f"{k + 1},14:0{k}:30,{row.replace(',', '.').replace(';', ',')}\n"
                   for k, row in enumerate(ROWS.splitlines()))  # fmt: skip
    assert bench.numbers(f"Logger 7\nsteps,1 ms\n{head}{rows}") == PLAIN
    assert {c["unit"] for c in bench.json["columns"]} >= {"N", "ms"}


COMMENTED = "50,469,116.2\n100,469,103.7\n149,642,98.3\n50,642,95.2\n"


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("# stand 7\n# dn,F,t_shift\n" + COMMENTED, (1,)),
        ("% exported 2024\n% dn;F;t\n% 1/min;N;ms\n" + COMMENTED.replace(",", ";"), (1,)),
        ("# stand 7\n# gear 3\ndn,F,t\n# units\n1/min,N,ms\n" + COMMENTED, (1, 2, 4)),
        ("Stand 7;Smith;2024\ndn;F;t_shift\n" + COMMENTED.replace(",", ";"), (1,)),
        ("dn|F|t\n# first campaign\n" + COMMENTED.replace(",", "|"), (2,)),
    ],
)
def test_comments_and_titles_are_no_names(bench: Bench, text: str, rows: tuple[int, ...]) -> None:
    assert bench.numbers(text) == PLAIN
    assert [one["row"] for one in bench.json["left_out"]] == list(rows)
    heads = {column["column"] for column in bench.json["columns"]}
    assert heads in ({"dn", "F", "t_shift"}, {"dn", "F", "t"})


LVM = """\
LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
Decimal_Separator\t{sign}
***End_of_Header***\t
\t
Channels\t3\t\t\t
Samples\t2\t2\t2\t
X0\t0\t0\t0\t
***End_of_Header***\t\t\t\t
X_Value\tdn (1/min)\tF_shift (N)\tt_shift (ms)\tComment
{one}
{two}"""


@pytest.mark.parametrize("sign", [",", "."])
def test_labview_tables(bench: Bench, sign: str) -> None:
    rows = [f"\t{row.replace(';', chr(9)).replace(',', sign)}\tok" for row in ROWS.splitlines()]
    text = LVM.format(sign=sign, one="\n".join(rows), two="")
    assert bench.numbers(text, name="m.lvm") == PLAIN
    assert "X_Value: empty" in bench.left_out
    again = LVM.format(sign=sign, one="\n".join(rows[:2]), two="")
    head = again[again.index("Channels") :]
    both = again + head.replace(head[head.index("\t50") :], "\n".join(rows[2:]))
    assert bench.numbers(both, name="m.lvm") == PLAIN


def test_a_table_without_names_or_separators_is_asked_about(bench: Bench) -> None:
    text = "".join(f"{a:.7e};{b:.7e};{c:.7e}\n" for a, b, c in PLAIN)
    bench.refused(text, words=["no column looks like mismatch_rpm", "'column 1'"])
    options = ("mismatch_rpm=column 1:1/min", "force_N=column 2:N", "shift_time_s=column 3:ms")
    assert bench.numbers(text, *(o for one in options for o in ("--column", one))) == PLAIN
    blanks = "dn F t_shift\n" + text.replace(";", "  ")
    bench.refused(blanks, words=["with semicolons, tabs or commas between cells"])


def test_names_that_are_there_twice(bench: Bench) -> None:
    text = "time;dn;time;F;time;t_shift\n" + "".join(
        f"{k}.5;{a};{k}.6;{b};{k}.7;{c}\n" for k, (a, b, c) in enumerate(PLAIN)
    )
    assert bench.numbers(text) == PLAIN
    assert bench.left_out.count("time: ") == 3
    text = text.replace("time;dn;time;F;time;t_shift", "dn;dn;x;F;y;t_shift")
    bench.refused(text, words=["mismatch_rpm", "column 1", "column 2"])
    assert bench.numbers(text, "--column", "mismatch_rpm=column 2:1/min") == PLAIN


STAMPED = "When;dn;F;t_shift\n"


@pytest.mark.parametrize(
    ("cells", "form"),
    [
        (("31.05.2024 14:05:09,5", "31.05.2024 14:05:39,5", "01.06.2024 14:05:09,5"), ""),
        (("2024/05/31 14:05:09", "2024/05/31 14:05:39", "2024/06/01 14:05:09"), ""),
        (("31/05/2024 14:05:09", "31/05/2024 14:05:39", "01/06/2024 14:05:09"),
         ":%d/%m/%Y %H:%M:%S"),
        (("05/31/2024 2:05:09 PM", "05/31/2024 2:05:39 PM", "06/01/2024 2:05:09 PM"),
         ":%m/%d/%Y %I:%M:%S %p"),
    ],
)  # fmt: skip
def test_dates(bench: Bench, cells: tuple[str, str, str], form: str) -> None:
    rows = "".join(f"{c};{a};{b};{t}\n" for c, (a, b, t) in zip(cells, PLAIN[:3], strict=True))
    if form:
        words = [f"has '{cells[0]}', which is no date and time as", "%d/%m/%Y %H:%M:%S'"]
        bench.refused(STAMPED + rows, words=words)
    options = ("--column", f"timestamp=When{form}") if form else ()
    places = [r.place for r in bench.read(STAMPED + rows, *options)]
    assert [float(b or 0) - float(a or 0) for a, b in pairwise(places)] == [
        pytest.approx(30.0, abs=0.02), pytest.approx(86_370.0, abs=0.02),
    ]  # fmt: skip
    (said,) = (c for c in bench.json["columns"] if c["quantity"] == "timestamp")
    assert said["first"].startswith("2024-05-31T14:05:09")


def test_clocks_and_numbers_as_time_stamps(bench: Bench) -> None:
    rows = ["23:59:30;50;469;116", "23:59:59;100;469;104", "00:00:30;149;642;98"]
    places = [r.place for r in bench.read(STAMPED + "\n".join(rows))]
    assert np.diff(np.array(places, dtype=float)).tolist() == [29.0, 31.0]
    numbers = STAMPED.replace("When", "Zeitstempel") + "40000;50;469;116\n40012;100;469;104\n"
    bench.refused(numbers, words=["--column timestamp='Zeitstempel:s' for numbers of seconds"])
    places = [r.place for r in bench.read(numbers, "--column", "timestamp=Zeitstempel:s")]
    assert places == [40_000.0, 40_012.0]
    assert [r.place for r in bench.read(numbers, "--column", "timestamp=-")] == [None, None]


@pytest.mark.parametrize("counter", ["1 2 3 4", "20 19 18 17", "1 2 4 5"])
def test_a_running_number_is_no_count_of_shifts(bench: Bench, counter: str) -> None:
    rows = "".join(f"{n},{a},{b},{c}\n" for n, (a, b, c) in
                   zip(counter.split(), PLAIN, strict=True))  # fmt: skip
    text = f"Number,dn,F,t_shift\n{rows}"
    bench.refused(text, words=["'Number' numbers the rows", "--column order='Number'"])
    said = ("--column", "order=Number")
    assert [r.place for r in bench.read(text, *said)] == [float(n) for n in counter.split()]
    unnamed = bench.read(text.replace("Number", "Versuch"))
    assert [(r.n, r.place) for r in unnamed] == [(1, None)] * 4
    assert "Versuch: numbers the rows" in bench.left_out


def test_counts_of_shifts_stay_counts(bench: Bench) -> None:
    for counts in ("5 10 20 40", "1 1 1 1", "10 12 9 10"):
        rows = "".join(f"{n},{a},{b},{c}\n" for n, (a, b, c) in
                       zip(counts.split(), PLAIN, strict=True))  # fmt: skip
        assert [r.n for r in bench.read(f"Number,dn,F,t_shift\n{rows}")] == [
            int(n) for n in counts.split()
        ]


def test_two_columns_of_times(bench: Bench) -> None:
    def text(one: str, other: str) -> str:
        return f"{one},dn,F,{other}\n" + "".join(
            f"{12.4 * k + 3.7},{a},{b},{c}\n" for k, (a, b, c) in enumerate(PLAIN)
        )

    for one, other in (("t [s]", "Dauer [ms]"), ("time [s]", "T90 [ms]"), ("Zeit [min]", "t [ms]")):
        assert bench.numbers(text(one, other)) == PLAIN
        assert bench.json["assumed"][-1] != "the stand gives up after 60 s"
    falling = text("t1 time [ms]", "time t2 [ms]").replace("16.1", "1.1")
    bench.refused(falling, words=["shift_time_s may be the column", "say which"])
    alone = "".join(f"{12.4 * k},{a},{b}\n" for k, (a, b, _) in enumerate(PLAIN, start=1))
    bench.refused(f"time [s],dn,F\n{alone}", words=["grows from row to row as a clock does"])


@pytest.mark.parametrize(
    "times", ["0.116 1.0 0.098 0.1", "0.116 0.5 0.098 0.5", "0.9 1 0.95 1 0.8 1", "0.1 2 2 0.2"]
)
def test_time_outs_that_are_written_as_times(bench: Bench, times: str) -> None:
    rows = "".join(f"{25 * k + 25},469,{t}\n" for k, t in enumerate(times.split()))
    text = f"dn,F,shift time [s]\n{rows}"
    most = max(map(float, times.split()))
    bench.refused(text, words=[f"say --set timeout_s={most:g} where these shifts did not engage"])
    found = bench.read(text, "--set", f"timeout_s={most}")
    late = [float(t) == most for t in times.split()]
    assert [r.engaged is False for r in found] == late
    assert "are shifts that did not engage" in " ".join(bench.json["assumed"])
    longer = bench.read(text, "--set", f"timeout_s={3 * most}")
    assert [r.time for r in longer] == [float(t) for t in times.split()]


def test_equal_times_of_a_coarse_clock_are_no_time_outs(bench: Bench) -> None:
    times = "0.05 0.06 0.06 0.07 0.12 0.06 0.07 0.12 0.08 0.09"
    rows = "".join(f"50,469,{t}\n" for t in times.split())
    assert len(bench.read(f"dn,F,shift time [s]\n{rows}")) == 10
    assert "multiples of 10 ms" in " ".join(bench.json["warnings"])


@pytest.mark.parametrize(
    ("words", "engaged"),
    [
        ("ja nein ja ja", [True, False, True, True]),
        ("io nio io -", [True, False, True, None]),
        ("1 0 1 1", [True, False, True, True]),
    ],
)
def test_words_for_engaged(bench: Bench, words: str, engaged: list[bool | None]) -> None:
    rows = "".join(f"{w};{a};{b};{'' if e is not True else c}\n" for w, e, (a, b, c) in
                   zip(words.split(), engaged, PLAIN, strict=True))  # fmt: skip
    found = bench.read(f"eingelegt;dn;F;t_shift\n{rows}")
    assert [r.engaged for r in found] == engaged
    (said,) = (c["why"] for c in bench.json["columns"] if c["quantity"] == "engaged")
    assert f"{words.split(maxsplit=1)[0].lower()} = yes" in said


def test_other_words_for_engaged_are_asked_about(bench: Bench) -> None:
    text = "ok;dn;F;t_shift\nx;50;469;116\n;100;469;\nx;149;642;98\n"
    for said, engaged in (("", None), (":empty=no", False)):
        found = bench.read(text, "--column", f"engaged=ok{said}")
        assert [r.engaged for r in found] == [True, engaged, True]
    other = text.replace("x;", "geschafft;").replace("\n;100", "\nhängt;100")
    bench.refused(other, words=["must be yes, no or empty", "--column engaged=- to leave it out"])
    assert [r.engaged for r in bench.read(other, "--column", "engaged=-")] == [True, None, True]
    found = bench.read(other, "--column", "engaged=ok:geschafft=yes,hängt=no")
    assert [r.engaged for r in found] == [True, False, True]
    failed = "Fehler;dn;F;t_shift\n;50;469;116\nx;100;469;\n;149;642;98\n"
    assert [r.engaged for r in bench.read(failed)] == [True, None, True]


SPEEDS = [(1450.0, 1500.0), (1450.0, 1550.0), (1461.0, 1610.0)]


def test_two_speeds_are_a_mismatch_by_formula(bench: Bench) -> None:
    rows = "".join(f"{a:.9g};{b * np.pi / 30.0:.9g};469;{116 - k}\n"
                   for k, (a, b) in enumerate(SPEEDS))  # fmt: skip
    text = f"n_in [1/min];n-out [rad/s];F [N];t_shift [ms]\n{rows}"
    bench.refused(text, words=["mismatch_rpm may be", "n-out - n_in", "docs/mismatch.md"])
    for formula, factor in (("n-out - n_in", 1.0), ("(n_in - n-out)/2", -0.5)):
        found = bench.numbers(text, "--column", f"mismatch_rpm={formula}")
        assert [row[0] for row in found] == [
            pytest.approx(factor * one, abs=1e-4) for one in (50.0, 100.0, 149.0)
        ]
    (said,) = (c for c in bench.json["columns"] if c["quantity"] == "mismatch_rpm")
    assert "sign is that of the formula" in said["why"]
    bench.refused(text, "--column", "mismatch_rpm=n2 - n3", words=["no such column"])
    for wrong in ("n_in -", "n_in / 0", "n_in(n-out)", "n_out2 - n_in"):
        bench.refused(text, "--column", f"mismatch_rpm={wrong}", words=["is no formula"])


@pytest.mark.parametrize("head", ["Δω [1/s]", "domega", "Winkelgeschwindigkeit"])
def test_an_angular_speed_is_never_revolutions_a_minute(bench: Bench, head: str) -> None:
    text = f"{head};F [N];t_shift [ms]\n5.2;469;116\n10.4;469;104\n"
    options = () if head != "Winkelgeschwindigkeit" else ("--column", f"mismatch_rpm={head}")
    if head == "domega":
        options = ("--column", "mismatch_rpm=domega")
    bench.refused(text, *options, words=["revolutions as well as radians", "rad/s"])
    found = bench.numbers(text, "--column", f"mismatch_rpm={head}:rad/s")
    assert found[0][0] == pytest.approx(5.2 * 30.0 / np.pi, abs=1e-4)


def measured(seed: int, *, rises: bool = True) -> tuple[str, list[tuple[float, float]]]:
    """Make single shifts whose speed and force were measured, and their set values."""
    draw = np.random.default_rng(seed)
    points = [(n, f) for n in (25, 50, 100, 149) for f in (235.2, 469.0) for _ in range(5)]
    rows = [
        f"{n + draw.normal(0.0, 1.2):.1f};{f * (1.0 + draw.normal(0.0, 0.01)):.1f};"
        + (f"{0.25 if f < 300 else 0.177};" if rises else "") + f"{draw.uniform(90, 130):.1f}"
        for n, f in points
    ]  # fmt: skip
    head = "n_diff [1/min];F [N];" + ("t_rise [s];" if rises else "") + "t_shift [ms]\n"
    return head + "\n".join(rows), points


@pytest.mark.parametrize("rises", [True, False])
def test_measured_values_get_the_set_values_of_the_origin(bench: Bench, rises: bool) -> None:
    text, points = measured(1, rises=rises)
    found = bench.read(text, "--from", "mq200_stand")
    for reading, (mismatch, force) in zip(found, points, strict=True):
        assert reading.point.mismatch / RPM == pytest.approx(mismatch)
        assert reading.point.profile.force == pytest.approx(force)
    errors = load_bench("b").errors.each_point
    cells = np.array([row.split(";")[:2] for row in text.splitlines()[1:]], dtype=float)
    scatter = np.sqrt(((cells - np.array(points)) ** 2).mean(axis=0))
    assert errors.mismatch / RPM == pytest.approx(scatter[0], rel=0.1)
    assert errors.force_share == pytest.approx(
        np.sqrt(((cells[:, 1] / np.array(points)[:, 1] - 1.0) ** 2).mean()), rel=0.1
    )
    assert "mismatch is measured" in " ".join(bench.json["assumed"])
    bench.call("init", "study", "--out", "m", "--yes", "--set", "operating.mismatch_rpm=[700.0]")
    bench.refused(
        text, "--from", "m", words=["measured in place of set values", "name with --from"]
    )


def test_set_values_stay_as_they_are(bench: Bench) -> None:
    for values in ("45 50 100 149", "100 105 110 115", "25 26 50 52", "141 149 199"):
        rows = "".join(f"{n};469;{100 + k}\n" for n in values.split() for k in range(3))
        found = bench.numbers(f"{HEAD}\n{rows}")
        assert sorted({row[0] for row in found}) == sorted(map(float, values.split()))


def test_every_column_and_row_that_is_left_out_has_its_reason(bench: Bench) -> None:
    text = ("Nr;rem;dn;Öltemp [°C];F;t_shift;leer\n1;a;50;60;469;116;\n2;b;100;61;469;104;\n"
            "# Pause;;;;;;\n3;c;149;63;642;98;\n")  # fmt: skip
    assert len(bench.read(text)) == 3
    for words in ("Nr: numbers the rows", "Öltemp [°C]: no quantity of this name",
                  "leer: empty", "4: has no number ('# Pause')"):  # fmt: skip
        assert words in bench.left_out
    for name in ("column", "unit", "decimals", "first", "least", "largest", "why"):
        assert all(name in column for column in bench.json["columns"])


def test_two_tables_in_a_file(bench: Bench) -> None:
    again = f"{HEAD}\n50;469;116\n100;469;104\n{HEAD}\n149;642;98\n"
    assert len(bench.read(again)) == 3
    assert "4: repeats the head" in bench.left_out
    other = f"{HEAD}\n50;469;116\n100;469;104\n\nF [N];dn [1/min];t [ms]\n642;149;98\n"
    bench.refused(other, words=["another table begins in row 5", "--rows 2-3"])


@pytest.mark.parametrize(
    "text",
    [
        "dn,F,t_shift\n50 rpm,0.469 kN,116.2ms\n100 rpm,0.469 kN,103.7ms\n",
        "dn,F,t_shift\n50,469 N,116.2\n100,469,103.7\n149,642,98.3\n",
        "dn [rpm],F [N],t_shift [ms]\n50,469,116.2\n100,0.469 kN,103.7\n149,642,98.3\n",
    ],
)
def test_units_behind_numbers_are_refused(bench: Bench, text: str) -> None:
    bench.refused(text, words=["number"])


def test_a_slip_is_settled_by_the_option_that_it_names(bench: Bench) -> None:
    text = "mismatch_rpm,force_N,shift_time_s\n50,469,116.2\n100,469,103.7\n149,642,98.3\n"
    said = bench.refused(text, words=["this looks like milliseconds"])
    option = said.partition("or --set '")[2].partition("' takes it")[0]
    assert bench.numbers(text, "--set", option) == PLAIN[:3]


def test_questions_in_a_terminal_take_the_options(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(verbs, "may_ask", lambda yes: not yes)
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
