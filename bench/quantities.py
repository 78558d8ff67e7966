"""Quantities of a bench table: the words that name them in Europe's languages, and a score.

Names are compared as whole words without accents. A unit in the head and the kind of cells must fit
the quantity. A speed without a word of a difference is never the mismatch, whatever its unit: it is
that of a shaft.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

import numpy as np

from dogshape.bench.cell_values import (
    CURRENT,
    FORCE,
    LENGTH,
    PRESSURE,
    SPEED,
    TIME,
    UNITS,
    VOLTAGE,
    Column,
)
from dogshape.sim.units import MS

#: Scores of a column: its unit alone, a loose word, one of its words, its name; a unit beside them.
UNIT, LOOSE, WORD, NAME, FITS = 1.0, 2.0, 3.0, 4.0, 0.5


@dataclass(frozen=True)
class TableQuantity:
    """A quantity that is looked for: name, dimension of its units, and patterns of whole words.

    ``words`` name it, ``loose`` ones may also mean something else, and with those ``against`` a
    column is another. ``needed`` says that a table is of no use without the quantity, ``filled``
    that each row has to have it. ``by_unit`` says that a unit alone may settle it.
    """

    name: str
    dimension: str | None
    words: str
    loose: str = "-"
    against: str = "-"
    needed: bool = False
    filled: bool = False
    by_unit: bool = True

    @property
    def units(self) -> str:
        """Spellings of units that it may have."""
        return ", ".join(text for text, unit in UNITS.items() if unit.dimension == self.dimension)


_SPREAD = (
    r"\w*std\w*|sd|stabw|sigma|s e m|sem|\w*streuung|\w*abweichung(en)?|\w*deviation|ecart type"
    r"|scarto|desviacion|odchylka|odchylenie|scatter|spread|\w*unsicherheit|uncertainty|incertitude"
    r"|tolerance|toleranz|variance|varianz|range|spannweite|etendue|confidence|konfidenz\w*"
    r"|vertrauens\w*|ci|ki|ic|iqr|mad|\w*standardfehler|(standard |std )error|plus minus"
    r"|u k \d|u m?s|u ?95|quartil\w*|interquartile|(half|demi) (width|largeur)|halbbreite|s d"
    r"|dispersion\w*|spreiding|spridning"
)
_EXTREME = r"min|max|minimum|maximum|kleinste\w*|groesste\w*"
_RISE = r"\w*rise|\w*anstieg\w*|ramp\w*|montee|salita|subida"
#: Name of a rise time, the words and signs behind it, number, and unit in a text.
_STATED_RISE = re.compile(
    rf"\b((?:{_RISE})[^\d;|]{{0,30}}?(\d+(?:[.,]\d+)?)\s*(ms|s)\b)", re.IGNORECASE
)
_FORCE = r"shift force|(schalt|stell|aktor|axial)kraft|f (shift|axial|act|schalt|ax)"
_DIFFERENCE = (
    r"\w*dif(f)?eren\w*|\w*verschil|\w*skillnad|diff|rel|ecart|relativ\w*|rozdil|roznica|verschil|skillnad|ero|kulonbseg|slip"
    r"|schlupf|glissement|scorrimento|deslizamiento|skluz|poslizg|\w*mismatch"
)
SHAFTS = (
    r"output|abtrieb\w*|antrieb\w*|input|in|out|\w*shaft|\w*welle|engine|\w*motor\w*|crank\w*|gear"
    r"|\w*rad|\w*muffe|sleeve|hub|nabe|wheel|\w*getriebe|turbine|rotor|spindle|spindel|ring|dog"
    r"|moteur|arbre|albero|eje|hridel|wal|primary|secondary|primaer|sekundaer|entree|sortie"
    r"|pignon|manchon|ingranaggio|ozubeni"
)
SHIFT_FORCE = TableQuantity(
    "force_N",
    FORCE,
    _FORCE,
    r"\w*force|\w*kraft|f|effort|forza|fuerza|forca|sila|kracht|voima|ero",
    rf"time|\w*zeit|{_RISE}|{_SPREAD}|{_EXTREME}|(feder|spring|reib|friction|vorspann"
    r"|preload|brems|rueckstell|rast|detent)\w*",
    needed=True,
    filled=True,
)
BACK_SIDE = r"back|gegen\w*|rueck\w*|return|ambient|umgebung\w*|tank|exhaust"
_PRESSURE = (
    r"p|p \w+|\w*(pressure|druck)|(supply|shift|actuator) pressure|(schalt|versorgungs|stell)druck"
    r"|pression|pressione|presion|tlak|cisnienie|tryck|luftdruck|oeldruck"
)
_CURRENT = r"i|i \w+|\w*current|\w*strom|courant|corrente|corriente|proud|prad"
_NO_LEVEL = rf"{_RISE}|{_SPREAD}|{_EXTREME}|{BACK_SIDE}"
#: Set values of an actuator in place of the shift force (``Actuator.set_keys``).
SET_VALUES = (
    TableQuantity("supply_bar", PRESSURE, _PRESSURE, against=_NO_LEVEL, filled=True),
    TableQuantity(
        "voltage_V",
        VOLTAGE,
        r"u|u \w+|\w*voltage|\w*spannung|tension|tensione|napeti|napiecie",
        against=_NO_LEVEL,
        filled=True,
    ),
    TableQuantity("current_A", CURRENT, _CURRENT, against=_NO_LEVEL, filled=True),
)
#: Channels of an actuator in place of the force of a trace (``Actuator.logged_key``).
LOGGED_VALUES = (
    TableQuantity("pressure_bar", PRESSURE, _PRESSURE, against=_NO_LEVEL),
    TableQuantity("current_A", CURRENT, _CURRENT, against=_NO_LEVEL),
)
SHIFT_COUNT = TableQuantity(
    "n_shifts",
    None,
    "n shifts|anzahl schaltungen|repeats|repetitions|wiederholungen|no of shifts"
    "|number of shifts|stueckzahl|nombre( d essais)?|numero|liczba|pocet|antal|aantal",
    r"shifts|count|anzahl|number|schaltungen|samples|n",
    r"ok|nok|io|nio|engaged|eingelegt|\w*fail\w*|\w*fehl\w*|ungueltig|invalid|rel|diff"
    rf"|{SHAFTS}",
)
SHIFT_TIME = TableQuantity(
    "shift_time_s",
    TIME,
    r"shift time|\w*schalt(zeit|dauer)|t (shift|schalt)"
    r"|shifting time|temps de (passage|changement)|tempo di (cambio|innesto)"
    r"|tiempo de cambio|cas razeni|czas zmiany|schakeltijd|vaxlingstid",
    r"\w*time|\w*zeit|\w*dauer|duration|t|t\d+|temps|duree|tempo|tiempo|duracion|cas|czas"
    r"|tijd|tid|aika",
    rf"\w*stamp|\w*zeitstempel|timeout|datum|date|delay|verzoegerung|\w*totzeit|dead|start\w*"
    rf"|beginn?|ende?|stop|uhrzeit|clock|heure|ora|{_RISE}|{_SPREAD}|{_EXTREME}",
    needed=True,
)
SHIFT_TIME_SD = TableQuantity(
    "shift_time_sd_s",
    TIME,
    _SPREAD,
    against=r"f|force|\w*kraft|n|mismatch|\w*drehzahl|rise|anstieg|regime",
)
SHIFTS = (
    TableQuantity(
        "mismatch_rpm",
        SPEED,
        r"\w*mismatch|(\w*differenz|relativ|schlupf)drehzahl|drehzahldifferenz|d n|dn"
        r"|delta (n|omega|w|rpm|speed|drehzahl|rev\w*|regime|v)|n diff|diff n|n rel|dn \w+"
        r"|(speed|rpm) difference|relative speed|domega|domega \w+|delta",
        rf"{_DIFFERENCE}|delta \w+",
        rf"{_SPREAD}|{_EXTREME}",
        needed=True,
        filled=True,
        by_unit=False,
    ),
    SHIFT_FORCE,
    TableQuantity(
        "force_rise_s",
        TIME,
        r"(force )?rise( time)?|anstiegszeit|kraftanstieg|t (rise|anstieg|ramp|an|anst)",
        _RISE,
        _SPREAD,
    ),
    SHIFT_COUNT,
    SHIFT_TIME,
    TableQuantity(
        "engaged",
        None,
        "engaged|eingelegt|geschaltet|eingerueckt|eingespurt|eingerastet|drin|im eingriff"
        "|engage|enclenche|innestato|engranado|zarazeno",
        "erfolg|erfolgreich|success|ok|i o|io|result|ergebnis|status|bewertung|beurteilung|urteil",
        r"not|nicht|no|n|fail\w*|fehler|error|non|nicht",
    ),
    TableQuantity(
        "trace",
        None,
        "trace( file)?|messdatei|measurement file",
        "file|datei|dateiname|filename|fichier",
    ),
    SHIFT_TIME_SD,
    TableQuantity(
        "order",
        None,
        r"(run )?order|reihenfolge|lfd( nr)?|laufende nummer|laufnummer|sequence|sequenz"
        "|run (number|no)|versuchsnummer|shift number",
    ),
    TableQuantity(
        "timestamp",
        TIME,
        "time ?stamp|zeitstempel|(datum|date|date time|datum uhrzeit)",
        against=r"shift time|\w*schalt(zeit|dauer)|t (shift|schalt)",
    ),
    *SET_VALUES,
)
SHIFT_QUANTITIES = {quantity.name: quantity for quantity in SHIFTS}
TRACE = (
    TableQuantity("t_s", TIME, "-", "t|time|zeit", needed=True),
    TableQuantity(
        "displacement_mm",
        LENGTH,
        "displacement|(schalt|muffen)weg|s sleeve|sleeve position",
        r"\w*weg|travel|position|x|s",
        needed=True,
    ),
    TableQuantity("force_N", FORCE, _FORCE, r"\w*force|\w*kraft|f", needed=True),
    TableQuantity(
        "sliding_speed_rpm",
        SPEED,
        r"speed sliding|(sliding|sleeve) speed|n (sleeve|muffe|sliding)"
        "|drehzahl muffe|muffendrehzahl",
        "n antrieb|antriebsdrehzahl|input speed|n in",
        needed=True,
    ),
    TableQuantity(
        "output_speed_rpm",
        SPEED,
        r"speed output|(output|gear) speed|n (rad|gear|output|abtrieb)"
        "|drehzahl rad|(rad|abtriebs)drehzahl",
        "n out",
        needed=True,
    ),
    *LOGGED_VALUES,
)
#: Quantities that may stand for the force where a table has none.
FORCE_STANDINS = {*SET_VALUES, *LOGGED_VALUES}
#: Words of means and of their spread.
MEAN = (
    r"mittel\w*|mean|average|avg|durchschnitt\w*|moyenne?|media|promedio|gemiddeld\w*|medel\w*"
    r"|sredni\w*|prumer\w*|median"
)
STANDARD_ERROR = (
    r"\w*standardfehler|(standard|std) err(or)?|stderr|sem|s e m|\w*abweichung des mittel\w*"
    r"|(standard|std) (deviation|dev) of (the )?mean|erreur (type|standard)|errore standard"
    r"|error estandar|standaardfout|medelfel"
)
STANDARD_DEVIATION = (
    r"\w*std\w*|sd|stabw|sigma|\w*standardabweichung|standard deviation|ecart type"
    r"|deviazione standard|desviacion (estandar|tipica)|scarto (tipo|quadratico medio)"
    r"|smerodatna odchylka|odchylenie standardowe"
)
VARIANCE = (
    r"varian[zs]|variance|varianza|variantie|wariancja|rozptyl|var|s ?2|sigma ?2|sigma squared"
)
VARIATION = (
    r"cv|vk|vko|rsd|variationskoeffizient\w*|\w*variationskoeff\w*|coef\w* (of |de |di )?varia\w*"
    r"|rel\w* (standardabweichung|standard deviation|std\w*|sd|streuung)|variatiecoefficient"
)
#: A variation of another quantity.
OTHER_SPREAD = r"f|force|\w*kraft|n|mismatch|\w*drehzahl|rise|anstieg|regime"
#: Words of columns that divide shifts into kinds, such as gear or direction.
SPLITTING = (
    r"gear|gang|gaenge|stufe|direction|richtung|sens|vorgang|vorgaenge|operation|mode|modus|type|typ"
    r"|art|kind|phase|action|aktion|marche?|rapport|vitesse|marcia|marchas?|rychlost|bieg|smer"
    r"|kierunek|direzione|direccion|verso|shift|state|zustand|klaue|clutch|side|seite|config\w*"
    r"|variante?|version"
)
_REPEATED = (
    r"run|lauf|versuch|messung|wdh|wiederholung|repeat|rep|shift|schaltung|trial|test|mesure|essai"
    r"|prova|prueba|measurement|probe|value|wert|x|nr|no"
)


def plain_words(name: str) -> str:
    """Write a name in lower case, its words parted by blanks, without accents and signs."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    words = re.sub(r"^\s*(±|\+/?-)", "plus minus ", words)
    for letter, spelling in (
        ("ä", "ae"),
        ("ö", "oe"),
        ("ü", "ue"),
        ("ß", "ss"),
        ("Δ", "delta "),
        ("\N{INCREMENT}", "delta "),
        ("ω", "omega"),
        ("Ø", "mean "),
        ("\N{GREEK SMALL LETTER SIGMA}", " sigma "),
        ("ł", "l"),
        ("ø", "oe"),
        ("æ", "ae"),
    ):
        words = words.replace(letter, spelling).replace(letter.upper(), spelling)
    ascii_text = unicodedata.normalize("NFKD", words).encode("ascii", "ignore").decode()
    return " ".join(re.sub(r"[^a-z0-9]+", " ", ascii_text.lower()).split())


