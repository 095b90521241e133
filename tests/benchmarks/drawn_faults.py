"""The faults of the library with drawn severities, on a lathe with drawn parameters.

Every fault of ``models/faults`` is drawn from a range around its own parameters; where a thread gets a fault of the
control and a mechanical one, the two are drawn one after the other and put on the same machine.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from threadpitch.cosim.values import Given
from threadpitch.faults import NONE, read_fault

Parameters = dict[str, Given]
Draw = np.random.Generator

SCREW_LEAD = 10e-3  # m
COUNTS = (1024, 2048, 2500, 5000)  # lines of the spindle's encoder


@dataclass(frozen=True)
class Workshop:
    """What is drawn of the machine and its thread; lengths in m."""

    lead: float
    speed_rpm: float
    length: float
    parameters: Parameters


def workshop(draw: Draw) -> Workshop:
    """A thread of 10 to 40 turns on the shipped lathe with other gains, encoder, speed and probed flank."""
    lead = float(draw.choice([1.0, 1.5, 2.0])) * 1e-3
    speed, length = float(draw.uniform(300.0, 650.0)), float(draw.uniform(20e-3, 40e-3))
    lines = int(draw.choice(COUNTS))
    given: Parameters = {
        "controller.lead": lead, "nominal_pitch.pitch_target": lead, "actual_pitch.pitch_target": lead,
        "controller.commanded_speed": f"{speed}rpm", "controller.z_end": -length,
        "z_drive.position_gain": float(draw.uniform(35.0, 80.0)),
        "spindle.initial_angle": float(draw.uniform(0.0, 6.28)),
        "spindle.encoder_lines": lines, "controller.counts_per_turn": 4.0 * lines,
        "cutting.probed_flank": str(draw.choice(["middle", "negative_z", "positive_z"])),
    }
    return Workshop(lead, speed, length, given)


def between(draw: Draw, least: float, most: float) -> float:
    """On a logarithmic scale."""
    return math.exp(draw.uniform(math.log(least), math.log(most)))


def spindle_dip(draw: Draw, shop: Workshop) -> Parameters:
    """The weaker the speed loop, the deeper the dip at the entry."""
    return {"spindle.speed_gain": between(draw, 0.3, 1.2), "spindle.integral_gain": between(draw, 0.2, 1.0),
            "spindle.initial_speed": f"{shop.speed_rpm}rpm",
            "controller.x_thread": float(draw.uniform(9.45e-3, 9.7e-3))}


def belt_ripple(draw: Draw, shop: Workshop) -> Parameters:
    """Another belt, of any order that is not whole."""
    return {"spindle.ripple_amplitude": [between(draw, 4.0, 40.0), 0.0, 0.0, 0.0],
            "spindle.ripple_order": [float(draw.uniform(0.08, 0.92)), 1.0, 1.0, 1.0],
            "spindle.ripple_phase": [float(draw.uniform(0.0, 6.28)), 0.0, 0.0, 0.0]}


def low_gain(draw: Draw, shop: Workshop) -> Parameters:
    """A feed that follows late, and a small ripple."""
    return {"spindle.ripple_amplitude": [between(draw, 2.0, 10.0), 0.0, 0.0, 0.0],
            "spindle.ripple_order": [float(draw.uniform(0.1, 0.5)), 1.0, 1.0, 1.0],
            "z_drive.position_gain": float(draw.uniform(8.0, 20.0))}


def saturation(draw: Draw, shop: Workshop) -> Parameters:
    """A torque limit a little above what friction takes."""
    return {"z_drive.torque_limit": float(draw.uniform(0.42, 0.6))}


def short_start(draw: Draw, shop: Workshop) -> Parameters:
    """An exponential start, slow or fast, and an approach that is short for it."""
    start = float(draw.uniform(0.5e-3, 2e-3))
    return {"controller.start_time_constant": between(draw, 0.05, 0.15), "controller.z_start": start,
            "z_drive.initial_position": start}


def screw_lead_error(draw: Draw, shop: Workshop) -> Parameters:
    """Too long or too short a screw."""
    return {"z_drive.lead_slope": float(draw.choice([-1.0, 1.0])) * between(draw, 1e-3, 8e-3)}


def periodic_screw_error(draw: Draw, shop: Workshop) -> Parameters:
    """A screw that wobbles."""
    return {"z_drive.lead_amplitude": between(draw, 4e-6, 40e-6), "z_drive.lead_phase": float(draw.uniform(0.0, 6.28))}


def backlash(draw: Draw, shop: Workshop) -> Parameters:
    """Play that the chip pulls the table across where the tool enters."""
    return {"z_drive.backlash": between(draw, 20e-6, 150e-6)}


def loose_nut(draw: Draw, shop: Workshop) -> Parameters:
    """An axial stiffness that is far too low."""
    return {"z_drive.axial_stiffness": between(draw, 1.5e6, 8e6)}


def thin_section(draw: Draw, shop: Workshop) -> Parameters:
    """Anywhere in the thread, more or less yielding."""
    return {"cutting.thin_position": -float(draw.uniform(0.3, 0.8)) * shop.length,
            "cutting.thin_length": float(draw.uniform(3e-3, 10e-3)),
            "cutting.thin_stiffness": between(draw, 0.3e6, 3e6),
            "cutting.probed_flank": str(draw.choice(["negative_z", "positive_z"]))}


def hard_spot(draw: Draw, shop: Workshop) -> Parameters:
    """Anywhere in the thread, at the start angle that is measured; the tool gives way."""
    return {"cutting.spot_position": -float(draw.uniform(0.2, 0.9)) * shop.length, "cutting.spot_length": shop.lead,
            "cutting.spot_factor": between(draw, 4.0, 20.0), "cutting.tool_radial_stiffness": between(draw, 10e6, 40e6),
            "cutting.probed_flank": str(draw.choice(["negative_z", "positive_z"]))}


def thermal_growth(draw: Draw, shop: Workshop) -> Parameters:
    """A workpiece that is warm, or warms up on the way."""
    return {"cutting.temperature_rise": between(draw, 80.0, 400.0),
            "cutting.thermal_time_constant": float(draw.choice([0.0, 1.0])) * between(draw, 0.5, 5.0)}


def missed_counts(draw: Draw, shop: Workshop) -> Parameters:
    """Too few or too many counts in every turn."""
    return {"spindle.missed_counts": int(draw.choice([-1, 1])) * int(np.ceil(between(draw, 4.0, 60.0)))}


def eccentric(draw: Draw, shop: Workshop) -> Parameters:
    """Repeats with every turn: cancels in P(n)."""
    return {"spindle.eccentricity": f"{between(draw, 0.05, 0.5)}deg"}


def nothing(draw: Draw, shop: Workshop) -> Parameters:
    """Nothing is wrong."""
    return {}


OF_THE_CONTROL: dict[str, Callable[[Draw, Workshop], Parameters]] = {
    "spindle_dip": spindle_dip, "belt_ripple": belt_ripple, "low_gain": low_gain, "saturation": saturation,
    "short_start": short_start}
BEHIND_IT: dict[str, Callable[[Draw, Workshop], Parameters]] = {
    "screw_lead_error": screw_lead_error, "periodic_screw_error": periodic_screw_error, "backlash": backlash,
    "loose_nut": loose_nut, "thin_section": thin_section, "hard_spot": hard_spot, "thermal_growth": thermal_growth,
    "missed_counts": missed_counts}
WITHOUT_A_TRACE: dict[str, Callable[[Draw, Workshop], Parameters]] = {
    "encoder_eccentricity": eccentric, NONE: nothing}
KINDS = {"control": (OF_THE_CONTROL,), "mechanical": (BEHIND_IT,), "both": (OF_THE_CONTROL, BEHIND_IT),
         "none": (WITHOUT_A_TRACE,)}


def drawn_faults(kind: str, draw: Draw, shop: Workshop) -> tuple[str, Parameters]:
    """(names, parameters) of one fault from each part of the library that the kind asks for."""
    names, given = [], {**read_fault(NONE).parameters, **shop.parameters}
    for part in KINDS[kind]:
        name = str(draw.choice(list(part)))
        names.append(name)
        given |= {**read_fault(name).parameters, **part[name](draw, shop)}
    return " + ".join(names), given
