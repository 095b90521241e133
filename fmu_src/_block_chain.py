"""The chain of threading blocks that a pass runs along, in step with the spindle's angle."""

from dataclasses import dataclass
from math import floor, sqrt

from threadpitch.fmu.variable import output, parameter, state

from ._axis_motion import AxisMotion, arrived
from ._spindle_reading import PULSE_GENERATOR, SAME_INSTANT, TURN

ALONG_Z = 1


def end_lead(length: float, lead: float, lead_change: float) -> float:
    """sqrt(lead^2 + 2 lead_change length): the lead at the end of a block; 0 where it would turn negative."""
    return sqrt(max(0.0, lead * lead + 2.0 * lead_change * length))


def turns_of(length: float, lead: float, lead_change: float) -> float:
    """length / ((lead + end lead) / 2); 0 for a block without movement."""
    both = lead + end_lead(length, lead, lead_change)
    if length > 0.0 and both > 0.0:
        return 2.0 * length / both
    return 0.0


def way_of(angle: float, lead: float, lead_change: float) -> float:
    """lead n + lead_change n^2 / 2, n turns; where the lead falls to zero the way stays."""
    turns = angle / TURN
    if lead_change < 0.0 and turns > -lead / lead_change:
        turns = -lead / lead_change
        return 0.5 * lead * turns
    return lead / TURN * angle + 0.5 * lead_change * turns * turns


