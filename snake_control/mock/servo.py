"""One AX-12: its registers, and the motor, sensor and alarms that they rule."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from snake_control.mock import disturbance, mechanics, units
from snake_control.mock.control_table import BY_NAME, RegisterFile, registers_in
from snake_control.mock.health import Health, HealthParameters
from snake_control.mock.models import AX_12A, Model
from snake_control.mock.protocol import ErrorBit
from snake_control.mock.sensor import Sensor

_REST_RAD_S = 1e-3
_REST_TIME_S = 0.1
# Output this near to the torque limit counts as all that the servo has.
_AT_THE_LIMIT = 0.99


@dataclasses.dataclass(frozen=True)
class ServoParameters:
    """What a servo is made of, and how strictly it reads its manual.

    Attributes:
        motor: motor and gear.
        health: warming and overload.
        supply_voltage_v: voltage at power-on [V].
        eeprom_needs_torque_off: refuse EEPROM writes while the servo is driven, as the e-manual
            asks; the manual of 2006 knows no such rule.
        goal_enables_torque: let a write of Goal Position in joint mode switch torque on, as users
            report of some firmware.
        shutdown_clears_torque_enable: let an alarm shutdown also clear Torque Enable (manual of
            2006), beside setting Torque Limit to 0 (e-manual).
    """

    motor: mechanics.MotorParameters = dataclasses.field(default_factory=mechanics.MotorParameters)
    health: HealthParameters = dataclasses.field(default_factory=HealthParameters)
    supply_voltage_v: float = 11.1
    eeprom_needs_torque_off: bool = True
    goal_enables_torque: bool = False
    shutdown_clears_torque_enable: bool = False

    def __post_init__(self) -> None:
        if not 0 <= self.supply_voltage_v <= 25.5:
            raise ValueError(f"supply_voltage_v = {self.supply_voltage_v!r}: give 0 to 25.5")


class Servo:
    """An AX-12 with its shaft; time passes only in ``step``.

    Attributes:
        parameters: what it is made of.
        registers: the control table; change it through ``store`` or ``store_bytes``.
        motion: state of the shaft.
        health: temperature and overload.
        disturbance: what acts on it from outside.
        powered: whether it has its supply; without, it neither hears nor moves by itself.
        waiting: address and bytes of a REG_WRITE that waits for its ACTION.
        id: the id that it answers to.
        baud_rate: bits per second that it listens at, 2000000 / (register + 1).
        return_delay_s: from an instruction's last byte to the reply's first [s].
        wheel_mode: whether both angle limits are 0.
    """

    def __init__(
        self,
        servo_id: int,
        parameters: ServoParameters | None = None,
        *,
        model: Model = AX_12A,
        angle_rad: float = 0.0,
        eeprom: Mapping[str, int] | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        """Make a servo and switch its power on.

        Args:
            servo_id: 0 to 253.
            parameters: of the motor and the firmware; by default the model's.
            model: which of the AX servos it is.
            angle_rad: angle of the shaft, counter-clockwise from position 512 [rad].
            eeprom: values that differ from the factory's, by register name.
            rng: for what the position sensor reads in its dead zone.

        Raises:
            ValueError: a register that is no EEPROM, or a value outside its range.
        """
        self.parameters = parameters or ServoParameters(motor=model.motor)
        self.registers = RegisterFile(model.defaults)
        self.registers["model_number"] = model.number
        for name, value in {"id": servo_id, **(eeprom or {})}.items():
            register = BY_NAME[name]
            if not register.eeprom or not register.low <= value <= register.high:
                raise ValueError(f"servo {servo_id}: {name} = {value!r} is no EEPROM value")
            self.registers[name] = value
        self.motion = mechanics.Motion(angle_rad=angle_rad)
        self._sensor = Sensor(rng or np.random.default_rng(servo_id))
        self.health = Health(self.parameters.health.ambient_c)
        self.disturbance = disturbance.NONE
        self.supply_voltage_v = self.parameters.supply_voltage_v
        self.power_on()

    @property
    def supply_voltage_v(self) -> float:
        """Voltage of the supply [V]."""
        return self._supply_voltage_v

    @supply_voltage_v.setter
    def supply_voltage_v(self, voltage_v: float) -> None:
        if not 0 <= voltage_v <= 25.5:
            raise ValueError(f"supply_voltage_v = {voltage_v!r}: give 0 to 25.5")
        self._supply_voltage_v = voltage_v

    def power_cycle(self) -> None:
        """Switch the power off and on: RAM returns to its defaults, the shaft stays."""
        self.power_off()
        self.power_on()

    def power_off(self) -> None:
        """Take the supply away: the shaft is free, and the RAM is lost."""
        self.powered = False
        self._driven = False
        self._drive: mechanics.Drive = mechanics.OpenLoop()
        self._executing = False

    def power_on(self) -> None:
        """Give it its supply: RAM has its defaults, Goal Position is where the shaft is."""
        self.powered = True
        r = self.registers
        r.reset_ram()
        r["torque_limit"] = r["max_torque"]
        r["goal_position"] = self._sensor.position(self.motion.angle_rad)
        self._driven = False
        self.waiting: tuple[int, bytes] | None = None
        self._conditions = ErrorBit.NONE
        self._tripped = ErrorBit.NONE
        self._executing = False
        self._resting_for_s = 0.0
        self._frozen: tuple[int, int] | None = None
        self.health.overloaded_for_s = 0.0
        self._refresh()

    @property
    def driven(self) -> bool:
        """Whether the motor is powered: after Torque Enable, or a Moving Speed in wheel mode."""
        return self._driven

    @property
    def error(self) -> ErrorBit:
        """Conditions that every reply reports; those that shut the servo down stay."""
        return self._conditions | self._tripped

    @property
    def moving(self) -> bool:
        """Whether a goal is being executed."""
        return self._executing

    def step(self, dt: float, load_nm: float = 0.0) -> None:
        """Let ``dt`` seconds pass under a load: the torque that holding the joint takes [N m]."""
        p, motion, drive, outside = self.parameters, self.motion, self._drive, self.disturbance
        load_nm += outside.extra_load_nm
        if outside.shaft_blocked:
            mechanics.block(motion, drive)
        else:
            mechanics.advance(motion, drive, p.motor, load_nm, self._supply_voltage_v, dt)
        self._sensor.step(motion.angle_rad, dt)
        self.health.step(p.health, motion.output, self._overloaded(load_nm), dt)
        if outside.temperature_c is not None:
            self.health.temperature_c = outside.temperature_c
        if self.powered:
            self._watch()
        if self._executing:
            self._follow_execution(drive, dt)

    def _overloaded(self, load_nm: float) -> bool:
        """Whether the load is more than torque limit and gear friction carry together.

        A shaft that is held fast loads the servo with all the output that its drive gives.
        """
        limit = self._torque_limit
        if not self._driven or limit == 0:
            return False
        if self.disturbance.shaft_blocked and abs(self.motion.output) >= _AT_THE_LIMIT * limit:
            return True
        motor = self.parameters.motor
        carried = limit * motor.torque(self._supply_voltage_v) + motor.friction_torque_nm
        return abs(load_nm) > carried

    def _watch(self) -> None:
        self._conditions = self.health.conditions(
            self.parameters.health,
            self._supply_voltage_v,
            self._voltage_limits_v,
            self._temperature_limit_c,
        )
        if not self._conditions:
            return
        tripping = self._conditions & self.registers["alarm_shutdown"]
        if tripping:
            self._tripped |= tripping
            self.store("torque_limit", 0)
            if self.parameters.shutdown_clears_torque_enable:
                self.store("torque_enable", 0)

    def _follow_execution(self, drive: mechanics.Drive, dt: float) -> None:
        at_rest = abs(self.motion.speed_rad_s) < _REST_RAD_S
        self._resting_for_s = self._resting_for_s + dt if at_rest else 0.0
        if not isinstance(drive, mechanics.ToGoal):
            self._executing = False
            return
        error = drive.error(self.motion.angle_rad)
        arrived = abs(error) <= drive.side(error).margin_rad
        # A load can keep the shaft away from the margin for ever: then rest is the end.
        self._executing = not arrived and self._resting_for_s < _REST_TIME_S

    def _refresh(self) -> None:
        """Take over what the registers say; reading them in every step would cost too much."""
        r = self.registers
        self.id = r["id"]
        self.baud_rate = 2_000_000 / (r["baud_rate"] + 1)
        self.return_delay_s = r["return_delay_time"] * 2e-6
        self.wheel_mode = r["cw_angle_limit"] == 0 == r["ccw_angle_limit"]
        # The e-manual: in wheel mode a unit is about 0.1 % of the speed without load.
        no_load = self.parameters.motor.no_load_speed_rad_s
        self._speed_unit_rad_s = (
            no_load / units.OUTPUT_STEPS if self.wheel_mode else units.SPEED_UNIT_RAD_S
        )
        self._voltage_limits_v = r["min_voltage_limit"] / 10, r["max_voltage_limit"] / 10
        self._temperature_limit_c = float(r["temperature_limit"])
        self._torque_limit = r["torque_limit"] / units.OUTPUT_STEPS
        self._drive = self._read_drive()

    def _read_drive(self) -> mechanics.Drive:
        """Turn the registers into what they ask of the motor."""
        r = self.registers
        if not self._driven:
            return mechanics.OpenLoop()
        limit = self._torque_limit
        speed = r["moving_speed"]
        if self.wheel_mode:
            output = min((speed & 0x3FF) / units.OUTPUT_STEPS, limit)
            return mechanics.OpenLoop(-output if speed & units.DIRECTION_BIT else output)
        speed &= 0x3FF
        return mechanics.ToGoal(
            goal_rad=units.angle_from_ticks(r["goal_position"]),
            speed_rad_s=speed * units.SPEED_UNIT_RAD_S if speed else math.inf,
            ccw=mechanics.side(r["ccw_compliance_margin"], r["ccw_compliance_slope"]),
            cw=mechanics.side(r["cw_compliance_margin"], r["cw_compliance_slope"]),
            punch=r["punch"] / units.OUTPUT_STEPS,
            torque_limit=limit,
        )

    def store(self, name: str, value: int) -> None:
        """Set a register by name, whether an instruction could or not, with all that follows."""
        register = BY_NAME[name]
        self.store_bytes(register.address, value.to_bytes(register.size, "little"))

    def store_bytes(self, address: int, data: bytes) -> None:
        """Set whole registers, whether an instruction could or not, with all that follows."""
        r = self.registers
        r.write(address, data)
        names = {register.name for register in registers_in(address, len(data))}
        if "torque_enable" in names:
            self._driven = bool(r["torque_enable"])
        # The mode before the write counts, which no block of registers can change with the speed.
        if "moving_speed" in names and self.wheel_mode:
            self._driven = True
        enables = self.parameters.goal_enables_torque and not self.wheel_mode
        if "goal_position" in names and enables:
            self._driven = True
            r["torque_enable"] = 1
        if "torque_limit" in names and r["torque_limit"]:
            self._tripped = ErrorBit.NONE
        self._refresh()
        if names & {"goal_position", "torque_enable"} and isinstance(self._drive, mechanics.ToGoal):
            self._resting_for_s = 0.0
            error = self._drive.error(self.motion.angle_rad)
            self._executing = abs(error) > self._drive.side(error).margin_rad

    def measure(self) -> None:
        """Fill the Present registers and Moving."""
        r, motion, sensor = self.registers, self.motion, self._sensor
        if not self.disturbance.frozen_sensor:
            self._frozen = None
        if self._frozen is None:
            seen = (
                sensor.position(motion.angle_rad),
                sensor.speed(motion.speed_rad_s, self._speed_unit_rad_s),
            )
            if self.disturbance.frozen_sensor:
                self._frozen = seen
        else:
            seen = self._frozen
        r["present_position"], r["present_speed"] = seen
        r["present_load"] = units.signed_magnitude(motion.output * units.OUTPUT_STEPS)
        r["present_voltage"] = min(max(round(self._supply_voltage_v * 10), 0), 255)
        r["present_temperature"] = min(max(round(self.health.temperature_c), 0), 255)
        r["moving"] = int(self._executing)
