"""The cutting process: the chip that a pass really takes, its forces, and the groove that it leaves."""

from dataclasses import dataclass
from math import floor

from threadpitch.fmu.elementary import cos, sin
from threadpitch.fmu.variable import Experiment, Terminal, input_, output, parameter, state

from ._groove_memory import TURN
from ._materials import C45, CUSTOM, catalogue_exponent, catalogue_force, specific_force
from ._v_groove import area_between, groove_area, groove_moment
from ._workpiece import Workpiece

EXPERIMENT = Experiment(stop_time=2.0, step_size=1e-3)
TERMINALS = (
    Terminal("shaft", {"angle": "spindle_angle", "torque": "torque"}, "Spindle nose"),
    Terminal("z_tool", {"position": "tool_z", "force": "axial_force"}, "Z drive"),
    Terminal("x_tool", {"position": "tool_x", "force": "radial_force"}, "X drive"),
    Terminal("cut", {"angle": "spindle_angle", "position": "groove_position", "threading": "threading"},
             "Spindle and groove"),
)
ERRORS = {
    1: "shoulder must not be at the face: it is where the material ends",
}
MIDDLE = 0  # values of probed_flank
ITERATIONS = 40
SETTLED = 1e-13  # m; deflections that change by less are found


@dataclass
class ThreadCutting(Workpiece):
    """Forces of a V tool in the groove that former passes left, and the flanks that it leaves. SI units, x as radius.

    F_c = A (s_1 k_c(h_1) + s_2 k_c(h_2)),  k_c = k_c1 (h / 1 mm)^-m_c,  torque = F_c r    r: centroid of the chip
    A = area of the tool's V in the material, less what of it the former passes have left empty
    h_1, h_2 = cos(e / 2) (shift of the flank along Z)           chips of the flanks towards -Z and +Z, s_i = h_i / sum
    axial force = q (F_2 - F_1) cos(e / 2),  radial force = -q (F_1 + F_2) sin(e / 2)       q = thrust_ratio, F_i = F_c
    groove: z = z_w + F_z / K_axial - slope r,  depth = surface - x - F_r (1 / K_radial + 1 / K)

    e is the angle of the profile. For radial infeed by dh: h_1 = h_2 = dh sin(e / 2); for flank infeed one flank takes
    2 dh sin(e / 2); the first chip has both. Forces count against the positive direction of their axis, as loads of
    its drive. The deflections follow the forces at once; the flanks of the groove are the outermost ones of all passes.
    Deflection normal to one flank moves that flank by F_i q (1 / K) / cos(e / 2), and the middle by half of it or, when
    both flanks yield alike, not at all: measure a flank (probed_flank) to see it.
    Only while threading metal is cut: after it the tool is taken to be in a relief groove. A sharp tip is supposed.
    """

    tool_z: float = input_("m", "True Z position of the tool", start=-0.01, display="mm")
    tool_x: float = input_("m", "True X position of the tool's tip, radius", start=0.0097, display="mm")
    threading: bool = input_("1", "The thread is being cut", start=False)

    torque: float = output("N.m", "Torque of the cutting force, braking the spindle when positive")
    axial_force: float = output("N", "Force on the tool against positive Z: load of the Z drive")
    radial_force: float = output("N", "Force on the tool against positive X: load of the X drive")
    cutting_force: float = output("N", "Cutting force F_c, tangential")
    groove_position: float = output("m", "Z of the groove where the tool is, as it is probed", display="mm")
    flank_position: list[float] = output("m", "Z where the groove's flanks meet the surface: towards -Z, towards +Z",
                                         display="mm", size=2)
    chip_thickness: list[float] = output("m", "Thickness of the chip at the flank towards -Z and towards +Z: where it "
                                              "is 0 a former pass has left the flank", display="um", size=2)
    chip_area: float = output("m2", "Cross-section A of the chip", display="mm2")
    groove_depth: float = output("m", "Depth of the tool's tip below the surface", display="mm")

    material: int = parameter("1", "Material of the workpiece", start=C45, choices={
        "custom": 0, "c15": 1, "c45": 2, "42crmo4": 3, "x5crni18_10": 4, "gjl_250": 5, "almgsi1": 6, "ti6al4v": 7})
    specific_cutting_force: float = parameter("N/m2", "k_c1 of a custom material", start=1500e6, display="N/mm2",
                                              min=0.0, nominal=1e9)
    chip_exponent: float = parameter("1", "m_c of a custom material", start=0.25, min=0.0, max=0.9)
    profile_angle: float = parameter("rad", "Included angle e of thread and tool", start=1.0471975511965976,
                                     display="deg", min=0.1, max=2.5)
    probed_flank: int = parameter("1", "What groove_position tells: the middle, or a flank: towards -Z, +Z",
                                  start=MIDDLE, choices={"middle": 0, "negative_z": 1, "positive_z": 2})
    thrust_ratio: float = parameter("1", "Force normal to a flank over its cutting force", start=0.5, min=0.0, max=3.0)
    tool_axial_stiffness: float = parameter("N/m", "Axial stiffness of tool and holder", start=50e6, display="N/um",
                                            min=1e5, nominal=1e7)
    tool_radial_stiffness: float = parameter("N/m", "Radial stiffness of tool and holder", start=80e6, display="N/um",
                                             min=1e5, nominal=1e7)

    flank_tangent: float = state("1", "tan(e / 2)", discrete=True)
    flank_cosine: float = state("1", "cos(e / 2)", discrete=True)
    flank_sine: float = state("1", "sin(e / 2)", discrete=True)
    unit_force: float = state("N/m2", "k_c1", display="N/mm2", discrete=True)
    exponent: float = state("1", "m_c", discrete=True)
    was_threading: bool = state("1", "Threading at the former communication point", start=False)
    former_angle: float = state("rad", "Spindle angle at the former communication point", display="deg")
    former_z: float = state("m", "Place of the tool there, in the workpiece", display="mm")
    former_place: float = state("1", "Angle along the helix there, in points of the groove; -1: not in the metal",
                                start=-1.0)
    tool_low: float = state("m", "Where the tool's V begins at the surface", display="mm")
    tool_high: float = state("m", "Where it ends", display="mm")
    axial_shift: float = state("m", "Deflection along Z, of the tool less that of the workpiece", display="um")
    radial_shift: float = state("m", "Deflection that makes the groove less deep", display="um")
    chip_radius: float = state("m", "Radius at which the chip's centroid is", display="mm")

    def check(self) -> int:
        """1 when there is no material, otherwise 0."""
        if self.shoulder == self.face:
            return 1
        return 0

    def initialize(self) -> None:
        """A smooth workpiece; the tool is where it is."""
        half = 0.5 * self.profile_angle
        self.flank_sine = sin(half)
        self.flank_cosine = cos(half)
        self.flank_tangent = self.flank_sine / self.flank_cosine
        self.unit_force = self.specific_cutting_force
        self.exponent = self.chip_exponent
        if self.material != CUSTOM:
            self.unit_force = catalogue_force(self.material)
            self.exponent = catalogue_exponent(self.material)
        self._initialize_memory()
        self.was_threading = False
        self.former_angle = self.spindle_angle
        self.former_z = self._cold(self.tool_z, 0.0)
        self.former_place = -1.0
        self._leave(self.former_z)

    def step(self, time: float, step_size: float) -> int:
        """The chip at the end of the step, and the points of the groove that the tool has passed."""
        z = self._cold(self.tool_z, time + step_size)
        if not self.threading or not self.was_threading:
            self.located = False
            self.pass_start = self.former_angle
        if self.threading and self._touches(z):
            self._cut(z)
        else:
            self._end_cut()
            self._leave(z)
        self.was_threading = self.threading
        self.former_angle = self.spindle_angle
        self.former_z = z
        return 0

    def _leave(self, z: float) -> None:
        """The tool is out of the metal: no force, and the flanks are those of the tool."""
        self.groove_depth = self._sense() * (self._surface(z) - self.tool_x)
        self.torque = 0.0
        self.axial_force = 0.0
        self.radial_force = 0.0
        self.cutting_force = 0.0
        self.chip_area = 0.0
        self.axial_shift = 0.0
        self.radial_shift = 0.0
        self.chip_radius = self._surface(z)
        half = max(0.0, self.groove_depth) * self.flank_tangent
        self.tool_low = z - half
        self.tool_high = z + half
        self._show_flanks(self.tool_low, self.tool_high)
        for i in range(2):
            self.chip_thickness[i] = 0.0

    def _touches(self, z: float) -> bool:
        """Whether the tool, were it rigid, would be in the material."""
        half = self._sense() * (self._surface(z) - self.tool_x) * self.flank_tangent
        first = min(self.face, self.shoulder)
        last = max(self.face, self.shoulder)
        return half > 0.0 and z + half > first and z - half < last

    def _cut(self, z: float) -> None:
        """One communication point in the metal."""
        turned = self.spindle_angle - self.former_angle
        moved = z - self.former_z
        if not self.located:
            self._locate(self.spindle_angle, z)
        self._learn_lead(turned, moved)
        self._make_room(self.spindle_angle)
        place = self._place(self.spindle_angle)
        low = self.tool_low
        high = self.tool_high
        self.advance = 0.0
        if turned > 0.0:
            self.advance = moved / turned * self.interval
        self._recall(place, z)
        self._deflect(z)
        self.torque = self.cutting_force * self.chip_radius
        self._outermost_flanks()
        if self.former_place >= 0.0 and place > self.former_place:
            next_point = floor(self.former_place) + 1
            end = floor(place) + 1
            for i in range(next_point, end):
                share = (i - self.former_place) / (place - self.former_place)
                self._pass_point(i, low + share * (self.tool_low - low), high + share * (self.tool_high - high))
        self.former_place = place

    def _make_room(self, angle: float) -> None:
        """Points for the groove up to this angle."""
        while self._place(angle) >= self._points() - 1.0:
            self._thin_out()
            if self.former_place >= 0.0:
                self.former_place = 0.5 * self.former_place

    def _end_cut(self) -> None:
        """The groove goes on to the next of its points: between two points there is the same pass.

        Room for a turn more is made here, where no pass is under way.
        """
        if self.former_place >= 0.0:
            point = floor(self.former_place) + 1
            beyond = (point - self.former_place) * self.advance
            self._pass_point(point, self.tool_low + beyond, self.tool_high + beyond)
            self._keep_pending()
            self.former_place = -1.0
            self._make_room(self.former_angle + TURN)
        self.former_place = -1.0

    def _deflect(self, z: float) -> None:
        """Deflections u = C F(u), by fixed-point iteration with Aitken's relaxation."""
        axial = 1.0 / self.tool_axial_stiffness + self._thin_yield(z)
        radial = 1.0 / self.tool_radial_stiffness + self._radial_yield(z)
        turning = self._sense() * self._bending_slope(z) * self._surface(z)
        hardness = self._hardness(z)
        share = 1.0
        former_axial = 0.0
        former_radial = 0.0
        for n in range(ITERATIONS):
            self._load(z, hardness)
            outwards = self._sense() * -self.radial_force
            missing_axial = -self.axial_force * axial - outwards * turning - self.axial_shift
            missing_radial = outwards * radial - self.radial_shift
            if abs(missing_axial) + abs(missing_radial) < SETTLED:
                break
            if n > 0:
                change_axial = missing_axial - former_axial
                change_radial = missing_radial - former_radial
                square = change_axial * change_axial + change_radial * change_radial
                if square > 0.0:
                    share = -share * (former_axial * change_axial + former_radial * change_radial) / square
                share = max(0.02, min(1.0, share))
            self.axial_shift = self.axial_shift + share * missing_axial
            self.radial_shift = self.radial_shift + share * missing_radial
            former_axial = missing_axial
            former_radial = missing_radial

    def _load(self, z: float, hardness: float) -> None:
        """Chip and forces at the present deflections."""
        self._take_chip(z + self.axial_shift)
        total = self.chip_thickness[0] + self.chip_thickness[1]
        self.axial_force = 0.0
        self.cutting_force = 0.0
        for i in range(2):
            thickness = self.chip_thickness[i]
            if thickness > 0.0:
                force = hardness * self.chip_area * thickness / total
                force = force * specific_force(self.unit_force, self.exponent, thickness)
                self.cutting_force = self.cutting_force + force
                self.axial_force = self.axial_force + (2.0 * i - 1.0) * self.thrust_ratio * self.flank_cosine * force
        self.radial_force = -self._sense() * self.thrust_ratio * self.flank_sine * self.cutting_force

    def _take_chip(self, z: float) -> None:
        """The tool's V at z, less the union of the two V that former passes left.

        A = A(V) - A(V and 1) - A(V and 2) + A(V and 1 and 2), each between face and shoulder.
        """
        self.groove_depth = self._sense() * (self._surface(z) - self.tool_x) - self.radial_shift
        half = self.groove_depth * self.flank_tangent
        low = z - half
        high = z + half
        self.tool_low = low
        self.tool_high = high
        low1 = max(low, self.left_low[0])
        high1 = min(high, self.left_high[0])
        low2 = max(low, self.left_low[1])
        high2 = min(high, self.left_high[1])
        self._measure_chip(low1, high1, low2, high2)
        # thickness is that of the band beside the V that is nearer to the tool's
        if high2 - low2 > high1 - low1:
            low1 = low2
            high1 = high2
        if high1 <= low1:
            low1 = z
            high1 = z
        self.chip_thickness[0] = max(0.0, low1 - low) * self.flank_cosine
        self.chip_thickness[1] = max(0.0, high - high1) * self.flank_cosine

    def _measure_chip(self, low1: float, high1: float, low2: float, high2: float) -> None:
        """Area of the chip, and the radius of its centroid."""
        tangent = self.flank_tangent
        first = min(self.face, self.shoulder)
        last = max(self.face, self.shoulder)
        low12 = max(low1, low2)
        high12 = min(high1, high2)
        area = area_between(self.tool_low, self.tool_high, tangent, first, last)
        area = area - area_between(low1, high1, tangent, first, last) - area_between(low2, high2, tangent, first, last)
        self.chip_area = max(0.0, area + area_between(low12, high12, tangent, first, last))
        whole = groove_area(self.tool_low, self.tool_high, tangent) - groove_area(low1, high1, tangent)
        whole = whole - groove_area(low2, high2, tangent) + groove_area(low12, high12, tangent)
        moment = groove_moment(self.tool_low, self.tool_high, tangent) - groove_moment(low1, high1, tangent)
        moment = moment - groove_moment(low2, high2, tangent) + groove_moment(low12, high12, tangent)
        depth = 0.0
        if whole > 0.0:
            depth = max(0.0, min(self.groove_depth, moment / whole))
        self.chip_radius = self._surface(0.5 * (self.tool_low + self.tool_high)) - self._sense() * depth

    def _outermost_flanks(self) -> None:
        """The outermost flanks of all passes."""
        low = self.tool_low
        high = self.tool_high
        if self.left_high[0] > self.left_low[0]:
            low = min(low, self.left_low[0])
            high = max(high, self.left_high[1])
        self._show_flanks(low, high)

    def _show_flanks(self, low: float, high: float) -> None:
        """The flanks, and what of them is probed."""
        self.flank_position[0] = low
        self.flank_position[1] = high
        self.groove_position = 0.5 * (low + high)
        if self.probed_flank != MIDDLE:
            self.groove_position = self.flank_position[self.probed_flank - 1]