@dataclass
class BlockChain(AxisMotion):
    """Block 1 runs from z_start to z_end, further ones from there. The lead is along Z, along X where X moves farther.

    way = sum over the blocks before + lead n + lead_change n^2 / 2        n: turns since the block's line began
    """

    block: int = output("1", "Number of the threading block in the chain, from 1", start=1, min=1, max=32,
                        discrete=True)

    lead: float = parameter("m", "Lead of the thread: movement per turn", start=0.0015, display="mm", min=1e-6, max=0.5)
    lead_change: float = parameter("m", "Change of the lead per turn (G34)", start=0.0, display="mm", min=-0.5, max=0.5)
    z_start: float = parameter("m", "Z where the feed starts", start=0.006, display="mm", min=-100.0, max=100.0)
    z_end: float = parameter("m", "Z where the thread ends", start=-0.030, display="mm", min=-100.0, max=100.0)
    z_face: float = parameter("m", "Z of the workpiece's face, where the metal begins", start=0.0, display="mm",
                              min=-100.0, max=100.0)
    x_clear: float = parameter("m", "X clear of the workpiece, radius", start=0.012, display="mm",
                               min=-100.0, max=100.0)
    infeed_axis: int = parameter("1", "Axis of infeed and retraction; z for threads across a face", start=0, choices={
        "x": 0, "z": 1})
    z_clear: float = parameter("m", "Z clear of the workpiece, where infeed_axis is z", start=0.006, display="mm",
                               min=-100.0, max=100.0)
    x_thread: float = parameter("m", "X of the last pass at z_end, radius", start=0.0097, display="mm",
                                min=-100.0, max=100.0)
    x_surface: float = parameter("m", "X of the workpiece's surface, radius", start=0.010, display="mm",
                                 min=-100.0, max=100.0)
    taper: float = parameter("m", "Taper i: X of the thread's start less X of its end, radius", start=0.0, display="mm",
                             min=-100.0, max=100.0)
    run_out_length: float = parameter("m", "Run-out along the long axis (K); 0 = none", start=0.0, display="mm",
                                      min=0.0, max=100.0)
    run_out_height: float = parameter("m", "Run-out out of the thread along the short axis (J)", start=0.0,
                                      display="mm", min=0.0, max=100.0)
    further_blocks: int = parameter("1", "Threading blocks that follow the first in a chain", start=0, min=0, max=31)
    further_z: list[float] = parameter("m", "Z of their ends", start=0.0, display="mm", min=-100.0, max=100.0, size=31)
    further_x: list[float] = parameter("m", "X of their ends at the last pass, radius", start=0.0, display="mm",
                                       min=-100.0, max=100.0, size=31)
    further_lead: list[float] = parameter("m", "Their leads", start=0.0, display="mm", min=0.0, max=0.5, size=31)
    further_lead_change: list[float] = parameter("m", "Their changes of lead per turn", start=0.0, display="mm",
                                                 min=-0.5, max=0.5, size=31)
    further_start_angle: list[float] = parameter("rad", "Their start positions from the one-turn pulse", start=0.0,
                                                 display="deg", min=0.0, max=6.283185307179587, size=31)
    start_each_block: bool = parameter("1", "Every block waits for its own start position, the index is reset once",
                                       start=False)

    chain_z: list[float] = state("m", "Z of the points of this pass: its start and the ends of its blocks",
                                 display="mm", size=33, discrete=True)
    chain_x: list[float] = state("m", "X of these points", display="mm", size=33, discrete=True)
    chain_way: list[float] = state("m", "Way at these points", display="mm", size=33, discrete=True)
    block_angle: float = state("rad", "Angle since the counter's reset at which the line of this block begins",
                               display="deg", discrete=True)

    def _check_chain(self, shift: float) -> int:
        """0, or which blocks make no thread; shift: the longest flank infeed."""
        total = 0.0
        length = 0.0
        for k in range(self.further_blocks + 1):
            along_z = self.z_end - self.z_start
            along_x = self.taper
            if k > 0:
                along_z = self.further_z[k - 1] - self.z_end
                along_x = self.further_x[k - 1] - self.x_thread
            if k > 1:
                along_z = self.further_z[k - 1] - self.further_z[k - 2]
                along_x = self.further_x[k - 1] - self.further_x[k - 2]
            length = max(abs(along_z), abs(along_x))
            lead = self._block_lead(k)
            if length > 0.0 and lead * lead + 2.0 * self._block_lead_change(k) * length <= 0.0:
                return 4
            if k == 0:
                length = length - shift
                if length < 0.0 or (shift > 0.0 and length == 0.0):
                    return 7
            total = total + length
        if total == 0.0:
            return 1
        if self.run_out_length > length:
            return 7
        return 0

    def _outward(self) -> float:
        """+1 where the tool leaves the thread towards larger X, -1 in an internal thread."""
        if self.x_clear >= self.x_thread:
            return 1.0
        return -1.0

    def _plan_chain(self, above: float, flank_shift: float) -> None:
        """The points of a pass: X above that of the last pass, the first one moved along the thread by flank_shift."""
        along = self.z_end - self.z_start
        shift = 0.0
        slope = 0.0
        if along != 0.0:
            shift = flank_shift * along / abs(along)
            slope = -self.taper / along
        self.chain_z[0] = self.z_start + shift
        self.chain_x[0] = self.x_thread + self.taper + above + slope * shift
        self.chain_z[1] = self.z_end
        self.chain_x[1] = self.x_thread + above
        for k in range(self.further_blocks):
            self.chain_z[k + 2] = self.further_z[k]
            self.chain_x[k + 2] = self.further_x[k] + above
        self.chain_way[0] = 0.0
        for k in range(self.further_blocks + 1):
            way = max(abs(self.chain_z[k + 1] - self.chain_z[k]), abs(self.chain_x[k + 1] - self.chain_x[k]))
            self.chain_way[k + 1] = self.chain_way[k] + way

    def _approach_start(self) -> bool:
        """Rapid traverse to the start of the pass, clear of the workpiece; True when there."""
        x = self.x_clear
        z = self.chain_z[0]
        if self.infeed_axis == ALONG_Z:
            x = self.chain_x[0]
            z = self.z_clear
        self._infeed(x)
        self._traverse(z)
        return arrived(self.z_command, z) and arrived(self.x_command, x)

    def _feed_in(self) -> bool:
        """The infeed axis to where the pass starts; True when there."""
        if self.infeed_axis == ALONG_Z:
            self._traverse(self.chain_z[0])
            return arrived(self.z_command, self.chain_z[0])
        self._infeed(self.chain_x[0])
        return arrived(self.x_command, self.chain_x[0])

    def _retract_clear(self) -> bool:
        """The infeed axis clear of the workpiece; True when there."""
        if self.infeed_axis == ALONG_Z:
            self._traverse(self.z_clear)
            return arrived(self.z_command, self.z_clear)
        self._infeed(self.x_clear)
        return arrived(self.x_command, self.x_clear)

    def _return_to_start(self) -> bool:
        """The other axis back to where the passes start; True when there."""
        if self.infeed_axis == ALONG_Z:
            self._infeed(self.x_thread + self.taper)
            return arrived(self.x_command, self.x_thread + self.taper)
        self._traverse(self.z_start)
        return arrived(self.z_command, self.z_start)

    def _begin_chain(self, angle: float) -> None:
        """The line of the first block begins at this angle since the counter's reset."""
        self.block = 1
        self.block_angle = angle
        self._begin_travel()

    def _block_lead(self, block: int) -> float:
        """Lead of a block, from 0."""
        if block == 0:
            return self.lead
        return self.further_lead[block - 1]

    def _block_lead_change(self, block: int) -> float:
        """Change of lead of a block, from 0."""
        if block == 0:
            return self.lead_change
        return self.further_lead_change[block - 1]

    def _largest_lead(self) -> float:
        """Of all blocks, at their beginnings and ends."""
        largest = self.lead
        for k in range(self.further_blocks + 1):
            length = self.chain_way[k + 1] - self.chain_way[k]
            if length > 0.0:
                lead = self._block_lead(k)
                largest = max(largest, max(lead, end_lead(length, lead, self._block_lead_change(k))))
        return largest

    def _length(self) -> float:
        """The whole way of the pass."""
        return self.chain_way[self.further_blocks + 1]

    def _target(self, angle: float) -> float:
        """The way that the spindle asks for at this angle since the counter's reset; counts the blocks on."""
        k = self.block - 1
        ended = self._line_end(k)
        while k < self.further_blocks and angle >= ended:
            self.block_angle = self._next_block_angle(ended, k)
            k = k + 1
            ended = self._line_end(k)
            self.on_line = False
        self.block = k + 1
        turned = angle - self.block_angle
        if k > 0 and turned < 0.0:
            self.on_line = False
            return self.chain_way[k]
        return self.chain_way[k] + way_of(turned, self._block_lead(k), self._block_lead_change(k))

    def _line_end(self, block: int) -> float:
        """Angle since the counter's reset at which the line of the block that is being cut ends."""
        length = self.chain_way[block + 1] - self.chain_way[block]
        return self.block_angle + TURN * turns_of(length, self._block_lead(block), self._block_lead_change(block))

    def _next_block_angle(self, ended: float, block: int) -> float:
        """Where the line of the block after this one begins: at once, or at its own start position modulo a turn."""
        if not self.start_each_block:
            return ended
        position = self._whole_counts(self.further_start_angle[block])
        just = SAME_INSTANT * TURN
        if self.detector == PULSE_GENERATOR:
            just = TURN / self.counts_per_turn
        return position - TURN * floor((position - ended + just) / TURN)

    def _waits(self, angle: float) -> bool:
        """The gate is shut until the start position of this block."""
        return self.block > 1 and angle < self.block_angle

    def _stop_ahead(self) -> bool:
        """The tool stands still at the end of this block: it is the last, or the next one waits."""
        if self.block > self.further_blocks:
            return True
        ended = self._line_end(self.block - 1)
        return self._next_block_angle(ended, self.block - 1) > ended + SAME_INSTANT * TURN

    def _place(self, way: float) -> None:
        """Both commands at a point of the chain; on the run-out they leave the thread."""
        k = 0
        while k < self.further_blocks and way >= self.chain_way[k + 1]:
            k = k + 1
        along_z = self.chain_z[k + 1] - self.chain_z[k]
        along_x = self.chain_x[k + 1] - self.chain_x[k]
        length = self.chain_way[k + 1] - self.chain_way[k]
        past = way - self.chain_way[k]
        if past < length:
            self.z_command = self.chain_z[k] + along_z / length * past
            self.x_command = self.chain_x[k] + along_x / length * past
        else:
            self.z_command = self.chain_z[k + 1]
            self.x_command = self.chain_x[k + 1]
        leaving = min(way, self._length()) - (self._length() - self.run_out_length)
        if self.run_out_length > 0.0 and leaving > 0.0:
            self._leave(leaving / self.run_out_length * self.run_out_height, along_z, along_x)

    def _leave(self, height: float, along_z: float, along_x: float) -> None:
        """Out of the thread along the short axis."""
        if abs(along_z) >= abs(along_x):
            self.x_command = self.x_command + self._outward() * height
        elif self.z_start >= self.z_end:
            self.z_command = self.z_command + height
        else:
            self.z_command = self.z_command - height
