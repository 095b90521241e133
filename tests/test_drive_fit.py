"""Drive parameters out of recordings: what made them is found, within the uncertainty that is stated."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import Command
from threadpitch.drive_fit import DriveFit, FitError, fit, read_fit

LOGS = Path(__file__).parent.parent / "models" / "logs" / "linuxcnc"
COLUMNS = {"time": "time_s", "command": "z_cmd_mm", "position": "z_fb_mm"}
PERIOD = 1e-3


def recorded(gain: float, lag: float, feedforward: float, *, seed: int = 0, noise: float = 2e-7,
             rows: int = 3000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A thread's feed under a rippled spindle, stepped by the loop as it is written down, with noise; s, m."""
    random = np.random.default_rng(seed)
    time = PERIOD * np.arange(rows)
    speed = 0.0125 * (1.0 + 0.05 * np.sin(9.0 * time) + 0.03 * np.sin(60.0 * time))
    speed[:100] *= np.linspace(0.0, 1.0, 100)
    speed[rows // 2:rows // 2 + 300] = 0.0
    command = np.cumsum(speed) * PERIOD
    position, velocity = np.zeros(rows), 0.0
    keep = np.exp(-PERIOD / lag) if lag > 0.0 else 0.0
    for k in range(rows - 1):
        ahead = (command[k] - command[k - 1]) / PERIOD if k else 0.0
        velocity = keep * velocity + (1.0 - keep) * (gain * (command[k] - position[k]) + feedforward * ahead)
        position[k + 1] = position[k] + PERIOD * velocity
    return time, command, position + noise * random.standard_normal(rows)


@pytest.mark.parametrize(("gain", "lag", "feedforward"), [(50.0, 0.0045, 0.0), (33.0, 0.012, 0.4), (120.0, 0.002, 0.9)])
def test_without_noise_the_truth_is_found(gain: float, lag: float, feedforward: float) -> None:
    found = fit(*recorded(gain, lag, feedforward, noise=0.0), free=("gain", "lag", "feedforward"))
    assert (found.gain, found.lag, found.feedforward) == pytest.approx((gain, lag, feedforward), rel=1e-4)
    assert found.residual < 1e-10


def noisy(kind: str, rows: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, command, position of 50 1/s and 4.5 ms; the position is measured with noise of this kind."""
    time, command, position = recorded(50.0, 0.0045, 0.0, noise=0.0, rows=rows)
    drawn = np.random.default_rng(seed)
    if kind == "counted":  # counts that begin anywhere
        place = drawn.random()
        return time, command, (np.round(position / 5e-7 + place) - place) * 5e-7
    noise = drawn.standard_normal(rows + 49)
    noise = np.convolve(noise, np.ones(50) / 50.0, "valid") if kind == "slow" else noise[:rows]
    return time, command, position + 2e-7 * noise / noise.std()


@pytest.mark.parametrize(("kind", "rows"), [("white", 1200), ("slow", 3000)])
def test_the_uncertainty_is_what_it_says(kind: str, rows: int) -> None:
    """Of forty recordings the errors, divided by their uncertainties, scatter by one.

    ``python -m tests.benchmarks.bench_fit`` has more of them, and of other kinds.
    """
    errors = []
    for seed in range(40):
        found = fit(*noisy(kind, rows, seed))
        told = found.uncertainty
        errors.append([(found.gain - 50.0) / told["gain"], (found.lag - 0.0045) / told["lag"]])
    scatter = np.std(errors, axis=0)
    assert np.all(scatter > 0.7)
    assert np.all(scatter < 1.4)
    assert np.all(np.mean(np.abs(errors) < 1.96, axis=0) > 0.87)


def test_slow_noise_is_more_uncertain_than_fast_noise() -> None:
    time, command, position = recorded(50.0, 0.0045, 0.0, noise=0.0)
    white = np.random.default_rng(1).standard_normal(time.size)
    slow = np.convolve(white, np.ones(50) / 50.0, "same")
    uncertainty = [fit(time, command, position + 2e-7 * noise / noise.std()).uncertainty["gain"]
                   for noise in (white, slow)]
    assert uncertainty[1] > 2.0 * uncertainty[0]


@pytest.mark.parametrize("log", ["C_ripple_500", "H_droop_500"])
def test_the_gain_of_linuxcnc(log: str) -> None:
    """Its position controller has 50 1/s and no feedforward, in front of a velocity loop that keeps 0.8 a period."""
    found = read_fit(LOGS / f"{log}.csv.gz", COLUMNS)
    assert found.gain == pytest.approx(50.0, rel=1e-4)
    assert found.lag == pytest.approx(-PERIOD / np.log(0.8), rel=1e-3)
    assert found.residual < 3e-8  # the log counts in 0.1 um
    alone = read_fit(LOGS / f"{log}.csv.gz", COLUMNS, free=("gain",))
    assert alone.gain == pytest.approx(50.0, rel=0.02)
    assert alone.uncertainty["gain"] > 100.0 * found.uncertainty["gain"]


def test_what_a_recording_does_not_tell_is_refused() -> None:
    with pytest.raises(FitError, match="the position follows at once"):
        read_fit(LOGS / "A_ideal_500.csv.gz", COLUMNS)
    time, command, position = recorded(50.0, 0.0045, 0.0)
    for wrong, why in ((("gian",), "no parameter"), (("lag",), "neither free nor known"), ((), "nothing to fit")):
        with pytest.raises(FitError, match=why):
            fit(time, command, position, free=wrong)
    with pytest.raises(FitError, match="too few"):
        fit(time[:20], command[:20], position[:20])
    with pytest.raises(FitError, match="not evenly spaced"):
        fit(np.delete(time, 700), np.delete(command, 700), np.delete(position, 700))
    with pytest.raises(FitError, match="does not change"):
        fit(time, 0.0 * command, position)
    with pytest.raises(FitError, match="numbers in every row"):
        fit(time, command, position + np.nan)
    with pytest.raises(FitError, match="one length"):
        fit(time, command[:-1], position)
    noise = np.random.default_rng(1).standard_normal(time.size)
    with pytest.raises(FitError, match="does not tell the gain"):
        fit(time, 1e-9 * command / command.max(), 1e-6 * noise)


def test_known_parameters_stay() -> None:
    found = fit(*recorded(50.0, 0.0045, 0.6), free=("gain",), known={"lag": 0.0045, "feedforward": 0.6})
    assert isinstance(found, DriveFit)
    assert found.gain == pytest.approx(50.0, abs=4.0 * found.uncertainty["gain"])
    assert set(found.uncertainty) == {"gain"}


def test_command(threadpitch: Command, workplace: Path) -> None:
    log = LOGS / "C_ripple_500.csv.gz"
    options = ["--command", "z_cmd_mm", "--position", "z_fb_mm", "--time", "time_s"]
    told = threadpitch("fit", log, *options, "--parameters", "drive.toml", "--json")
    assert json.loads(told.out)["gain_per_s"] == pytest.approx(50.0, rel=1e-4)
    assert Path("drive.toml").read_text(encoding="utf-8").startswith("[z_drive]\nposition_gain = 49.99")
    for arguments, why in ((["--known", "lagg=1"], "no parameter"), (["--free", "gain", "lagg"], "no parameter"),
                           (["--known", "lag"], "sets nothing"), (["--time", "nowhere"], "nowhere")):
        refused = threadpitch("fit", log, *options[:4 if arguments[0] == "--time" else 6], *arguments)
        assert refused.status == 2
        assert why in refused.err
        assert refused.err.count("\n") == 1
