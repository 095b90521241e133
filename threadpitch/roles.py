"""Which components of a system are parts of a lathe, and what follows: what is watched, which values go together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from threadpitch.cosim import Plan, Watch
from threadpitch.cosim.values import Given
from threadpitch.passes import CONTROLLER, TOLD, WORKPIECE
from threadpitch.workpiece import ProgrammedThread, following

Z_DRIVE, X_DRIVE = "z_drive", "x_drive"  # names in the lathe's SSD

# Parameters of the control that a diagnosis needs
DIAGNOSED = {
    CONTROLLER: ("commanded_speed", "start_mode", "start_time_constant", "command_age", "age_compensation",
                 *(f"further_{name}[{block}]" for name in ("lead", "lead_change") for block in range(1, 32))),
    Z_DRIVE: ("speed_limit", "position_gain", "feedforward", "command_period", "torque_limit", "drive_type",
              "screw_lead"),
}


@dataclass(frozen=True)
class Roles:
    """Components by what they do, which their variables tell.

    ``limits`` name what a warning of too slow axes and a diagnosis need, ``alarms`` the controllers' alarms;
    ``thread`` is the one that the controller cuts unless it is given another.
    """

    calculators: tuple[str, ...]
    controllers: tuple[str, ...]
    cutters: tuple[str, ...]
    limits: tuple[str, ...]
    alarms: tuple[str, ...]
    thread: ProgrammedThread

    @classmethod
    def of(cls, plan: Plan) -> Roles:
        """The roles of a checked system's components."""
        variables = {name: description.variables.keys() for name, description in plan.descriptions.items()}

        def having(*names: str) -> tuple[str, ...]:
            return tuple(component for component, found in variables.items() if found >= set(names))

        limits = tuple(f"{component}.{name}" for component, names in DIAGNOSED.items() for name in names
                       if name in variables.get(component, ()))
        controllers = having("z_face", "start_number")
        alarms = tuple(f"{name}.alarm" for name in controllers if "alarm" in variables[name])
        return cls(having("completed_pitch[1]"), controllers, having("surface_radius", "groove_position"), limits,
                   alarms, ProgrammedThread.of(plan))

    @property
    def watch(self) -> Watch:
        """What tells of every turn: the calculators' results when a turn ends or threading begins or ends."""
        record, on = [], []
        for name in self.calculators:
            record += [f"{name}.{variable}" for variable in ("direction", "pitch_target", "start_angle*", "completed*",
                                                             "crossing_position*")]
            on += [f"{name}.{variable}" for variable in ("threading", "completed[*", "revolution*")]
        for name in self.controllers:
            record += [f"{name}.{variable}" for variable in (*WORKPIECE, *TOLD)]
        return Watch((*record, *self.limits, *self.alarms), (*on, *self.alarms))

    def parameters(self, given: Mapping[str, Given], start_angles: Sequence[float] | None = None) -> dict[str, Given]:
        """The caller's parameters with start angles [rad] for every calculator, and with what follows from them.

        Targets and workpiece follow another thread of the controller, where they are not given themselves.
        """
        angles: dict[str, Given] = {}
        if start_angles is not None:
            for name in self.calculators:
                angles |= {f"{name}.start_angle_count": len(start_angles), f"{name}.start_angle": list(start_angles)}
        chosen = {**given, **angles}
        workpiece = {f"{name}.{variable}": value for variable, value in self.thread.tapered(chosen).items()
                     for name in self.cutters}
        return following(chosen, self.calculators, self.cutters) | workpiece | chosen
