"""A mounted system gives, run after run, the bits of a new simulation; what runs have in common is computed once."""

from __future__ import annotations

import functools
from collections.abc import Iterator

import pytest

from threadpitch import cosim, lathe
from threadpitch.cosim.mounted import Experiment, Mounted, mount
from threadpitch.cosim.values import Given
from threadpitch.roles import Roles

RECORDED = ("z_drive.position", "z_drive.following_error", "spindle.angle", "cutting.axial_force",
            "z_drive.position_gain")
STOP = 0.6  # s; threading begins at 0.26 s


def experiment(roles: Roles, stop_time: float = STOP) -> Experiment:
    return Experiment(stop_time=stop_time, record=RECORDED, watch=roles.watch, part_at="nominal_pitch.threading")


def read(flavor: str) -> cosim.System:
    with cosim.read_system(lathe.find_system(lathe.DEFAULT_SYSTEM),
                           locate=functools.partial(lathe.locate_fmu, flavor)) as system:
        return system


def roles_of(system: cosim.System) -> Roles:
    with cosim.prepare(system) as plan:
        return Roles.of(plan)


def assert_same_bits(found: cosim.Result, expected: cosim.Result) -> None:
    assert found.watched is not None
    assert expected.watched is not None
    for one, other in ((found, expected), (found.watched, expected.watched)):
        assert list(one) == list(other)
        for name in ("time", *one):
            assert one[name].tobytes() == other[name].tobytes(), name


@pytest.fixture(scope="module")
def system() -> cosim.System:
    return read("native")


@pytest.fixture
def mounted(system: cosim.System) -> Iterator[Mounted]:
    with mount(system, experiment=experiment(roles_of(system))) as made:
        yield made


CUT: dict[str, Given] = {"cutting.specific_cutting_force": 1.9e9}
SLOW: dict[str, Given] = {"controller.commanded_speed": "400rpm"}


@pytest.mark.parametrize("flavor", ["native", "python"])
def test_runs_give_the_bits_of_new_simulations(flavor: str) -> None:
    system = read(flavor)
    roles = roles_of(system)
    stop = STOP if flavor == "native" else 0.3
    rows: tuple[dict[str, Given], ...] = (
        {}, CUT, {}, {"z_drive.position_gain": 40.0}, SLOW, {**SLOW, "nominal_pitch.start_angle_count": 1},
        {"spindle.inertia": 0.3, **CUT}, {**SLOW, **CUT, "controller.z_end": "-10mm"})
    with mount(system, experiment=experiment(roles, stop)) as mounted:
        for parameters in rows:
            assert_same_bits(mounted.run(parameters), cosim.simulate(
                system, parameters=parameters, stop_time=stop, record=RECORDED, watch=roles.watch))
        assert mounted.branched >= 3


def test_what_changes_nothing_before_threading_branches_off(mounted: Mounted) -> None:
    mounted.run({})
    mounted.run(CUT)
    assert mounted.branched == 1
    mounted.run({**CUT, "actual_pitch.start_angle_count": 2})
    assert mounted.branched == 2
    mounted.run({**CUT, "spindle.inertia": 0.3})
    assert mounted.branched == 2
    for force in (1.5e9, 1.6e9):
        mounted.run({"cutting.specific_cutting_force": force, "spindle.inertia": 0.3})
    assert mounted.branched == 4


def test_a_failed_run_is_told_and_asks_for_a_new_mount(mounted: Mounted) -> None:
    with pytest.raises(cosim.SystemStructureError, match="no variable 'nothing'"):
        mounted.run({"z_drive.nothing": 1.0})
    mounted.run({})  # a parameter that is refused at the door does no harm
    with pytest.raises(cosim.StepError, match=r"controller: "):
        mounted.run({"controller.start": 2})
    with pytest.raises(cosim.CosimError, match="mount the system anew"):
        mounted.run({})


def test_memory_stays(mounted: Mounted) -> None:
    resource = pytest.importorskip("resource", reason="tells the memory of a process, not on Windows")

    def after(runs: int) -> int:  # KiB, the most so far
        for number in range(runs):
            mounted.run({"z_drive.position_gain": 40.0 + number % 7, "cutting.specific_cutting_force": 1.9e9})
        return int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)

    after(40)
    before = after(10)
    assert after(40) - before < 1024  # the recorded rows of one run alone are 200


def test_values_and_versions_are_described(mounted: Mounted) -> None:
    described = mounted.describe()
    assert described["components"]["z_drive"]["fmu"] == "FeedDrive.fmu"
    assert len(described["components"]["z_drive"]["sha256"]) == 64
    assert described["steps"] == 600
