"""What a simulation leaves on the command line: saved, printed, kept when it ends too early."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import typer
from rich.console import Console
from rich.text import Text

from threadpitch import cosim, lathe
from threadpitch.cli.printing import BAD_INPUT, complain, fail, print_json, printing
from threadpitch.diagnosis import Diagnosis, diagnose, diagnosis_document, diagnosis_lines
from threadpitch.judgement import JudgementError
from threadpitch.measuring import MeasuringPlan
from threadpitch.run_folder import run_document, save_run
from threadpitch.tables import show_pass

DEFAULT_OUTPUT = "threadpitch-run"



@dataclass(frozen=True, eq=False)
class Done:
    """A simulation that came to its end: what it found, and its files."""

    simulation: lathe.Simulation
    found: Diagnosis | None
    files: list[Path]


def finish(simulation: lathe.Simulation, output: Path, plan: MeasuringPlan | None, as_json: bool) -> None:
    """Save a simulation that came to its end, and print what it found."""
    done = save(simulation, output, plan)
    with printing():
        if as_json:
            print_json(run_document(simulation, done.found))
        else:
            _show(done)
    _warn(simulation)


def save(simulation: lathe.Simulation, output: Path, plan: MeasuringPlan | None) -> Done:
    """The files of a simulation, which has cut a turn at least, with the verdict on its thread."""
    if simulation.calculators and not simulation.passes:
        fail(simulation.why_no_turn())
    found = None
    try:
        found = diagnose(simulation, plan)
    except JudgementError as error:
        complain(f"no verdict: {error}")
    except lathe.LatheError:
        save_run(simulation, output)  # what was computed is not lost for a thread that cannot be measured
        raise
    return Done(simulation, found, save_run(simulation, output, found))


def finish_program(done: Sequence[Done], as_json: bool) -> None:
    """Print what the operations of a program found; their files are saved."""
    with printing():
        if as_json:
            print_json(_program_document(done))
        else:
            for one in done:
                _show(one)
    for one in done:
        _warn(one.simulation)


def _program_document(done: Sequence[Done]) -> dict[str, object]:
    """As of one run: the passes of all operations, their verdicts, and the sums of their steps and times."""
    simulations = [one.simulation for one in done]
    documents = [run_document(simulation) for simulation in simulations]
    passes = [one for document in documents for one in document["passes"]]  # type: ignore[attr-defined] # a list
    return {
        "passes": passes,
        "steps": sum(simulation.steps for simulation in simulations),
        "simulated_s": sum(simulation.simulated for simulation in simulations),
        "wall_s": sum(simulation.wall_time for simulation in simulations),
        "flavor": simulations[0].flavor,
        "operations": len(simulations),
        "verdicts": [None if one.found is None else diagnosis_document(one.found) for one in done],
    }


def _warn(simulation: lathe.Simulation) -> None:
    slow = simulation.axis_too_slow()
    for warning in [*([slow] if slow else []), *simulation.result.warnings]:
        complain(f"warning: {warning}")


def _show(done: Done) -> None:
    console, simulation, saved = Console(), done.simulation, done.files
    for one in simulation.passes:
        show_pass(console, one)
        console.print()
    if not simulation.calculators:
        console.print(simulation.why_no_turn())
    if done.found is not None:
        heading, *lines = diagnosis_lines(done.found)
        console.print(Text(heading, style="bold"))
        for line in (*lines, ""):
            console.print(Text(line))
    result = simulation.result
    elsewhere = "" if result.path is None else f", results in {result.path}"
    print(f"{simulation.steps} steps, {simulation.simulated:g} s simulated in {simulation.wall_time:.2f} s with "
          f"{simulation.flavor} FMUs\nsaved in {saved[0].parent}: {', '.join(path.name for path in saved)}{elsewhere}")


@contextlib.contextmanager
def keeping(output: Path, flavor: str) -> Iterator[None]:
    """While a simulation runs: what was recorded before it is ended or fails is saved."""
    try:
        yield
    except (cosim.SimulationInterrupted, cosim.StepError) as error:
        kept = ""
        # A run that fails before its first step leaves the former one.
        if error.result is not None and (error.result.steps or isinstance(error, cosim.SimulationInterrupted)):
            folder = save_run(lathe.Simulation(error.result, flavor), output)[0].parent
            kept = f"; what was recorded is in {error.result.path or folder}"
        complain(f"{error}{kept}")
        raise typer.Exit(128 + error.signal if isinstance(error, cosim.SimulationInterrupted) else BAD_INPUT) from None
