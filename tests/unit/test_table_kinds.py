"""Kinds of other people's tables, each in other words: read rightly, or asked about by its rows.

A table that is read has the times of ``TIMES`` in ms unless it says others. A refusal has its
words, and the option behind it reads the times that follow.
"""

from __future__ import annotations

import shutil
import tracemalloc
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, time, timedelta
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

import pandas as pd
import pytest
from openpyxl import Workbook, load_workbook
from openpyxl.comments import Comment
from openpyxl.formatting.rule import CellIsRule, FormulaRule, Rule
from openpyxl.styles import Font, PatternFill
from typer.testing import CliRunner

from dogshape.bench.bench_data import load_bench
from dogshape.bench.decoding import CODE_PAGES, decode_text
from dogshape.cli import dialogue
from dogshape.cli.app import app
from dogshape.sim.files import write_frame
from tests.conftest import Call

TIMES = [116.0, 131.0, 84.0, 71.0, 98.0, 103.0]
POINTS = [(50, 469), (50, 469), (100, 469), (100, 642), (149, 642), (149, 642)]
HEAD = "dn [1/min];F_shift [N];t_shift [ms]"
ROWS = [f"{n};{f};{t:.0f}" for (n, f), t in zip(POINTS, TIMES, strict=True)]


@dataclass(frozen=True)
class Case:
    """A table, and what is right: times in ms, or words of the refusal and what settles it."""

    table: str | bytes
    times: Sequence[float] = tuple(TIMES)
    words: tuple[str, ...] = ()
    option: tuple[str, ...] = ()
    forces: tuple[float, ...] = ()


def text_of(*rows: str, head: str = HEAD) -> str:
    return "\n".join([head, *rows]) + "\n"


def beside(name: str, cells: Sequence[str], *, first: bool = False, times: str = "") -> str:
    """Write the plain table with one more column."""
    kept = [float(t) for t in times.split()] if times else TIMES
    rows = [f"{n};{f};{t:.0f}" for (n, f), t in zip(POINTS, kept, strict=True)]
    if first:
        return text_of(*(f"{c};{row}" for c, row in zip(cells, rows, strict=True)),
                       head=f"{name};{HEAD}")  # fmt: skip
    return text_of(*(f"{row};{c}" for c, row in zip(cells, rows, strict=True)),
                   head=f"{HEAD};{name}")  # fmt: skip


