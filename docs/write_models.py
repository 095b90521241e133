"""Writes docs/models.md, the page of all models and their variables: python docs/write_models.py."""

from __future__ import annotations

from pathlib import Path

from threadpitch.fmu import markdown_table, read_model
from threadpitch.lathe import model_files

PAGE = Path(__file__).with_name("models.md")


def page() -> str:
    """The page: each model's description with its equations, and its variables."""
    parts = ["# The models", "", "Written by `python docs/write_models.py` from `fmu_src/`. Units are those for people;"
             " inside all is SI.", ""]
    for path in model_files():
        model = read_model(path)
        summary, _, rest = model.description.partition("\n\n")
        parts += [f"## {model.class_name}", "", summary, "", "```", rest, "```", "", markdown_table(model)]
        if model.errors:
            parts += ["**Errors**", "", *(f"- {number}: {text}" for number, text in sorted(model.errors.items())), ""]
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
