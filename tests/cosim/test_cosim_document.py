"""XML files: encodings that are not known, and bytes that are not of the encoding."""

from __future__ import annotations

from pathlib import Path

import pytest

from threadpitch.cosim.document import DocumentError, parse_document


@pytest.mark.parametrize(("encoding", "content", "message"), [
    ("NONSENSE", b"", r"is in an encoding that is not read \(unknown encoding: NONSENSE\); save it as UTF-8"),
    ("Shift_JIS", b"", r"is in an encoding that is not read \(multi-byte .*\); save it as UTF-8"),
    ("UTF-8", b"\n\xe4", r"line 2: is not XML: not well-formed .*; it may have another encoding"),
])
def test_encodings_that_are_not_known_or_not_kept(encoding: str, content: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "file.xml").write_bytes(f'<?xml version="1.0" encoding="{encoding}"?><a>'.encode() + content + b"</a>")
    with pytest.raises(DocumentError, match=message):
        parse_document(tmp_path / "file.xml")