SIX = "\n".join(ROWS)
SIGNS = ("Bad", "", "", "", "X", "", "")
KINDS: dict[str, Case] = {
    # 7 encodings
    "utf-16 big end, Italian": Case(
        text_of(*ROWS, head="Differenza di velocità [giri/min];Forza [N];Tempo di innesto [ms]")
        .encode("utf-16-be")),
    "MacRoman with its line ends": Case(
        text_of(*(f"{row}000" for row in ROWS),
                head="Differenzdrehzahl [1/min];Schaltkraft für Größe [N];Schaltzeit [µs]")
        .replace("\n", "\r").encode("mac_roman")),
    "DOS, umlauts": Case(
        text_of(*ROWS, head="Drehzahldifferenz [1/min];Schaltkraft geprüft [N];Schaltzeit [ms]")
        .replace("\n", "\r\n").encode("cp437")),
    "two-character umlauts": Case(
        text_of(*ROWS,
                head="Drehzahldifferenz [1/min];Schaltkraft u\u0308ber [N];Schaltzeit [ms]")),
    # 8 quotation marks
    "quote before a name": Case(
        beside("note", ['"ok', "", "", "", "", ""]), words=("row 2", "quotation mark")),
    "quotes over three rows": Case(
        text_of(*ROWS).replace(";131", ';131;"see').replace("149;642;98", '149;642;98;x"'),
        words=("row 3", "quotation mark")),
    "comma separated, quote in a remark": Case(
        beside("Remark", ["", "", '"noisy', "", "", ""]).replace(";", ","),
        words=("row 4", "quotation mark")),
    "inches are no quotation": Case(
        beside("pipe", ['1/4"'] * 6)),
    "quotes of a word processor": Case(
        text_of(*("“" + row.replace(";", "”;„") + "“" for row in ROWS))),
    "quote that is no quotation": Case(
        beside("note", ['"ok', "", "", "", "", ""]), words=("--quotes none", "--rows 2-7"),
        option=("--rows", "2-7")),
    "quotes over two rows": Case(
        beside("note", ["", '"ok', "", 'x"', "", ""]), words=("2 lines would be lost",),
        option=("--rows", "2-7")),
    "inch marks in all rows": Case(
        beside("pipe", ['"1/4', '"1/4', '"1/4', '"1/4', '"1/4', '"1/4']),
        words=("row 2: a quotation mark", "--quotes none"), option=("--quotes", "none")),
    "quote, comma separated": Case(
        beside("note", ["", "", '"ok', "", "", ""]).replace(";", ","),
        words=("--quotes none", "--rows 2-7"), option=("--rows", "2-7")),
    # 9 matrix, transposed
    "matrix with units in its head": Case(
        "dn [1/min];235 N;469 N;642 N\n25;121;93;77\n50;118;88;70\n100;99;81;66\n",
        words=("matrix",)),
    "matrix without a corner": Case(
        "Mean shift time [ms], force across\n;235;469;642\n25;121;93;77\n50;118;88;70\n",
        words=("matrix",)),
    "matrix with names": Case(
        "F [N];dn=25 1/min;dn=50 1/min;dn=100 1/min\n235;121;93;77\n469;118;88;70\n",
        words=("matrix",)),
    "transposed, English": Case(
        "mismatch [rpm],50,50,100,100,149,149\nshift force [N],469,469,469,642,642,642\n"
        "shift time [ms],116,131,84,71,98,103\n"),
    "transposed with units beside": Case(
        "Differenzdrehzahl [1/min]\t50\t50\t100\nSchaltkraft [N]\t469\t469\t469\n"
        "Schaltzeit [s]\t0,116\t0,131\t0,084\n", times=TIMES[:3]),
    "transposed, numbered": Case(
        "Nr;1;2;3\ndn [1/min];50;50;100\nF [kN];0,469;0,469;0,469\nt_shift [ms];116;131;84\n",
        times=TIMES[:3]),
    # 10 repeats
    "repeats, runs": Case(
        "speed difference [rpm],force [N],run 1 [ms],run 2 [ms],run 3 [ms]\n50,469,116,131,84\n"
        "100,642,71,98,\n", times=TIMES[:5]),
    "repeats below a title": Case(
        "dn [1/min];F [N];Schaltzeit [ms];;\n;;1;2;3\n50;469;116;131;84\n100;642;71;98;103\n"),
    "repeats with number and deviation": Case(
        "dn;F;Schaltzeit 1 [ms];Schaltzeit 2 [ms];Mittelwert [ms];s [ms];n\n"
        "50;469;116;131;123,5;10,6;2\n100;642;71;98;84,5;19,1;2\n", times=[116, 131, 71, 98]),
    "phases are no repeats": Case(
        "dn;F;t1 [ms];t2 [ms];t3 [ms]\n50;469;20;116;131\n100;642;21;71;98\n",
        words=("repeats of a shift, or phases", "'t1 [ms]'"),
        option=("--column", "shift_time_s=t3 [ms]"), times=[131, 98]),
    # 11 blocks
    "blocks, English": Case(
        "mismatch: 50 rpm; force: 469 N\nNo;time [ms]\n1;116\n2;131\n\n"
        "mismatch: 100 rpm; force: 642 N\nNo;time [ms]\n1;84\n2;71\n", words=("in titles",)),
    "blocks in two columns": Case(
        "Messpunkt 50 1/min / 469 N\nt [ms];Kommentar\n116;\n131;\nMesspunkt 100 1/min / 469 N\n"
        "t [ms];Kommentar\n84;\n71;\n", words=("in titles",)),
    "names between the rows": Case(
        text_of(*ROWS[:3], "Gang 2", *ROWS[3:]), words=("row 5 'Gang 2'", "--rows"),
        option=("--rows", "2-4"), times=TIMES[:3]),
    "value in first row, force": Case(
        text_of(ROWS[0], ";;131", "100;469;84", ";642;71"), words=("--fill-down",),
        option=("--fill-down",), times=TIMES[:4]),
    # 13 numbers and units
    "factor before the unit": Case(
        text_of(*(f"{row}0" for row in ROWS), head=f"{HEAD[:-4]}[x0.1 ms]"), words=("'x0.1 ms'",),
        option=("--column", "shift_time_s=t_shift:x0.1 ms")),
    "tenth of milliseconds": Case(
        text_of(*(f"{row}0" for row in ROWS), head=f"{HEAD[:-4]}(1/10 ms)"), words=("1/10 ms",),
        option=("--column", "shift_time_s=t_shift:1/10 ms")),
    "unknown unit of time": Case(
        text_of(*ROWS, head=f"{HEAD[:-4]}[ticks]"), words=("'ticks', which is unknown",),
        option=("--column", "shift_time_s=t_shift:ms")),
    "pressure in kPa": Case(
        text_of("50;400;116", "100;550;84", head="dn;pressure [kPa];t_shift [ms]"),
        words=("is a pressure and no force_N",), times=[116, 84], forces=(400.0, 550.0),
        option=("--column", "force_N=pressure * 10 cm2")),
    "pressure in psi of a named force": Case(
        text_of("50;100;116", "100;145;84", head="dn;shift force [psi];t_shift [ms]"),
        words=("is a pressure",), times=[116, 84], forces=(68.947573, 99.973981),
        option=("--column", "force_N=shift force [psi] * 100 mm2")),
    "force in kp": Case(text_of("50;47.8;116", head="dn;Schaltkraft [kp];t [ms]"), times=[116],
                        forces=(468.75787,)),
    "hertz": Case(text_of("0,5;469;116", "1;469;84", head="dn [Hz];F;t_shift [ms]"),
                  times=[116, 84]),
    # 14 cells
    "time-outs with a sign": Case(
        text_of("50;469;116", "100;469;≥ 1000", "149;642;98"), words=("row 3: '≥ 1000'",)),
    "deviation behind +/-": Case(
        text_of("50;469;116 +/- 12", "100;469;84 +/- 9"), words=("row 2: '116 +/- 12'",)),
    "two times in a cell": Case(
        text_of("50;469;116 / 131", "100;469;84 / 71"), times=TIMES[:4]),
    "lists between semicolons": Case(
        text_of("50,469,116; 131", "100,642,84; 71; 98", head=HEAD.replace(";", ",")),
        times=TIMES[:5]),
    "lists between bars, decimal commas": Case(
        text_of("50;469;116,5 | 131", "100;469;84", "149;642;71 | 98 | 103,25"),
        times=[116.5, 131, 84, 71, 98, 103.25]),
    "lists with their number": Case(
        text_of('50;469;2;"116, 131"', '100;469;2;"84, 97"', "149;642;1;71",
                head="dn;F;n;t_shift [ms]"), times=[116, 131, 84, 97, 71]),
    "lists in seconds with commas": Case(
        text_of('50;469;"0,116, 0,131, 0,084"', '100;642;"0,071, 0,098"',
                head="dn;F;Schaltzeit [s]"), times=TIMES[:5]),
    "lists of another number": Case(
        text_of('50;469;3;"116, 131"', '100;469;2;"84, 71"', head="dn;F;n;t_shift [ms]"),
        words=("row 2: '116, 131'", "a row of its own")),
    "lists in one order may be phases": Case(
        text_of("50;469;20 / 116", "100;469;21 / 84"), words=("row 2: '20 / 116'", "own")),
    "lists beside a spread": Case(
        text_of("50;469;116 / 131;9", "100;469;84 / 71;8", head=f"{HEAD};Standardabweichung [ms]"),
        words=("row 2: '116 / 131'",)),
    "mean and deviation in a cell": Case(
        text_of("50;469;116 / 12", "100;469;84 / 9"), words=("row 2: '116 / 12'",)),
    "units in some cells": Case(
        text_of("50;469;116 ms", "100;469;84", head="dn;F;t_shift"), words=("row 3: '84'",)),
    "another unit than the head": Case(
        text_of("50;469;116", "100;0.469 kN;84"), words=("another unit", "0.469 kN")),
    # 15 shares
    "eleven of fifteen": Case(
        text_of("50;469;15;11/15;116", "100;469;15;15/15;84",
                head="dn;F;n;ok of n;t_shift [ms]"), words=("11/15", "did not engage")),
    "failures beside a number": Case(
        text_of("50;469;15;4;116", "100;469;15;0;84", head="dn;F;n;failures;t_shift [ms]"),
        words=("'failures'", "did not engage")),
    "rate in German": Case(
        text_of("50;469;15;73 %;116", "100;469;15;100 %;84",
                head="dn;F;Anzahl;Erfolgsquote;t_shift [ms]"), words=("73 %",)),
    # 22 comments
    "remark behind a number": Case(
        "% stand 7\n" + text_of(*ROWS[:2], f"{ROWS[2]} % valve", *ROWS[3:]),
        words=("rows are marked in the file (remark valve: row 5)", "--drop 'row=remark valve'"),
        option=("--keep", "row=*")),
    "row that is a comment": Case(
        "# stand 7\n" + text_of(*ROWS[:2], "# 50;469;905 again", *ROWS[2:])),
    "comments of words between the rows": Case(
        "# stand 7\n" + text_of(*ROWS[:2], "# pause", *ROWS[2:])),
    "comment on another kind of shifts": Case(
        "# stand 7\n" + text_of(*ROWS[:3], "# gear 2", *ROWS[3:]),
        words=("row 6 '# gear 2'", "--rows"), option=("--rows", "3-5"), times=TIMES[:3]),
    "remark with the separator": Case(
        "# stand 7\n" + text_of(*ROWS[:5], f"{ROWS[5]} # loud, hot").replace(";", ","),
        words=("remark loud, hot: row 8",), option=("--drop", "row=remark*"), times=TIMES[:5]),
    "remark on a force": Case(
        "! stand 7\n" + text_of(ROWS[0], "50;469 ! new valve;131", *ROWS[2:]),
        words=("remark new valve: row 4",), option=("--keep", "row=*")),
    "numbers with a sign are no comments": Case(
        "# stand 7\n" + text_of(*(f"#{k};{row}" for k, row in enumerate(ROWS)),
                                head=f"Nr;{HEAD}")),
    # 18 marks
    "sign in front": Case(
        beside("!", ["", "!", "", "", "", ""], first=True), words=("row 3", "--drop '!=*'"),
        option=("--drop", "!=*"), times=[116, 84, 71, 98, 103]),
    "valid flag": Case(
        beside("valid", ["1", "1", "0", "1", "1", "1"]), words=("'valid' marks rows", "row 4"),
        option=("--drop", "valid=0"), times=[116, 131, 71, 98, 103]),
    "remark in French": Case(
        beside("Remarque", ["", "", "", "essai rejeté", "", ""]), words=("row 5: 'essai rejeté'",),
        option=("--drop", "Remarque=*rejeté"), times=[116, 131, 84, 98, 103]),
    "remarks in all rows": Case(
        beside("Notiz", ["a", "b warm", "c", "ungültig", "e", "f"]),
        words=("row 5: 'ungültig'",), option=("--drop", "Notiz=ungültig"),
        times=[116, 131, 84, 98, 103]),
    "number as a flag": Case(
        beside("Kennung", ["", "", "9", "", "", ""]), words=("'Kennung' has a sign", "row 4"),
        option=("--keep", "Kennung=*")),
    "words below": Case(
        text_of(*ROWS, "Zeile 3 ungültig, Ventil klemmt"), words=("row 8", "ungültig", "--rows"),
        option=("--rows", "2,4-7"), times=[116, 84, 71, 98, 103]),
    "star behind": Case(
        beside("", ["", "", "*", "", "", ""]), words=("row 4: '*'",),
        option=("--drop", "column 4=*"), times=[116, 131, 71, 98, 103]),
    # 19 means
    "means named in a column of types": Case(
        beside("Art", ["Einzel", "Einzel", "Mittel", "Einzel", "Einzel", "Mittel"]),
        words=("'Mittel': row 4, 7",), option=("--keep", "Art=Einzel"),
        times=[116, 131, 71, 98]),
    "a mean without a number": Case(
        text_of(*ROWS[::2], head="dn;F;mean shift time [ms]"), words=("is a mean", "n_shifts=5"),
        option=("--column", "n_shifts=5"), times=TIMES[::2]),
    "a deviation without a number": Case(
        text_of("50;469;116;12", "100;469;84;9", head=f"{HEAD};std [ms]"),
        words=("no column counts them",), option=("--column", "n_shifts=8"), times=[116, 84]),
    "means without a word": Case(
        text_of("50;469;116", "50;469;131", "50;469;123.5", "100;469;84", "100;469;90",
                "100;469;87"), words=("rows 4, 7 are the means", "such as 2-3,5-6"),
        option=("--rows", "2-3,5-6"), times=[116, 131, 84, 90]),
    # 12 codes
    "code as a mismatch": Case(
        text_of("50;469;116", "-1;469;131", "100;469;84", "149;642;98"),
        words=("is -1 in row 3", "code"), option=("--drop", "dn [1/min]=-1"),
        times=[116, 84, 98]),
    "code as a force": Case(
        text_of("50;469;116", "50;9999;131", "100;469;84"), words=("is 9999 in row 3",),
        option=("--drop", "F_shift=9999"), times=[116, 84]),
    "reversed mismatch is no code": Case(
        text_of("50;469;116", "-50;469;131", "-1;469;84", "1;642;71"), times=TIMES[:4]),
    "code as a time": Case(
        text_of("50;469;116", "50;469;-99", "100;469;84"), words=("is -99 in row 3",),
        option=("--drop", "t_shift=-99"), times=[116, 84]),
    # 15 shares, further
    "number in the head": Case(
        text_of("50;469;116;5", "100;469;84;4", head=f"{HEAD};ok of 5"),
        words=("'ok of 5' has shares",)),
    "failures of few": Case(
        text_of("50;469;5;116;0", "100;469;5;84;1", head="dn;F;shifts;t_shift [ms];not engaged"),
        words=("'not engaged' has shares",)),
    # 10 repeats, further
    "repeats with letters": Case(
        text_of("50;469;116;131", "100;642;98;71", head="dn;F;t_a [ms];t_b [ms]"),
        words=("shift_time_s='t_a [ms]; t_b [ms]' where each",),
        option=("--column", "shift_time_s=t_a [ms]; t_b [ms]"), times=[116, 131, 98, 71]),
    "repeats that numbers name": Case(
        text_of("50;469;116;131", "100;642;98;71", head="dn;F;1;2"),
        words=("shift_time_s='1; 2'",), option=("--column", "shift_time_s=1; 2:ms"),
        times=[116, 131, 98, 71]),
    "repeats in seconds by an option": Case(
        text_of("50;469;0.116;0.131", "100;642;0.098;0.071",
                head="dn;F;Versuch 1;Versuch 2"), words=("shift_time_s",),
        option=("--column", "shift_time_s=Versuch 1; Versuch 2:s"), times=[116, 131, 98, 71]),
    # 5 durations as text
    "clock of less than a minute": Case(
        text_of("50;469;00:00,116", "100;469;0:00:00,084", head="dn;F;Schaltzeit"),
        times=[116, 84]),
    # 20 spread
    "half width of a confidence interval": Case(
        text_of("50;469;8;116;18", "100;469;8;84;14", head="dn;F;n;t_shift [ms];± 95 % [ms]"),
        words=("'± 95 % [ms]' may be",), times=[116, 84],
        option=("--column", "shift_time_sd_s=± 95 % [ms] / 2 * 8 ** 0.5")),
    "expanded uncertainty": Case(
        text_of("50;469;8;116;18", "100;469;8;84;14", head="dn;F;n;t_shift [ms];U (k=2) [ms]"),
        words=("'U (k=2) [ms]' may be",)),
    "twice sigma behind a sign": Case(
        text_of("50;469;8;116;18", "100;469;8;84;14", head="dn;F;n;t_shift [ms];± 2 sigma [ms]"),
        times=[116, 84]),
    "Spanish difference": Case(
        text_of(*ROWS, head="Diferencia de velocidad [rpm];Fuerza [N];Tiempo de cambio [ms]")),
    "spread without a word": Case(
        text_of("50;469;8;116;22", "100;469;8;84;17", head="dn;F;n;t_shift [ms];Streuung [ms]"),
        words=("'Streuung [ms]' may be",), times=[116, 84],
        option=("--column", "shift_time_sd_s=Streuung [ms] / 2")),
    "confidence": Case(
        text_of("50;469;8;116;22", "100;469;8;84;17", head="dn;F;n;t_shift [ms];95 % CI [ms]"),
        words=("half width",), option=("--column", "shift_time_sd_s=-"), times=[116, 84]),
    "range": Case(
        text_of("50;469;8;116;22", "100;469;8;84;17", head="dn;F;n;t_shift [ms];Spannweite [ms]"),
        words=("range",), option=("--column", "shift_time_sd_s=-"), times=[116, 84]),
    # 21 speeds
    "slip in percent": Case(
        text_of("5;469;116", "10;469;84", head="slip [%];F;t_shift [ms]"),
        words=("no column looks like mismatch_rpm",)),
    "speed of the sleeve": Case(
        text_of("1500;469;116", "1550;469;84", head="Drehzahl Schaltmuffe [1/min];F;t_shift [ms]"),
        words=("is a speed",)),
    "a speed": Case(text_of("1500;469;116", "1550;469;84", head="n [U/min];F;t_shift [ms]"),
                    words=("'n [U/min]' is a speed",)),
    "motor and gear": Case(
        text_of("1500;1450;469;116", "1550;1450;469;84",
                head="n_Motor [1/min];n_Rad [1/min];F;t_shift [ms]"),
        words=("n_Rad - n_Motor",), option=("--column", "mismatch_rpm=n_Motor - n_Rad"),
        times=[116, 84]),
    "start and end of a shift": Case(
        text_of("50;469;20;136", "100;469;21;105", head="dn;F;t_start [ms];t_end [ms]"),
        words=("t_end [ms] - t_start [ms]",), times=[116, 84],
        option=("--column", "shift_time_s=t_end [ms] - t_start [ms]")),
    "side by side without a gap": Case(
        text_of("50;469;116;50;469;22", "100;469;84;100;469;21",
                head="dn;F;t_shift [ms];dn;F;t_shift [ms]"), words=("side by side", "column 3"),
        option=("--column", "mismatch_rpm=column 1", "--column", "force_N=column 2",
                "--column", "shift_time_s=column 3"), times=[116, 84]),
    # 22 groups
    "gears as numbers": Case(
        beside("gear", ["2", "2", "2", "3", "3", "3"], first=True), words=("'2': row 2, 3, 4",),
        option=("--keep", "gear=2"), times=TIMES[:3]),
    "direction in Czech": Case(
        beside("smer", ["nahoru", "dolu"] * 3), words=("'dolu': row 3, 5, 7",),
        option=("--keep", "smer=nahoru"), times=TIMES[::2]),
    "neutral and third gear": Case(
        beside("Schaltung", ["N-3", "3-N"] * 3, first=True), words=("'3-N': row 3, 5, 7",),
        option=("--keep", "Schaltung=N-3"), times=TIMES[::2]),
    "types as numbers": Case(
        beside("Typ", ["1", "2"] * 3, first=True), words=("'2': row 3, 5, 7",),
        option=("--keep", "Typ=1"), times=TIMES[::2]),
    "flag of a data frame": Case(
        beside("use", ["1.0", "0.0", "1.0", "1.0", "1.0", "1.0"]), words=("'0.0': row 3",),
        option=("--drop", "use=0.0"), times=[116, 84, 71, 98, 103]),
    "empty words of a data frame": Case(
        beside("flag", ["nan", "nan", "9.0", "nan", "NaN", "nan"]), words=("row 4: '9.0'",),
        option=("--drop", "flag=9.0"), times=[116, 131, 71, 98, 103]),
    "mismatch that may be a ratio": Case(
        text_of("0.05;469;116", "0.1;469;84", head="dn;F;t_shift [ms]"), words=("as a ratio has",),
        option=("--column", "mismatch_rpm=dn * 1450"), times=[116, 84]),
    "numbered means": Case(
        text_of("50;469;1;116", "50;469;1;131", "50;469;2;123.5", "100;469;1;84", "100;469;1;90",
                "100;469;2;87", head="dn;F;n;t_shift [ms]"), words=("rows 4, 7 are the means",),
        option=("--rows", "2-3,5-6"), times=[116, 131, 84, 90]),
    "engage and disengage": Case(
        beside("event", ["engage", "disengage"] * 3), words=("'disengage': row 3, 5, 7",),
        option=("--drop", "event=disengage"), times=TIMES[::2]),
    "comment behind a time": Case(
        text_of("50;469;116 // slow", "100;469;84"), words=("row 2: '116 // slow'",)),
    "points are named": Case(beside("Messpunkt", ["P1", "P1", "P2", "P3", "P4", "P4"])),
    "one operator": Case(beside("Prüfer", ["Maier"] * 6)),
    # 23 two units
    "seconds beside milliseconds": Case(
        text_of("50;469;0.116", "100;469;84", "149;642;98", head="dn;F;t_shift"),
        words=("two units in one column", "'0.116' (row 2)")),
    "N beside kN": Case(
        text_of("50;469;116", "100;0.642;84", "149;642;98", head="dn;F;t_shift [ms]"),
        words=("two units in one column", "'0.642' (row 3)")),
    "thousands beside decimals": Case(
        text_of("50,5;1.200;116.250", "100,0;800;84.125", head="dn;F;t_shift [µs]"),
        times=[116.25, 84.125], forces=(1200.0, 800.0)),
}  # fmt: skip


