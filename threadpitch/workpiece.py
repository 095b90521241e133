"""What of the pitch calculators and the cutting process follows from the thread that the controller is given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from threadpitch.cosim import Plan, check
from threadpitch.cosim.values import Given
from threadpitch.passes import CONTROLLER

STEEPEST = 1.0  # of a surface: 45 degrees, where the lead changes its axis
_NAMES = ("x_clear", "x_thread", "x_surface", "z_start", "z_end", "taper")


def following(chosen: Mapping[str, Given], calculators: Sequence[str], cutters: Sequence[str]) -> dict[str, Given]:
    """Targets and workpiece of another thread of the controller, for where they are not given themselves."""
    followers = (("lead", "pitch_target", calculators), ("x_surface", "surface_radius", cutters),
                 ("z_face", "face", cutters), ("starts", "starts", cutters))
    found = {f"{name}.{variable}": chosen[f"{CONTROLLER}.{source}"] for source, variable, names in followers
             for name in names if f"{CONTROLLER}.{source}" in chosen}
    workpiece = workpiece_of(chosen)
    return found | {f"{name}.{variable}": value for variable, value in workpiece.items() for name in cutters}


def workpiece_of(chosen: Mapping[str, Given]) -> dict[str, Given]:
    """``thread_side``, ``taper`` and ``surface_radius`` of the cutting process, for a thread that is given whole in SI.

    slope = -i / (z_end - z_start),  surface at the face = x_surface + slope (z_face - z_end)      i: taper, radius

    ``x_surface`` is the surface over the end of the thread. Nothing where a part of the thread is not given, or given
    with a unit, or where the taper is steeper than 45 degrees: then the workpiece stays as it is.
    """
    values = {name: chosen.get(f"{CONTROLLER}.{name}") for name in _NAMES}
    given = {name: float(value) for name, value in values.items() if isinstance(value, int | float)}
    if len(given) < len(_NAMES):
        return {}
    made: dict[str, Given] = {"thread_side": "external" if given["x_clear"] >= given["x_thread"] else "internal"}
    length = given["z_end"] - given["z_start"]
    face = chosen.get(f"{CONTROLLER}.z_face", 0.0)
    if abs(given["taper"]) <= STEEPEST * abs(length) and length != 0.0 and isinstance(face, int | float):
        slope = -given["taper"] / length
        made |= {"taper": slope, "surface_radius": given["x_surface"] + slope * (face - given["z_end"])}
    return made


def tapered(plan: Plan, chosen: Mapping[str, Given], cutters: Sequence[str]) -> dict[str, Given]:
    """The workpiece of a tapered thread: r(z) = x_surface + slope (z - z_end), slope = taper / (z_start - z_end)."""
    if f"{CONTROLLER}.taper" not in chosen:
        return {}
    names = ("taper", "z_start", "z_end", "z_face", "x_surface")
    values = {name: plan.descriptions[CONTROLLER].variables[name].start or 0.0 for name in names}
    settings = check(plan.system, plan.descriptions, chosen).settings
    values |= {one.variable.name: float(one.value) for one in settings
               if one.component == CONTROLLER and one.variable.name in values}
    along = values["z_start"] - values["z_end"]
    slope = values["taper"] / along if along else 0.0
    return {f"{name}.{variable}": value for name in cutters for variable, value in (
        ("taper", slope), ("surface_radius", values["x_surface"] + slope * (values["z_face"] - values["z_end"])))
        if f"{name}.{variable}" not in chosen or f"{CONTROLLER}.x_surface" in chosen}
