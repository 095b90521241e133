from __future__ import annotations

import stat
import zipfile
from pathlib import Path

import pytest

from threadpitch.cosim.archive import ArchiveError
from threadpitch.cosim.ssp import read_parameter_set, read_system
from threadpitch.cosim.system import Connection, Connector, System, SystemStructureError
from threadpitch.units import Unit

NAMESPACES = " ".join(f'xmlns:{prefix}="http://ssp-standard.org/SSP1/SystemStructure{name}"' for prefix, name in (
    ("ssd", "Description"), ("ssc", "Common"), ("ssv", "ParameterValues"), ("ssm", "ParameterMapping")))
BODY = """
<ssd:Connectors><ssd:Connector name="advance" kind="input"><ssc:Real unit="mm"/></ssd:Connector></ssd:Connectors>
<ssd:ParameterBindings>
  <ssd:ParameterBinding source="lathe.ssv"/>
  <ssd:ParameterBinding prefix="b."><ssd:ParameterValues>
    <ssv:ParameterSet version="1.0" name="inline"><ssv:Parameters>
      <ssv:Parameter name="k"><ssv:Real value="3"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet>
  </ssd:ParameterValues></ssd:ParameterBinding>
</ssd:ParameterBindings>
<ssd:Elements>
  <ssd:Component name="a" source="resources/My%20Probe.fmu">
    <ssd:Connectors>
      <ssd:Connector name="x" kind="output"><ssc:Real unit="mm"/></ssd:Connector>
      <ssd:Connector name="count" kind="output"><ssc:Integer/></ssd:Connector>
      <ssd:Connector name="u" kind="input"/>
    </ssd:Connectors>
    <ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>
      <ssv:ParameterSet version="1.0" name="own"><ssv:Parameters>
        <ssv:Parameter name="flag"><ssv:Boolean value="true"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet>
    </ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>
  </ssd:Component>
  <ssd:Component name="b" source="resources/My%20Probe.fmu"/>
</ssd:Elements>
<ssd:Connections>
  <ssd:Connection startElement="a" startConnector="x" endElement="b" endConnector="u" suppressUnitConversion="true">
    <ssc:LinearTransformation factor="2" offset="-1"/></ssd:Connection>
  <ssd:Connection startElement="b" startConnector="x" endElement="a" endConnector="u"/>
  <ssd:Connection startConnector="advance" endElement="a" endConnector="u"/>
</ssd:Connections>
"""
SSV = f"""<?xml version="1.0"?><ssv:ParameterSet {NAMESPACES} version="1.0" name="lathe"><ssv:Parameters>
<ssv:Parameter name="a.k"><ssv:Real value="2.5" unit="per second"/></ssv:Parameter>
<ssv:Parameter name="a.fault"><ssv:Integer value="1"/></ssv:Parameter>
<ssv:Parameter name="a.mode"><ssv:Enumeration value="fast"/></ssv:Parameter>
<ssv:Parameter name="a.label"><ssv:String value="left"/></ssv:Parameter>
</ssv:Parameters>
<ssv:Units><ssc:Unit name="per second"><ssc:BaseUnit s="-1"/></ssc:Unit></ssv:Units></ssv:ParameterSet>"""


def ssd(body: str = BODY, version: str = "1.0") -> str:
    return (f'<?xml version="1.0"?><ssd:SystemStructureDescription {NAMESPACES} version="{version}" name="two">'
            f'<ssd:System name="root">{body}</ssd:System>'
            '<ssd:Units><ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit></ssd:Units>'
            '<ssd:DefaultExperiment startTime="1" stopTime="3.5"/></ssd:SystemStructureDescription>')


def files(text: str | None = None) -> dict[str, str]:
    return {"SystemStructure.ssd": ssd() if text is None else text, "lathe.ssv": SSV, "resources/My Probe.fmu": "fmu"}


def folder(path: Path, text: str | None = None) -> Path:
    for name, content in files(text).items():
        (path / name).parent.mkdir(parents=True, exist_ok=True)
        (path / name).write_text(content)
    return path


