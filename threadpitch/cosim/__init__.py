"""Co-simulation of any system of FMI 2.0 and 3.0 FMUs: a folder with an SSD, or an .ssp -> recorded variables.

    result = simulate("system.ssp", parameters={"drive.gain": 40.0}, stop_time=1.0, step_size=1e-3)
    result["drive.position"], result.time

The way of a run is ``simulation.simulate``; ``algorithms`` holds what is computed, and ``kernel``
the same, compiled.
"""

from threadpitch.cosim.check import Plan, check
from threadpitch.cosim.checkpoint import CheckpointError, read_checkpoint
from threadpitch.cosim.errors import CosimError, SimulationInterrupted, StepError, TimeLimitError
from threadpitch.cosim.events import Event, EventRecord
from threadpitch.cosim.metadata import again
from threadpitch.cosim.method import Method, StepControl
from threadpitch.cosim.result import Result
from threadpitch.cosim.selection import Watch, choose_channels
from threadpitch.cosim.simulation import choose_schedule, instantiate, prepare, resume, simulate
from threadpitch.cosim.ssp import read_parameter_set, read_system
from threadpitch.cosim.survey import Survey, survey
from threadpitch.cosim.system import System, SystemStructureError

__all__ = [
    "CheckpointError",
    "CosimError",
    "Event",
    "EventRecord",
    "Method",
    "Plan",
    "Result",
    "SimulationInterrupted",
    "StepControl",
    "StepError",
    "Survey",
    "System",
    "SystemStructureError",
    "TimeLimitError",
    "Watch",
    "again",
    "check",
    "choose_channels",
    "choose_schedule",
    "instantiate",
    "prepare",
    "read_checkpoint",
    "read_parameter_set",
    "read_system",
    "resume",
    "simulate",
    "survey",
]
