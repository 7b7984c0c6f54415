"""The axis of an emulated servo drive: CiA 402 states, profiles, following error, faults.

It turns a simulated spindle. Time is what `advance` is told: a bus's SYNC, or a clock.
"""

import math
from dataclasses import dataclass
from threading import RLock

import numpy as np

from labdrive.model.waveform import TURN
from labdrive_sim.spindle import Spindle

SUBSTEPS = 4
ON_TARGET = 1e-9

PROFILE_POSITION, HOMING, CYCLIC_POSITION = 1, 6, 8
MODES = frozenset({PROFILE_POSITION, HOMING, CYCLIC_POSITION})
FAULT_FOLLOWING, FAULT_SYNC = 0x8611, 0x8700

NOT_READY, DISABLED, READY, ON, ENABLED, STOPPING, FAULT = range(7)
# Bits of the statusword in each state, with voltage (bit 4) and remote (bit 9) set.
STATUS = {
    NOT_READY: 0x0210,
    DISABLED: 0x0250,
    READY: 0x0231,
    ON: 0x0233,
    ENABLED: 0x0237,
    STOPPING: 0x0217,
    FAULT: 0x0218,
}
TARGET_REACHED, INTERNAL_LIMIT, BIT_12, BIT_13 = 1 << 10, 1 << 11, 1 << 12, 1 << 13


@dataclass
class AxisSettings:
    """What the drive is made of; lengths of time in s, angles in revolutions."""

    counts_per_turn: int = 1 << 20
    lag_s: float = 2e-3
    quick_stop_acceleration: float = 100.0
    index_angle: float = 0.25


