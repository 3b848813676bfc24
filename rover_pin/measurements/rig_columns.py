"""Column names of wheel-rig tables as laboratories write them, in several languages, and the columns of a data set that
they mean.

`matches` finds the meaning of one column name; `scale_to` converts its unit.
"""

import math
import re
import unicodedata
from collections.abc import Iterator, Sequence
from functools import cache
from typing import NamedTuple

from rover_pin.base.files.column_names import COMMAND, tokens_of, usual_unit
from rover_pin.base.units import factor_to, name_and_unit
from rover_pin.measurements.channel import RIG_CHANNELS, sd_column

KILOPOND = 9.80665
"""Force [N] that a reading of 1 kg means if a force is stated in kg: the standard gravity, wherever the balance is."""


class RigColumn(NamedTuple):
    """One column of a wheel-rig data set: its name, its SI unit, and the names that laboratories give to it.

    `phrases` are whole names, whose case does not matter. `symbols` are short names, for which upper and lower case
    differ. `unit_symbols` are short names that also denote other quantities; a column name with such a symbol matches
    only if it states a unit of the right kind. If `needs_unit` is True, a phrase matches only with a unit too.
    """

    column: str
    unit: str
    phrases: tuple[str, ...]
    symbols: tuple[str, ...] = ()
    unit_symbols: tuple[str, ...] = ()
    needs_unit: bool = False


LOAD = ("load", "vertical load", "normal load", "contact load", "static load", "wheel load", "axle load", "dead weight",
        "weight", "normal force", "vertical force", "normal reaction", "vertical reaction", "load force", "radlast",
        "last", "normalkraft", "vertikalkraft", "aufstandskraft", "gewichtskraft", "auflast", "charge",
        "charge verticale", "charge normale", "force normale", "force verticale", "effort normal", "carga",
        "carga vertical", "carga normal", "fuerza normal", "荷重", "垂直荷重", "鉛直荷重", "輪荷重", "接地荷重",
        "垂直力", "载荷", "垂直载荷", "法向力", "fz", "f z", "fn", "f n")  # fmt: skip
