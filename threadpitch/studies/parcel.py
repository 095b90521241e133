"""A study on its way to workers: what was asked for, the system as it was read, and its FMUs by their content.

A worker needs neither the study's file nor the system's folder, nor a compiler: where it does not share the client's
disk it writes the FMUs into its own folder. Dask gives the parcel to workers that come later too, such as those in the
place of killed ones.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from threadpitch.cosim.system import System
from threadpitch.fmu.cache import write_file
from threadpitch.studies.definition import Document
from threadpitch.studies.evaluation import Evaluator


@dataclass(frozen=True)
class Parcel:
    """``digest`` tells what rows the client draws, ``components`` which FMUs it has, ``fmus`` what is in their files,
    by SHA-256; without that they lie where the client has them. ``system`` is None for a study of formulae.
    """

    document: Document
    digest: str
    components: Any
    system: System | None
    fmus: Mapping[str, bytes] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, evaluator: Evaluator, *, with_fmus: bool = False) -> Parcel:
        """That of a study whose system was read; ``with_fmus`` for workers that do not share this machine's disk.

        Raises:
            OSError: an FMU cannot be read.
        """
        system, study = evaluator.system, evaluator.study
        if system is not None:  # temporary folders stay here
            system = replace(system, folders=())
        fmus = {}
        if with_fmus and system is not None:
            contents = {path: path.read_bytes() for path in {one.fmu for one in system.components}}
            digests = {path: hashlib.sha256(content).hexdigest() for path, content in contents.items()}
            fmus = {digests[path]: content for path, content in contents.items()}
            system = replace(system, components=tuple(replace(one, fmu=Path(digests[one.fmu], one.fmu.name))
                                                      for one in system.components))
        return cls(study.document, study.digest, evaluator.describe().get("components"), system, fmus)

    def unpacked(self, folder: Path) -> Parcel:
        """The parcel with its FMUs as files in the folder: ``<SHA-256>/<name>.fmu``.

        Raises:
            OSError: the folder cannot be written.
        """
        if self.system is None or not self.fmus:
            return self
        components = tuple(replace(one, fmu=folder / one.fmu) for one in self.system.components)
        for path in {one.fmu for one in components}:
            write_file(path, self.fmus[path.parent.name])
        return replace(self, system=replace(self.system, components=components), fmus={})