def book(**changes: Any) -> bytes:
    """Save the plain table as a workbook, with changes of cells by their names."""
    workbook = Workbook()
    sheet = workbook.active
    assert sheet is not None
    sheet.append(HEAD.split(";"))
    for (n, f), t in zip(POINTS, TIMES, strict=True):
        sheet.append([n, f, t])
    for name, change in changes.items():
        if callable(change):
            change(sheet)
        elif isinstance(change, tuple):
            sheet[name], sheet[name].number_format = change
        else:
            sheet[name] = change
    workbook.save("book.xlsx")
    return Path("book.xlsx").read_bytes()


def hide(*rows: int) -> Any:
    def change(sheet: Any) -> None:
        for row in rows:
            sheet.row_dimensions[row].hidden = True

    return change


def filtered(sheet: Any) -> None:
    sheet.auto_filter.ref = "A1:C7"
    sheet.auto_filter.add_filter_column(0, ["50", "100"])
    hide(6, 7)(sheet)


def coloured(sheet: Any) -> None:
    for cell in sheet[4]:
        cell.fill = PatternFill("solid", fgColor="FFFF0000")


def red(sheet: Any) -> None:
    sheet["C5"].font = Font(color="FFFF0000")


def half_coloured(sheet: Any) -> None:
    for row in (5, 6, 7):
        sheet[f"A{row}"].fill = PatternFill("solid", fgColor="FFFFC7CE")


