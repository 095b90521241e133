"""SSP's nested systems, laid flat: components, connections and parameters of every level."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from tests.cosim.conftest import FmuFactory
from tests.cosim.ssd_text import (
    BOX,
    INNER,
    LINEAR,
    bound,
    box,
    laws,
    nested,
    planned,
    ports,
    problems,
    read,
    settings,
    ssd,
    system,
    values,
    wire,
)
from threadpitch.cosim import simulate
from threadpitch.cosim.check import check

# Nested systems

@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_nested_systems_are_laid_flat(version: str, tmp_path: Path) -> None:
    text = ssd(system(nested("one", INNER) + box("last") + nested("two", INNER),
                      wire("one.x", "two.u") + wire("two.x", "last.u")), version)
    structure = read(tmp_path, text)
    assert [component.name for component in structure.components] == ["one.box", "last", "two.box"]  # in the order
    assert [connector.name for connector in structure.connectors] == ["one.u", "one.x", "two.u", "two.x"]
    plan = check(structure, {component.name: BOX for component in structure.components})
    assert laws(plan) == {"one.box.x -> two.box.u": (pytest.approx(1.0), 0.0), "two.box.x -> last.u": (1.0, 0.0)}
    assert plan.order == ("one.box", "two.box", "last")


def test_units_and_transformations_of_every_level_follow_one_another(tmp_path: Path) -> None:
    """m -> (x in m) -> 2 x + 1 in mm at the connector of the system -> variable in m."""
    text = ssd(system(nested("one", INNER) + box("last"), wire("last.x", "one.u", LINEAR)))
    factor, offset = laws(planned(tmp_path, text))["last.x -> one.box.u"]
    assert (factor, offset) == (pytest.approx(2.0), pytest.approx(0.001))


def test_connectors_without_a_unit_hand_the_unit_on(tmp_path: Path) -> None:
    inner = INNER.replace("<ssc:Real unit=\"mm\"/>", "")
    inside = system(nested("one", inner) + box("a", ports("output x Real mm")), wire("a.x", "one.u"))
    assert laws(planned(tmp_path, ssd(inside))) == {"a.x -> one.box.u": (pytest.approx(1.0), 0.0)}


def test_connections_may_be_written_backwards_on_every_level(tmp_path: Path) -> None:
    inner = INNER.replace(wire("u", "box.u"), wire("box.u", "u")).replace(wire("box.x", "x"), wire("x", "box.x"))
    text = ssd(system(nested("one", inner) + nested("two", inner), wire("two.u", "one.x")))
    assert list(laws(planned(tmp_path, text))) == ["one.box.x -> two.box.u"]


def test_values_pass_through_a_system_without_components(tmp_path: Path) -> None:
    through = nested("pass", ports("input in", "output out") + f"<ssd:Connections>{wire('in', 'out', LINEAR)}"
                                                              "</ssd:Connections>")
    text = ssd(system(box("a") + through + box("b"), wire("a.x", "pass.in") + wire("pass.out", "b.u", LINEAR)))
    assert laws(planned(tmp_path, text)) == {"a.x -> b.u": (4.0, 3.0)}


@pytest.mark.parametrize(("elements", "wires", "message"), [
    (nested("one", INNER), wire("one.y", "one.u"), "system 'one' lists no connector 'y'; known are u, x"),
    (nested("one", INNER) + nested("two", INNER), wire("one.x", "two.x"), "one.x and two.x both give data"),
    (nested("one", INNER) + nested("two", INNER), wire("one.u", "two.u"), "one.u and two.u both take data"),
    (nested("one", INNER) + box("a") + box("b"), wire("a.x", "one.u") + wire("b.x", "one.u"),
     "connector one.u is fed already by a.x"),
    (nested("one", INNER) + box("one.box"), "", "component name 'one.box' stands twice"),
])
def test_wrong_wires_of_nested_systems(elements: str, wires: str, message: str, tmp_path: Path) -> None:
    assert message in problems(tmp_path, ssd(system(elements, wires)))


def test_data_that_run_in_a_circle_of_connectors_are_told(tmp_path: Path) -> None:
    through = nested("pass", ports("input in", "output out") + f"<ssd:Connections>{wire('in', 'out')}"
                                                              "</ssd:Connections>")
    text = ssd(system(box("a") + through, wire("pass.out", "pass.in") + wire("pass.out", "a.u")))
    assert "a.u run in a circle" in problems(tmp_path, text)


# Nested files

def package(path: Path, text: str) -> bytes:
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("SystemStructure.ssd", text)
        packed.writestr("Other.ssd", text.replace("Real 2", "Real 4"))
        packed.writestr("Box.fmu", "fmu")
    return path.read_bytes()


@pytest.mark.parametrize(("kind", "source"), [("definition", "inner.ssd"), ("package", "inner.ssp"),
                                              ("package", "inner.ssp#Other.ssd"), ("definition", "#embedded")])
def test_systems_of_other_files_and_by_id(kind: str, source: str, tmp_path: Path) -> None:
    reference = f'<ssd:Component name="two" type="application/x-ssp-{kind}" source="{source}">{{}}</ssd:Component>'
    text = ssd(system(nested("one", INNER, 'id="embedded"') + reference.format(bound(values("box.k Real 9"))),
                      wire("one.x", "two.u")))
    structure = read(tmp_path / "s", text, {"inner.ssd": ssd(INNER), "inner.ssp": package(tmp_path / "p", ssd(INNER))})
    with structure:
        plan = check(structure, {component.name: BOX for component in structure.components})
        assert list(laws(plan)) == ["one.box.x -> two.box.u"]
        assert settings(plan) == {"one.box.k": 2.0, "two.box.k": 9.0}  # the reference's own binding comes last
        unpacked = [folder.path for folder in structure.folders]
        assert len(unpacked) == (kind == "package")
        assert all(path.exists() for path in unpacked)
    assert not any(path.exists() for path in unpacked)


def test_a_system_that_contains_itself_is_refused(tmp_path: Path) -> None:
    again = '<ssd:Component name="again" type="application/x-ssp-definition" source="SystemStructure.ssd"/>'
    assert "lie more than 20 deep in one another" in problems(tmp_path, ssd(system(again)))


def test_short_files_that_mean_very_many_components_are_refused(tmp_path: Path) -> None:
    """Every level refers twice to the next: 2^19 boxes of 2 kB of text."""
    level = '<ssd:Component name="{}" type="application/x-ssp-definition" source="#s{}"/>'
    text = "".join(nested(f"d{n}", system(level.format("a", n + 1) + level.format("b", n + 1)), f'id="s{n}"')
                   for n in range(1, 19))
    text += nested("end", system(box("box")), 'id="s19"')
    assert "more than 100000 components and systems" in problems(tmp_path, ssd(system(text)))


# Parameters

@pytest.mark.parametrize(("outer", "expected"), [
    ("", 2.0),
    (bound(values("one.box.k Real 5")), 5.0),
    (bound(values("one.box.k Real 5"), values("one.box.k Real 6")), 6.0),
    (bound(values("box.k Real 5", binding='prefix="one."')), 5.0),
    (bound(values("k Real 5")), 2.0),  # names nothing
])
def test_bindings_of_higher_levels_and_later_ones_take_precedence(outer: str, expected: float, tmp_path: Path) -> None:
    inner = INNER.replace(box("box"), box("box", bound(values("k Real 1"))))
    assert settings(planned(tmp_path, ssd(system(nested("one", inner), before=outer))))["one.box.k"] == expected


def test_a_parameter_of_a_system_reaches_all_that_it_feeds(tmp_path: Path) -> None:
    """The connector's own unit, the transformation behind it, and the value of the higher level, which wins."""
    inner = system(box("a") + box("b"), wire("size", "a.length") + wire("size", "b.length", LINEAR),
                   ports("parameter size Real mm") + bound(values("size Real 7")))
    low = ssd(system(nested("one", inner)))
    assert settings(planned(tmp_path / "1", low)) == {
        "one.a.length": pytest.approx(0.007), "one.b.length": pytest.approx(1.014)}
    high = ssd(system(nested("one", inner), wire("all", "one.size"),
                      ports("parameter all Real m") + bound(values("all Real 4 mm"))))
    assert settings(planned(tmp_path / "2", high)) == {
        "one.a.length": pytest.approx(0.004), "one.b.length": pytest.approx(1.008)}


@pytest.mark.parametrize("engine", ["python", "kernel"])
def test_a_nested_system_runs_with_the_bits_of_a_flat_one(make_fmu: FmuFactory, tmp_path: Path, engine: str) -> None:
    for name in ("nested", "flat"):
        make_fmu(tmp_path / name / "Box.fmu")
    inner = INNER.replace("<ssc:Real unit=\"mm\"/>", '<ssc:Real unit="m"/>')
    texts = {"nested": ssd(system(nested("one", inner) + box("last"), wire("one.x", "last.u"))),
             "flat": ssd(system(box("first", bound(values("k Real 2"))) + box("last"), wire("first.x", "last.u")))}
    results = {}
    for name, text in texts.items():
        (tmp_path / name / "SystemStructure.ssd").write_text(text)
        start = {"nested": "one.box.u", "flat": "first.u"}[name]
        results[name] = simulate(tmp_path / name, engine=engine, parameters={start: 1.0})
    assert results["nested"]["one.box.x"][-1] != 0.0
    assert results["nested"]["one.box.x"].tobytes() == results["flat"]["first.x"].tobytes()
    assert results["nested"]["last.x"].tobytes() == results["flat"]["last.x"].tobytes()
