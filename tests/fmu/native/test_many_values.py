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
