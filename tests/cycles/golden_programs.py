"""The programs with golden text: those of ``models/programs`` and those beside the text; how each is set up."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from threadpitch.cycles import (
    IncrementSystem,
    Indexing,
    Interpretation,
    Setup,
    dialect_named,
    interpret,
    moves_text,
    read_program_file,
)

GOLDEN = Path(__file__).parent / "golden"
EXAMPLES = Path(__file__).parents[2] / "models" / "programs"
PROGRAMS = sorted([*GOLDEN.glob("*.nc"), *EXAMPLES.glob("*.nc")], key=lambda path: path.name)


def setup_of(path: Path) -> Setup:
    """What a program's first comment says of its control: ``(setup: dialect=fanuc starts=2)``."""
    setup = Setup()
    comment = re.match(r"\(setup: ([^)]*)\)", path.read_text(encoding="utf-8"))
    for word in comment.group(1).split() if comment else ():
        key, value = word.split("=")
        match key:
            case "dialect":
                setup = replace(setup, dialect=dialect_named(value))
            case "increments":
                setup = replace(setup, increments=IncrementSystem(value))
            case "indexing":
                setup = replace(setup, indexing=Indexing(value))
            case "starts":
                setup = replace(setup, starts=int(value))
            case _:
                raise ValueError(f"{path}: {word} is no setup")
    return setup


def run(path: Path) -> Interpretation:
    return interpret(read_program_file(path), setup_of(path))


def golden_text(path: Path) -> str:
    """Moves, kinds of the passes, rewritten parameters and notes, one per line."""
    result = run(path)
    kinds = " ".join(f"{cut.number}:{cut.kind}" for cut in result.passes)
    rewritten = " ".join(f"{number}={value:g}" for number, value in sorted(result.rewritten.items()))
    notices = "".join(f"note line {notice.place.line}: {notice.text}\n" for notice in result.notices)
    return f"{moves_text(result.moves)}passes {kinds}\nrewritten {rewritten or '-'}\n{notices}"


if __name__ == "__main__":
    for program in PROGRAMS:
        (GOLDEN / f"{program.stem}.txt").write_text(golden_text(program), encoding="utf-8")
