"""Every error that this package raises on purpose.

Subclasses carry their data and also derive from the built-in that a caller would catch.
"""


class SnakeError(Exception):
    """Base of all errors raised on purpose by snake_control."""

    def __reduce__(self) -> tuple[object, ...]:
        # Errors that make their text of several arguments must pass between processes, too; Python
        # would call them with the text alone.
        return _restored, (type(self), self.__dict__, self.args)


def _restored(
    cls: type[SnakeError], state: dict[str, object], args: tuple[object, ...]
) -> SnakeError:
    error = cls.__new__(cls)
    error.args = args
    error.__dict__.update(state)
    return error


class ConfigError(SnakeError, ValueError):
    """A configuration value that is missing, of the wrong type, or not allowed.

    Attributes:
        field: dotted name of the field, as in the YAML file (``robot.links``).
        value: what was given; ``None`` if nothing was.
        allowed: what would be accepted, in words.
    """

    def __init__(self, field: str, value: object, allowed: str) -> None:
        self.field = field
        self.value = value
        self.allowed = allowed
        super().__init__(f"{field} = {value!r}: {allowed}")


class ConfigFileError(SnakeError, ValueError):
    """A parameter file that cannot be read, or that rcl would refuse.

    Attributes:
        path: the file.
    """

    def __init__(self, path: str, reason: str) -> None:
        self.path = path
        super().__init__(f"{path}: {reason}")


class ModelError(SnakeError, ValueError):
    """A model quantity was asked for with an argument of wrong shape or without a finite value."""


class TrajectoryError(SnakeError, ValueError):
    """A motion of the head that cannot be: not finite, times in no order, or out of reach."""


class SubTaskError(SnakeError, RuntimeError):
    """A sub-task of somebody else's raised an error or gave an answer of the wrong form.

    Attributes:
        name: ``package.module:Class``.
        method: which of its methods.
        reason: the error that it raised, or what is wrong with its answer.
    """

    def __init__(self, name: str, method: str, reason: str) -> None:
        self.name = name
        self.method = method
        self.reason = reason
        super().__init__(f"sub-task {name}, {method} fails: {reason}")


class BusError(SnakeError, OSError):
    """The serial port cannot be opened or stopped working."""


class ServoError(SnakeError, RuntimeError):
    """One or more servos are missing, of the wrong kind or wrongly set up.

    Attributes:
        findings: one sentence per servo and finding.
    """

    def __init__(self, findings: list[str]) -> None:
        self.findings = list(findings)
        super().__init__("; ".join(findings))


class StudyError(SnakeError, RuntimeError):
    """A study of SCP choices that cannot be run or continued."""


class SeriesFileError(SnakeError, ValueError):
    """A recorded series that does not belong to this robot, or is damaged.

    Attributes:
        path: the file.
    """

    def __init__(self, path: str, reason: str) -> None:
        self.path = path
        super().__init__(f"{path}: {reason}")


class NodeDiedError(SnakeError, ChildProcessError):
    """A node's process ended while it was needed.

    Attributes:
        kind: which node.
        code: its exit code, negative for a signal.
        log: path of its log.
        log_tail: the last lines it wrote.
    """

    def __init__(self, kind: str, code: int, log: str, log_tail: str) -> None:
        self.kind = kind
        self.code = code
        self.log = log
        self.log_tail = log_tail
        how = f"by signal {-code}" if code < 0 else f"with exit code {code}"
        super().__init__(f"node {kind} ended {how}; the end of {log}:\n{log_tail}")


class NotReadyError(SnakeError, TimeoutError):
    """Something did not happen within its time.

    Attributes:
        what: what was waited for.
        timeout_s: for how long.
    """

    def __init__(self, what: str, timeout_s: float, found: str) -> None:
        self.what = what
        self.timeout_s = timeout_s
        super().__init__(f"waited {timeout_s:g} s in vain for {what}; {found}")
