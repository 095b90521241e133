"""What the names of a log's columns speak for, in the languages and the spelling of controls.

Besides plain English and German words these are the names in SINUMERIK Operate's trace (``nckServoDataActPos1stEnc64``,
``measPos1``, ``nckServoDataFlwErr64``), HEIDENHAIN's oscilloscope (Actual pos, Noml. pos, Lag; s actual), TwinCAT
(``ActPos``, ``SetPos``, ``PosDiff``, ``fPosIst``, ``fPosSoll``) and LinuxCNC (``spindle.0.revs``, ``joint.2.pos-fb``,
``f-error``), and the commonest words in French, Italian, Spanish, Japanese and Chinese.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

_WORD = re.compile(r"[A-Z]?[a-zß-ÿ]+|[A-Z]+(?![a-z])|\d+|[^\W\d_]+")
_BRACKETS = re.compile(r"[\[(]([^\])]*)[\])]\s*$")
_AXES = {"x", "y", "z", "c", "s", "spindle", "spindel", "z1", "z2", "x1", "x2", "s1"}

# What a column's words speak for; the highest sum is taken.
_ACTUAL = {"actual": 1, "act": 1, "actl": 1, "ist": 1, "istwert": 1, "fb": 1, "feedback": 1, "meas": 1, "measured": 1,
           "posf": 1, "réel": 1, "reale": 1, "real": 1}
_ANGLE = {"angle": 4, "theta": 4, "phi": 4, "winkel": 4, "revs": 4, "rev": 4, "revolutions": 4, "turns": 4,
          "umdrehungen": 4, "angolo": 4, "ángulo": 4, "angulo": 4, "rotation": 3, "spindle": 3, "spindel": 3,
          "broche": 3, "mandrino": 3, "husillo": 3, "s1": 2, "sp1": 2, "c": 2, "c1": 2, "encoder": 2, "count": 1,
          "counts": 1, **_ACTUAL}
_POSITION = {"z": 4, "xi": 4, "z1": 4, "feed": 3, "position": 3, "pos": 3, "lage": 3, "vorschub": 3, "posizione": 3,
             "posición": 3, "posicion": 3, "posf": 3, "axis": 1, "achse": 1, "axe": 1, "asse": 1, "eje": 1, "scale": 1,
             "mm": 1, "tool": 1, **_ACTUAL}
_PASS = {"pass": 4, "passes": 4, "durchgang": 4, "schnitt": 3, "threading": 3, "group": 3, "gruppe": 3, "gewinde": 3,
         "gewindeschneiden": 4, "cut": 2, "passe": 4, "passata": 4, "pasada": 4}
_OTHER = {"speed": 9, "velocity": 9, "vel": 9, "velo": 9, "rps": 9, "rpm": 9, "torque": 9, "current": 9, "curr": 9,
          "acc": 9, "acceleration": 9, "jerk": 9, "error": 9, "err": 9, "lag": 9, "diff": 9, "deviation": 9, "dev": 9,
          "index": 9, "enable": 9, "temperature": 9, "force": 9, "load": 9, "start": 9, "status": 9, "at": 3,
          "cmd": 2, "command": 2, "commanded": 2, "set": 2, "setpoint": 2, "target": 2, "noml": 2, "nominal": 2,
          "contr": 2, "true": 1, "vitesse": 9, "couple": 9, "erreur": 9, "velocità": 9, "coppia": 9, "errore": 9,
          "velocidad": 9, "par": 9, "consigne": 2, "comando": 2, "consigna": 2}
# Parts of long words, as German puts them together and Japanese and Chinese write them.
_ANGLE_PARTS = {"winkel": 4, "spindel": 3, "drehgeber": 2, "主轴": 3, "主軸": 3, "角度": 4}
_POSITION_PARTS = {"position": 3, "lageist": 4, "lagesoll": 3, "istlage": 3, "vorschub": 3, "achs": 1, "位置": 3}
_OTHER_PARTS = {"drehzahl": 9, "geschwindigkeit": 9, "moment": 9, "strom": 9, "kraft": 9, "temperatur": 9,
                "beschleunigung": 9, "schlepp": 9, "abweichung": 9, "fehler": 9, "differenz": 9, "auslastung": 9,
                "soll": 2, "速度": 9, "偏差": 9, "指令": 2}
_PARTS = {"angle": _ANGLE_PARTS, "position": _POSITION_PARTS, "pass": {"gewinde": 3, "durchgang": 4}}
_WORDS: Mapping[str, Mapping[str, int]] = {"angle": _ANGLE, "position": _POSITION, "pass": _PASS}
_OTHER_UNITS = {"mm/min", "m/min", "mm/s", "m/s", "mm/rev", "mm/u", "rpm", "1/min", "u/min", "min-1", "1/s", "rad/s",
                "deg/s", "°/s", "grad/s", "m/s²", "m/s^2", "m/s2", "nm", "n", "kn", "a", "v", "mv", "%", "°c", "w",
                "kw", "hz"}
_FOLLOWING = re.compile(
    r"following[\s_.-]*(?:err|dist)|flw[\s_.-]*err|f[\s_.-]?error|schlepp|pos(?:ition)?[\s_.-]*(?:diff|lag)"
    r"|(?:servo|axis)[\s_.-]*lag|(?:^|[^a-z])lag(?:[^a-z]|$)|poursuite|inseguimento|seguimiento|追従|跟随|位置偏差",
    re.IGNORECASE)
_COMMAND_WORDS = {"cmd", "command", "commanded", "set", "setpoint", "soll", "sollwert", "noml", "nominal", "consigne",
                  "comando", "consigna"}


def words_of(name: str) -> list[str]:
    """The words of a name, in small letters: ActPosZ -> act, pos, z."""
    return [word.casefold() for word in _WORD.findall(name)]


def score(name: str, quantity: str) -> int:
    """How much a name speaks for ``angle``, ``position`` or ``pass``."""
    known, parts = _WORDS[quantity], _PARTS[quantity]
    found = sum(_value(word, known, parts) - _value(word, _OTHER, _OTHER_PARTS) for word in set(words_of(name)))
    whole = name.strip().casefold()
    found += known.get(whole, 0) if whole not in words_of(name) else 0  # z1, which is no word
    unit = _BRACKETS.search(name)
    return found - (9 if unit is not None and unit[1].strip().casefold() in _OTHER_UNITS else 0)


def beside(names: Sequence[str], position: int, what: str) -> int | None:
    """The column of the ``following error`` or the ``command`` of a position; None where no single one is called so.

    It has the axis of the position in its name; without one it is the only column of its kind.
    """
    own = without_unit(names[position])
    axis = _axis(own)
    found = []
    for i, name in enumerate(names):
        bare = without_unit(name)
        following = _FOLLOWING.search(bare) is not None
        if i == position:
            continue
        commanded = not following and _commanded(bare) and not _commanded(own) and score(name, "position") > 0
        if (following if what == "following error" else commanded) and _axis(bare) in (axis, ""):
            found.append(i)
    return found[0] if len(found) == 1 else None


def _value(word: str, known: Mapping[str, int], parts: Mapping[str, int]) -> int:
    """Of a whole word, else of the parts that are in it."""
    return known[word] if word in known else sum(value for part, value in parts.items() if part in word)


def _commanded(name: str) -> bool:
    words = words_of(name)
    return any(word in _COMMAND_WORDS or "soll" in word or "指令" in word for word in words)


def _axis(name: str) -> str:
    """The letter of the axis, or its address in a SINUMERIK (``u1, 3``), as far as the name tells; else empty."""
    if address := re.search(r"\[u\d+[,;]?\s+(\d+)\]", name):
        return address[1]
    axes = [word for word in re.findall(r"[a-z]+\d?", name.casefold().replace("_", " ")) if word in _AXES]
    axes += [word for word in words_of(name) if word in _AXES]
    return axes[0] if axes else ""


def without_unit(name: str) -> str:
    """``Z [mm]`` -> ``Z``."""
    unit = _BRACKETS.search(name)
    return name if unit is None or unit[1].strip().startswith("u1") else name[: unit.start()].rstrip()
