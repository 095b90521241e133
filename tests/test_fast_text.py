"""Text that pyarrow reads gives the bits, the notes and the messages of the reader of rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from threadpitch.pitch import stream_pitches
from threadpitch.trace import ColumnChoice, fast_text, text_rows
from threadpitch.trace.text_head import Head
from threadpitch.trace.text_rows import Text

pytest.importorskip("pyarrow.csv", reason="pyarrow is not installed: all text is read row by row")


def table(rows: int, separator: str = ",", comma: bool = False) -> str:
    random = np.random.default_rng(5)
    lines = [separator.join(("time", "spindle revs", "z [mm]", "pass"))]
    for k in range(rows):
        revs = k / 37.0 + 1e-3 * random.normal()
        fields = [f"{k / 1000:.3f}", repr(revs), f"{-1.5 * revs:.17g}", "0" if k % 900 > 800 else f"{1 + k // 900}"]
        lines.append(separator.join(field.replace(".", ",") if comma else field for field in fields))
    return "\n".join(lines) + "\n"


TEXTS = {"comma": table(2500), "semicolon": table(2500, ";"), "decimal comma": table(2500, ";", comma=True),
         "tab": table(2500, "\t"), "blanks": "# made by hand\n" + table(2500, "  ").replace("  ", " \t ").replace(
             "spindle revs", "revs").replace("z [mm]", "z_mm")}


def outcome(path: Path) -> str:
    """The bits of all pitches and the notes, or the message."""
    try:
        groups = stream_pitches(path, ColumnChoice(), (0.0, 1.0))
    except ValueError as error:
        return str(error)
    return repr([(one.label, one.table.pitch.tobytes(), one.table.crossings.tobytes(), one.table.notes)
                 for one in groups])


@pytest.mark.parametrize("name", TEXTS)
def test_long_texts_are_read_by_pyarrow_with_the_same_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                           name: str) -> None:
    monkeypatch.setattr(text_rows, "_LOOKED_AT", 2000)
    path = tmp_path / "log.csv"
    path.write_text(TEXTS[name])
    taken: list[bool] = []
    reader = fast_text.columns_of

    def watched(*arguments: object) -> fast_text.Columns | None:
        found = reader(*arguments)  # type: ignore[arg-type] # handed on as they come
        taken.append(found is not None)
        return found

    monkeypatch.setattr(fast_text, "columns_of", watched)
    fast = outcome(path)
    assert taken
    assert all(taken)
    monkeypatch.setattr(fast_text, "columns_of", lambda *_: None)
    assert outcome(path) == fast
    assert "'3'" in fast


EDITS = ["\n", "\n\n", ",", ";", '"', "#", "%", "//", " ", "1_0", "nan", "nan(1)", "inf", "-", "+", "1e400", "0x1p3",
         "e5", "\t", "é", "\x0b", "\r", "١", "true", "1" * 400, "1." + "3" * 60]


@settings(deadline=None, max_examples=120, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_whatever_is_changed_in_a_text_both_readers_agree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                          data: st.DataObject) -> None:
    text = TEXTS[data.draw(st.sampled_from(sorted(TEXTS)))][:6000]
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(700, len(text)))
        text = text[:place] + data.draw(st.sampled_from(EDITS)) + text[place + data.draw(st.integers(0, 3)) :]
    path = tmp_path / "log.csv"
    path.write_text(text)
    with monkeypatch.context() as patch:
        patch.setattr(text_rows, "_LOOKED_AT", 600)
        patch.setattr(text_rows, "BLOCK", 1500)
        patch.setattr(fast_text, "LEAST", 0)
        fast = outcome(path)
        patch.setattr(fast_text, "_arrow", lambda: None)
        assert outcome(path) == fast


@pytest.mark.parametrize("number", ["1.7976931348623157e308", "4.9e-324", "2.2250738585072011e-308", "0.1", "1e23",
                                    "9007199254740993", "-0.0", "123456789.123456789123456789", ".5", "5."])
def test_numbers_are_those_of_python(monkeypatch: pytest.MonkeyPatch, number: str) -> None:
    monkeypatch.setattr(fast_text, "LEAST", 0)
    found = fast_text.columns_of(Text(f"{number},1\n", 1, 1), Head(["a", "b"], ["", ""], 1, 1, ","), [0], None)
    assert found is not None
    assert found.numbers[0].tobytes() == np.array([float(number)]).tobytes()