def coloured_column(sheet: Any) -> None:
    for row in range(2, 8):
        sheet[f"B{row}"].fill = PatternFill("solid", fgColor="FFC6EFCE")


def hidden_time(sheet: Any) -> None:
    sheet.column_dimensions["C"].hidden = True


def banded(sheet: Any) -> None:
    for row in (3, 5, 7):
        for cell in sheet[row]:
            cell.fill = PatternFill("solid", fgColor="FFDDDDDD")


def struck(sheet: Any) -> None:
    sheet["C5"].font = Font(strike=True)


def commented(sheet: Any) -> None:
    sheet["C3"].comment = Comment("Ventil klemmt", "Maier")


def grouped(sheet: Any) -> None:
    sheet.row_dimensions.group(3, 4, outline_level=1)


def hidden_column(sheet: Any) -> None:
    sheet["D1"] = "alt"
    sheet["D5"] = "x"
    sheet.column_dimensions["D"].hidden = True


def merged(sheet: Any) -> None:
    for area, cell in (("A2:A3", "A3"), ("B2:B4", "B3"), ("A4:A5", "A5"), ("B5:B7", "B6")):
        sheet[cell] = None
        sheet.merge_cells(area)


def merged_time(sheet: Any) -> None:
    sheet.merge_cells("C2:C3")