class Axis:
    """A drive, seen from its object dictionary. Positions are counts, velocities counts/s."""

    def __init__(self, plant: Spindle, settings: AxisSettings | None = None) -> None:
        self.settings = settings or AxisSettings()
        self.plant = plant
        self.lock = RLock()
        self.state = DISABLED
        self.mode = 0
        self.controlword = 0
        self.error_code = 0
        self.target = 0
        self.profile_velocity = self.settings.counts_per_turn
        self.profile_acceleration = 10 * self.settings.counts_per_turn
        self.homing_method = 0
        self.following_window = 0xFFFFFFFF
        self.following_timeout_ms = 100
        self.limits: tuple[int, int] | None = None
        self.quick_stop_option = 6
        self._home = 0.0
        self._demand = 0.0
        self._motor = 0.0
        self._velocity = 0.0
        self._taken: float | None = None
        self._homing = False
        self._attained = False
        self._homing_failed = False
        self._acknowledged = False
        self._limited = False
        self._beyond_s = 0.0

    @property
    def actual(self) -> int:
        """The motor's own encoder."""
        return self._counts(self.plant.motor_angle / TURN)

    @property
    def demand(self) -> int:
        """Where the profile or the set-point has come to."""
        return self._counts(self._demand)

    @property
    def following_error(self) -> int:
        """Demand less actual."""
        return self.demand - self.actual

    @property
    def homed(self) -> bool:
        """Whether the homing that was begun last, in whatever run, found its home."""
        return self._attained

    @property
    def statusword(self) -> int:
        """Object 6041h."""
        word = STATUS[self.state]
        if self.mode == CYCLIC_POSITION:
            word |= BIT_12 if self.state == ENABLED else 0
        elif self.mode == HOMING:
            word |= BIT_12 if self._attained else 0
            word |= BIT_13 if self._homing_failed else 0
        else:
            word |= BIT_12 if self._acknowledged else 0
        word |= INTERNAL_LIMIT if self._limited else 0
        return word | (TARGET_REACHED if self._at_rest else 0)

    def set_mode(self, mode: int) -> None:
        """Take a mode of operation; an unknown one is refused silently, as drives do."""
        if mode in MODES:
            self.mode = mode
            self._taken = None
            self._homing = self._homing_failed = False

    def set_controlword(self, word: int) -> None:
        """Obey a controlword (IEC 61800-7-201, table 27)."""
        rising = word & ~self.controlword
        self.controlword = word
        if self.state == FAULT:
            if rising & 0x80:
                self.state, self.error_code = DISABLED, 0
            return
        self._change_state(word)
        self._acknowledged &= bool(word & 0x10)
        if self.state == ENABLED and rising & 0x10:
            self._start()

    def fail(self, code: int) -> None:
        """Raise a fault: the drive stops and takes the voltage away."""
        self.state, self.error_code = FAULT, code
        self._velocity = 0.0
        self._taken = None

    def advance(self, seconds: float) -> None:
        """Let time pass in which no set-points come."""
        goal = self._demand
        if self.state == STOPPING:
            goal = self._braked(seconds)
        elif self.state == ENABLED and self.mode != CYCLIC_POSITION:
            goal = self._profiled(seconds)
        self._turn_to(goal, seconds)

    def follow_set_point(self, seconds: float) -> None:
        """Interpolate to the target over a cycle of the SYNC."""
        if self.state != ENABLED or self.mode != CYCLIC_POSITION:
            self.advance(seconds)
            return
        goal = self._home + self._within_limits(self.target) / self.settings.counts_per_turn
        self._velocity = (goal - self._demand) / seconds
        self._turn_to(goal, seconds)

    def told(self) -> dict[str, object]:
        """Return what a person would see."""
        with self.lock:
            return {
                "counts": self.actual,
                "moving": self._velocity != 0.0,
                "enabled": self.state == ENABLED,
                "error_code": self.error_code,
            }

    @property
    def _at_rest(self) -> bool:
        return self._taken is None and not self._homing and self._velocity == 0.0

    def _counts(self, turns: float) -> int:
        return round((turns - self._home) * self.settings.counts_per_turn)

    def _change_state(self, word: int) -> None:
        if not word & 0x02:
            self.state = DISABLED
        elif not word & 0x04:
            self.state = {ENABLED: STOPPING, STOPPING: STOPPING}.get(self.state, DISABLED)
        elif word & 0x07 == 0x06:
            self.state = READY if self.state != STOPPING else STOPPING
        elif word & 0x0F == 0x07 and self.state in {READY, ON, ENABLED}:
            self.state = ON
        elif word & 0x0F == 0x0F and self.state in {READY, ON, STOPPING}:
            self.state = ENABLED
        if self.state not in {ENABLED, STOPPING}:
            self._taken, self._homing, self._velocity = None, False, 0.0

    def _start(self) -> None:
        """Take a rising new-set-point or start-homing bit."""
        if self.mode == PROFILE_POSITION:
            self._acknowledged = True
            target = self._within_limits(self.target)
            self._taken = self._home + target / self.settings.counts_per_turn
        elif self.mode == HOMING:
            self._attained = self._homing_failed = False
            self._begin_homing()

    def _begin_homing(self) -> None:
        """Methods 33 and 34 seek the index pulse; 35 and 37 take where the motor stands."""
        index = self.settings.index_angle
        if self.homing_method in {35, 37}:
            self._home, self._attained = self._demand, True
        elif self.homing_method == 33:
            self._taken, self._homing = math.ceil(self._demand - index) - 1 + index, True
        elif self.homing_method == 34:
            self._taken, self._homing = math.floor(self._demand - index) + 1 + index, True
        else:
            self._homing_failed = True

    def _within_limits(self, target: int) -> int:
        if self.limits is None or self.limits[0] >= self.limits[1]:
            return target
        within = max(self.limits[0], min(self.limits[1], target))
        self._limited = within != target
        return within

    def _profiled(self, seconds: float) -> float:
        """Return the demand after a step along the trapezoid to the target."""
        if self._taken is None:
            return self._demand
        per_turn = self.settings.counts_per_turn
        fastest = self.profile_velocity / per_turn
        acceleration = self.profile_acceleration / per_turn
        left = self._taken - self._demand
        allowed = min(fastest, math.sqrt(2 * acceleration * abs(left)))
        wanted = math.copysign(allowed, left)
        change = acceleration * seconds
        self._velocity += max(-change, min(change, wanted - self._velocity))
        step = self._velocity * seconds
        if abs(left) <= max(abs(step), ON_TARGET):
            return self._arrive(self._taken)
        return self._demand + step

    def _arrive(self, at: float) -> float:
        self._taken, self._velocity = None, 0.0
        if self._homing:
            self._homing, self._attained, self._home = False, True, at
        return at

    def _braked(self, seconds: float) -> float:
        """Return the demand after a step along the quick-stop ramp."""
        self._taken, self._homing = None, False
        change = self.settings.quick_stop_acceleration * seconds
        self._velocity -= max(-change, min(change, self._velocity))
        if self._velocity == 0.0 and self.quick_stop_option in {1, 2, 3, 4}:
            self.state = DISABLED
        return self._demand + self._velocity * seconds

    def _turn_to(self, goal: float, seconds: float) -> None:
        """Turn the motor after the demand, which goes to `goal` [revolutions] in `seconds`."""
        step = seconds / SUBSTEPS
        stay = math.exp(-step / self.settings.lag_s)
        outputs = np.empty((SUBSTEPS, 1), dtype=np.float64)
        demand, motor = self._demand, self._motor
        gain = (goal - demand) / SUBSTEPS
        behind = gain / step * self.settings.lag_s
        for i in range(SUBSTEPS):
            # Exact for a lag of first order and a demand that rises steadily.
            motor = demand + gain - behind + (motor - demand + behind) * stay
            demand += gain
            outputs[i, 0] = TURN * motor
        self._demand, self._motor = goal, motor
        self.plant.follow(outputs, step * np.arange(SUBSTEPS, dtype=np.float64), step)
        self._watch_following(seconds)

    def _watch_following(self, seconds: float) -> None:
        if self.state != ENABLED or abs(self.following_error) <= self.following_window:
            self._beyond_s = 0.0
            return
        self._beyond_s += seconds
        if self._beyond_s * 1000 > self.following_timeout_ms:
            self.fail(FAULT_FOLLOWING)