def has_word(pattern: str, name: str) -> bool:
    """Test that a name as ``plain_words`` writes it has one of the words of a pattern."""
    return bool(re.search(rf"\b({pattern})\b", name))


def score(quantity: TableQuantity, column: Column) -> float:
    """Score a column for a quantity; zero where its unit, a word or its cells speak against it."""
    name = plain_words(column.name)
    if _is_other(quantity, column, name):
        return 0.0
    fits = 0.0 if column.unit is None else FITS
    is_stamp = quantity.name == "timestamp" and column.is_dated
    if re.fullmatch(quantity.words, name) or is_stamp:
        return NAME + fits
    if has_word(quantity.words, name):
        return WORD + fits
    if has_word(quantity.loose, name):
        # A bare slip may be a ratio, which no unit of a speed contradicts.
        return 0.0 if quantity.name == "mismatch_rpm" and not fits else LOOSE + fits
    # A unit alone says nothing of what a table may lack.
    return UNIT + fits if fits and quantity.needed and quantity.by_unit else 0.0


def _is_other(quantity: TableQuantity, column: Column, name: str) -> bool:
    """Test that a column cannot be a quantity."""
    if column.hidden or has_word(quantity.against, name):
        return True
    if column.unit and column.unit.dimension != quantity.dimension:
        return True
    if quantity.dimension and quantity.name != "timestamp" and column.is_dated:
        return True
    numeric = any(re.search(r"\d", cell) for cell in column.cells)
    if quantity.needed and any(column.cells) and not numeric:
        return True
    is_named = has_word(quantity.words, name)
    return quantity.name == "shift_time_s" and not is_named and grows(column)


