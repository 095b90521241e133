"""A process whose compiled loops are called while signals raise; it says how often one did, or it crashes.

    python -m tests.cosim.signalled_kernel probe.fmu
"""

from __future__ import annotations

import random
import signal
import sys
from pathlib import Path
from types import FrameType
from typing import NoReturn

from threadpitch.cosim import prepare
from threadpitch.cosim.kernel_loops import COUPLINGS
from threadpitch.cosim.network import Network
from threadpitch.cosim.program import Program
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.selection import Selection
from threadpitch.cosim.simulation import instantiate
from threadpitch.cosim.system import Component, System

RAISED = 2000
CALLS = 30  # between two signals
SHORTEST, LONGEST = 2e-6, 3e-4  # s until the signal


class Rung(Exception):  # noqa: N818 -- no error: it stands for the KeyboardInterrupt of a second Ctrl-C
    pass


def ring(number: int, frame: FrameType | None) -> NoReturn:
    raise Rung


def main() -> None:
    """Call loops over no steps, so that nearly all of the time is spent at their edges."""
    schedule, selection, drawn = Schedule.between(0.0, 10.0, 1.0), Selection(("a.count",)), random.Random(1)
    with prepare(System("one", (Component("a", Path(sys.argv[1])),))) as plan, instantiate(plan) as instances:
        recorder = selection.recorder(plan, schedule, selection.channels(plan), None)
        network = Network(instances, plan.links, recorder)
        program, raised = Program(network), 0
        signal.signal(signal.SIGALRM, ring)
        for loop in COUPLINGS.values():
            loop(program.places, program.span(network, schedule, range(0)))  # compiles
        while raised < RAISED:
            try:
                signal.setitimer(signal.ITIMER_REAL, drawn.uniform(SHORTEST, LONGEST))
                for _ in range(CALLS):
                    for loop in COUPLINGS.values():
                        loop(program.places, program.span(network, schedule, range(0)))
                signal.setitimer(signal.ITIMER_REAL, 0.0)
            except Rung:
                raised += 1
        print(raised)


if __name__ == "__main__":
    main()
