"""One AX-12: its registers, and the motor, sensor and alarms that they rule."""

from __future__ import annotations

import functools
from collections.abc import Mapping

import numpy as np

from snake_control.mock import disturbance, mechanics, units
from snake_control.mock.control_table import BY_NAME, RAM_START, RegisterFile, registers_in
from snake_control.mock.health import Health
from snake_control.mock.models import AX_12A, Model
from snake_control.mock.parameters import ServoParameters, Shutdown
from snake_control.mock.protocol import CONDITIONS, ErrorBit
from snake_control.mock.sensor import Sensor
from snake_control.mock.volatile import RegisteredWrite, Volatile

_REST_RAD_S = 1e-3
_REST_TIME_S = 0.1
# Output this near to the torque limit counts as all that the servo has.
_AT_THE_LIMIT = 0.99
# Manual of 2006, page 15: the LED stops blinking 2 s after the error is over.
_BLINKS_ON_FOR_S = 2.0
_BEGINS_A_MOVE = frozenset({"goal_position", "torque_enable"})
_ENDS_A_SHUTDOWN = frozenset({"torque_limit", "torque_enable"})


@functools.cache
def _names_in(address: int, size: int) -> frozenset[str]:
    return frozenset(register.name for register in registers_in(address, size))


class Servo:
    """An AX-12 with its shaft; time passes only in ``step``.

    Attributes:
        parameters: what it is made of.
        model: which of the AX servos it is.
        registers: the control table; change it through ``store`` or ``store_bytes``.
        motion: state of the shaft.
        health: temperature and overload.
        disturbance: what acts on it from outside.
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
        self.model = model
        self.parameters = parameters or ServoParameters(motor=model.motor)
        self.registers = RegisterFile({**model.defaults, "model_number": model.number})
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
        self._powered = False
        self._take_eeprom()
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

    @property
    def powered(self) -> bool:
        """Whether it has its supply; without, it neither hears nor drives."""
        return self._powered

    def power_cycle(self) -> None:
        """Switch the power off and on: RAM returns to its defaults, the shaft stays."""
        self.power_off()
        self.power_on()

    def power_off(self) -> None:
        """Take the supply away: the shaft is free, and the RAM is lost."""
        self._powered = False
        self._forget()

    def power_on(self) -> None:
        """Give it its supply: RAM has its defaults, Goal Position is where the shaft is.

        Nothing happens if it has it.
        """
        if not self._powered:
            self._powered = True
            self._start()

    def factory_reset(self) -> None:
        """Give the control table the factory's values, and start anew."""
        self.registers.reset()
        self._take_eeprom()
        self._start()

    def _start(self) -> None:
        self._forget()
        r = self.registers
        r["torque_limit"] = r["max_torque"]
        r["goal_position"] = self._sensor.position(self.motion.angle_rad)
        self._take_ram()

    def _forget(self) -> None:
        self.registers.reset_ram()
        self._now = Volatile()
        self._frozen: tuple[int, int] | None = None
        self.health.overloaded_for_s = 0.0
        self._take_ram()

    @property
    def driven(self) -> bool:
        """Whether the motor is powered: after Torque Enable, or a Moving Speed in wheel mode."""
        return self._now.driven

    @property
    def error(self) -> ErrorBit:
        """Conditions that every reply reports; those that shut the servo down stay."""
        bits = self._now.conditions | self._now.tripped
        return ErrorBit(bits) if bits else ErrorBit.NONE

    @property
    def shut_down(self) -> bool:
        """Whether an alarm has switched the motor off."""
        return self._now.shut_down

    @property
    def led_blinks(self) -> bool:
        """Whether the LED blinks for an alarm; the LED register has no say then."""
        return self._now.blinking_for_s > 0.0

    @property
    def moving(self) -> bool:
        """Whether a goal is being executed."""
        return self._now.executing

    @property
    def waiting(self) -> RegisteredWrite | None:
        """The REG_WRITE that waits for its ACTION."""
        return self._now.waiting

    @waiting.setter
    def waiting(self, write: RegisteredWrite | None) -> None:
        self._now.waiting = write
        self.registers["registered"] = int(write is not None)

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
        if not self._powered:
            return
        self._watch(dt)
        if self._now.executing:
            self._follow_execution(drive, dt)

    def _overloaded(self, load_nm: float) -> bool:
        """Whether the torque limit does not do: e-manual, "cannot be controlled by the set torque".

        That is a load beyond limit and gear friction together; or a shaft that does not turn
        where all the limit drives it, because it is held fast or at the end of its strength.
        """
        limit = self._limit
        if limit == 0.0:
            return False
        motion, motor = self.motion, self.parameters.motor
        output = motion.output
        if abs(output) >= _AT_THE_LIMIT * limit:
            forwards = motion.speed_rad_s if output > 0.0 else -motion.speed_rad_s
            if forwards < _REST_RAD_S:
                return True
        carried = limit * motor.torque(self._supply_voltage_v) + motor.friction_torque_nm
        return abs(load_nm) > carried

    def _watch(self, dt: float) -> None:
        now = self._now
        if now.blinking_for_s > 0.0:
            now.blinking_for_s -= dt
        now.conditions = self.health.conditions(
            self.parameters.health,
            self._supply_voltage_v,
            self._voltage_limits_v,
            self._temperature_limit_c,
        )
        if now.conditions:
            self.alarm(now.conditions)

    def alarm(self, errors: int) -> None:
        """Do about errors what Alarm LED and Alarm Shutdown say.

        An error of an instruction can shut down, too; only conditions are also reported by the
        replies that follow, because an instruction's error bits are about that instruction.

        Args:
            errors: bits of ``ErrorBit``.
        """
        now = self._now
        if errors & self._alarm_led:
            now.blinking_for_s = _BLINKS_ON_FOR_S
        tripping = errors & self._alarm_shutdown
        if not tripping:
            return
        now.tripped |= tripping & CONDITIONS
        if now.shut_down:
            return
        now.shut_down = True
        clears = self.parameters.shutdown_clears
        if Shutdown.TORQUE_LIMIT in clears:
            self.store("torque_limit", 0)
        if Shutdown.TORQUE_ENABLE in clears:
            self.store("torque_enable", 0)

    def _recovers(self) -> bool:
        """Whether all that a shutdown clears has been written again."""
        clears, r = self.parameters.shutdown_clears, self.registers
        limited = Shutdown.TORQUE_LIMIT in clears and r["torque_limit"] == 0
        disabled = Shutdown.TORQUE_ENABLE in clears and r["torque_enable"] == 0
        return not (limited or disabled)

    def _follow_execution(self, drive: mechanics.Drive, dt: float) -> None:
        now = self._now
        at_rest = abs(self.motion.speed_rad_s) < _REST_RAD_S
        now.resting_for_s = now.resting_for_s + dt if at_rest else 0.0
        if not isinstance(drive, mechanics.ToGoal):
            now.executing = False
            return
        error = drive.error(self.motion.angle_rad)
        arrived = abs(error) <= drive.side(error).margin_rad
        # A load can keep the shaft away from the margin for ever: then rest is the end.
        now.executing = not arrived and now.resting_for_s < _REST_TIME_S

    def _take_eeprom(self) -> None:
        """Take over what the EEPROM says; reading it in every step would cost too much."""
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
        self._alarm_led, self._alarm_shutdown = r["alarm_led"], r["alarm_shutdown"]

    def _take_ram(self) -> None:
        """Take over what the RAM asks of the motor."""
        now = self._now
        on = now.driven and not now.shut_down
        self._limit = self.registers["torque_limit"] / units.OUTPUT_STEPS if on else 0.0
        self._drive = self._read_drive() if on else mechanics.OpenLoop()

    def _read_drive(self) -> mechanics.Drive:
        """Turn the registers into what they ask of a motor that is switched on."""
        r = self.registers
        limit = self._limit
        speed = r["moving_speed"]
        if self.wheel_mode:
            output = min((speed & 0x3FF) / units.OUTPUT_STEPS, limit)
            return mechanics.OpenLoop(-output if speed & units.DIRECTION_BIT else output)
        # A value beyond 1023 can only be left over from wheel mode; its direction has no meaning.
        speed &= 0x3FF
        fastest = self.parameters.motor.joint_mode_speed_rad_s
        return mechanics.ToGoal(
            goal_rad=units.angle_from_ticks(r["goal_position"]),
            speed_rad_s=min(speed * units.SPEED_UNIT_RAD_S, fastest) if speed else fastest,
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
        r, now = self.registers, self._now
        r.write(address, data)
        names = _names_in(address, len(data))
        if self._powered:
            self._switch(names)
        # The mode before the write counts, which no block of registers can change with the speed.
        if address < RAM_START:
            self._take_eeprom()
        self._take_ram()
        if names & _BEGINS_A_MOVE and isinstance(self._drive, mechanics.ToGoal):
            now.resting_for_s = 0.0
            error = self._drive.error(self.motion.angle_rad)
            now.executing = abs(error) > self._drive.side(error).margin_rad

    def _switch(self, written: frozenset[str]) -> None:
        """Switch the motor, and end a shutdown, as written registers ask for."""
        r, now = self.registers, self._now
        if "torque_enable" in written:
            now.driven = bool(r["torque_enable"])
        if self.wheel_mode:
            if "moving_speed" in written:
                now.driven = True
        elif "goal_position" in written and self.parameters.goal_enables_torque:
            now.driven = True
            r["torque_enable"] = 1
        if now.shut_down and written & _ENDS_A_SHUTDOWN and self._recovers():
            now.shut_down = False
            now.tripped = 0
            # What is still too much for it has its time again.
            self.health.overloaded_for_s = 0.0

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
        r["moving"] = int(self._now.executing)
