"""From SSDs to blocks: components located, parameter sets, mappings and dictionaries read, nested files opened."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import TypeAlias
from urllib.parse import unquote

from threadpitch.cosim.archive import MAXIMUM_SIZE, unpack
from threadpitch.cosim.document import Element
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.ssp.block import Block, End, Reference, Wire
from threadpitch.cosim.ssp.content import Definitions, annotated, connector, connectors, transformation
from threadpitch.cosim.ssp.parameters import mapped, mappings, parameter_values
from threadpitch.cosim.ssp.schema import SSB, SSD, SSM, SSV, inside, parse, validate, where
from threadpitch.cosim.system import Annotation, Component, Connector, ParameterValue, SystemStructureError
from threadpitch.cosim.temporary_folder import TemporaryFolder

Locate: TypeAlias = Callable[[str, Path], Path]

DEEPEST = 20  # systems in systems
MOST_ELEMENTS = 100_000  # of all systems together: references can make very many of a short file
FMU_TYPE = "application/x-fmu-sharedlibrary"
_NESTED = ("application/x-ssp-definition", "application/x-ssp-package")


@dataclass(frozen=True)
class Place:
    """Where an SSD lies, and what people call it: the file, or the archive that it was unpacked from."""

    ssd: Path
    name: str
    archive: str | None = None

    @property
    def folder(self) -> Path:
        """What sources are relative to."""
        return self.ssd.parent

    def label(self, source: str) -> str:
        """What people call a file beside the SSD."""
        return f"{self.archive}: {source}" if self.archive else str(self.folder / source)


@dataclass
class Session:
    """What reading one system gathers from all its files; ``replace`` names files for components instead of theirs."""

    locate: Locate
    replace: Mapping[str, Path]
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    annotations: list[Annotation] = field(default_factory=list)
    folders: list[TemporaryFolder] = field(default_factory=list)
    unpacked: int = 0  # bytes
    elements: int = 0
    names: list[str] = field(default_factory=list)  # of all components, those that cannot be read too

    def count(self) -> None:
        """Count one element of a system.

        Raises:
            SystemStructureError: there are too many.
        """
        self.elements += 1
        if self.elements > MOST_ELEMENTS:
            raise SystemStructureError(f"more than {MOST_ELEMENTS} components and systems; refused")

    def unpack(self, archive: Path, name: str) -> Path:
        """The folder of an unpacked archive; all together stay below the limit for one."""
        folder = unpack(archive, name, MAXIMUM_SIZE - self.unpacked)
        self.folders.append(folder)
        self.unpacked += folder.size
        return folder.path


class Reader:
    """Reads the SSD at one place, as the system whose full name, with a dot behind it, is ``prefix``."""

    def __init__(self, place: Place, session: Session, prefix: str = "", depth: int = 0) -> None:
        self.place = place
        self.session = session
        self.prefix = prefix
        self.depth = depth
        self.root = parse(place.ssd, place.name, f"{SSD}SystemStructureDescription")
        self.definitions = Definitions.of(self.root, SSD)

    def block(self) -> Block:
        """The outermost system of the file."""
        self.session.annotations += annotated(self.root, self.prefix)
        return self._block(inside(self.root, f"{SSD}System"), self.prefix, self.depth)

    def _block(self, system: Element, prefix: str, depth: int) -> Block:
        elements: list[Component | Block | Reference] = []
        values: list[ParameterValue] = []
        for element in system.iterfind(f"{SSD}Elements/*"):
            with self._collecting(element):
                self.session.count()
                found = self._element(element, prefix, depth)
                elements.append(found)
                own = found.values if isinstance(found, Block) else self._bindings(element)
                values += [replace(value, name=f"{element.get('name')}.{value.name}") for value in own]
        values += self._bindings(system)
        wires = map(self._wire, system.iterfind(f"{SSD}Connections/{SSD}Connection"))
        return Block(system.get("name", ""), connectors(system, self.definitions), tuple(elements),
                     dict(self._dictionaries(system)), tuple(wires), tuple(values))

    def _collecting(self, element: Element) -> _Collecting:
        return _Collecting(self.session.problems, self.place.name, where(self.place.name, element))

    # Elements

    def _element(self, element: Element, prefix: str, depth: int) -> Component | Block | Reference:
        if element.tag == f"{SSD}SignalDictionaryReference":
            return Reference(element.get("name", ""), element.get("dictionary", ""),
                             connectors(element, self.definitions), where(self.place.name, element))
        if element.tag == f"{SSD}System" or element.get("type") in _NESTED:
            return self._nested(element, f"{prefix}{element.get('name')}.", depth + 1)
        return self._component(element, prefix)

    def _nested(self, element: Element, prefix: str, depth: int) -> Block:
        """The system that an element is, or refers to."""
        source = element.get("source", "")
        if depth > DEEPEST:
            raise SystemStructureError(f"system {prefix[:40]}...: systems lie more than {DEEPEST} deep in one another; "
                                       "does one contain itself?")
        if element.tag == f"{SSD}System":
            return self._block(element, prefix, depth)
        if source.startswith("#"):
            found = next((one for one in self.root.iter(f"{SSD}System") if one.get("id") == source[1:]), None)
            if found is None:
                raise SystemStructureError(f"system {prefix[:-1]}: no system has the id {source[1:]!r}")
            block = self._block(found, prefix, depth)
        else:
            place = self._place(source, element.get("type", ""))
            block = Reader(place, self.session, prefix, depth).block()
        # The bindings of the element come after those of the system that it refers to (SSP 2.0, 5.3.3).
        return replace(block, name=element.get("name", ""), values=(*block.values, *self._bindings(element)))

    def _place(self, source: str, kind: str) -> Place:
        """Where the SSD of another file lies."""
        file, _, variant = source.partition("#")
        relative = self._inside(file)
        label = self.place.label(relative)
        if kind == _NESTED[0]:
            return Place(self.place.folder / relative, label, self.place.archive)
        ssd = self.session.unpack(self.place.folder / relative, label) / self._inside(variant or "SystemStructure.ssd")
        if not ssd.is_file():
            raise SystemStructureError(f"{label}: holds no {ssd.name}")
        return Place(ssd, f"{label}: {ssd.name}", label)

    def _component(self, element: Element, prefix: str) -> Component:
        """The component; without a file where the problems tell why, so that the rest can be looked at too."""
        full = prefix + element.get("name", "")
        self.session.names.append(full)
        fmu, label = Path(), ""
        with self._collecting(element):
            fmu, label = self._fmu(element, full)
        return Component(full, fmu, connectors(element, self.definitions), label)

    def _fmu(self, element: Element, full: str) -> tuple[Path, str]:
        """The FMU of a component, and what people call it."""
        kind, implementation = element.get("type", FMU_TYPE), element.get("implementation", "any")
        if kind != FMU_TYPE or implementation not in ("any", "CoSimulation"):
            what = {"ModelExchange": "model exchange"}.get(implementation, implementation) if kind == FMU_TYPE else kind
            raise SystemStructureError(f"component {full!r} is {what}; only FMUs for co-simulation can be run")
        if full in self.session.replace:
            fmu = self.session.replace[full]
            if not fmu.is_file():
                raise SystemStructureError(f"component {full!r} cannot be replaced: {fmu}: no such file")
            return fmu, str(fmu)
        if element.get("source") is None:
            raise SystemStructureError(f"component {full!r} names no source; give it an FMU")
        try:
            source = self._inside(element.get("source", ""))
            fmu = self.session.locate(source, self.place.folder)
        except CosimError as error:
            raise SystemStructureError(f"component {full!r}: {error}") from None
        if fmu == self.place.folder / source:
            return fmu, self.place.label(source)
        if self.place.archive:
            self.session.notes.append(f"{self.place.archive} holds no {source}; component {full!r} runs {fmu}")
        return fmu, str(fmu)

    def _dictionaries(self, system: Element) -> Iterator[tuple[str, dict[str, Connector]]]:
        for element in system.iterfind(f"{SSD}SignalDictionaries/{SSD}SignalDictionary"):
            with self._collecting(element):
                root, _ = self._content(element, element, SSB, "SignalDictionary")
                definitions = Definitions.of(root, SSB).within(self.definitions)
                entries = (connector(entry, definitions) for entry in root.iterfind(f"{SSB}DictionaryEntry"))
                yield element.get("name", ""), {entry.name: entry for entry in entries}

    def _wire(self, element: Element) -> Wire:
        start, end = (
            End(element.get(f"{end}Element", ""), element.get(f"{end}Connector", ""),
                tuple(map(int, element.get(f"{end}Indices", "").split()))) for end in ("start", "end"))
        return Wire(start, end, transformation(element), where(self.place.name, element))

    # Parameters

    def _bindings(self, element: Element) -> list[ParameterValue]:
        """The values that are bound to an element, under their names in it."""
        values: list[ParameterValue] = []
        for binding in element.iterfind(f"{SSD}ParameterBindings/{SSD}ParameterBinding"):
            with self._collecting(binding):
                prefix = binding.get("prefix", "")
                holder = binding.find(f"{SSD}ParameterValues")
                root, name = self._content(binding, holder, SSV, "ParameterSet")
                found: Iterator[ParameterValue] | tuple[ParameterValue, ...]
                found = tuple(replace(value, name=prefix + value.name)
                              for value in parameter_values(root, name, self.definitions))
                mapping = binding.find(f"{SSD}ParameterMapping")
                if mapping is not None:
                    found = mapped(found, mappings(self._content(mapping, mapping, SSM, "ParameterMapping")[0]))
                values += found
        return values

    def _content(self, element: Element, holder: Element | None, namespace: str, tag: str) -> tuple[Element, str]:
        """What an element names by its ``source`` or holds itself, and what it is called in messages."""
        source = element.get("source")
        if source is None:
            found = None if holder is None else holder.find(namespace + tag)
            if found is None:
                raise SystemStructureError(f"a binding without values: neither a source nor a {tag}")
            validate(found, self.place.name)
            return found, self.place.name
        file = self._file(element, source)
        return parse(file, where(self.place.name, element) + f": {source}", namespace + tag), unquote(source)

    def _file(self, element: Element, source: str) -> Path:
        """The file of a source: beside the SSD, or inside of the component that it belongs to."""
        if element.get("sourceBase", "SSD") == "SSD":
            return self.place.folder / self._inside(source)
        owner = next(one for one in element.iterancestors() if one.tag in (f"{SSD}Component", f"{SSD}System"))
        archive = self._inside(owner.get("source", ""))
        return self.session.unpack(self.place.folder / archive, self.place.label(archive)) / self._inside(source)

    def _inside(self, uri: str) -> str:
        """The relative path that a URI names, which stays inside of the SSD's folder."""
        path = unquote(uri)
        parts = PurePosixPath(path)
        if parts.is_absolute() or ".." in parts.parts or set(path) & set(":\\\0") or not parts.parts:
            raise SystemStructureError(f"source {uri!r} is not a path inside of the SSD's folder; "
                                       "put the file beside the SSD and name it relative to it")
        return str(parts)


class _Collecting:
    """Notes what goes wrong in one element, so that all problems are told at once."""

    def __init__(self, problems: list[str], file: str, origin: str) -> None:
        self.problems = problems
        self.file = file
        self.origin = origin

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> bool:
        if not isinstance(error, CosimError):
            return False
        for problem in getattr(error, "problems", None) or [str(error)]:
            self.problems.append(problem if problem.startswith(self.file) else f"{self.origin}: {problem}")
        return True
