"""What of the pitch calculators and the cutting process follows from the thread that the controller is given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from threadpitch.cosim import Plan
from threadpitch.cosim.conversion import Known
from threadpitch.cosim.values import Given, VariableValueError, from_si
from threadpitch.cosim.variable import FmuVariable
from threadpitch.passes import CONTROLLER
from threadpitch.units import unit

STEEPEST = 1.0  # of a surface: 45 degrees, where the lead changes its axis
_TAPERED = ("taper", "z_start", "z_end", "z_face", "x_surface")
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


@dataclass(frozen=True)
class ProgrammedThread:
    """The controller's thread as the system states it, (name -> m), and what reads other values of its ``variables``.

    Empty where the system has no such controller.
    """

    variables: Mapping[str, FmuVariable]
    values: Mapping[str, float]
    unit: Known

    @classmethod
    def of(cls, plan: Plan) -> ProgrammedThread:
        """That of a checked system."""
        description = plan.descriptions.get(CONTROLLER)
        if description is None or not description.variables.keys() >= set(_TAPERED):
            return cls({}, {}, unit)
        variables = {name: description.variables[name] for name in _TAPERED}
        values = {name: float(variable.start or 0.0) for name, variable in variables.items()}
        values |= {one.variable.name: float(one.value) for one in plan.settings
                   if one.component == CONTROLLER and one.variable.name in values}
        return cls(variables, values, description.unit)

    def tapered(self, chosen: Mapping[str, Given]) -> dict[str, Given]:
        """``taper`` and ``surface_radius`` of the workpiece, where the thread's taper is chosen.

        r(z) = x_surface + slope (z - z_end),  slope = taper / (z_start - z_end),  surface_radius = r(z_face)

        Nothing where a chosen value is none, which whoever sets it tells, or the taper is steeper than 45 degrees.
        """
        if f"{CONTROLLER}.taper" not in chosen or not self.variables:
            return {}
        try:
            values = {**self.values, **{name: float(from_si(chosen[f"{CONTROLLER}.{name}"], variable, self.unit))
                                        for name, variable in self.variables.items()
                                        if f"{CONTROLLER}.{name}" in chosen}}
        except VariableValueError:
            return {}
        along = values["z_start"] - values["z_end"]
        if abs(values["taper"]) > STEEPEST * abs(along) or along == 0.0:
            return {}
        slope = values["taper"] / along
        return {"taper": slope, "surface_radius": values["x_surface"] + slope * (values["z_face"] - values["z_end"])}
