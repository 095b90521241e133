"""What a simulation leaves on the command line: saved, printed, kept when it ends too early."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path

import typer
from rich.console import Console

from threadpitch import cosim, lathe
from threadpitch.cli.kept import Asked, Keeper, keeping_run, stored_line
from threadpitch.cli.printing import BAD_INPUT, complain, fail, print_json, printing
from threadpitch.run_folder import event_records, run_document, save_run
from threadpitch.tables import printable, show_pass

DEFAULT_OUTPUT = "threadpitch-run"
_MOST_EVENTS = 10  # that are printed

def finish(simulation: lathe.Simulation, output: Path, as_json: bool, keeper: Keeper | None = None) -> None:
    """Save a simulation that came to its end, keep it where that is wanted, and print what it found."""
    saved = save(simulation, output)
    stored: dict[str, object] = {}
    try:
        if keeper is not None:
            stored = keeper.finish_simulation(simulation)
    finally:  # what was found is told, whatever becomes of the store
        with printing():
            if as_json:
                print_json(run_document(simulation) | stored)
            else:
                _show(simulation, saved, stored)
        _warn(simulation)


def save(simulation: lathe.Simulation, output: Path) -> list[Path]:
    """The files of a simulation, which has cut a turn at least."""
    if simulation.calculators and not simulation.passes:
        fail(simulation.why_no_turn())
    return save_run(simulation, output)


def finish_program(done: Sequence[tuple[lathe.Simulation, list[Path]]], as_json: bool, asked: Asked,
                   source: str) -> None:
    """Print what the operations of a program found, and keep each where that is wanted; their files are saved."""
    stored: list[dict[str, object]] = [{} for _ in done]
    try:
        for place, (simulation, _) in enumerate(done):
            with keeping_run(asked, "simulation", f"{source}, operation {place + 1}") as keeper:
                if keeper is not None:
                    stored[place] = keeper.finish_simulation(simulation)
    finally:
        with printing():
            if as_json:
                kept = {"stored": [one["stored"] for one in stored]} if all(stored) else {}
                print_json(_program_document([simulation for simulation, _ in done]) | kept)
            else:
                for (simulation, saved), place_kept in zip(done, stored, strict=True):
                    _show(simulation, saved, place_kept)
        for simulation, _ in done:
            _warn(simulation)


def _program_document(simulations: Sequence[lathe.Simulation]) -> dict[str, object]:
    """As of one run: the passes of all operations, and the sums of their steps and times."""
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
    }


def _warn(simulation: lathe.Simulation) -> None:
    told = [text for text in (simulation.alarm, simulation.axis_too_slow()) if text]
    for warning in [*told, *simulation.result.warnings]:
        complain(f"warning: {warning}")


def _show(simulation: lathe.Simulation, saved: Sequence[Path], stored: dict[str, object]) -> None:
    console = Console()
    for one in simulation.passes:
        show_pass(console, one, simulation.beside(one))
        console.print()
    if not simulation.calculators:
        console.print(simulation.why_no_turn())
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