def grows(column: Column) -> bool:
    """Test that numbers of a column grow from row to row, as a clock does."""
    steps = np.diff(column.values[np.isfinite(column.values)])
    return bool(steps.size >= 3 and (steps > 0).mean() >= 0.9)


def counts_up(column: Column) -> bool:
    """Test that a column numbers its rows: whole numbers, most of them one apart."""
    cells = [cell for cell in column.cells if cell]
    if column.unit is not None or not all(cell.isdecimal() for cell in cells):
        return False
    if len(set(cells)) < min(3, len(cells)) or cells in (["0", "1"], ["1", "0"], ["0"]):
        return False
    if len(cells) < 2:
        return False
    steps = np.diff(np.array(cells, dtype=int))
    return bool(max((steps == 1).mean(), (steps == -1).mean()) >= 0.6 and (steps != 0).all())


def is_force_by_area(column: Column) -> bool:
    """Test that a column is a force that a pressure or a mass stands for."""
    unit = column.unit
    if unit is None:
        return False
    is_named = has_word(f"{SHIFT_FORCE.words}|{SHIFT_FORCE.loose}", plain_words(column.name))
    return unit.dimension == PRESSURE or (is_named and unit.text.lower() == "kg")


def repeated_name(column: Column) -> str | None:
    """Give the name that a column shares with other repeats of a shift, None for no repeat.

    Its number is taken out: ``t1``, ``Schaltzeit 2``, ``3. Messung`` and ``run 4``.
    """
    words = plain_words(column.name)
    name = " ".join(re.sub(r"\d+", " ", words).split())
    if name == words or not re.search(r"\d", words):
        return None
    if column.unit is not None:
        return name if column.unit.dimension == TIME else None
    return name if has_word(f"{SHIFT_TIME.words}|{SHIFT_TIME.loose}|{_REPEATED}", name) else None


def stated_rise(text: str) -> tuple[str, float] | None:
    """Find a rise time in a text such as a title: its words and the time, s; None without one."""
    match = _STATED_RISE.search(text)
    if match is None:
        return None
    words, number, unit = match.groups()
    value = float(number.replace(",", "."))
    return words, value * MS if unit.lower() == "ms" else value
