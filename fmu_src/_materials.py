"""Specific cutting force of workpiece materials: k_c = k_c1 (h / 1 mm)^-m_c, h the thickness of the chip.

Values of the material groups of a catalogue for turning (ISCAR): typical of the group, for a sharp tool.
"""

from threadpitch.fmu.elementary import exp, log

CUSTOM = 0
C15 = 1
C45 = 2
C42CRMO4 = 3
X5CRNI18_10 = 4
GJL_250 = 5
ALMGSI1 = 6
TI6AL4V = 7
MILLIMETRE = 1e-3


def catalogue_force(material: int) -> float:
    """k_c1 in N/m2: the specific force for a chip 1 mm thick."""
    if material == C15:  # unalloyed steel below 0.25 % carbon
        return 1350e6
    if material == C45:  # unalloyed steel from 0.25 % carbon on, annealed
        return 1500e6
    if material == C42CRMO4:  # low-alloy steel, annealed
        return 1775e6
    if material == X5CRNI18_10:  # austenitic stainless steel
        return 2150e6
    if material == GJL_250:  # grey cast iron
        return 1225e6
    if material == ALMGSI1:  # wrought aluminium
        return 700e6
    return 2110e6  # titanium alloy


def catalogue_exponent(material: int) -> float:
    """m_c: how the specific force rises as the chip becomes thin."""
    if material == C15:
        return 0.21
    if material == X5CRNI18_10:
        return 0.20
    if material == C42CRMO4:
        return 0.24
    if material == GJL_250:
        return 0.25
    if material == ALMGSI1:
        return 0.25
    return 0.22  # C45 and the titanium alloy


def specific_force(force: float, exponent: float, thickness: float) -> float:
    """k_c = k_c1 (h / 1 mm)^-m_c."""
    return force * exp(-exponent * log(thickness / MILLIMETRE))