def second_sheet(sheet: Any) -> None:
    other = sheet.parent.create_sheet("Tabelle2")
    other["A1"] = "notes"


def durations(sheet: Any) -> None:
    sheet["C1"] = "Schaltzeit"
    for k, t in enumerate(TIMES, start=2):
        sheet[f"C{k}"] = timedelta(milliseconds=t)
        sheet[f"C{k}"].number_format = "[s].000"


def clocks(sheet: Any) -> None:
    sheet["C1"] = "Schaltzeit"
    for k in range(2, 8):
        sheet[f"C{k}"] = time(14, 5, k)
        sheet[f"C{k}"].number_format = "hh:mm:ss"


def with_format(letter: str, form: str, factor: float = 1.0) -> Any:
    def change(sheet: Any) -> None:
        for row in range(2, 8):
            cell = sheet[f"{letter}{row}"]
            cell.value, cell.number_format = cell.value * factor, form

    return change


def masked_row(sheet: Any) -> None:
    for letter in "ABC":
        sheet[f"{letter}6"].number_format = ";;;"


def decimal_text(sheet: Any) -> None:
    for row in range(2, 8):
        sheet[f"C{row}"] = f"{sheet[f'C{row}'].value:.2f}".replace(".", ",")
        sheet[f"B{row}"] = sheet[f"B{row}"].value + 0.5


def thousands_text(sheet: Any) -> None:
    sheet["B3"] = "1.200"


def ruled(rule: Rule, area: str = "C2:C7") -> Any:
    def change(sheet: Any) -> None:
        sheet.conditional_formatting.add(area, rule)

    return change


RED = PatternFill("solid", bgColor="FFFFC7CE")