"""Names of the vertical load on the wheel in tables of several languages."""
RIG_COLUMNS = (
    RigColumn(
        "slip", "",
        ("slip", "slip ratio", "slip rate", "slippage", "slippage ratio", "longitudinal slip", "schlupf", "radschlupf",
         "schlupfwert", "glissement", "taux de glissement", "patinage", "deslizamiento", "patinamiento",
         "indice de deslizamiento", "すべり率", "スリップ率", "滑り率", "すべり比", "すべり", "スリップ", "滑转率",
         "滑移率"),
        symbols=("S", "s", "i"),
    ),
    RigColumn("load_N", "N", LOAD, symbols=("W",), unit_symbols=("N", "P", "Q", "G")),
    RigColumn(
        "load_kg", "kg",
        (*LOAD, "mass", "load mass", "total mass", "payload", "masse", "gewicht", "poids", "masa", "質量", "质量"),
        unit_symbols=("m", "M", "W"), needs_unit=True,
    ),
    RigColumn(
        "drawbar_pull_N", "N",
        ("drawbar pull", "drawbar", "drawbar force", "draw bar pull", "pull", "pull force", "pulling force", "dp",
         "d p", "dbp", "net traction", "net tractive effort", "net tractive force", "net traction force", "traction",
         "traction force", "tractive force", "tractive effort", "horizontal force", "longitudinal force", "draft",
         "draft force", "zugkraft", "nettozugkraft", "netto zugkraft", "langskraft", "laengskraft", "horizontalkraft",
         "hakenzugkraft", "triebkraft", "force de traction", "effort de traction", "effort au crochet",
         "traction nette", "force longitudinale", "force horizontale", "traccion", "fuerza de traccion",
         "fuerza de tiro", "けん引力", "牽引力", "水平力", "前後力", "挂钩牵引力", "牵引力", "fx", "f x"),
        unit_symbols=("F", "P", "H"),
    ),
    RigColumn(
        "torque_Nm", "N m",
        ("torque", "wheel torque", "drive torque", "driving torque", "driven torque", "input torque", "shaft torque",
         "axle torque", "drehmoment", "antriebsmoment", "radmoment", "raddrehmoment", "antriebsdrehmoment", "couple",
         "couple moteur", "couple roue", "couple d entrainement", "par", "par motor", "トルク", "駆動トルク",
         "車輪トルク", "扭矩", "转矩", "驱动扭矩", "my", "m y"),
        symbols=("T",), unit_symbols=("Q", "M"),
    ),
    RigColumn(
        "sinkage_m", "m",
        ("sinkage", "wheel sinkage", "total sinkage", "dynamic sinkage", "sinkage depth", "sink depth", "sinking",
         "sinking depth", "depth", "einsinkung", "einsinktiefe", "einsenkung", "radeinsinkung", "enfoncement",
         "profondeur d enfoncement", "hundimiento", "沈下量", "沈下", "車輪沈下量", "沉陷", "沉陷量", "下陷量"),
        symbols=("z", "h", "Z"), unit_symbols=("H", "d", "D"),
    ),
    RigColumn(
        "lateral_N", "N",
        ("lateral", "lateral force", "side force", "sideways force", "sideforce", "cornering force", "seitenkraft",
         "querkraft", "force laterale", "effort lateral", "fuerza lateral", "横力", "側方力", "サイドフォース",
         "コーナリングフォース", "侧向力", "fy", "f y"),
    ),
    RigColumn(
        "moment_z_Nm", "N m",
        ("moment z", "mz", "m z", "torque z", "vertical moment", "yaw moment", "steering moment",
         "moment about the vertical", "giermoment", "hochachsenmoment", "moment de lacet", "ヨーモーメント"),
    ),
    RigColumn(
        "travel_speed_mps", "m/s",
        ("travel speed", "travel velocity", "traveling speed", "travelling speed", "traveling velocity",
         "travelling velocity", "carriage speed", "carriage velocity", "forward speed", "forward velocity",
         "linear speed", "linear velocity", "ground speed", "translational speed", "translational velocity",
         "longitudinal velocity", "longitudinal speed", "vehicle speed", "actual speed", "fahrgeschwindigkeit",
         "vorschubgeschwindigkeit", "schlittengeschwindigkeit", "vitesse d avancement", "vitesse du chariot",
         "vitesse longitudinale", "vitesse de translation", "velocidad de avance", "走行速度", "並進速度", "台車速度",
         "前進速度", "vx", "v x"),
        symbols=("v", "V"), unit_symbols=("u",),
    ),
    RigColumn(
        "rim_speed_mps", "m/s",
        ("rim speed", "rim velocity", "circumferential speed", "circumferential velocity", "peripheral speed",
         "peripheral velocity", "tangential speed", "tangential velocity", "theoretical speed", "wheel speed",
         "umfangsgeschwindigkeit", "vitesse peripherique", "vitesse circonferentielle", "velocidad periferica",
         "周速度", "周速", "車輪周速度"),
    ),
    RigColumn(
        "wheel_rate_radps", "rad/s",
        ("wheel rate", "wheel speed", "angular velocity", "angular speed", "angular rate", "rotational speed",
         "rotational velocity", "rotation speed", "rotation rate", "speed of rotation", "omega", "drehzahl",
         "raddrehzahl", "winkelgeschwindigkeit", "vitesse de rotation", "vitesse angulaire", "regime",
         "velocidad angular", "角速度", "回転数", "回転速度", "車輪回転数", "车轮转速", "rpm"),
        unit_symbols=("n", "N", "w"), needs_unit=True,
    ),
    RigColumn(
        "slope_rad", "rad",
        ("slope", "slope angle", "incline", "inclination", "inclination angle", "neigung", "neigungswinkel",
         "hangneigung", "pente", "angle de pente", "pendiente", "傾斜角", "傾斜角度", "斜面角度"),
    ),
    RigColumn(
        "slip_angle_rad", "rad",
        ("slip angle", "side slip angle", "sideslip angle", "beta", "β", "schraglaufwinkel", "schraeglaufwinkel",
         "angle de derive", "derive", "angulo de deriva", "すべり角", "横すべり角", "スリップ角"),
    ),
    RigColumn("slip_angle_rad", "rad", ("slip",), needs_unit=True),
    RigColumn(
        "run", "text",
        ("run", "test", "trial", "id", "no", "nr", "run no", "run nr", "run number", "run id", "test no", "test nr",
         "test number", "test id", "trial no", "trial number", "experiment", "experiment no", "versuch",
         "versuchsnummer", "versuch nr", "essai", "numero d essai", "ensayo", "試験番号", "実験番号"),
    ),
    RigColumn("level", "text", ("level", "slip level", "stufe", "schlupfstufe", "niveau")),
)  # fmt: skip
"""All columns that a wheel-rig data set may have. If a column name without a unit fits two of them, the first one is
taken, because it is more probable."""