def archive(path: Path, text: str | None = None) -> Path:
    with zipfile.ZipFile(path, "w") as packed:
        for name, content in files(text).items():
            packed.writestr(name, content)
    return path


def test_everything_that_counts_is_read(tmp_path: Path) -> None:
    system = read_system(folder(tmp_path))
    assert (system.name, system.start_time, system.stop_time) == ("two", 1.0, 3.5)
    assert [component.name for component in system.components] == ["a", "b"]
    assert system.components[0].fmu == tmp_path / "resources" / "My Probe.fmu"
    assert system.components[0].connectors == (
        Connector("x", "output", "Real", "mm"), Connector("count", "output", "Integer"), Connector("u", "input"))
    assert system.connections == (
        Connection("a", "x", "b", "u", 2.0, -1.0, convert_units=False), Connection("b", "x", "a", "u"),
        Connection("", "advance", "a", "u"))
    assert system.units == {"mm": Unit("mm", (0, 1, 0, 0, 0, 0, 0, 0), 0.001)}
    values = [(value.name, value.value, value.unit) for value in system.parameter_values]
    assert values == [("a.flag", True, None), ("a.k", 2.5, "per second"), ("a.fault", 1, None),
                      ("a.mode", "fast", None), ("a.label", "left", None), ("b.k", 3.0, None)]
    assert system.parameter_values[1].definition == Unit("per second", (0, 0, -1, 0, 0, 0, 0, 0))
    assert system.parameter_values[1].origin == "lathe.ssv:2"


def test_folder_file_and_archive_read_alike(tmp_path: Path) -> None:
    from_folder = read_system(folder(tmp_path / "f"))
    from_file = read_system(tmp_path / "f" / "SystemStructure.ssd")
    assert from_folder.components == from_file.components
    with read_system(archive(tmp_path / "two.ssp")) as packed:
        unpacked = packed.folders[0].path
        assert packed.components[0].fmu.read_text() == "fmu"
        assert packed.connections == from_file.connections
        assert [value.value for value in packed.parameter_values] == [
            value.value for value in from_file.parameter_values]
        assert packed.parameter_values[0].origin == "two.ssp:19"  # the archive, not the folder it is unpacked to
    assert not unpacked.exists()


def test_a_forgotten_archive_is_removed_too(tmp_path: Path) -> None:
    system: System | None = read_system(archive(tmp_path / "two.ssp"))
    assert system is not None
    unpacked = system.folders[0].path
    assert unpacked.exists()
    system = None
    assert not unpacked.exists()


def test_the_caller_may_find_the_fmus(tmp_path: Path) -> None:
    asked = []

    def locate(source: str, base: Path) -> Path:
        asked.append((source, base))
        return base / "built.fmu"

    folder(tmp_path)
    (tmp_path / "resources" / "My Probe.fmu").unlink()
    assert read_system(tmp_path, locate=locate).components[1].fmu == tmp_path / "built.fmu"
    assert asked == [("resources/My Probe.fmu", tmp_path)] * 2


def refusal(path: Path) -> str:
    with pytest.raises((SystemStructureError, ArchiveError)) as error:
        read_system(path)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_missing_and_foreign_files(tmp_path: Path) -> None:
    assert "holds no SystemStructure.ssd; give an .ssp" in refusal(tmp_path)
    assert "no such file" in refusal(tmp_path / "nothing.ssd")
    assert "no such file" in refusal(tmp_path / "nothing.ssp")
    (tmp_path / "text.ssp").write_text("no archive")
    assert "is not a readable ZIP archive" in refusal(tmp_path / "text.ssp")
    (tmp_path / "text.ssd").write_text("no XML")
    assert "line 1: is not XML" in refusal(tmp_path / "text.ssd")
    (tmp_path / "other.ssd").write_text(SSV)
    assert "holds <ParameterSet>, not a SystemStructureDescription" in refusal(tmp_path / "other.ssd")
    with zipfile.ZipFile(tmp_path / "empty.ssp", "w"):
        pass
    assert "holds no SystemStructure.ssd" in refusal(tmp_path / "empty.ssp")
    archive(tmp_path / "cut.ssp")
    (tmp_path / "cut.ssp").write_bytes((tmp_path / "cut.ssp").read_bytes()[:-30])
    assert "is not a readable ZIP archive" in refusal(tmp_path / "cut.ssp")


