"""Draws docs/pitch.svg from the files of a run: threadpitch run --output DIR, then python docs/draw_pitch.py DIR."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt

LABELS = {"nominal_pitch": "nominal: what the detectors saw", "actual_pitch": "actual: where the groove is"}
COLOURS = {"nominal_pitch": "#0b5cad", "actual_pitch": "#c2410c"}
MARKERS = {"nominal_pitch": "o", "actual_pitch": "s"}


def main(folder: Path) -> None:
    """P(n) - target in um over n, nominal and actual, from the first start angle; turns in the metal are shaded."""
    with (folder / "pitch.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if float(row["start_angle_deg"]) == 0.0]
    mpl.rcParams.update({"svg.hashsalt": "threadpitch", "font.size": 10, "axes.spines.top": False,
                         "axes.spines.right": False})
    figure, axes = plt.subplots(figsize=(8, 3.4), layout="constrained")
    metal = [int(row["n"]) for row in rows if row["in_metal"] == "1"]
    axes.axvspan(min(metal) - 0.5, max(metal) + 0.5, color="#e8edf2", label="turns in the metal")
    for name, label in LABELS.items():
        found = [(int(row["n"]), float(row["deviation_um"])) for row in rows if row["calculator"] == name]
        axes.plot(*zip(*found, strict=True), marker=MARKERS[name], markersize=4, color=COLOURS[name], label=label)
    axes.set(xlabel="turn n", ylabel="P(n) - 1.5 mm [um]", ylim=(-4, 4), xlim=(0.5, len(rows) / 2 + 0.5))
    axes.set_title("M20x1.5 at 500 rpm: movement per revolution, start angle 0 (the first turns leave the picture)",
                   fontsize=10, loc="left")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper right", fontsize=8, framealpha=1.0)
    figure.savefig(Path(__file__).parent / "pitch.svg", metadata={"Date": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]))
