"""How a result was made, as a document that travels with it; and the way back from it to the same bits.

    {"threadpitch", "python", "numpy", "platform",            versions
     "system", "components", "connections", "settings",       what was computed: FMUs by their content, values
     "parameters", "method", "engine", "start_time", "step_size", "steps", "record", "record_every", "record_on",
     "watch", "isolate", "about"}                             what was asked for

It holds no time of day and no host's name: the same run gives the same document.
"""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

import threadpitch
from threadpitch.cosim.check import Plan
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.method import read_method
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.selection import Watch
from threadpitch.cosim.values import Given

_VERSIONS = ("threadpitch", "python", "numpy", "platform")
_WORDS = {"components": "FMU of component", "connections": "connection", "settings": "value of", "method": "method",
          "start_time": "start time", "step_size": "step size", "record": "recorded variable",
          "record_every": "record every", "record_on": "recorded on", "watch": "watched"}


def versions() -> dict[str, Any]:
    """What computed: this package, Python, NumPy, and the platform."""
    return {"threadpitch": threadpitch.__version__, "python": platform.python_version(), "numpy": np.__version__,
            "platform": f"{platform.system()} {platform.machine()}"}


def describe(plan: Plan) -> dict[str, Any]:
    """What is computed: components with their FMUs' contents, connections, and the values that are set.

    ``settings`` are in the variables' own units.
    """
    digests = {fmu.path: hashlib.sha256(fmu.path.read_bytes()).hexdigest() for fmu in plan.descriptions.values()}
    return {
        "components": {name: {"fmu": fmu.path.name, "sha256": digests[fmu.path], "fmi": fmu.fmi}
                       for name, fmu in sorted(plan.descriptions.items())},
        "connections": sorted([f"{link.source_component}.{link.source.name}",
                               f"{link.target_component}.{link.target.name}", link.factor, link.offset]
                              for link in plan.links),
        "settings": {f"{found.component}.{found.variable.name}": found.value
                     for found in sorted(plan.settings, key=lambda one: (one.component, one.variable.name))},
    }


def plain_parameters(parameters: Mapping[str, Given]) -> dict[str, Any]:
    """A caller's parameters as JSON holds them: NumPy's numbers become Python's."""
    return {name: _plain(value) for name, value in parameters.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    return value if isinstance(value, str | int | float) else [_plain(one) for one in value]


def again(metadata: Mapping[str, Any]) -> dict[str, Any]:
    """Keyword arguments of ``simulate`` that make a result with this metadata once more, bit for bit.

    The system is to be handed over with them: ``simulate(system, **again(result.metadata))``.

    Raises:
        CosimError: this is no metadata of a result.
    """
    try:
        start, step = float(metadata["start_time"]), float(metadata["step_size"])
        schedule = Schedule(start, step, int(metadata["steps"]))
        return {
            "parameters": dict(metadata["parameters"]), "start_time": start, "step_size": step,
            "stop_time": schedule.stop_time, "method": read_method(metadata["method"]), "engine": metadata["engine"],
            "record": list(metadata["record"]), "record_every": int(metadata["record_every"]),
            "record_on": list(metadata["record_on"]), "watch": _watch(metadata["watch"]),
            "isolate": list(metadata["isolate"]), "about": dict(metadata["about"]),
        }
    except (KeyError, TypeError, ValueError) as error:
        raise CosimError(f"this is no metadata of a result: {' '.join(str(error).split())}") from None


def _watch(document: Mapping[str, Any] | None) -> Watch | None:
    return None if document is None else Watch(tuple(document["record"]), tuple(document["on"]))


def differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    """What is not the same in two documents, of all that the bits of a result depend on, versions left out."""
    for key, word in _WORDS.items():
        one, other = _as_mapping(before.get(key)), _as_mapping(now.get(key))
        for name in sorted(one.keys() | other.keys()):
            if name not in other:
                yield f"{word} {name} was there, and is not".replace("  ", " ")
            elif name not in one:
                yield f"{word} {name} was not there, and is".replace("  ", " ")
            elif one[name] != other[name]:
                yield f"{word} {name}: was {_shown(one[name])}, is {_shown(other[name])}".replace(" :", ":")


def _as_mapping(value: Any) -> Mapping[str, Any]:
    if isinstance(value, Mapping):
        return value
    if isinstance(value, Sequence) and not isinstance(value, str):
        return {_name(one): one for one in value}
    return {"": value}


def _name(entry: Any) -> str:
    return entry if isinstance(entry, str) else f"{entry[0]} to {entry[1]}"


def _shown(value: Any) -> str:
    if isinstance(value, Mapping) and "sha256" in value:
        return f"{value.get('fmu')} ({str(value['sha256'])[:12]})"
    return str(list(value[2:]) if isinstance(value, list) else value)


def same_versions(before: Mapping[str, Any]) -> Iterator[str]:
    """What versions differ from those here: the bits may differ then."""
    now = versions()
    for key in _VERSIONS:
        if before.get(key) != now[key]:
            yield f"{key} was {before.get(key)}, is {now[key]}"
