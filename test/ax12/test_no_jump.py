"""Whatever state the servos are found in: giving them torque moves no joint by more than a tick.

Two hundred random states of two servos each, at rest before: held under a load by a driver that ran
before, limp, shut down by an alarm, without their settings after a power failure, in wheel mode,
outside the joint's range. A limp joint at rest lies on something, so it carries nothing.

Held by somebody else's compliance, the load is known to the sensor's steps only; a softer servo
makes up to three ticks of that.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from snake_control.ax12.bus import Bus
from snake_control.ax12.chain import ServoChain
from snake_control.ax12.driven_joint import Motion
from snake_control.ax12.joint import JointSetup
from snake_control.ax12.startup import handshake
from snake_control.errors import ServoError
from snake_control.mock.servo import Servo
from support.simulated_bus import MemoryPort, World

TICK = math.radians(300.0 / 1023.0)
MOTION = Motion(period=0.02, look_ahead=0.15, acceleration=0.0, lost_after_misses=25)
HELD_S = 0.6
STATES = 200


class Rig:
    """Two servos in a random state, at rest, and what drives them."""

    def __init__(self, seed: int, foreign: bool = False) -> None:
        self.foreign = foreign
        self.rng = rng = np.random.default_rng(seed)
        self.modes = ["wheel" if rng.random() < 0.15 else "joint" for _ in range(2)]
        self.servos = []
        for i, mode in enumerate(self.modes):
            limits = {"cw_angle_limit": 0, "ccw_angle_limit": 0 if mode == "wheel" else 1023}
            # Some stand outside the joint's range of 2.2 rad.
            angle = rng.uniform(-2.5, 2.5)
            eeprom = {**limits, "return_delay_time": int(rng.integers(0, 255))}
            self.servos.append(Servo(i + 1, angle_rad=angle, eeprom=eeprom))
        self.joints = tuple(
            JointSetup(
                f"joint_{i + 1}", i + 1, int(rng.choice([-1, 1])), rng.uniform(-0.2, 0.2), mode,
                -2.2, 2.2, 5.5, int(rng.integers(0, 3)), int(rng.choice([16, 32, 64])),
                int(rng.choice([0, 32])), rng.uniform(0.6, 1.0),
            )
            for i, mode in enumerate(self.modes)
        )  # fmt: skip
        self.world = World(self.servos)
        for i in range(2):
            self._prepare(i)
        self.wait(1.5)

    def _prepare(self, i: int) -> None:
        """Bring a servo into a state that it can be found in."""
        servo, rng, joint = self.servos[i], self.rng, self.joints[i]
        servo.store("moving_speed", int(rng.choice([0, 0, 20, 1023])))
        if self.modes[i] == "wheel":
            servo.store("moving_speed", 0)
            return
        kind = rng.choice(["limp", "held", "held", "shut down", "fresh"])
        if kind == "fresh":
            servo.power_cycle()
            return
        for side in ("cw", "ccw"):
            servo.store(f"{side}_compliance_slope", int(rng.choice([16, 32, 64, 128])))
            servo.store(f"{side}_compliance_margin", int(rng.integers(0, 4)))
        servo.store("punch", int(rng.choice([0, 32, 64])))
        here = servo.motion.angle_rad
        servo.store("goal_position", round(512 + here / TICK))
        if kind == "limp":
            # An old goal far away: the register keeps it.
            servo.store("goal_position", int(rng.integers(0, 1024)))
        elif kind == "held":
            if not self.foreign:
                for side in ("cw", "ccw"):
                    servo.store(f"{side}_compliance_slope", joint.slope_raw)
                    servo.store(f"{side}_compliance_margin", joint.margin_ticks)
                servo.store("punch", joint.punch_raw)
            limit = int(rng.integers(700, 1024)) if self.foreign else joint.torque_limit_raw
            servo.store("torque_limit", limit)
            servo.store("torque_enable", 1)
            self.world.loads[i] = rng.uniform(-0.5, 0.5)
        else:
            servo.store("torque_enable", 1)
            self._shut_down(servo)
            servo.store("goal_position", int(rng.integers(0, 1024)))

    def _shut_down(self, servo: Servo) -> None:
        servo.store("torque_limit", 0)

    def wait(self, seconds: float) -> None:
        self.world.pass_until(self.world.now + seconds)

    def chain(self) -> ServoChain:
        """What a driver that has just opened the port has."""
        bus = Bus(MemoryPort(self.world), retries=1)
        found = handshake(bus, self.joints, (12,))
        chain = ServoChain(bus, self.joints, found.servos, MOTION, lambda: self.world.now)
        chain.look_for_torque()
        return chain

    def lay_down(self) -> None:
        """Limp joints rest on something from now on."""
        for i, servo in enumerate(self.servos):
            if not servo.driven or servo.registers["torque_limit"] == 0:
                self.world.loads[i] = 0.0

    def arm_and_hold(self, chain: ServoChain) -> float:
        """Give torque, hold for a while; return the longest way of a joint [ticks]."""
        begin = self.world.angles()
        farthest = 0.0

        def look() -> None:
            nonlocal farthest
            moved = max(abs(a - b) for a, b in zip(self.world.angles(), begin, strict=True))
            farthest = max(farthest, moved / TICK)

        chain.arm()
        look()
        end = self.world.now + HELD_S
        while self.world.now < end:
            cycle = self.world.now
            chain.write(None)
            chain.read(cycle + 0.017)
            look()
            self.world.pass_until(cycle + 0.02)
            look()
        assert not chain.fault()
        return farthest


@pytest.mark.timeout(240)
def test_torque_moves_no_joint_by_more_than_a_tick() -> None:
    worst: dict[str, float] = {}
    for seed in range(STATES):
        rig = Rig(seed)

        def note(what: str, ticks: float, seed: int = seed) -> None:
            assert ticks <= 1.0, f"{what} of state {seed} moved a joint by {ticks:.1f} ticks"
            worst[what] = max(worst.get(what, 0.0), ticks)

        chain = rig.chain()
        note("start-up", rig.arm_and_hold(chain))

        rig.world.loads = [0.0, 0.0]
        rig.wait(0.5)
        chain.disarm()
        rig.wait(0.2)
        note("re-enable", rig.arm_and_hold(chain))

        # One servo shuts itself down, the other one's power fails for a moment.
        trip, blink = rig.rng.permutation(2)
        rig._shut_down(rig.servos[trip])
        rig.servos[blink].power_cycle()
        rig.wait(0.2)
        chain = rig.chain()
        note("recover", rig.arm_and_hold(chain))

        rig.world.loads = [
            rig.rng.uniform(-0.4, 0.4) if mode == "joint" else 0.0 for mode in rig.modes
        ]
        rig.wait(1.0)
        note("replug", rig.arm_and_hold(rig.chain()))
    assert set(worst) == {"start-up", "re-enable", "recover", "replug"}


def test_held_by_other_settings_a_joint_is_taken_over_within_three_ticks() -> None:
    moved = []
    for seed in range(60):
        rig = Rig(seed, foreign=True)
        moved.append(rig.arm_and_hold(rig.chain()))
    assert max(moved) <= 3.0
    assert sum(ticks <= 1.0 for ticks in moved) >= 55


def test_a_joint_outside_its_servos_own_limits_is_refused_and_stays_limp() -> None:
    servo = Servo(1, angle_rad=1.5, eeprom={"cw_angle_limit": 300, "ccw_angle_limit": 700})
    world = World([servo])
    joint = JointSetup("joint_1", 1, 1, 0.0, "joint", -2.2, 2.2, 5.5, 1, 32, 32, 1.0)
    bus = Bus(MemoryPort(world), retries=1)
    found = handshake(bus, [joint], (12,))
    chain = ServoChain(bus, [joint], found.servos, MOTION, lambda: world.now)
    with pytest.raises(ServoError, match="outside its servo's angle limits"):
        chain.arm()
    assert not servo.driven
