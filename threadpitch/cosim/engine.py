"""Which loop computes the steps: the compiled kernel, or plain Python; both give the same bits."""

from __future__ import annotations

from threadpitch.cosim.algorithms import ALGORITHMS, Algorithm
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.free_steps import FreeSteps
from threadpitch.cosim.instance import FmuInstance
from threadpitch.cosim.network import Network

ENGINES = ("kernel", "python")

_WORTH = 200_000  # component steps: below, plain Python is done before the kernel is loaded


def choose_engine(network: Network, engine: str | None = None) -> Algorithm:
    """The algorithm of the network's method, compiled or plain; without a word the one that is done sooner.

    Raises:
        CosimError: the word is not known, or the kernel is wanted for what is not a loaded FMU.
    """
    fmus = all(isinstance(node.instance, FmuInstance) for node in network.nodes)
    wanted = engine is not None
    if engine is None:
        worth = network.recorder.schedule.steps * len(network.nodes) >= _WORTH
        engine = "kernel" if fmus and worth else "python"
    if engine not in ENGINES:
        raise CosimError(f"engine {engine!r} is not known; choose one of {', '.join(ENGINES)}")
    if network.method.free:
        if engine == "kernel" and wanted:
            raise CosimError("steps whose size an error or an event chooses run in plain Python; take the engine "
                             "'python'")
        return FreeSteps(network)
    if engine == "python":
        return ALGORITHMS[network.method.coupling]
    if not fmus:
        raise CosimError("the kernel steps loaded FMUs only; take the engine 'python'")
    from threadpitch.cosim.program import Program  # Numba takes its time to load

    return Program(network)
