"""Whatever state the servos are found in: giving them torque moves no joint by more than a tick.

Two hundred random states of three servos each, at rest before: held under a load by a driver that
ran before, or by somebody else's compliance, limp, shut down by an overload, without their settings
after a power failure, locked, in wheel mode, outside the joint's range. A limp joint at rest lies
on something, so it carries nothing.
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
from snake_control.mock.disturbance import NONE, Disturbance
from snake_control.mock.parameters import ServoParameters
from snake_control.mock.servo import Servo
from support.simulated_bus import MemoryPort, World

TICK = math.radians(300.0 / 1023.0)
MOTION = Motion(period=0.02, look_ahead=0.15, acceleration=0.0, lost_after_misses=25)
HELD_S = 1.0
SERVOS = 3
STATES, CHUNKS = 200, 4
BLOCKED = Disturbance(shaft_blocked=True)


class Rig:
    """Servos in a random state, at rest, and what drives them."""

    def __init__(self, seed: int) -> None:
        self.rng = rng = np.random.default_rng(seed)
        self.modes = ["wheel" if rng.random() < 0.15 else "joint" for _ in range(SERVOS)]
        self.servos = []
        for i, mode in enumerate(self.modes):
            limits = {"cw_angle_limit": 0, "ccw_angle_limit": 0 if mode == "wheel" else 1023}
            # Some stand outside the joint's range of 2.2 rad; a load may push a soft one by 0.12
            # rad, and beyond 2.618 the sensor does not see it.
            angle = rng.uniform(-2.45, 2.45)
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
        self.kinds = [self._prepare(i) for i in range(SERVOS)]
        self.wait(1.5)
        for i, servo in enumerate(self.servos):
            if rng.random() < 0.1:
                servo.store("punch", self.joints[i].punch_raw)
                self.wait(0.5)
                servo.store("lock", 1)

    def _prepare(self, i: int) -> str:
        """Bring a servo into a state that it can be found in; return which."""
        servo, rng, joint = self.servos[i], self.rng, self.joints[i]
        if self.modes[i] == "wheel":
            servo.store("moving_speed", 0)
            return "wheel"
        servo.store("moving_speed", int(rng.choice([0, 0, 20, 1023])))
        kind = rng.choice(["limp", "held", "held by others", "shut down", "fresh"])
        if kind == "fresh":
            servo.power_cycle()
            return kind
        for side in ("cw", "ccw"):
            servo.store(f"{side}_compliance_slope", int(rng.choice([16, 32, 64, 128])))
            servo.store(f"{side}_compliance_margin", int(rng.integers(0, 4)))
        servo.store("punch", int(rng.choice([0, 32, 64])))
        servo.store("torque_limit", int(rng.integers(700, 1024)))
        here = servo.motion.angle_rad
        servo.store("goal_position", round(512 + here / TICK))
        if kind == "limp":
            # An old goal far away: the register keeps it.
            servo.store("goal_position", int(rng.integers(0, 1024)))
        elif kind == "shut down":
            servo.store("torque_enable", 1)
            self.shut_down(i)
        else:
            if kind == "held":
                for side in ("cw", "ccw"):
                    servo.store(f"{side}_compliance_slope", joint.slope_raw)
                    servo.store(f"{side}_compliance_margin", joint.margin_ticks)
                servo.store("punch", joint.punch_raw)
                servo.store("torque_limit", joint.torque_limit_raw)
            servo.store("torque_enable", 1)
            self.world.loads[i] = rng.uniform(-0.5, 0.5)
        return kind

    def shut_down(self, i: int) -> None:
        """Let a servo push against something until it gives up; its goal stays far away."""
        servo = self.servos[i]
        if servo.wheel_mode:
            servo.store("torque_limit", 0)
            return
        servo.disturbance = BLOCKED
        before = servo.registers["goal_position"]
        servo.store("goal_position", before + (300 if before < 512 else -300))
        self.wait(3.0)
        assert servo.registers["torque_limit"] == 0
        servo.disturbance = NONE
        self.world.loads[i] = 0.0

    def wait(self, seconds: float) -> None:
        self.world.pass_until(self.world.now + seconds)

    def chain(self) -> ServoChain:
        """What a driver that has just opened the port has."""
        bus = Bus(MemoryPort(self.world), retries=1)
        found = handshake(bus, self.joints, (12,))
        chain = ServoChain(bus, self.joints, found.servos, MOTION, lambda: self.world.now)
        chain.look_for_torque()
        return chain

    def load(self, i: int) -> None:
        """Let gravity pull at a joint that is held."""
        if self.modes[i] == "joint":
            self.world.loads[i] = self.rng.uniform(-0.5, 0.5)

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
        assert all(
            on.driven for on, mode in zip(self.servos, self.modes, strict=True) if mode == "joint"
        )
        return farthest


@pytest.mark.timeout(240)
@pytest.mark.parametrize("chunk", range(CHUNKS))
def test_torque_moves_no_joint_by_more_than_a_tick(chunk: int) -> None:
    worst: dict[str, float] = {}
    seen: set[str] = set()
    for seed in range(chunk, STATES, CHUNKS):
        rig = Rig(seed)
        seen.update(rig.kinds)

        def note(what: str, ticks: float, seed: int = seed) -> None:
            assert ticks <= 1.0, f"{what} of state {seed} moved a joint by {ticks:.1f} ticks"
            worst[what] = max(worst.get(what, 0.0), ticks)

        chain = rig.chain()
        note("start-up", rig.arm_and_hold(chain))

        # It is laid down before its torque goes.
        rig.world.loads = [0.0] * SERVOS
        rig.wait(0.5)
        chain.disarm()
        rig.wait(0.2)
        note("re-enable", rig.arm_and_hold(chain))

        # One servo shuts itself down, another one's power fails for a moment, one goes on holding.
        trip, blink, hold = rig.rng.permutation(SERVOS)
        rig.load(hold)
        rig.shut_down(trip)
        rig.servos[blink].power_cycle()
        rig.wait(1.0)
        note("recover", rig.arm_and_hold(chain if seed % 2 else rig.chain()))

        for i in range(SERVOS):
            rig.load(i)
        # Without punch a joint creeps into its droop.
        rig.wait(2.0)
        note("replug", rig.arm_and_hold(rig.chain()))
    assert set(worst) == {"start-up", "re-enable", "recover", "replug"}
    assert seen == {"limp", "held", "held by others", "shut down", "fresh", "wheel"}


def single(servo: Servo) -> tuple[World, ServoChain]:
    world = World([servo])
    joint = JointSetup("joint_1", 1, 1, 0.0, "joint", -2.2, 2.2, 5.5, 1, 32, 32, 1.0)
    bus = Bus(MemoryPort(world), retries=1)
    found = handshake(bus, [joint], (12,))
    return world, ServoChain(bus, [joint], found.servos, MOTION, lambda: world.now)


@pytest.mark.parametrize("angle", [2.63, 3.0, math.pi, -3.0, -2.63])
def test_a_joint_that_its_sensor_does_not_see_gets_no_torque(angle: float) -> None:
    servo = Servo(1)
    servo.motion.angle_rad = angle
    world, chain = single(servo)
    world.pass_until(world.now + 0.2)
    with pytest.raises(ServoError, match="does not stand still"):
        chain.arm()
    world.pass_until(world.now + 1.0)
    assert not servo.driven
    assert servo.motion.angle_rad == angle


def test_a_joint_that_sags_out_of_its_sensors_sight_is_refused_and_held_as_it_was() -> None:
    servo = Servo(1, angle_rad=2.55)
    servo.store("goal_position", 1009)
    servo.store("torque_enable", 1)
    servo.store("cw_compliance_slope", 128)
    servo.store("ccw_compliance_slope", 128)
    world, chain = single(servo)
    world.loads = [-0.45]
    world.pass_until(world.now + 1.0)
    assert servo.motion.angle_rad > 2.625
    for _ in range(20):
        with pytest.raises(ServoError, match="readings jump"):
            chain.arm()
        world.pass_until(world.now + 0.013)
    assert servo.driven
    assert servo.registers["goal_position"] == 1009


def test_a_firmware_that_takes_goals_for_torque_is_not_driven_after_a_power_failure() -> None:
    servo = Servo(1, ServoParameters(goal_enables_torque=True))
    world, chain = single(servo)
    chain.arm()

    def cycles(seconds: float, velocity: float | None) -> None:
        end = world.now + seconds
        while world.now < end:
            cycle = world.now
            chain.write(None if velocity is None else [velocity])
            chain.read(cycle + 0.017)
            world.pass_until(cycle + 0.02)

    cycles(0.5, 0.3)
    assert not chain.fault()
    servo.power_off()
    cycles(0.1, 0.3)
    servo.power_on()
    cycles(0.1, 0.3)
    assert "settings are gone" in chain.fault() or "torque is off" in chain.fault()
    before = servo.motion.angle_rad
    cycles(1.0, 0.3)
    # What it was sent last lies no further than the look-ahead.
    assert abs(servo.motion.angle_rad - before) < 0.3 * 0.15 + 36 * TICK
    rest = servo.motion.angle_rad
    cycles(1.0, 0.3)
    assert servo.motion.angle_rad == pytest.approx(rest, abs=TICK)
    chain.arm()
    cycles(0.5, 0.3)
    assert not chain.fault()
    assert servo.motion.angle_rad > rest + 0.1


def test_a_joint_that_a_load_pushes_away_keeps_its_goal() -> None:
    servo = Servo(1)
    world, chain = single(servo)
    chain.arm()
    world.loads = [-0.45]
    world.pass_until(world.now + 0.02)
    assert servo.motion.speed_rad_s > 0.1
    chain.arm()
    assert servo.registers["goal_position"] == 512


def test_a_joint_on_its_way_stops_where_it_is() -> None:
    servo = Servo(1)
    world, chain = single(servo)
    chain.arm()
    servo.store("moving_speed", 100)
    servo.store("goal_position", 532)
    world.pass_until(world.now + 0.03)
    assert servo.motion.speed_rad_s > 0.1
    chain.arm()
    assert 512 <= servo.registers["goal_position"] < 525


def test_a_locked_servo_that_needs_another_punch_is_refused_with_what_to_do() -> None:
    servo = Servo(1)
    servo.store("punch", 100)
    servo.store("lock", 1)
    _, chain = single(servo)
    with pytest.raises(ServoError, match=r"is locked .* switch its power off and on"):
        chain.arm()
    assert not servo.driven


def test_a_joint_outside_its_servos_own_limits_is_refused_and_stays_limp() -> None:
    servo = Servo(1, angle_rad=1.5, eeprom={"cw_angle_limit": 300, "ccw_angle_limit": 700})
    _, chain = single(servo)
    with pytest.raises(ServoError, match="outside its servo's angle limits"):
        chain.arm()
    assert not servo.driven
