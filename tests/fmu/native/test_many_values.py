"""Values that are got together are those that are got one by one, in whatever order they are asked for."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from hypothesis import given, settings
from hypothesis import strategies as st

from threadpitch.fmu import available_compiler, cached_fmu

MODEL = Path(__file__).parents[2] / "cosim" / "models" / "played_table.py"
INTERVAL, LAST = 2, 802  # value references: first, second, interval, 400 of firsts, 400 of seconds

pytestmark = pytest.mark.skipif(available_compiler() is None, reason="no C compiler and no ziglang")


@contextlib.contextmanager
def filled(folder: Path) -> Iterator[FMU2Slave]:
    """An instance in which every value is its own reference."""
    unpacked = extract(str(cached_fmu(MODEL, "native")), str(folder))
    description = read_model_description(unpacked)
    assert [variable.valueReference for variable in description.modelVariables] == list(range(LAST + 1))
    slave = FMU2Slave(guid=description.guid, modelIdentifier=description.coSimulation.modelIdentifier,
                      unzipDirectory=unpacked, instanceName="table")
    slave.instantiate()
    slave.setReal(range(INTERVAL, LAST + 1), [float(reference) for reference in range(INTERVAL, LAST + 1)])
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    try:
        yield slave
    finally:
        with contextlib.suppress(FMICallException):  # not allowed after an error
            slave.terminate()
        slave.freeInstance()


@pytest.fixture(scope="module")
def slave(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FMU2Slave]:
    with filled(tmp_path_factory.mktemp("table")) as made:
        yield made


STRETCHES = st.tuples(st.integers(INTERVAL, LAST), st.integers(1, 60), st.sampled_from((1, 1, 1, 0, 2, -1)))


@settings(deadline=None, max_examples=200)
@given(st.lists(STRETCHES, max_size=12))
def test_stretches_gaps_and_repetitions(slave: FMU2Slave, stretches: list[tuple[int, int, int]]) -> None:
    references = [first + step * n for first, count, step in stretches for n in range(count)
                  if INTERVAL <= first + step * n <= LAST]
    assert slave.getReal(references) == [float(reference) for reference in references]


def test_all_at_once(slave: FMU2Slave) -> None:
    references = list(range(LAST + 1))
    assert slave.getReal(references)[INTERVAL:] == [float(reference) for reference in references[INTERVAL:]]


def test_a_reference_behind_the_last_is_refused(tmp_path: Path) -> None:
    with filled(tmp_path) as made, pytest.raises(FMICallException):
        made.getReal(list(range(LAST + 2)))


COUNTS = '''
from dataclasses import dataclass
from threadpitch.fmu.variable import Experiment, output, parameter

EXPERIMENT = Experiment(stop_time=1.0, step_size=0.5)


@dataclass
class Counts:
    """Counts, one after another."""

    counts: list[int] = output("1", "Place times factor", start=0, size=40, min=-2147483648, max=2147483647)
    factor: int = parameter("1", "Factor", start=3, min=-1000, max=200000000)
    marks: list[bool] = output("1", "Every second", start=False, size=3)

    def check(self) -> int:
        """Always content."""
        return 0

    def initialize(self) -> None:
        """All of them."""
        for i in range(40):
            self.counts[i] = self.factor * (i - 20)
        self.marks[1] = True

    def step(self, time: float, step_size: float) -> int:
        """As they are."""
        return 0
'''


@contextlib.contextmanager
def counted(folder: Path, factor: int) -> Iterator[FMU2Slave]:
    """An instance that is being initialised with this factor."""
    path = folder / "counts.py"
    path.write_text(COUNTS)
    unpacked = extract(str(cached_fmu(path, "native")), str(folder / "fmu"))
    description = read_model_description(unpacked)
    slave = FMU2Slave(guid=description.guid, modelIdentifier=description.coSimulation.modelIdentifier,
                      unzipDirectory=unpacked, instanceName="counts")
    slave.instantiate()
    slave.setInteger([40], [factor])
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    try:
        yield slave
    finally:
        slave.freeInstance()


@pytest.fixture(scope="module")
def counts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FMU2Slave]:
    with counted(tmp_path_factory.mktemp("counts"), -3) as made:
        made.exitInitializationMode()
        yield made


@settings(deadline=None, max_examples=100)
@given(st.lists(st.tuples(st.integers(0, 39), st.integers(1, 40), st.sampled_from((1, 1, 0, 2, -1))), max_size=6))
def test_stretches_of_integers(counts: FMU2Slave, stretches: list[tuple[int, int, int]]) -> None:
    references = [first + step * n for first, count, step in stretches for n in range(count)
                  if 0 <= first + step * n <= 39]
    assert counts.getInteger(references) == [-3 * (reference - 20) for reference in references]
    assert counts.getInteger([*references, 40]) == [*(-3 * (reference - 20) for reference in references), -3]
    assert counts.getBoolean([41, 42, 43]) == [False, True, False]


@pytest.mark.parametrize("references", [list(range(40)), [39], [30, 31, 39, 0]], ids=["all", "one", "gaps"])
def test_an_integer_beyond_32_bits_is_refused(tmp_path: Path, references: list[int]) -> None:
    with counted(tmp_path, 2**31 // 19 + 1) as made:
        assert made.getInteger(range(2, 39)) == [(2**31 // 19 + 1) * (place - 20) for place in range(2, 39)]
        with pytest.raises(FMICallException):
            made.getInteger(references)
