"""Columns of a foreign table: which of them are which quantities, and in which units.

Names are compared with words that benches use, in English and German; a unit in the head must fit
the quantity. What fits equally well twice is not decided here.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from dogshape.diagnosis.bench.measured_units import (
    FORCE,
    LENGTH,
    SPEED,
    TIME,
    UNITS,
    Unit,
    split_head,
    unit_named,
)
from dogshape.sim.errors import InputError, did_you_mean

LEAST = 20.0  #: score from which a column is taken for a quantity
FITS = 20.0  #: what a unit of the right kind adds


@dataclass(frozen=True)
class Quantity:
    """A quantity that is looked for: name, kind, words that speak for it and words against.

    ``loose`` words may also mean something else; ``needed`` says that a table is of no use without
    the quantity. ``also`` is a kind that its numbers may have though it needs none.
    """

    name: str
    dimension: str | None
    words: tuple[str, ...]
    loose: tuple[str, ...] = ()
    against: tuple[str, ...] = ()
    needed: bool = False
    also: str | None = None

    @property
    def units(self) -> list[str]:
        """Spellings of units that it may have."""
        return [text for text, unit in UNITS.items() if unit.dimension == self.dimension]


_SPREAD = ("std", "sd", "sigma", "streuung", "abweichung", "min", "max", "deviation", "stdev")
SHIFTS = (
    Quantity(
        "mismatch_rpm", SPEED,
        ("mismatch", "drehzahldifferenz", "differenzdrehzahl", "relativdrehzahl", "delta n",
         "delta omega", "dn", "d n", "n diff", "diff n", "speed difference", "relative speed",
         "schlupfdrehzahl", "delta speed", "delta rpm"),
        ("slip", "schlupf", "rpm", "drehzahl", "n"),
        ("output", "abtrieb", "antrieb", "input", *_SPREAD), needed=True,
    ),
    Quantity(
        "force_N", FORCE,
        ("shift force", "schaltkraft", "stellkraft", "aktorkraft", "axialkraft", "f shift",
         "f axial", "f act", "f schalt", "f ax"),
        ("force", "kraft", "f"), ("rise", "anstieg", "time", "zeit", *_SPREAD), needed=True,
    ),
    Quantity(
        "force_rise_s", TIME,
        ("force rise", "rise time", "anstiegszeit", "kraftanstieg", "t rise", "t anstieg",
         "t ramp", "t an", "t anst"),
        ("rise", "anstieg", "ramp", "rampe"), _SPREAD,
    ),
    Quantity(
        "n_shifts", None,
        ("n shifts", "anzahl schaltungen", "repeats", "repetitions", "wiederholungen"),
        ("shifts", "count", "anzahl", "number", "schaltungen", "samples", "n"),
    ),
    Quantity(
        "shift_time_s", TIME,
        ("shift time", "schaltzeit", "schaltdauer", "t shift", "t schalt", "mean shift time",
         "mittlere schaltzeit"),
        ("mean time", "t mean", "time", "zeit", "dauer", "duration", "t"),
        ("rise", "anstieg", "ramp", "rampe", "stamp", "stempel", "timeout", "datum", "delay",
         *_SPREAD), needed=True,
    ),
    Quantity(
        "engaged", None,
        ("engaged", "eingelegt", "geschaltet", "eingerueckt", "eingespurt"),
        ("erfolg", "erfolgreich", "success", "ok", "i o", "result", "ergebnis", "status"),
    ),
    Quantity(
        "trace", None,
        ("trace", "trace file", "messdatei", "measurement file"),
        ("file", "datei", "dateiname", "filename"),
    ),
    Quantity(
        "shift_time_sd_s", TIME,
        ("std", "sd", "stdev", "stddev", "sigma", "streuung", "standardabweichung",
         "standard deviation", "standard abweichung", "std dev"),
        (), ("f", "force", "kraft", "n", "mismatch", "drehzahl", "rise", "anstieg", "error"),
    ),
    Quantity(
        "order", None,
        ("order", "run order", "reihenfolge", "lfd nr", "lfd", "laufende nummer", "laufnummer",
         "sequence", "sequenz", "run number", "run no", "versuchsnummer", "shift number"),
    ),
    Quantity(
        "timestamp", None,
        ("timestamp", "time stamp", "zeitstempel", "datum", "date", "date time", "datum uhrzeit"),
        also=TIME,
    ),
)  # fmt: skip
TRACE = (
    Quantity("t_s", TIME, (), ("t", "time", "zeit"), needed=True),
    Quantity(
        "displacement_mm", LENGTH,
        ("displacement", "schaltweg", "s sleeve", "sleeve position", "muffenweg"),
        ("weg", "travel", "position", "x", "s"), needed=True,
    ),
    Quantity("force_N", FORCE, SHIFTS[1].words, SHIFTS[1].loose, needed=True),
    Quantity(
        "sliding_speed_rpm", SPEED,
        ("sliding speed", "speed sliding", "n sleeve", "n muffe", "drehzahl muffe", "sleeve speed",
         "muffendrehzahl", "n sliding"),
        ("n antrieb", "antriebsdrehzahl", "input speed", "n in"), needed=True,
    ),
    Quantity(
        "output_speed_rpm", SPEED,
        ("output speed", "speed output", "n rad", "n gear", "drehzahl rad", "gear speed",
         "raddrehzahl", "n output", "n abtrieb", "abtriebsdrehzahl"),
        ("n out",), needed=True,
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Column:
    """A column of the file: its head as it stands, the name in plain words, and its unit."""

    head: str
    words: str
    unit: Unit | None
    strange: str | None = None

    @classmethod
    def of(cls, head: str, below: str = "") -> Column:
        """Read a head, with the unit that stands in a row of its own below it, if there is one."""
        name, unit, strange = split_head(head)
        under = unit_named(below.strip("[]() "))
        return cls(head, plain_words(name), unit or under, None if under else strange)


@dataclass(frozen=True)
class Match:
    """A column that is taken for a quantity; ``unit`` is None where its head gives none."""

    quantity: Quantity
    column: Column
    unit: Unit | None
    given: bool = False


def plain_words(name: str) -> str:
    """Write a name in lower case, its words parted by blanks, without accents and signs."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    for letter, said in (("ä", "ae"), ("ö", "oe"), ("ü", "ue"), ("ß", "ss"), ("Δ", "delta "),
                         ("\N{INCREMENT}", "delta "), ("ω", "omega"), ("Ø", "mean ")):  # fmt: skip
        apart = apart.replace(letter, said).replace(letter.upper(), said)
    bare = unicodedata.normalize("NFKD", apart).encode("ascii", "ignore").decode()
    return " ".join(re.sub(r"[^a-z0-9]+", " ", bare.lower()).split())