CHANNEL_COLUMNS = {kind.column for kind in RIG_CHANNELS}
"""Columns of a wheel-rig data set that hold measured channels: pull, torque, sinkage, side force, vertical moment."""
SPREAD = {"sd", "std", "stdev", "stddev", "sigma", "σ", "deviation", "standardabweichung", "streuung", "ecart",
          "desviacion", "標準偏差", "标准差"}  # fmt: skip
"""Words in a column name which mean that the column holds the standard deviation of another column, in several
languages."""
SPREAD_FILLERS = {"standard", "dev", "type", "estandar", "of", "de"}
"""Words that accompany a word for the standard deviation, as in "standard deviation of", and that add no meaning."""
FILLERS = {"mean", "average", "avg", "averaged", "av", "median", "measured", "meas", "value", "values", "wheel", "of",
           "the", "in", "on", "at", "a", "single", "steady", "state", "filtered", "filt", "mittel", "mittelwert",
           "mittlere", "mittlerer", "gemittelt", "gemessen", "moyen", "moyenne", "mesure", "mesuree", "roue", "de",
           "la", "le", "du", "rueda", "medio", "media", "平均", "車輪", "sensor", "ist", "actual", "soil",
           "final"}  # fmt: skip
"""Words in column names that do not change the quantity: "mean measured torque" is the torque."""
OTHER_QUANTITY = {"max", "maximum", "min", "minimum", "peak", "initial", "static", "rate", "speed", "velocity",
                  "acceleration", "coefficient", "coeff", "coef", "ratio", "index", "number", "count", "energy",
                  "power", "work", "efficiency", "temperature", "temp", "moisture", "time", "per", "resistance",
                  "rolling", "motion", "gross", "motor", "lug", "grouser", "plate", "penetration", "cell", "error",
                  "err", "uncertainty", "angle", "moment", "box", "bin", "offset", "zero", "raw", "sand", "density",
                  "rut", "length", "width", "radius", "pressure", "stress", "current", "voltage", "battery",
                  "coefficients", "entry", "exit", "camera", "left", "right"}  # fmt: skip
"""Words in a column name which show that another quantity is meant: peak torque is no steady torque, and a slip rate is
no slip."""
BRACKETS = str.maketrans("{}<>【】〔〕「」・", "[][][][][]·")
"""Replacement of characters in column names before the unit is looked for: brackets of other scripts become [ and ],
and the middle dot of Japanese units becomes the usual middle dot."""


class Match(NamedTuple):
    """One interpretation of a column name in a researcher's table: the column of a data set that it means, and the unit
    that it states.
    """

    column: str
    unit: str
    is_guess: bool = False
    """whether the name contains words that are unknown, so that the interpretation is a guess"""
    is_set_point: bool = False
    """whether the name states that the values were commanded, not measured"""


