"""Files of strangers: nothing leaves the folder it is unpacked to, nothing is fetched, nothing fills memory or disk."""

from __future__ import annotations

import contextlib
import socket
import stat
import struct
import tempfile
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.cosim.conftest import PROBE, FmuFactory
from threadpitch.cosim import archive, document, fmus, survey
from threadpitch.cosim.archive import ArchiveError, unpack
from threadpitch.cosim.description import FmuError, read_fmu
from threadpitch.cosim.document import DocumentError, parse_document
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.ssp import read_parameter_set, read_system

MEGABYTE = 2**20


@pytest.fixture(autouse=True)
def nothing_is_left_behind_or_fetched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    def refuse(*_: object) -> None:
        raise AssertionError("a file made the reader open a connection")

    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    monkeypatch.setattr(socket.socket, "connect", refuse)
    yield
    assert list(scratch.iterdir()) == []


def packed(path: Path, *members: tuple[str | zipfile.ZipInfo, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for member, content in members:
            if isinstance(member, zipfile.ZipInfo):
                member.compress_type = zipfile.ZIP_DEFLATED
            file.writestr(member, content)
    return path


def refused(path: Path) -> str:
    with pytest.raises(ArchiveError) as error:
        unpack(path)
    assert "\n" not in str(error.value)
    return str(error.value)


# Archives

@pytest.mark.parametrize("name", ["../out", "/out", "a/../../out", "C:/out", "c:out", "a\\..\\..\\out", "\\\\host\\out",
                                  "a/..", "..", "nul\0byte"])
def test_paths_that_leave_the_folder(name: str, tmp_path: Path) -> None:
    member = zipfile.ZipInfo("x")
    member.filename = member.orig_filename = name
    with zipfile.ZipFile(tmp_path / "a.fmu", "w") as file:
        file.writestr("modelDescription.xml", "")
        file.writestr(member, b"out")
    assert "would leave the folder" in refused(tmp_path / "a.fmu") or "\0" in name


def test_links(tmp_path: Path) -> None:
    """Even a link that another member would be written through."""
    link = zipfile.ZipInfo("resources")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    assert "is a symbolic link" in refused(packed(tmp_path / "a.fmu", (link, b"/tmp"), ("resources/out", b"out")))


def test_a_zip_bomb_by_its_ratio(tmp_path: Path) -> None:
    path = packed(tmp_path / "a.fmu", ("zeros", bytes(70 * MEGABYTE)))
    assert path.stat().st_size < MEGABYTE
    assert "unpacks to 70 MiB, " in refused(path)
    small = packed(tmp_path / "b.fmu", ("zeros", bytes(MEGABYTE)))  # a table of zeros is no bomb
    folder = unpack(small)
    assert (folder.path / "zeros").stat().st_size == folder.size == MEGABYTE
    folder.close()


def test_a_zip_bomb_by_its_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = packed(tmp_path / "a.fmu", *((str(number), bytes(1000)) for number in range(11)))
    with pytest.raises(ArchiveError, match="more than the"):
        unpack(path, room=10_000)
    monkeypatch.setattr(archive, "MOST_MEMBERS", 10)
    assert "holds 11 members, more than 10" in refused(path)


def test_sizes_that_lie(tmp_path: Path) -> None:
    """The directory says 10 bytes, the member holds a million: no more than is said is ever written."""
    path = packed(tmp_path / "a.fmu", ("zeros", bytes(MEGABYTE)))
    content = path.read_bytes()
    said = struct.pack("<L", MEGABYTE)
    assert content.count(said) == 2
    path.write_bytes(content.replace(said, struct.pack("<L", 10)))
    assert "is not a readable ZIP archive" in refused(path)


def test_members_made_of_the_same_bytes(tmp_path: Path) -> None:
    """The kernel of a bomb whose members overlap: ten names in the directory, one member in the file."""
    path = packed(tmp_path / "a.fmu", ("zeros", bytes(MEGABYTE)))
    content = path.read_bytes()
    start = content.index(b"PK\1\2")
    entry, end = content[start:content.index(b"PK\5\6")], bytearray(content[content.index(b"PK\5\6"):])
    names = [entry.replace(b"zeros", b"zero%d" % number) for number in range(10)]
    end[8:16] = struct.pack("<HHL", 10, 10, len(entry) * 10)
    path.write_bytes(content[:start] + b"".join(names) + bytes(end))
    assert "overlap" in refused(path)


def test_members_that_stand_twice(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="Duplicate name"):
        path = packed(tmp_path / "a.fmu", ("modelDescription.xml", b"one"), ("modelDescription.xml", b"two"))
    assert "member 'modelDescription.xml' stands twice, with different content" in refused(path)
    assert "stands twice" in refused(packed(tmp_path / "b.fmu", ("a/b", b"one"), ("a/./b", b"two")))
    with pytest.warns(UserWarning, match="Duplicate name"):  # as in an FMU that the FMI project publishes
        path = packed(tmp_path / "c.fmu", ("a", b"one"), ("a", b"one"))
    unpack(path).close()


def test_encrypted_members(tmp_path: Path) -> None:
    path = packed(tmp_path / "a.fmu", ("secret", b"text"))
    content = bytearray(path.read_bytes())
    for mark, place in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        content[content.index(mark) + place] |= 1
    path.write_bytes(bytes(content))
    assert "member 'secret' is encrypted" in refused(path)


@pytest.mark.parametrize("spoil", [
    lambda content: content[:-30], lambda content: content[:40] + b"\xff" * 20 + content[60:], lambda _: b"",
    lambda content: content.replace(b"PK\1\2", b"PK\7\7"), lambda _: b"PK\5\6" + b"\xff" * 18])
def test_damaged_archives(spoil: Callable[[bytes], bytes], tmp_path: Path) -> None:
    path = packed(tmp_path / "a.fmu", ("noise", bytes(range(256)) * 10))
    path.write_bytes(spoil(path.read_bytes()))
    assert "is not a readable ZIP archive" in refused(path)


def test_a_file_and_a_folder_of_one_name(tmp_path: Path) -> None:
    assert "is not a readable ZIP archive" in refused(packed(tmp_path / "a.fmu", ("a", b"file"), ("a/b", b"inside")))


def test_nested_bombs_share_one_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make_fmu: FmuFactory) -> None:
    """FMUs that are small one by one: all of a system together stay below what one archive may take."""
    system = tmp_path / "system"
    for number in range(4):
        make_fmu(system / f"{number}.fmu")
    with zipfile.ZipFile(system / "0.fmu") as one:
        size = sum(member.file_size for member in one.infolist())
    components = "".join(f'<ssd:Component name="c{number}" source="{number}.fmu"/>' for number in range(4))
    (system / "SystemStructure.ssd").write_text(ssd(f"<ssd:Elements>{components}</ssd:Elements>"))
    monkeypatch.setattr(fmus, "MAXIMUM_SIZE", 2 * size + size // 2)
    with read_system(system) as structure, fmus.opened(structure) as found:
        assert list(found.descriptions) == ["c0", "c1"]
        assert all("more than the" in problem for problem in found.problems)
        assert len(found.problems) == 2


# XML

def ssd(system: str) -> str:
    return ('<?xml version="1.0"?><ssd:SystemStructureDescription version="1.0" name="s" '
            'xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" '
            'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" '
            'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues">'
            f'<ssd:System name="root">{system}</ssd:System></ssd:SystemStructureDescription>')


LAUGHS = "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, 12))
BOMBS = {
    "billion laughs": f'<!DOCTYPE a [<!ENTITY l0 "ha">{LAUGHS}]><a b="&l11;">&l11;</a>',
    "quadratic": f'<!DOCTYPE a [<!ENTITY q "{"q" * 50_000}">]><a>{"&q;" * 50_000}</a>',
    "quadratic in an attribute": f'<!DOCTYPE a [<!ENTITY q "{"q" * 50_000}">]><a b="{"&q;" * 50_000}"/>',
    "external entity": '<!DOCTYPE a [<!ENTITY e SYSTEM "file:///etc/passwd">]><a>&e;</a>',
    "external entity of the network": '<!DOCTYPE a [<!ENTITY e SYSTEM "http://127.0.0.1:9/x">]><a>&e;</a>',
    "parameter entity": '<!DOCTYPE a [<!ENTITY % p SYSTEM "http://127.0.0.1:9/x.dtd">%p;]><a/>',
    "external document type": '<!DOCTYPE a SYSTEM "http://127.0.0.1:9/x.dtd"><a/>',
    "public document type": '<!DOCTYPE a PUBLIC "-//x" "file:///etc/passwd"><a/>',
    "empty document type": "<!DOCTYPE a><a/>",
    "default attributes": '<!DOCTYPE a [<!ATTLIST a fmiVersion CDATA "2.0">]><a/>',
}


@pytest.mark.parametrize("name", BOMBS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_document_types_are_refused_before_anything_is_expanded(name: str, encoding: str, tmp_path: Path) -> None:
    text = BOMBS[name] if encoding == "utf-8" else f'<?xml version="1.0" encoding="UTF-16"?>{BOMBS[name]}'
    (tmp_path / "a.xml").write_bytes(text.encode(encoding))
    tracemalloc.start()
    try:
        with pytest.raises(DocumentError, match="document type declaration"):
            parse_document(tmp_path / "a.xml")
        assert tracemalloc.get_traced_memory()[1] < 4 * MEGABYTE
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("text", [
    "<a>" * 100_000 + "</a>" * 100_000,
    "<a>" * 100_000,
    "<a " + " ".join(f'x{n}=""' for n in range(1000)) + ' x1=""/>',
    f"<a>{'x' * 11_000_000}</a>",
    "<a>&undeclared;</a>",
    "",
    "<a",
    "<a></b>",
    '<?xml version="1.0" encoding="EBCDIC-CP-US"?><a/>',
    "<a>\x00</a>",
], ids=["deep", "deep and open", "attribute twice", "huge text", "undeclared", "empty", "cut", "crossed", "encoding",
        "null"])
def test_xml_that_is_not_well_formed_or_monstrous(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(text)
    with pytest.raises(DocumentError, match=r"line \d+: is not XML"):
        parse_document(tmp_path / "a.xml")


def test_very_many_attributes_cost_no_more_than_they_take(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text("<a " + " ".join(f'x{n}=""' for n in range(50_000)) + "/>")
    assert len(parse_document(tmp_path / "a.xml").attrib) == 50_000


def test_large_documents_are_refused_unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.xml").write_text(f"<a>{'<b/>' * 1000}</a>")
    monkeypatch.setattr(document, "LARGEST", 1000)
    with pytest.raises(DocumentError, match="MiB of XML, more than"):
        parse_document(tmp_path / "a.xml")


def test_nothing_is_included_and_no_schema_fetched(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("secret")
    (tmp_path / "a.xml").write_text(
        '<a xmlns:xi="http://www.w3.org/2001/XInclude" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
        'xsi:schemaLocation="urn:a http://127.0.0.1:9/a.xsd"><xi:include href="secret" parse="text"/></a>')
    root = parse_document(tmp_path / "a.xml")
    assert "".join(str(text) for text in root.itertext()) == ""


# Every kind of file goes through these doors

def bombed(text: str) -> str:
    head, _, rest = text.partition("?>")
    return f'{head}?><!DOCTYPE a [<!ENTITY e SYSTEM "file:///etc/passwd">]>{rest}'


SETS = {
    "ssv": '<ssd:ParameterBindings><ssd:ParameterBinding source="bad.xml"/></ssd:ParameterBindings>{}',
    "ssm": '<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="p">'
           "<ssv:Parameters/></ssv:ParameterSet></ssd:ParameterValues><ssd:ParameterMapping source='bad.xml'/>"
           "</ssd:ParameterBinding></ssd:ParameterBindings>{}",
    "ssb": '{}<ssd:SignalDictionaries><ssd:SignalDictionary name="d" source="bad.xml"/></ssd:SignalDictionaries>',
    "nested ssd": '{}',
}


@pytest.mark.parametrize("kind", ["ssd", *SETS])
@pytest.mark.parametrize("packing", [False, True])
def test_every_file_of_a_system_is_looked_at(kind: str, packing: bool, tmp_path: Path) -> None:
    component = '<ssd:Component name="c" source="c.fmu"/>'
    if kind == "nested ssd":
        component += '<ssd:Component name="n" type="application/x-ssp-definition" source="bad.xml"/>'
    text = ssd(SETS.get(kind, "{}").format(f"<ssd:Elements>{component}</ssd:Elements>"))
    files = {"SystemStructure.ssd": bombed(text) if kind == "ssd" else text, "c.fmu": "", "bad.xml": bombed(ssd(""))}
    if packing:
        path = packed(tmp_path / "s.ssp", *((name, content.encode()) for name, content in files.items()))
    else:
        path = tmp_path
        for name, content in files.items():
            (path / name).write_text(content)
    with pytest.raises(CosimError, match="holds a document type declaration") as error:
        read_system(path)
    assert "scratch" not in str(error.value)  # people know the archive, not the temporary folder


def test_a_parameter_file_and_a_model_description_too(tmp_path: Path) -> None:
    (tmp_path / "a.ssv").write_text(bombed(ssd("")))
    with pytest.raises(CosimError, match="holds a document type declaration"):
        read_parameter_set(tmp_path / "a.ssv")
    text = (PROBE / "modelDescription.xml").read_text()
    with pytest.raises(FmuError, match=r"modelDescription\.xml: holds a document type declaration"):
        read_fmu(packed(tmp_path / "a.fmu", ("modelDescription.xml", bombed(text).encode())))


@pytest.mark.parametrize("source", ["../c.fmu", "..%2fc.fmu", "%2e%2e/c.fmu", "/etc/c.fmu", "file:///etc/c.fmu",
                                    "http://127.0.0.1:9/c.fmu", "C:/c.fmu", "a\\..\\..\\c.fmu", "//host/c.fmu", "a%00b",
                                    "", "."])
@pytest.mark.parametrize("kind", ["fmu", "ssp", "ssd", "ssv"])
def test_sources_stay_inside_of_the_folder(source: str, kind: str, tmp_path: Path) -> None:
    component = '<ssd:Component name="c" source="c.fmu"/>'
    binding = ""
    if kind == "ssv":
        binding = f'<ssd:ParameterBindings><ssd:ParameterBinding source="{source}"/></ssd:ParameterBindings>'
    else:
        word = {"fmu": "x-fmu-sharedlibrary", "ssp": "x-ssp-package", "ssd": "x-ssp-definition"}[kind]
        component += f'<ssd:Component name="bad" type="application/{word}" source="{source}"/>'
    folder = tmp_path / "inner"
    folder.mkdir()
    for path in (tmp_path / "c.fmu", folder / "c.fmu"):
        path.write_text("")
    (folder / "SystemStructure.ssd").write_text(ssd(f"{binding}<ssd:Elements>{component}</ssd:Elements>"))
    with pytest.raises(CosimError, match="is not a path inside of the SSD's folder"):
        read_system(folder)


@pytest.mark.parametrize("identifier", ["../../evil", "/tmp/evil", "..\\evil", "C:evil", ".hidden", "a/b"])
def test_the_name_of_the_library_leads_nowhere_else(identifier: str, make_fmu: FmuFactory, tmp_path: Path) -> None:
    path = make_fmu(tmp_path / "a.fmu", lambda text: text.replace('="probe" can', f'="{identifier}" can'))
    with pytest.raises(FmuError, match="is not the name of a library; refused"):
        read_fmu(path)


@pytest.mark.parametrize(("dimensions", "size"), [
    ('<Dimension start="4000000000"/><Dimension start="4000000000"/>', 16 * 10**18),
    ('<Dimension start="1000001"/>', 1_000_001)])
def test_arrays_that_nobody_means(dimensions: str, size: int, make_fmu3: FmuFactory, tmp_path: Path) -> None:
    path = make_fmu3(tmp_path / "a.fmu", lambda text: text.replace('<Dimension start="3"/></Float64>',
                                                                   f"{dimensions}</Float64>"))
    with pytest.raises(FmuError, match=f"an array of {size} elements; at most 1000000 can be read"):
        read_fmu(path)


def test_arrays_of_nothing_cost_nothing(make_fmu3: FmuFactory, tmp_path: Path) -> None:
    """The other extent may be of any size: its indices are never listed."""
    path = make_fmu3(tmp_path / "a.fmu", lambda text: text.replace(
        '<Dimension start="3"/></Float64>', '<Dimension start="0"/><Dimension start="4000000000000"/></Float64>'))
    with contextlib.closing(read_fmu(path)) as fmu:
        assert "w" not in fmu.arrays


def test_messages_name_the_archive_and_the_file_in_it(make_fmu: FmuFactory, tmp_path: Path) -> None:
    broken = make_fmu(tmp_path / "Broken.fmu", lambda text: text.replace("fmiVersion=\"2.0\"", "fmiVersion=\"1.0\""))
    path = packed(tmp_path / "x.ssp", ("resources/Broken.fmu", broken.read_bytes()), (
        "SystemStructure.ssd", ssd('<ssd:Elements><ssd:Component name="c" source="resources/Broken.fmu"/>'
                                   "</ssd:Elements>").encode()))
    problem, = survey(path).problems
    assert problem.startswith("x.ssp: resources/Broken.fmu: ")


def test_the_checksum_of_a_member_is_looked_at(tmp_path: Path) -> None:
    path = packed(tmp_path / "a.fmu", ("text", b"true"))
    path.write_bytes(path.read_bytes().replace(struct.pack("<L", zlib.crc32(b"true")), b"\1\2\3\4"))
    assert "is not a readable ZIP archive (Bad CRC-32" in refused(path)
