"""The workpiece: its surface, how it yields, where it is hard, and how it grows."""

from dataclasses import dataclass
from math import floor

from threadpitch.fmu.elementary import cos, exp
from threadpitch.fmu.variable import input_, parameter

from ._groove_memory import TURN, GrooveMemory

OUTSIDE = 0
INSIDE = 1


def hump(distance: float, length: float) -> float:
    """(1 + cos(2 pi d / length)) / 2: from 1 in the middle to 0 half a length beside it; its mean is one half."""
    if length <= 0.0 or abs(distance) >= 0.5 * length:
        return 0.0
    return 0.5 + 0.5 * cos(TURN * distance / length)


@dataclass
class Workpiece(GrooveMemory):
    """A bar in a chuck, at Z = chuck_position; z in the workpiece is counted at the reference temperature.

    1 / K(a) = 1 / K_chuck + (a / L)^3 / K_face + hump / K_thin     radial, a from the chuck, L from there to the face
    slope under a radial force F = 3/2 a^2 / L^3 F / K_face         a cantilever; turns the surface by slope * radius
    z_w = z - (z - z_chuck) alpha dT / (1 + alpha dT),  dT = temperature_rise (1 - exp(-t / thermal_time_constant))
    """

    spindle_angle: float = input_("rad", "True spindle angle", display="deg")

    thread_side: int = parameter("1", "External or internal thread", start=OUTSIDE, choices={
        "external": 0, "internal": 1})
    surface_radius: float = parameter("m", "Radius of the workpiece's surface at the face", start=0.010, display="mm",
                                      min=1e-4, max=10.0)
    taper: float = parameter("1", "Growth of the surface's radius along Z", start=0.0, min=-1.0, max=1.0)
    shoulder: float = parameter("m", "Z where the material ends: relief groove or shoulder", start=-1.0, display="mm")
    chuck_position: float = parameter("m", "Z of the chuck: there the workpiece is held and grows from", start=-0.060,
                                      display="mm")
    chuck_stiffness: float = parameter("N/m", "Stiffness of spindle and chuck", start=60e6, display="N/um", min=1e5,
                                       nominal=1e8)
    bending_stiffness: float = parameter("N/m", "Bending stiffness of the workpiece at its face: 3 E I / L^3",
                                         start=23e6, display="N/um", min=1e5, nominal=1e7)
    thin_position: float = parameter("m", "Z of the middle of a thin section", start=-0.015, display="mm")
    thin_length: float = parameter("m", "Length of the thin section; 0 = none", start=0.0, display="mm", min=0.0)
    thin_stiffness: float = parameter("N/m", "Its stiffness in the middle, radial and axial", start=20e6,
                                      display="N/um", min=1e5, nominal=1e7)
    spot_angle: float = parameter("rad", "Hard spot or foreign matter: angle of its middle", start=0.0, display="deg")
    spot_width: float = parameter("rad", "Its width around the workpiece", start=0.6981317007977318, display="deg",
                                  min=0.0, max=6.283185307179587)
    spot_position: float = parameter("m", "Z of its middle", start=-0.015, display="mm")
    spot_length: float = parameter("m", "Its length along Z; 0 = none", start=0.0, display="mm", min=0.0)
    spot_factor: float = parameter("1", "Specific cutting force in its middle, over that of the material", start=2.0,
                                   min=0.0, max=100.0)
    thermal_expansion: float = parameter("1/K", "Thermal expansion alpha of the workpiece", start=11.5e-6,
                                         display="um/m/K", min=0.0, max=1e-3)
    temperature_rise: float = parameter("K", "Temperature that the workpiece comes to, above the reference of "
                                             "20 degrees Celsius", start=0.0, min=-50.0, max=500.0)
    thermal_time_constant: float = parameter("s", "Time constant of its rise; 0 = warm from the start", start=0.0,
                                             min=0.0)

    def _sense(self) -> float:
        """+1 where the tool cuts from outside, towards smaller radii."""
        if self.thread_side == INSIDE:
            return -1.0
        return 1.0

    def _surface(self, z: float) -> float:
        """Radius of the surface."""
        return self.surface_radius + self.taper * (z - self.face)

    def _cold(self, z: float, time: float) -> float:
        """The same place of the workpiece at the reference temperature."""
        rise = self.temperature_rise
        if self.thermal_time_constant > 0.0:
            rise = rise * (1.0 - exp(-time / self.thermal_time_constant))
        growth = self.thermal_expansion * rise
        return z - (z - self.chuck_position) * growth / (1.0 + growth)

    def _thin_yield(self, z: float) -> float:
        """1 / K of the thin section."""
        return hump(z - self.thin_position, self.thin_length) / self.thin_stiffness

    def _radial_yield(self, z: float) -> float:
        """1 / K(a) where the tool is."""
        length = self.face - self.chuck_position
        share = 0.0
        if length != 0.0:
            share = max(0.0, (z - self.chuck_position) / length)
        return 1.0 / self.chuck_stiffness + share * share * share / self.bending_stiffness + self._thin_yield(z)

    def _bending_slope(self, z: float) -> float:
        """Slope of the bent workpiece where the tool is, per radial force."""
        length = self.face - self.chuck_position
        if length == 0.0:
            return 0.0
        share = max(0.0, (z - self.chuck_position) / length)
        return 1.5 * share * share / length / self.bending_stiffness

    def _hardness(self, z: float) -> float:
        """Specific cutting force over that of the material: 1 + (factor - 1) hump(angle) hump(z)."""
        if self.spot_length <= 0.0:
            return 1.0
        turns = (self.spindle_angle - self.spot_angle) / TURN
        beside = (turns - floor(turns + 0.5)) * TURN
        return 1.0 + (self.spot_factor - 1.0) * hump(beside, self.spot_width) * hump(z - self.spot_position,
                                                                                     self.spot_length)