#: Changes of the plain workbook, and what is right as of a ``Case``.
BOOKS: dict[str, tuple[dict[str, Any], tuple[str, ...], tuple[str, ...], Sequence[float]]] = {
    "plain": ({}, (), (), TIMES),
    "hidden": ({"a": hide(3, 7)}, ("hidden: row 3, 7",), ("--drop", "row=hidden"),
               [116, 84, 71, 98]),
    "filtered": ({"a": filtered}, ("hidden by a filter: row 6, 7",), ("--keep", "row=*"), TIMES),
    "grouped": ({"a": grouped}, ("grouped: row 3, 4",), ("--drop", "row=grouped"),
                [116, 71, 98, 103]),
    "coloured": ({"a": coloured}, ("coloured: row 4",), ("--drop", "row=coloured"),
                 [116, 131, 71, 98, 103]),
    "banded": ({"a": banded}, (), (), TIMES),
    "one cell struck out": ({"a": struck}, ("struck out: row 5",), ("--rows", "2-4,6-7"),
                            [116, 131, 84, 98, 103]),
    "comment": ({"a": commented}, ("comment 'Ventil klemmt': row 3",), ("--keep", "row=*"), TIMES),
    "hidden column of marks": ({"a": hidden_column}, ("'alt' has a sign", "row 5: 'x'"),
                               ("--drop", "alt=x"), [116, 131, 84, 98, 103]),
    "formula in a remark": ({"D1": "r", "D2": "=A2"}, ("D2 holds a formula", "save it"), (), []),
    "formula of a force": ({"B4": "=A4*2"}, ("B4 holds a formula",), (), []),
    "formulas of times": ({f"C{k}": f"=D{k}" for k in range(2, 8)}, ("and 3 more",), (), []),
    "merged": ({"a": merged}, (), (), TIMES),
    "merged time": ({"a": merged_time}, ("one result for several rows",), (), []),
    "a second sheet": ({"a": second_sheet}, ("several sheets", "Sheet, Tabelle2"), (), []),
    "durations": ({"a": durations}, (), (), TIMES),
    "clocks": ({"a": clocks}, ("holds clock times",), (), []),
    "thousands of N": ({"a": with_format("B", "#,##0.0,")}, ("row 2", "divided by thousands"), (),
                       []),
    "unit in the format": ({"C1": "t_shift", "a": with_format("C", '0 "ms"')}, (), (), TIMES),
    "digits in the format": ({"a": with_format("C", "0.000")}, (), (), TIMES),
    "text times": ({"a": decimal_text}, (), (), TIMES),
    "one force is text": ({"a": thousands_text}, ("row 3", "'1.200' is text among numbers"), (),
                          []),
    "a time became a date": ({"C4": (datetime(2026, 4, 8), "d.mm")}, ("row 4", "date among"), (),
                             []),
    "a force became a date": ({"B6": (datetime(2026, 4, 8), "d.m.")}, ("row 6", "date among"), (),
                              []),
    "text integers": ({"C3": "131", "A4": "100 "}, (), (), TIMES),
    "red digits": ({"a": red}, ("coloured: row 5",), ("--drop", "row=coloured"),
                   [116, 131, 84, 98, 103]),
    "half the rows coloured": ({"a": half_coloured}, ("coloured: row 5, 6, 7",),
                               ("--keep", "row=coloured"), [71, 98, 103]),
    "coloured column": ({"a": coloured_column}, (), (), TIMES),
    "word in a format": ({"C4": (84, '0 "ungültig"')}, ("row 4: '84 ungültig'",), (), []),
    "footnote": ({"E9": "Zeilen 3 und 4 verworfen"}, ("row 9", "--rows"), ("--rows", "2,5-7"),
                 [116, 71, 98, 103]),
    "hidden time": ({"a": hidden_time}, ("'t_shift [ms]' (hidden in the workbook)",),
                    ("--column", "shift_time_s=t_shift"), TIMES),
    "a row shows nothing": ({"a": masked_row},
                           ("hidden by a number format: row 6",),
                           ("--drop", "row=hidden by a number format"), [116, 131, 84, 71, 103]),
    "a word shows nothing": ({"D1": "r", "D4": ("x", "0;0;0;")},
                             ("hidden by a number format: row 4",), ("--rows", "2-7"), TIMES),
    "zeros are blank": ({"D1": "temperature [°C]", "D2": (0, "0;-0;"), "D3": 7}, (), (), TIMES),
    "rule above a value": ({"a": ruled(CellIsRule("greaterThan", ["120"], fill=RED))},
                           ("under the rule above 120: row 3",),
                           ("--drop", "row=under the rule above 120"), [116, 84, 71, 98, 103]),
    "rule between cells": ({"F1": 80, "F2": 100, "a": ruled(
        CellIsRule("notBetween", ["$F$1", "$F$2"], fill=RED))},
        ("under the rule not between 80 and 100: row 2, 3, 5, 7",), ("--keep", "row=*"), TIMES),
    "rule on forces": ({"a": ruled(CellIsRule("equal", ["469"], fill=RED), "B1:B99")},
                       ("under the rule equal to 469: row 2, 3, 4",),
                       ("--keep", "row=under the rule equal to 469"), TIMES[:3]),
    "rule on no cell": ({"a": ruled(CellIsRule("lessThan", ["0"], fill=RED))}, (), (), TIMES),
    "rule that is a formula": ({"a": ruled(FormulaRule(["MOD(ROW(),2)=0"], fill=RED))}, (), (),
                               TIMES),
    "error value": ({"C6": "#DIV/0!"}, ("row 6: '#DIV/0!'",), (), []),
}  # fmt: skip


def times_of(call: Call, file: str, *options: str) -> tuple[list[float], list[float], str]:
    """Read a table: times in ms, forces in N, and the refusal, empty where it is read."""
    shutil.rmtree("b", ignore_errors=True)
    said = call("init", "bench", file, "--json", "--yes", "--out", "b", *options)
    if said.status:
        assert said.status == 2, said.err
        return [], [], said.err
    readings = load_bench("b").readings
    times = [round(1e3 * r.time, 6) for r in readings if r.time is not None]
    return times, [round(r.point.profile.force, 6) for r in readings], ""


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_of_table_is_read_or_asked_about(dogshape: Call, kind: str) -> None:
    case = KINDS[kind]
    raw = case.table if isinstance(case.table, bytes) else case.table.encode()
    Path("m.csv").write_bytes(raw)
    times, forces, refusal = times_of(dogshape, "m.csv")
    if case.words:
        assert [word for word in case.words if word not in refusal] == [], refusal
        if not case.option:
            return
        times, forces, refusal = times_of(dogshape, "m.csv", *case.option)
    assert not refusal
    assert times == [float(t) for t in case.times]
    assert not case.forces or forces == list(case.forces)


@pytest.mark.parametrize("kind", BOOKS)
def test_a_workbook_is_read_as_a_person_sees_it(dogshape: Call, kind: str) -> None:
    changes, words, option, wanted = BOOKS[kind]
    Path("m.xlsx").write_bytes(book(**changes))
    times, _, refusal = times_of(dogshape, "m.xlsx")
    if words:
        assert [word for word in words if word not in refusal] == [], refusal
        if not option:
            return
        times, _, refusal = times_of(dogshape, "m.xlsx", *option)
    assert not refusal
    assert times == [float(t) for t in wanted]