def matches(header: str) -> tuple[Match, ...]:
    """Return the possible interpretations of a table's column name as a column of a data set, the most probable first.

    Units may be in brackets of any kind, behind a comma or slash, or at the end of the name. A symbol such as T or s
    counts only with a unit of its own kind or without a unit: `t_s` is a time and `T (°C)` a temperature, so neither of
    them is taken as a torque or slip.

    >>> matches("Normal force (N)")[0].column, matches("Sinkage, z [mm]")[0][:2]
    ('load_N', ('sinkage_m', 'mm'))
    >>> matches("T (°C)"), matches("t_s")
    ((), ())
    """
    readings = tuple(_readings(header))
    exact = tuple(dict.fromkeys(match for name, unit in readings for match in _exact(name, unit)))
    if exact:
        return exact
    # No reading explains every word. A name that contains the words of exactly one quantity is then a guess, because
    # its other words are not understood. A word in OTHER_QUANTITY excludes the guess. The unit must not be read as a
    # word, so only the first reading is used.
    name, unit = readings[0]
    tokens, is_set_point, is_spread = _words(name)
    if set(tokens) & OTHER_QUANTITY or is_spread:
        return ()
    candidates: list[RigColumn] = []
    for column in RIG_COLUMNS:
        # Phrases that end in a short word, such as "d p", occur by chance in too many names.
        phrases = [phrase for phrase in _phrases(column.phrases) if len(phrase[-1]) > 2]
        has_phrase = any(
            tuple(tokens[at : at + len(phrase)]) == phrase for phrase in phrases for at in range(len(tokens))
        )
        if has_phrase and column.unit != "text" and _fits(column, unit, column.needs_unit):
            candidates.append(column)
    if len({column.column for column in candidates}) != 1:
        return ()
    return (Match(candidates[0].column, unit, True, is_set_point),)


def unit_of_wrong_kind(header: str) -> str:
    """Return the unit in a column name if it does not fit the quantity that the name means; otherwise an empty text.

    >>> unit_of_wrong_kind("Torque [mm]")
    'mm'
    """
    for name, unit in _readings(header):
        if unit and not matches(header) and any(match.unit == "" for match in _exact(name, "")):
            return unit
    return ""


def _readings(header: str) -> Iterator[tuple[str, str]]:
    """Yield the possible splits of a column name into a name and a unit, the most probable first.

    A letter at the end may be a unit or a symbol: in "Sinkage, h" the h is a symbol and does not mean hours, and in
    "Load (W)" the W does not mean watts. Therefore the whole column name is also yielded, as the last possibility,
    without a unit.
    """
    # Full-width letters and other forms become plain ones.
    plain = unicodedata.normalize("NFKC", header.translate(BRACKETS)).strip()
    name, unit = name_and_unit(plain)
    if plain.endswith(("]", ")")):
        inner, inner_unit = name_and_unit(name)
        if inner_unit and not _is_unit(unit):  # a note behind the unit, as in "Pull [N] (mean)"
            yield f"{inner} {unit}", inner_unit
        elif not _is_unit(unit):  # words in brackets, as in "Drawbar pull (net)"
            yield f"{name} {unit}", ""
        else:
            yield name, unit
            has_words = max(map(len, tokens_of(name)), default=0) > 2
            if has_words and unit.isalpha() and unit.lower() not in FILLERS:
                yield f"{name} {unit}", ""
        return
    if unit:
        yield name, unit
    behind = TRAILING_UNIT.fullmatch(plain)  # units that only this package's list of words knows, or behind a blank
    if behind and _is_unit(behind[2]):
        yield behind[1], behind[2]
    yield plain, ""


TRAILING_UNIT = re.compile(r"(.*?)(?:\s+in\s+|\s*[/,]\s*|\s+)([^\s/,]+(?:/[^\s/,]+)?)")
"""Pattern that splits a column name at its last blank, comma, slash or "in". The text after this place may be a
unit."""


def stated_unit(header: str, expected: str) -> str:
    """Return the unit that a column name states, if it measures the kind of quantity of the SI unit `expected`;
    otherwise an empty text.
    """
    # The first reading whose unit can be converted to the expected one decides.
    units = (unit for _, unit in _readings(header) if unit)
    return next((unit for unit in units if not math.isnan(scale_to(unit, expected))), "")


def _is_unit(unit: str) -> bool:
    """Return whether a text is a possible unit of at least one column of a data set."""
    return bool(usual_unit(unit)) or any(not math.isnan(scale_to(unit, column.unit)) for column in RIG_COLUMNS)


def scale_to(unit: str, expected: str) -> float:
    """Return the factor that converts values in `unit` to the SI unit `expected`; NaN if the unit is of another kind.

    A force in kg and a torque in kg m are read as kilopond and kilopond metre.

    >>> scale_to("mm", "m")
    0.001
    """
    if expected == "text":
        return 1.0
    # A unit is tried as written, then in the usual spelling of its language.
    for spelling in (unit, usual_unit(unit)):
        if spelling or not unit:
            factor = factor_to(spelling or expected, expected)
            as_mass = factor_to(spelling, expected.replace("N", "kg", 1)) if "N" in expected and spelling else math.nan
            if not math.isnan(factor):
                return factor
            if not math.isnan(as_mass):
                return KILOPOND * as_mass
    return math.nan


