"""What a simulation or a log leaves -> what the store keeps: runs, their traces, and events while they go on."""

from threadpitch.runs.events import Labels, RunEvents
from threadpitch.runs.making import log_run, simulation_run
from threadpitch.runs.trace_file import LogTrace, simulation_trace

__all__ = ["Labels", "LogTrace", "RunEvents", "log_run", "simulation_run", "simulation_trace"]
