"""Co-simulation of any system of FMI 2.0 and 3.0 FMUs: a folder with an SSD, or an .ssp -> recorded variables.

    result = simulate("system.ssp", parameters={"drive.gain": 40.0}, stop_time=1.0, step_size=1e-3)
    result["drive.position"], result.time

The way of a run is ``simulation.simulate``; ``algorithms`` holds what is computed, and ``kernel``
the same, compiled.
"""

from threadpitch.cosim.check import Plan, check
from threadpitch.cosim.errors import CosimError, SimulationInterrupted, StepError, TimeLimitError
from threadpitch.cosim.method import Method
from threadpitch.cosim.recording import Result
from threadpitch.cosim.simulation import choose_channels, choose_schedule, instantiate, prepare, simulate
from threadpitch.cosim.ssp import read_parameter_set, read_system
from threadpitch.cosim.system import System, SystemStructureError

__all__ = [
    "CosimError",
    "Method",
    "Plan",
    "Result",
    "SimulationInterrupted",
    "StepError",
    "System",
    "SystemStructureError",
    "TimeLimitError",
    "check",
    "choose_channels",
    "choose_schedule",
    "instantiate",
    "prepare",
    "read_parameter_set",
    "read_system",
    "simulate",
]