@pytest.mark.parametrize(("text", "message"), [
    (ssd(version="3.0"), "is SSP version '3.0'; only 1.0 and 2.0 are read"),
    (ssd("<ssd:Elements/>"), "the system holds no component"),
    (ssd("<ssd:Elements><ssd:Part/></ssd:Elements>"), "schema: line 1: Element 'Part': This element is not expected"),
    (ssd(""), "the system holds no component"),
    (ssd(BODY.replace("My%20Probe", "Gone")), "component 'a': FMU 'resources/Gone.fmu' does not lie beside"),
    (ssd(BODY.replace("resources/My%20Probe", "../out")), "is not a path inside of the SSD's folder"),
    (ssd(BODY.replace("resources/My%20Probe", "%2e%2e/out")), "is not a path inside of the SSD's folder"),
    (ssd(BODY.replace("resources/My%20Probe", "/etc/out")), "is not a path inside of the SSD's folder"),
    (ssd(BODY.replace("resources/My%20Probe", "http://host/out")), "is not a path inside of the SSD's folder"),
    (ssd(BODY.replace('"lathe.ssv"', '"gone.ssv"')), "gone.ssv: no such file"),
    (ssd(BODY.replace('name="b"', 'name="b" implementation="ModelExchange"')), "component 'b' is model exchange"),
    (ssd(BODY.replace('source="lathe.ssv"/>', 'source="lathe.ssv"><ssd:ParameterMapping source="gone.ssm"/>'
                                              "</ssd:ParameterBinding>")), "gone.ssm: no such file"),
    (ssd(BODY.replace('startConnector="advance"', 'startConnector="advanse"')),
     "the system lists no connector 'advanse'; did you mean advance?"),
    (ssd(BODY.replace('<ssv:Real value="3"/>', '<ssv:Real value="three"/>')), "breaks the SSP 1.0 schema"),
    (ssd().replace('<?xml version="1.0"?>', '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY e SYSTEM "lathe.ssv">]>'),
     "holds a document type declaration"),
])
def test_faults_of_an_ssd(text: str, message: str, tmp_path: Path) -> None:
    assert message in refusal(folder(tmp_path, text))


@pytest.mark.parametrize("name", ["../out.txt", "/out.txt", "a/../../out.txt", "C:/out.txt", "a\\..\\out.txt"])
def test_no_path_leaves_the_archives_folder(name: str, tmp_path: Path) -> None:
    path = archive(tmp_path / "evil.ssp")
    with zipfile.ZipFile(path, "a") as packed:
        packed.writestr(zipfile.ZipInfo(name), "out")
    assert "would leave the folder" in refusal(path)


def test_a_symbolic_link_in_an_archive_is_refused(tmp_path: Path) -> None:
    path = archive(tmp_path / "link.ssp")
    link = zipfile.ZipInfo("resources/link")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    with zipfile.ZipFile(path, "a") as packed:
        packed.writestr(link, "/etc")
    assert "is a symbolic link" in refusal(path)


def test_a_parameter_set_alone(tmp_path: Path) -> None:
    (tmp_path / "lathe.ssv").write_text(SSV)
    assert [value.name for value in read_parameter_set(tmp_path / "lathe.ssv")] == ["a.k", "a.fault", "a.mode",
                                                                                    "a.label"]
    (tmp_path / "lathe.ssv").write_text(SSV.replace('value="2.5"', ""))
    with pytest.raises(SystemStructureError, match="breaks the SSP"):
        read_parameter_set(tmp_path / "lathe.ssv")
