"""Parameters of the lathe that follow those of its controller, where they are not given themselves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from threadpitch import cosim
from threadpitch.cosim.values import Given
from threadpitch.passes import CONTROLLER


def following(chosen: Mapping[str, Given], calculators: Sequence[str], cutters: Sequence[str]) -> dict[str, Given]:
    """Targets and workpiece of another thread of the controller, for where they are not given themselves."""
    followers = (("lead", "pitch_target", calculators), ("x_surface", "surface_radius", cutters),
                 ("z_face", "face", cutters), ("starts", "starts", cutters))
    return {f"{name}.{variable}": chosen[f"{CONTROLLER}.{source}"] for source, variable, names in followers
            for name in names if f"{CONTROLLER}.{source}" in chosen}


def tapered(plan: cosim.Plan, chosen: Mapping[str, Given], cutters: Sequence[str]) -> dict[str, Given]:
    """The workpiece of a tapered thread: r(z) = x_surface + slope (z - z_end), slope = taper / (z_start - z_end)."""
    if f"{CONTROLLER}.taper" not in chosen:
        return {}
    names = ("taper", "z_start", "z_end", "z_face", "x_surface")
    values = {name: plan.descriptions[CONTROLLER].variables[name].start or 0.0 for name in names}
    settings = cosim.check(plan.system, plan.descriptions, chosen).settings
    values |= {one.variable.name: float(one.value) for one in settings
               if one.component == CONTROLLER and one.variable.name in values}
    along = values["z_start"] - values["z_end"]
    slope = values["taper"] / along if along else 0.0
    return {f"{name}.{variable}": value for name in cutters for variable, value in (
        ("taper", slope), ("surface_radius", values["x_surface"] + slope * (values["z_face"] - values["z_end"])))
        if f"{name}.{variable}" not in chosen or f"{CONTROLLER}.x_surface" in chosen}
