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
from threadpitch.cli.kept import Asked, Keeper, keeping_run, stored_line
from threadpitch.cli.printing import BAD_INPUT, complain, fail, print_json, printing
from threadpitch.diagnosis import Diagnosis, diagnose, diagnosis_document, diagnosis_lines
from threadpitch.judgement import JudgementError
from threadpitch.measuring import MeasuringPlan
from threadpitch.run_folder import event_records, run_document, save_run
from threadpitch.tables import printable, show_pass

DEFAULT_OUTPUT = "threadpitch-run"
_MOST_EVENTS = 10  # that are printed


@dataclass(frozen=True, eq=False)
class Done:
    """A simulation that came to its end: what it found, and its files."""

    simulation: lathe.Simulation
    found: Diagnosis | None
    files: list[Path]
    why_not: str = ""  # why there is no verdict, where its pitches cannot be judged


def finish(done: Done, as_json: bool, keeper: Keeper | None = None) -> None:
    """Keep a simulation that came to its end and is saved, where that is wanted, and print what it found."""
    stored: dict[str, object] = {}
    try:
        if keeper is not None:
            stored = keeper.finish_simulation(done.simulation, done.found)
    finally:  # what was found is told, whatever becomes of the store
        with printing():
            if as_json:
                print_json(run_document(done.simulation, done.found) | stored)
            else:
                _show(done, stored)
        _warn(done.simulation)


def save(simulation: lathe.Simulation, output: Path, plan: MeasuringPlan | None) -> Done:
    """The files of a simulation, with the verdict on its thread; without a turn there is no more to tell than why."""
    if simulation.calculators and not simulation.passes:
        saved = save_run(simulation, output)
        fail(f"{simulation.why_no_turn()}; what was computed until then is saved in {saved[0].parent}")
    found, why_not = None, ""
    try:
        found = diagnose(simulation, plan)
    except JudgementError as error:
        why_not = str(error)
    except lathe.LatheError:
        save_run(simulation, output)  # what was computed is not lost for a thread that cannot be measured
        raise
    return Done(simulation, found, save_run(simulation, output, found), why_not)


def finish_program(done: Sequence[Done], as_json: bool, asked: Asked, source: str) -> None:
    """Print what the operations of a program found, and keep each where that is wanted; their files are saved."""
    stored: list[dict[str, object]] = [{} for _ in done]
    try:
        for place, one in enumerate(done):
            with keeping_run(asked, "simulation", f"{source}, operation {place + 1}") as keeper:
                if keeper is not None:
                    stored[place] = keeper.finish_simulation(one.simulation, one.found)
    finally:
        with printing():
            if as_json:
                kept = {"stored": [one["stored"] for one in stored]} if all(stored) else {}
                print_json(_program_document(done) | kept)
            else:
                for one, place_kept in zip(done, stored, strict=True):
                    _show(one, place_kept)
        for one in done:
            _warn(one.simulation)


def _program_document(done: Sequence[Done]) -> dict[str, object]:
    """As of one run: the passes of all operations, their verdicts, and the sums of their steps and times."""
    simulations = [one.simulation for one in done]
    documents = [run_document(simulation) for simulation in simulations]
    passes = [one for document in documents for one in document["passes"]]  # type: ignore[attr-defined] # a list
    events = [{"operation": number, **event} for number, simulation in enumerate(simulations, start=1)
              for event in event_records(simulation)]
    return {
        "passes": passes,
        "alarm": next((simulation.alarm for simulation in simulations if simulation.alarm), None),
        "events": events,
        "steps": sum(simulation.steps for simulation in simulations),
        "simulated_s": sum(simulation.simulated for simulation in simulations),
        "wall_s": sum(simulation.wall_time for simulation in simulations),
        "flavor": simulations[0].flavor,
        "operations": len(simulations),
        "verdicts": [None if one.found is None else diagnosis_document(one.found) for one in done],
    }


def _warn(simulation: lathe.Simulation) -> None:
    told = [text for text in (simulation.alarm, simulation.axis_too_slow()) if text]
    for warning in [*told, *simulation.result.warnings]:
        complain(f"warning: {warning}")


def _show(done: Done, stored: dict[str, object]) -> None:
    console, simulation, saved = Console(), done.simulation, done.files
    for one in simulation.passes:
        show_pass(console, one, simulation.beside(one))
        console.print()
    if not simulation.calculators:
        console.print(simulation.why_no_turn())
    if done.found is not None:
        heading, *lines = diagnosis_lines(done.found)
        whole = not console.is_terminal  # lines of a pipe are not broken
        console.print(Text(heading, style="bold"), soft_wrap=whole)
        for line in (*lines, ""):
            console.print(Text(line), soft_wrap=whole)
    if done.why_not:
        console.print(Text(f"No verdict: {done.why_not}"), soft_wrap=not console.is_terminal)
    result = simulation.result
    for time, variable, direction in result.events[:_MOST_EVENTS]:
        print(f"event: {printable(variable)} {direction} at t = {time:.9g} s")
    if result.events[_MOST_EVENTS:]:
        print(f"and {len(result.events) - _MOST_EVENTS} more events in result.json")
    elsewhere = "" if result.path is None else f", results in {result.path}"
    print(f"{simulation.steps} steps, {simulation.simulated:g} s simulated in {simulation.wall_time:.2f} s with "
          f"{simulation.flavor} FMUs\nsaved in {saved[0].parent}: {', '.join(path.name for path in saved)}{elsewhere}")
    if stored:
        print(stored_line(stored))


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
