"""How often the true parameters of a drive lie within the uncertainty that `fit` states, and real logs.

    python -m tests.benchmarks.bench_fit [recordings]      default 200

Stated are 95 %. "slow" noise is a mean over 50 rows, "counted" a position that counts in 0.5 um.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tests.test_drive_fit import COLUMNS, LOGS, noisy
from threadpitch.drive_fit import CONFIDENCE_FACTOR, fit, read_fit

TRUE = {"gain": 50.0, "lag": 0.0045, "feedforward": 0.0}
LINUXCNC_GAIN = 50.0  # 1/s, of its configuration


def errors(kind: str, rows: int, free: Sequence[str], recordings: int) -> NDArray[np.float64]:
    """(recordings, parameters) errors in standard uncertainties."""
    found = []
    for seed in range(recordings):
        one = fit(*noisy(kind, rows, seed), free=free, known={name: TRUE[name] for name in TRUE if name not in free})
        found.append([(getattr(one, name) - TRUE[name]) / one.uncertainty[name] for name in free])
    return np.array(found)


def main() -> None:
    """Print the figures."""
    recordings = int(sys.argv[1]) if sys.argv[1:] else 200
    for kind, rows, free in (("white", 1200, ("gain", "lag")), ("slow", 3000, ("gain", "lag")),
                             ("counted", 3000, ("gain", "lag")), ("white", 3000, tuple(TRUE)),
                             ("white", 3000, ("gain",))):
        seen = errors(kind, rows, free, recordings)
        told = ", ".join(f"{name} {np.mean(np.abs(column) < CONFIDENCE_FACTOR):.1%} (scatter {np.std(column):.2f})"
                         for name, column in zip(free, seen.T, strict=True))
        print(f"{kind} noise, {rows} rows, {recordings} recordings: true value within the stated 95 %: {told}")
    for log in ("C_ripple_500", "H_droop_500"):
        for free in (("gain", "lag"), ("gain",)):
            one = read_fit(LOGS / f"{log}.csv.gz", COLUMNS, free=free)
            print(f"{log}, free {' and '.join(free)}: gain {one.gain:.4f} 1/s, "
                  f"{one.gain / LINUXCNC_GAIN - 1.0:+.4%} of {LINUXCNC_GAIN:g} 1/s")


if __name__ == "__main__":
    main()