def score(quantity: Quantity, column: Column) -> float:
    """Score a column for a quantity; zero where its unit or a word speaks against it."""
    words = column.words.split()
    if any(word in words or (len(word) > 4 and word in column.words) for word in quantity.against):
        return 0.0
    kind = None if column.unit is None else column.unit.dimension
    if kind is not None and kind not in (quantity.dimension, quantity.also):
        return 0.0
    found = max((_alike(phrase, words) for phrase in quantity.words), default=0.0)
    loose = max((0.6 * _alike(phrase, words) for phrase in quantity.loose), default=0.0)
    best = max(found, loose)
    if best == 0.0 and not quantity.needed:
        return 0.0  # a unit alone says nothing of what a table may lack
    return best + (FITS if kind is not None else 0.0)


def _alike(phrase: str, words: Sequence[str]) -> float:
    parts = phrase.split()
    if parts == list(words):
        return 100.0
    if set(parts) <= set(words):
        return 50.0 if len(phrase) > 2 else 20.0
    if len(phrase) >= 5 and len(parts) == 1 and any(phrase in word for word in words):
        return 40.0
    return 0.0


def matched(
    columns: Sequence[Column], quantities: Sequence[Quantity], said: Mapping[str, str]
) -> tuple[list[Match], list[str]]:
    """Match columns with quantities, best first: matches, and faults for what is not decided.

    ``said`` are what a user says: quantity to ``COLUMN`` or ``COLUMN:UNIT``; they come first.
    """
    found, faults = [], []
    for name, text in said.items():
        try:
            found.append(_said(columns, quantities, name, text))
        except InputError as error:
            faults.append(str(error))
    taken = {one.column.head for one in found}
    open_ = [q for q in quantities if q.name not in said]
    while open_:
        ranked = sorted(
            ((score(q, c), -k, q, c) for k, q in enumerate(open_) for c in columns
             if c.head not in taken), key=lambda row: row[:2], reverse=True,
        )  # fmt: skip
        if not ranked or ranked[0][0] < LEAST:
            break
        best, _, quantity, column = ranked[0]
        equal = [c.head for s, _, q, c in ranked if q is quantity and s == best]
        open_.remove(quantity)
        if len(equal) > 1:
            names = " or ".join(f"'{head}'" for head in equal)
            faults.append(
                f"{quantity.name} may be the column {names}; say which: "
                f"--column {quantity.name}='{equal[0]}'"
            )
            continue
        taken.add(column.head)
        found.append(Match(quantity, column, column.unit))
    missing = [q for q in open_ if q.needed and q.name not in {m.quantity.name for m in found}]
    left = [c.head for c in columns if c.head not in taken]
    faults += [_missing(one, left) for one in missing]
    return found, faults


def _missing(quantity: Quantity, left: Iterable[str]) -> str:
    there = ", ".join(f"'{head}'" for head in left) or "none"
    return (
        f"no column looks like {quantity.name}; say which one it is: --column "
        f"{quantity.name}=COLUMN or COLUMN:UNIT (columns left: {there})"
    )


def _said(columns: Sequence[Column], quantities: Sequence[Quantity], name: str, text: str) -> Match:
    known = {quantity.name: quantity for quantity in quantities}
    if name not in known:
        hint = did_you_mean(name, known)
        raise InputError(f"--column {name}=... names no quantity; {hint}")
    heads = {column.head: column for column in columns}
    head, _, asked = (text, "", "") if text in heads else text.rpartition(":")
    if head not in heads:
        hint = did_you_mean(text, heads)
        raise InputError(f"--column {name} is '{text}', but the file has no such column; {hint}")
    column, unit = heads[head], heads[head].unit
    if asked:
        told, unit = unit, unit_named(asked)
        if told and unit and told.dimension == unit.dimension and told.factor != unit.factor:
            raise InputError(
                f"--column {name} is '{text}', but the head itself says {told.text}; leave out "
                f"':{asked}', or correct the head where it is wrong"
            )
    kinds = known[name].dimension, known[name].also
    if (asked and unit is None) or (unit and unit.dimension not in kinds):
        wrong = asked or (unit.text if unit else "")
        valid = ", ".join(known[name].units) or "none: it is a number without one"
        raise InputError(f"the unit of {name} is '{wrong}', but it must be one of: {valid}")
    return Match(known[name], column, unit, given=True)
