"""What the tables say about the turns in the metal."""

from __future__ import annotations

import numpy as np
import pytest

from threadpitch.passes import Pass
from threadpitch.pitch import PitchTable, statistics
from threadpitch.tables import Layout, pass_text

PITCH = 1e-3 * np.array([[1.4, 1.5, 1.6, 1.5], [1.45, 1.55, 1.5, np.nan]])


@pytest.mark.parametrize(("in_metal", "told"), [
    ([[0, 1, 1, 1], [0, 1, 1, 1]], "turns in the metal, n = 2 to 4\n"),
    ([[0, 1, 1, 1], [0, 1, 1, 0]], "turns in the metal, 0 deg: n = 2 to 4; 90 deg: n = 2 to 3\n"),
    ([[0, 0, 1, 0], [0, 0, 0, 0]], "turns in the metal, 0 deg: n = 3 to 3; 90 deg: none\n"),
])
def test_effective_turns_of_every_start_angle_where_they_differ(in_metal: list[list[int]], told: str) -> None:
    flags = np.array(in_metal, dtype=np.bool_)
    table = PitchTable.of_pitches(PITCH, [0.0, np.pi / 2])
    effective = statistics(np.where(flags, PITCH, np.nan))
    one = Pass(1, 1, table, effective, PITCH - 1.5e-3, flags)
    text = pass_text(one, layout=Layout(width=120))
    assert told in text
    rows = text[text.index(told) :].splitlines()
    assert sum("theta_S" in row for row in rows) == 2
    if "none" in told:
        assert [field.strip() for field in rows[-2].split("|")[2:-1]] == ["-", "-", "-"]


def test_nothing_is_said_where_no_turn_is_in_the_metal() -> None:
    table = PitchTable.of_pitches(PITCH, [0.0, np.pi / 2])
    flags = np.zeros(PITCH.shape, dtype=np.bool_)
    one = Pass(1, 1, table, statistics(np.full(PITCH.shape, np.nan)), PITCH - 1.5e-3, flags)
    assert "Effective thread" not in pass_text(one)