#: Tables of shares, the option, and rows of the folder: engaged, number, time in ms.
SHARES: dict[str, tuple[str, str, list[tuple[bool, int, float | None]]]] = {
    "percent": ("dn;F;n;engaged [%];t_shift [ms]\n50;469;5;100;116\n100;469;5;80;84\n",
                "engaged [%]:share", [(True, 5, 116), (True, 4, 84), (False, 1, None)]),
    "fractions": ("dn;F;engaged;t_shift [ms]\n50;469;5/5;116\n100;469;2 of 5;84\n",
                  "engaged:share", [(True, 5, 116), (True, 2, 84), (False, 3, None)]),
    "none engaged": ("dn;F;ok;t_shift [ms]\n50;469;3/5;116\n100;469;0/5;\n", "ok:share",
                     [(True, 3, 116), (False, 2, None), (False, 5, None)]),
    "rounded percent": ("dn;F;Anzahl;Erfolgsquote;t_shift [ms]\n50;469;15;73 %;116\n",
                        "Erfolgsquote:share", [(True, 11, 116), (False, 4, None)]),
    "share below 1": ("dn;F;n;rate;t_shift [ms]\n50;469;8;0.75;116\n100;469;8;1;84\n",
                      "rate:share", [(True, 6, 116), (False, 2, None), (True, 8, 84)]),
    "number": ("dn;F;n;engaged;t_shift [ms]\n50;469;15;11;116\n100;469;15;15;84\n",
               "engaged:number", [(True, 11, 116), (False, 4, None), (True, 15, 84)]),
    "failures": ("dn;F;n;failures;t_shift [ms]\n50;469;15;4;116\n100;469;15;0;84\n",
                 "failures:failed", [(True, 11, 116), (False, 4, None), (True, 15, 84)]),
    "failures in percent": ("dn;F;n;Fehlerquote [%];t_shift [ms]\n50;469;10;30;116\n",
                            "Fehlerquote [%]:failed", [(True, 7, 116), (False, 3, None)]),
}  # fmt: skip


@pytest.mark.parametrize("kind", SHARES)
def test_a_share_divides_a_row_and_loses_no_shift(dogshape: Call, kind: str) -> None:
    """The question offers the option, and the option gives all shifts of each row."""
    table, column, wanted = SHARES[kind]
    Path("m.csv").write_text(table)
    refused = dogshape("init", "bench", "m.csv", "--yes", "--out", "b")
    assert refused.status == 2
    assert f"--column engaged='{column}'" in refused.err
    said = dogshape("init", "bench", "m.csv", "--yes", "--out", "b", "--column",
                    f"engaged={column}")  # fmt: skip
    assert said.status == 0, said.err
    rows = [
        (r.engaged, r.n, None if r.time is None else round(1e3 * r.time, 6))
        for r in load_bench("b").readings
    ]
    assert rows == wanted


@pytest.mark.parametrize(
    ("rows", "option", "words"),
    [
        ("50;469;7;73 %;116", "share:share", "of 7 shifts are 5.11, but must be a whole number"),
        ("50;469;300;73.1 %;116", "share:share", "must be a whole number"),
        ("50;469;5;4/6;116", "share:share", "is of 6 shifts, but their number is 5"),
        ("50;469;5;6;116", "share:number", "is no part of 5 shifts"),
        ("50;469;5;2.5;116", "share:number", "is no whole number of shifts"),
        ("50;469;5;4;116", "share:share", "is no share between 0 and 1; say :number"),
        ("50;469;;40 %;116", "share:share", "is of an unknown number of shifts"),
        ("50;469;5;most;116", "share:share", "is no share and no number"),
    ],
)
def test_a_share_that_is_no_whole_number_of_shifts_is_refused(
    dogshape: Call, rows: str, option: str, words: str
) -> None:
    Path("m.csv").write_text(f"dn;F;n;share;t_shift [ms]\n{rows}\n149;642;10;1/10;98\n")
    said = dogshape("init", "bench", "m.csv", "--yes", "--out", "b", "--column",
                    f"engaged={option}")  # fmt: skip
    assert said.status == 2
    assert f"'share' (engaged): row 2: '{rows.split(';')[3]}' " in said.err
    assert words in said.err
    assert not Path("b").exists()


#: Head and cells of a spread beside means of 116 and 84 ms, an option, and deviations in ms.
SPREADS: dict[str, tuple[str, str, str, tuple[str, ...], list[float]]] = {
    "variance": ("Varianz [ms²]", "144", "81", (), [12.0, 9.0]),
    "variance in s": ("variance [s^2]", "0.000144", "0.000081", (), [12.0, 9.0]),
    "squared sigma": ("σ² [ms²]", "144", "81", (), [12.0, 9.0]),
    "variance without a unit": ("Varianz", "144", "81",
                                ("--column", "shift_time_sd_s=sqrt(Varianz:ms2)"), [12.0, 9.0]),
    "variance in a wrong unit": ("variance [ms]", "144", "81",
                                 ("--column", "shift_time_sd_s=sqrt(variance [ms]:ms2)"),
                                 [12.0, 9.0]),
    "percent": ("CV %", "10", "25", (), [11.6, 21.0]),
    "coefficient in German": ("Variationskoeffizient [%]", "10", "25", (), [11.6, 21.0]),
    "relative deviation": ("rel. Standardabweichung [%]", "10", "25", (), [11.6, 21.0]),
    "share of the mean": ("CV", "0.1", "0.25",
                          ("--column", "shift_time_sd_s=CV * t_shift [ms]"), [11.6, 21.0]),
    "percent without a sign": ("coefficient of variation", "10", "25",
                               ("--column", "shift_time_sd_s="
                                            "coefficient of variation * t_shift [ms] / 100"),
                               [11.6, 21.0]),
}  # fmt: skip


@pytest.mark.parametrize("kind", SPREADS)
def test_a_variance_and_a_variation_become_a_deviation(dogshape: Call, kind: str) -> None:
    head, first, second, option, wanted = SPREADS[kind]
    Path("m.csv").write_text(
        f"dn [1/min];F [N];n;t_shift [ms];{head}\n50;469;5;116;{first}\n100;469;5;84;{second}\n"
    )
    said = dogshape("init", "bench", "m.csv", "--yes", "--out", "b")
    if option:
        assert said.status == 2
        assert option[1].replace("=", "='", 1) in said.err
        said = dogshape("init", "bench", "m.csv", "--yes", "--out", "b", *option)
    assert said.status == 0, said.err
    readings = load_bench("b").readings
    assert [r.time for r in readings] == [0.116, 0.084]
    assert [r.sd for r in readings] == pytest.approx([1e-3 * sd for sd in wanted], rel=1e-6)


def test_a_rule_that_is_not_judged_is_named(dogshape: Call) -> None:
    Path("m.xlsx").write_bytes(book(a=ruled(FormulaRule(["MOD(ROW(),2)=0"], fill=RED))))
    said = dogshape("init", "bench", "m.xlsx", "--yes", "--json", "--out", "b")
    assert "conditional formatting of C2:C7 (expression MOD(ROW(),2)=0) is not judged" in " ".join(
        said.json["assumed"]
    )