def _fits(column: RigColumn, unit: str, needs_unit: bool) -> bool:
    """Return whether a column of a data set can be given in the unit that a column name states.

    A name without a unit (`unit` is empty) fits if `needs_unit` is False.
    """
    if not unit:
        return not needs_unit
    if column.unit == "text":
        return False
    # A load in kg is a mass on the wheel (column load_kg), whose weight depends on gravity; it is no kilopond.
    return not math.isnan(factor_to(unit, "N") if column.column == "load_N" else scale_to(unit, column.unit))


def _exact(name: str, unit: str) -> Iterator[Match]:
    """Yield the interpretations that explain every word of a column name, such as torque_Nm for "mean wheel torque".

    `unit` is the unit that the column name states; empty if it states none.
    """
    tokens, is_set_point, is_spread = _words(name)
    if not tokens:
        return
    for column in RIG_COLUMNS:
        if is_spread and column.column not in CHANNEL_COLUMNS:
            continue
        target = sd_column(column.column) if is_spread else column.column
        # The set's own name of a column states its unit at the end, which may have been split off: drawbar_pull_N.
        stem = column.column.rpartition("_")[0]
        if name == column.column or (name == stem and bool(unit) and _fits(column, unit, True)):
            yield Match(target, unit or "")
        elif _is_covered(tokens, _phrases(column.phrases)) and _fits(column, unit, column.needs_unit):
            yield Match(target, unit, is_set_point=is_set_point)
        elif _is_covered(tokens, _phrases(column.phrases + column.symbols + column.unit_symbols)):
            # The case of symbols counts: S is a slip, but s may be seconds.
            letters = set(re.findall(r"[^\W\d_]+", name))
            plain = any(symbol in letters for symbol in column.symbols)
            with_unit = any(symbol in letters for symbol in column.unit_symbols)
            if (plain and _fits(column, unit, False)) or (with_unit and _fits(column, unit, True)):
                yield Match(target, unit, is_set_point=is_set_point)


def _words(name: str) -> tuple[list[str], bool, bool]:
    """Return the words of a column name without numbers, whether the name means a commanded value, and whether it means
    a standard deviation.

    The words that only state these two facts are removed from the list.
    """
    # First look for words of a standard deviation, then for words of a command; both may stand in one name.
    tokens = [token for token in tokens_of(name) if not token.isdigit()]
    is_spread = bool(set(tokens) & SPREAD)
    if is_spread:
        tokens = [token for token in tokens if token not in SPREAD | SPREAD_FILLERS]
    is_set_point = bool(set(tokens) & COMMAND_WORDS)
    return [token for token in tokens if token not in COMMAND_WORDS], is_set_point, is_spread


COMMAND_WORDS = COMMAND | {"set", "nominal", "nominell", "nominale", "target", "vorgabe", "desired", "commande"}
"""Words in a column name which mean that the values were commanded, not measured."""


@cache
def _phrases(texts: tuple[str, ...]) -> frozenset[tuple[str, ...]]:
    """Return texts as a set of phrases, each a tuple of its words, so that they can be compared with the words of a
    column name.
    """
    return frozenset(tuple(tokens_of(text)) for text in texts)


def _is_covered(tokens: Sequence[str], phrases: frozenset[tuple[str, ...]]) -> bool:
    """Return whether every word of a column name is explained: the name consists of some of the phrases and of filler
    words, with at least one phrase.

    `tokens` are the words of the name, and `phrases` are tuples of words.
    """
    known = {0: False}  # number of words explained from the beginning -> whether a phrase is among them
    # Dynamic programming over the words: from each explained position, a phrase or a filler word leads further.
    for begin in range(len(tokens)):
        if begin not in known:
            continue
        for end in range(begin + 1, len(tokens) + 1):
            if tuple(tokens[begin:end]) in phrases:
                known[end] = True
            elif end == begin + 1 and tokens[begin] in FILLERS:
                known[end] = known.get(end, False) or known[begin]
    return known.get(len(tokens), False)
