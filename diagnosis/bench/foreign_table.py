"""Layout of a table that a stand has written: dialect, head, units, rows of shifts, rows left out.

The table is the longest run of numbers below a row of names. Rows of sums and means are recognised
by their structure: a word where other rows have a number, or numbers that are one statistic of
those above.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, zip_longest
from pathlib import Path

import numpy as np

from dogshape.diagnosis.bench.measured_units import Unit, split_head, unit_named
from dogshape.diagnosis.bench.written_numbers import Decimals, decimals_of, is_number
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError
from dogshape.sim.texts import parted, read_lines

Rows = list[tuple[int, list[str]]]
SAMPLE = 200  #: lines by which the dialect is recognised
FOOT = 100  #: last rows that may be sums without a mark
HEADS = 4  #: rows of names and units above the numbers, at most
_LABVIEW = re.compile(
    r"(?ms)^(?:LabVIEW Measurement|Channels\b).*?^\*\*\*End_of_Header\*\*\*[^\n]*"
)
_WIDE = re.compile(r"\S+(?: \S+)*")  # words between two blanks or more
_ANY = re.compile(r"\S+")
_NAMED = re.compile(r"\S+(?: +[\[(]\S*)?")  # names with units behind a blank
_DECIMAL = re.compile(r"(?m)^Decimal_Separator\s+([.,])")


@dataclass(frozen=True)
class Column:
    """A column: its place from 1, head, name without unit, unit, and cells.

    ``strange`` stands in the place of a unit and is none that is known.
    """

    place: int
    head: str
    name: str
    unit: Unit | None
    strange: str | None = None
    cells: tuple[str, ...] = ()

    @classmethod
    def of(cls, place: int, head: str, below: str = "", cells: Sequence[str] = ()) -> Column:
        """Read a head, with the unit that stands in a row of its own below it, if there is one."""
        name, unit, strange = split_head(head)
        under = below.strip("[]() ")
        unit = unit or unit_named(under)
        strange = None if unit else strange or (under if re.search(r"\w", under) else None)
        return cls(place, head, name, unit, strange, tuple(cells))


@dataclass(frozen=True)
class ForeignTable:
    """A table as it stands: columns, the numbers of its rows in the file, and what was left out.

    ``left_out`` are pairs of row and reason, ``questions`` pairs of a column's place and a question
    on one of its words. ``stated`` is the decimal sign that the file says.
    """

    path: Path
    columns: tuple[Column, ...]
    rows: tuple[int, ...]
    left_out: tuple[tuple[int, str], ...] = ()
    stated: str | None = None
    separator: str = ","
    questions: tuple[tuple[int, str], ...] = ()

    def decimals(self, columns: Sequence[Column], said: str | None) -> Decimals:
        """Decide on the decimal sign by columns; raises DataError for numbers with both."""
        cells = {c.head: list(zip(self.rows, c.cells, strict=True)) for c in columns}
        return decimals_of(cells, said or self.stated, self.separator)


def read_foreign(path: Path, chosen: Sequence[range] = (), *, sums: bool = True) -> ForeignTable:
    """Read a table whose head stands anywhere above its numbers; raises DataError without one.

    ``chosen`` are the rows of the file that are shifts, where its structure is not to decide.
    Without ``sums`` no row can be one of those above.
    """
    try:
        text = "".join(read_lines(path))
    except FileNotFoundError as error:
        raise DataError(f"there is no {path}; give a CSV that the stand has written") from error
    stated = _DECIMAL.search(text)
    bare = _LABVIEW.sub(lambda found: "\n" * found.group().count("\n"), text)
    separator, rows = _cells(path, bare.splitlines(keepends=True))
    head, units, body, left = _divided(path, rows, chosen)
    width = len(head)
    if long := [n for n, row in body if any(row[width:])]:
        raise DataError(
            f"{path}, row {long[0]} has more cells than the {width} columns of the head; is a "
            "decimal comma among them? save it with semicolons between cells"
        )
    body = [(n, [*row[:width], *[""] * (width - len(row))]) for n, row in body]
    questions: list[tuple[int, str]] = []
    if sums and body and not chosen:
        left += _summaries(body, separator, questions)
    gone = {n for n, _ in left}
    kept = [(n, row) for n, row in body if n not in gone]
    if not kept:
        raise DataError(f"{path} has no row of a shift; name its rows with --rows, such as 2-41")
    columns = [
        Column.of(k + 1, head[k] or f"column {k + 1}", units[k], [row[k] for _, row in kept])
        for k in range(width)
        if head[k] or any(row[k] for _, row in kept)
    ]
    return ForeignTable(
        path, tuple(columns), tuple(n for n, _ in kept), tuple(sorted(left)),
        stated[1] if stated else None, separator, tuple(questions),
    )  # fmt: skip


def _cells(path: Path, lines: list[str]) -> tuple[str, Rows]:
    """Part lines into cells by the dialect that gives the most regular table."""
    import clevercsv  # noqa: PLC0415  # loaded for foreign tables only

    sample = "".join([line for line in lines if line.strip()][:SAMPLE])
    found = clevercsv.Detector().detect(sample, delimiters=list(",;\t| "))
    for separator in (str(found.delimiter or "") if found else "", ";", "\t", ","):
        if separator == " ":
            break
        rows = parted(path, lines, separator) if separator else []
        first = next((k for k, (_, row) in enumerate(rows) if _is_data(row)), -1)
        if first == 0 or (first > 0 and _full(rows[first - 1][1]) > 1):
            return separator, rows
    texts = [(n, re.sub(r"^[#%!]+", " ", line.rstrip())) for n, line in enumerate(lines, start=1)
             if line.strip("#%! \t\r\n")]  # fmt: skip
    for blanks in (_WIDE, _ANY):
        rows = [(n, blanks.findall(text)) for n, text in texts]
        widths = Counter(len(row) for _, row in rows if _is_data(row)).most_common(1)
        width, often = widths[0] if widths else (0, 0)
        if width >= 3 and 2 * often >= len(rows):
            break
    usual = [[found.span() for found in blanks.finditer(text)]
             for (_, text), (_, row) in zip(texts, rows, strict=True)
             if len(row) == width and _is_data(row)]  # fmt: skip
    for k, (n, text) in enumerate(texts):
        if usual and len(rows[k][1]) != width:
            ways = [way.findall(text) for way in (_WIDE, _NAMED)]
            rows[k] = (n, next((w for w in ways if len(w) == width), _by_place(text, usual)))
    return " ", rows


def _by_place(text: str, usual: Sequence[Sequence[tuple[int, int]]]) -> list[str]:
    """Put the words of a line into the columns of other lines by their places."""
    edges = [
        (min(a), max(b))
        for a, b in (zip(*those, strict=True) for those in zip(*usual, strict=True))
    ]
    cells = [""] * len(edges)
    for found in _WIDE.finditer(text):
        a, b = found.span()
        far = [max(low - b, a - high, abs(low + high - a - b) * 1e-3) for low, high in edges]
        at = far.index(min(far))
        cells[at] = f"{cells[at]} {found.group()}".strip()
    return cells


def _full(row: Sequence[str]) -> int:
    return sum(map(bool, row))


def _is_data(row: Sequence[str]) -> bool:
    numbers = sum(map(is_number, row))
    return numbers >= 2 and 2 * numbers >= _full(row)


def _is_head(row: Sequence[str], data: Sequence[str]) -> bool:
    return _full(row) >= max(2, 0.6 * _full(data)) and not any(map(is_number, row))


def _is_units(row: Sequence[str], above: Sequence[str]) -> bool:
    """Test that a row holds units, some cells aside, of the names above it."""
    known = [k for k, cell in enumerate(row) if unit_named(cell.strip("[]() "))]
    others = [c for k, c in enumerate(row) if k not in known and c.strip("[]()-1 ")]
    named = all(k < len(above) and above[k] for k in known)
    again = sum(bool(unit_named(cell)) for cell in above)
    return named and again < len(known) and (len(known) >= 2 or (len(known) == 1 and not others))


def _divided(
    path: Path, rows: Rows, chosen: Sequence[range]
) -> tuple[list[str], list[str], Rows, list[tuple[int, str]]]:
    """Divide rows into names, units, rows below them, and rows left out with their reasons."""
    kinds = [_is_data(row) for _, row in rows]
    if not any(kinds):
        raise DataError(
            f"{path} has no rows of numbers; save the table as CSV with a name and unit above each "
            "column"
        )
    starts = [
        k
        for k, data in enumerate(kinds)
        if data and k and not kinds[k - 1]
        and any(_is_head(row, rows[k][1]) for _, row in rows[max(0, k - 2) : k])
    ] or [kinds.index(True)]  # fmt: skip
    names = {k: _names(rows, kinds, k) for k in starts}
    size = Counter[str]()
    for a, b in pairwise([*starts, len(rows)]):
        size[str(names[a])] += sum(kinds[a:b])
    first = max(starts, key=lambda k: size[str(names[k])])
    above = [row for _, row in rows[max(0, first - HEADS) : first]]
    body, left = [], []
    for k, (n, row) in enumerate(rows):
        if chosen:
            inside = k >= first and any(n in those for those in chosen)
            body += [(n, row)] if inside else []
            left += [(n, "not among --rows")] if kinds[k] and not inside else []
        elif k < first:
            left += [(n, "stands above the table")] if kinds[k] else []
        elif k in names and names[k] != names[first]:
            raise DataError(
                f"{path}: another table begins in row {n}; save each as a file of its own, or name "
                f"the rows of shifts, such as --rows {rows[first][0]}-{n - 1}"
            )
        elif row in above:
            left.append((n, "repeats the head"))
        elif not any(map(is_number, row)):
            left.append((n, f"has no number ('{next(filter(None, row))}')"))
        else:
            body.append((n, row))
    return *names[first], body, left


def _names(rows: Rows, kinds: Sequence[bool], first: int) -> tuple[list[str], list[str]]:
    """Read names and units from the rows above the first row of numbers."""
    width = max(len(_unpadded(row)) for (_, row), data in zip(rows, kinds, strict=True) if data)
    zone: list[list[str]] = []
    for k in range(first - 1, max(-1, first - 1 - HEADS), -1):
        unit = any(unit_named(cell.strip("[]() ")) for cell in rows[k][1])
        if kinds[k] or (_full(rows[k][1]) < 2 and not unit):
            break
        zone.insert(0, _unpadded(rows[k][1]))
    if not zone:
        return [""] * width, [""] * width
    zone = [[cell.lstrip("#%! ") if not k else cell for k, cell in enumerate(r)] for r in zone]
    units: list[str] = []
    for k in range(len(zone) - 1, 0, -1):
        if _is_units(zone[k], ["".join(c) for c in zip_longest(*zone[:k], fillvalue="")]):
            units, zone = zone[k], zone[:k]
            break
    head = zone[-1]
    width = max(len(head), len(units)) if len(head) > 1 else width
    head = head + [""] * (width - len(head))
    if len(zone) > 1:
        head = _two_lines(zone[-2] + [""] * (width - len(zone[-2])), head)
    return head, units + [""] * (width - len(units))


def _two_lines(upper: list[str], lower: list[str]) -> list[str]:
    """Join names that stand in two lines, or below names of groups."""
    names = [name for name in lower if name]
    if len(set(names)) < len(names):
        upper = [next((c for c in upper[k::-1] if c), "") for k in range(len(upper))]
    elif _full(upper) < 3 or (_full(upper) < len(names) and all(lower[: len(upper)])):
        return lower
    joined = [f"{a[:-1]}{b}" if a.endswith("-") else f"{a} {b}".strip()
              for a, b in zip(upper, lower, strict=False)]  # fmt: skip
    return joined + lower[len(joined) :]


def _unpadded(row: list[str]) -> list[str]:
    return row[: max((place for place, cell in enumerate(row, start=1) if cell), default=0)]


def _summaries(
    body: Rows, separator: str, questions: list[tuple[int, str]]
) -> list[tuple[int, str]]:
    """Find rows that summarise those above them, and labelled rows at the ends of the table."""
    columns = {str(k): [(n, row[k]) for n, row in body] for k in range(len(body[0][1]))}
    try:
        decimals = decimals_of(columns, None, separator)
    except DataError:
        decimals = Decimals(None)
    values = np.array([[decimals.value(c) if is_number(c) else np.nan for c in r] for _, r in body])
    labels = _labels(body, values)
    found: dict[int, str] = {}
    above: list[int] = []
    start = 0  # of the group that the last rows belong to
    for k, (_, row) in enumerate(body):
        follows = k - 1 in found
        if k in labels or follows or k >= len(body) - FOOT:
            sure = labels.get(k) and not re.search(r"\d", labels[k])
            mark = "word" if sure else "place" if k in labels or follows else ""
            for those in (above[start:], above):
                if name := _statistic(values[those], values[k], row, decimals, mark):
                    found[k] = f"{name} of rows {body[those[0]][0]} to {body[those[-1]][0]}"
                    break
        if k not in found:
            start = len(above) if follows else start
            above.append(k)
    shifts = [k for k in above if not labels.get(k)]
    for k, word in labels.items():
        n, row = body[k]
        foot = not shifts or k < shifts[0] or k > shifts[-1]
        if k in found or not word or (re.search(r"\d", word) and not (foot and k - 1 in found)):
            continue
        if foot:
            found[k] = "word where other rows have a number"
        else:
            questions.append((
                row.index(word) + 1, f"row {n} has '{word}' where other rows have a number, and is "
                "no sum or mean of those above; correct it, or name the rows of shifts with --rows",
            ))  # fmt: skip
    return [(body[k][0], why + (f" ('{labels[k]}')" if labels.get(k) else ""))
            for k, why in found.items()]  # fmt: skip


def _labels(body: Rows, values: Array) -> dict[int, str]:
    """Find rows whose first cell is a word, or empty, where other rows have a number."""
    cells = np.array([np.isfinite(values), [[bool(c) for c in row] for _, row in body]])
    below = cells.sum(axis=1)[:, None] - cells.cumsum(axis=1)
    above, others = np.zeros_like(below[:, 0]), 0
    found: dict[int, str] = {}
    for k, (_, row) in enumerate(body):
        numbers, filled = above if others > 1 else below[:, k]
        usual = 2 * numbers > filled
        place = next((p for p, cell in enumerate(row) if cell), 0)
        word = usual[place] and not cells[0, k, place] and cells[0, k].any()
        if word or (not row[0] and usual[0]):
            found[k] = row[place] if word else ""
        else:
            others += 1
            above = above + cells[:, k]
    return found


def _statistic(
    above: Array, values: Array, row: Sequence[str], decimals: Decimals, mark: str
) -> str | None:
    """Name the statistic that a row is of the rows above it, None where it is of none.

    ``mark`` says by what the row stands out: a ``word``, its ``place``, or nothing. Columns that
    are constant above tell little, and every column has to agree where no word stands.
    """
    whole, hits, telling = 0, Counter[str](), Counter[str]()
    statistics: dict[str, float] = {}
    for k, value in enumerate(values):
        known = above[:, k][np.isfinite(above[:, k])]
        if not np.isfinite(value) or known.size < 2:
            continue
        whole += 1
        by = 0.51 * decimals.step(row[k]) + 1e-9 * abs(value)
        sd, size = known.std(ddof=1), known.size
        statistics = {
            "mean": known.mean(), "sum": known.sum(), "standard deviation": sd,
            "standard deviation (n)": known.std(), "standard error": sd / size**0.5, "count": size,
            "median": np.median(known), "least value": known.min(), "largest value": known.max(),
            "range": np.ptp(known), "variance": sd**2,
        }  # fmt: skip
        agreeing = {name for name, one in statistics.items() if abs(float(one) - value) <= by}
        hits.update(agreeing)
        telling.update(agreeing if np.ptp(known) else ())
    for name in statistics:
        likely = name in ("mean", "sum", "standard deviation", "standard deviation (n)", "count")
        least = {"word": 1, "place": 1 if likely else 2}.get(mark, 2 if likely else whole + 1)
        share = 2 / 3 if mark == "word" else 1.0
        if telling[name] >= least and hits[name] >= share * whole and (mark or len(above) > 2):
            return name
    return None
