"""Passes that meet the metal while their feed has hardly begun to move find the groove of the pass before."""

from __future__ import annotations

import numpy as np
import pytest

from threadpitch import lathe
from threadpitch.cosim.values import Given

SHORT: dict[str, Given] = {
    "controller.start_mode": "exponential", "controller.start_time_constant": 0.06, "controller.z_start": "0.3mm",
    "z_drive.initial_position": "0.3mm", "controller.z_end": "-9mm", "controller.cycle": "multiple",
    "controller.thread_height": "0.6mm", "controller.x_thread": "9.4mm", "controller.first_cut": "0.45mm",
    "controller.least_cut": 0.0, "controller.allowance": 0.0, "controller.finishing_passes": 0,
}


def test_the_second_pass_cuts_in_the_first_ones_groove(fmu_cache: None) -> None:
    """Flanks of the groove are the tool's own or those of the pass before, never those of another turn."""
    cut = lathe.simulate(parameters=SHORT, stop_time=3.5, start_angles=[0.0])
    second = (np.asarray(cut["controller.pass_number"]) == 2) & (np.asarray(cut["cutting.torque"]) > 0.0)
    assert second.sum() > 500
    beside = np.asarray(cut["cutting.groove_position"])[second] - np.asarray(cut["z_drive.position"])[second]
    assert np.abs(beside).max() < 0.1e-3
    chip, depth = np.asarray(cut["cutting.chip_area"])[second], np.asarray(cut["cutting.groove_depth"])[second]
    steady = np.asarray(cut["z_drive.position"])[second] < -2e-3
    assert chip[steady] == pytest.approx((0.6e-3**2 - 0.45e-3**2) * np.tan(np.pi / 6.0), rel=0.1)
    assert depth[steady] == pytest.approx(0.6e-3, abs=0.02e-3)