def test_ordinary_quotation_marks_lose_no_line(dogshape: Call) -> None:
    """Both tables of an open quotation mark, with the option that makes marks ordinary signs."""
    for notes in (["", '"jams', "", "good", "", ""], ["", '"jams', "", 'x"', "", ""]):
        Path("m.csv").write_text(beside("note", notes))
        times, _, refusal = times_of(dogshape, "m.csv", "--quotes", "none")
        assert times == []
        assert "'note' has a sign in few rows (row 3: '\"jams'" in refusal
        read = times_of(dogshape, "m.csv", "--quotes", "none", "--keep", "note=*")
        assert read[0] == TIMES
    wrong = dogshape("init", "bench", "m.csv", "--out", "c", "--quotes", "some")
    assert "--quotes is 'some', but must be cells or none" in wrong.sentence


def test_the_steps_of_reading_are_printed(dogshape: Call) -> None:
    Path("m.csv").write_text(text_of("50;469;116;x", "100;469;84;", head=f"{HEAD};mark"))
    said = dogshape("init", "bench", "m.csv", "--explain")
    assert said.status == 2
    steps = ("raw sheet", "layout", "columns and units", "rows and marks", "readings")
    places = [said.out.index(step) for step in steps]
    assert places == sorted(places)
    for line in ("3 rows with cells", "one row a shift", "shift_time_s: 't_shift [ms]' in ms",
                 "question: 'mark' has a sign in few rows"):  # fmt: skip
        assert line in said.out
    assert "--drop 'mark=*'" in said.err
    assert dogshape("init", "bench", "m.csv", "--explain", "--drop", "mark=x").status == 0
    assert [path.name for path in Path().iterdir()] == ["m.csv"]


def test_the_steps_are_printed_of_what_is_read_and_refused_alike(dogshape: Call) -> None:
    """Columns of traces are no quantities of the table; another decimal sign is refused."""
    Path("m.csv").write_text(text_of("50;469;116", "100;469;84"))
    of_trace = ("--column", "trace.force_N=F [N]")
    assert dogshape("init", "bench", "m.csv", "--explain", *of_trace).status == 0
    for explain in ((), ("--explain",)):
        refused = dogshape("init", "bench", "m.csv", *explain, "--decimal", ";")
        assert "--decimal is ';', but must be a point or a comma" in refused.sentence


@pytest.mark.parametrize(
    ("option", "words"),
    [
        (("--drop", "Mark=y"), "no row of column 'Mark' has that value"),
        (("--keep", "Marl=x"), "did you mean 'Mark'"),
        (("--drop", "Mark"), "must be COLUMN=VALUE"),
        (("--limit", "row=5"), "did you mean 'rows'"),
        (("--limit", "rows=some"), "must be a whole number above 0"),
        (("--limit", "rows=1"), "rows are 3, but at most 1 are read"),
    ],
)
def test_wrong_answers_are_refused(dogshape: Call, option: tuple[str, ...], words: str) -> None:
    Path("m.csv").write_text(text_of("50;469;116;x", "100;469;84;", head=f"{HEAD};Mark"))
    said = dogshape("init", "bench", "m.csv", "--out", "b", *option)
    assert said.status == 2
    assert words in said.err


def test_an_answer_in_a_terminal_is_the_option(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(dialogue, "may_ask", lambda yes=False: not yes)
    Path("m.csv").write_text(text_of("50;469;116;x", ";;84;", "100;642;71;"
                                     , head=f"{HEAD};Mark"))  # fmt: skip
    answers = ["--keep 'Mark=*'", "--fill-down", "y", "", "", "", "y", "", "", "", "n"]
    done = CliRunner().invoke(app, ["init", "bench", "m.csv"], input="\n".join(answers) + "\n")
    assert done.exit_code == 0, done.stderr
    assert [r.point.profile.force for r in load_bench("m").readings] == [469.0, 469.0, 642.0]
    assert "'Mark' has a sign in few rows" in done.stderr
    assert "--fill-down where the value above holds" in done.stderr


def test_hostile_tables_are_refused_in_their_bytes(dogshape: Call) -> None:
    """Packed zeros, rows, columns and cells beyond the limits; nothing is read beyond them."""
    book()
    with ZipFile("book.xlsx") as plain, ZipFile("bomb.xlsx", "w", ZIP_DEFLATED) as bomb:
        for name in plain.namelist():
            bomb.writestr(name, plain.read(name))
        with bomb.open("xl/media/zeros", "w", force_zip64=True) as zeros:
            for _ in range(300):
                zeros.write(bytes(1_000_000))
    with Path("sparse.csv").open("wb") as file:
        file.write(text_of(*ROWS).encode())
        file.truncate(2_000_000_000)
    Path("wide.csv").write_text("\n".join([";".join(["1"] * 10_000)] * 2))
    Path("cell.csv").write_text(text_of("50;469;" + "1" * 1_000_000))
    Path("far.xlsx").write_bytes(book(XFD1048576="x"))
    for name, words in (
        ("bomb.xlsx", "unpacked bytes are 3000"), ("sparse.csv", "file bytes are 2000000000"),
        ("wide.csv", "columns are 10000"), ("cell.csv", "row 2 has a cell of more than 10000"),
        ("far.xlsx", "columns are 16384"),
    ):  # fmt: skip
        tracemalloc.start()
        said = dogshape("init", "bench", name, "--out", "b")
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert said.status == 2
        assert words in said.err
        assert "limit" in said.err
        assert peak < 200e6


def test_a_code_page_is_found_by_its_letters() -> None:
    text = "Größe;Schaltzeit [µs];Rückmeldung;°C;Écart de régime;numéro\n"
    for page in ("utf-8", "utf-16", "utf-16-le", "utf-16-be", *CODE_PAGES):
        try:
            raw = text.encode(page)
        except UnicodeEncodeError:
            continue
        assert decode_text(raw) == text, page


def test_exported_tables_start_no_formula(tmp_path: Path) -> None:
    names = ["=1+1", "+x", "@sum", "-x", "-5", "+5.0", "plain", "-"]
    frame = pd.DataFrame({"=name": names, "value": [-1.0] * len(names)})
    write_frame(frame, tmp_path / "t.xlsx")
    write_frame(frame, tmp_path / "t.csv")
    sheet = load_workbook(tmp_path / "t.xlsx").active
    assert sheet is not None
    cells = [row[0].value for row in sheet.iter_rows()]
    wanted = ["'=name", "'=1+1", "'+x", "'@sum", "'-x", "-5", "+5.0", "plain", "-"]
    assert cells == wanted
    assert {row[0].data_type for row in sheet.iter_rows()} == {"s"}
    lines = (tmp_path / "t.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in lines] == wanted
