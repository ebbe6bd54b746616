r"""What is thrown: the bottle, the water cut into slices, and the throw.

    y                                  theta is the angle of u_r (cap to base) from the
    ^                                  downward vertical; theta = 0: the bottle stands upright.
    |      cap  r = 0                  omega = d theta/dt > 0 turns counter-clockwise.
    |        \
    |         \  u_r = (sin theta, -cos theta)
    |          \
    +------> x  base  r = L

Units are SI throughout:

==================  =======  ======  ===============================================
field               paper    unit    meaning
==================  =======  ======  ===============================================
bottle.length       L        m       cap to base
bottle.radius       R        m       radius of the thin cylinder
bottle.mass         M_b      kg      empty bottle
bottle.capacity     M_max    kg      water that fills it
water_mass          M_w      kg      all slices together
n_slices            N        1       point slices of equal mass on the axis
drag                alpha    kg/s    drag coefficient of one slice
restitution         -beta    1       e: speed after an impact over speed before
omega0              omega_0  rad/s   angular velocity at release
theta0              theta_0  rad     angle at release
duration            T        s       time from release
gravity             g        m/s^2   0 is allowed
launch_velocity     v_0      m/s     (v_x, v_y) of the centre of mass at release
frozen              (ice)    -       True: no slice may move
==================  =======  ======  ===============================================
"""

from __future__ import annotations

import math
import numbers
import textwrap
import tomllib
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


MAX_SLICES = 10_000_000
"""Slices of a throw at the most; the paper uses 500."""


MIN_VALUE = 1e-15
MAX_VALUE = 1e15
"""Least and largest positive number of a field, in its unit: between them no product of fields leaves the range of
floating point."""

MAX_ANGLE = 4 * math.pi
"""Largest angle at release [rad]: a larger one was meant in degrees."""

MAX_FILE = 2**18
"""Bytes of a scenario file at the most."""

MAX_SHOWN = 60
"""Characters of a value that an error message shows."""


class ScenarioError(ValueError):
    """A value no bottle can have; the message names field, value and admissible range."""


class _Checks:
    """Collects every problem of one object, so that the user sees all of them at once."""

    def __init__(self, where: str = "") -> None:
        self.where = where
        self.problems: list[str] = []

    def number(
        self,
        name: str,
        value: object,
        unit: str,
        *,
        minimum: float,
        maximum: float,
    ) -> float | None:
        """Return ``value`` as float if it is a finite number in range, else note why not."""
        # A float first: asking ``numbers.Real`` takes longer than the rest of the check.
        if not isinstance(value, float) and (isinstance(value, bool) or not isinstance(value, numbers.Real)):
            admissible = f"[{minimum:g}, {maximum:g}] {unit}".rstrip()
            self.problems.append(f"{self.where}{name} = {shown(value)} is not a number (admissible: {admissible})")
            return None
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        # Written as "not inside", because NaN passes every "outside" test.
        if not minimum <= number <= maximum:
            given = f"{self.where}{name} = {number!r} {unit}".rstrip()
            self.problems.append(f"{given} is outside [{minimum:g}, {maximum:g}]")
            return None
        return number

    def whole(self, name: str, value: object, *, minimum: int, maximum: int) -> int | None:
        """Return ``value`` as int if it is a whole number in [minimum, maximum]."""
        problem = not_whole(f"{self.where}{name}", value, minimum, maximum)
        if problem:
            self.problems.append(problem)
            return None
        return int(value)  # type: ignore[call-overload, no-any-return]

    def pair(self, name: str, value: object, unit: str, *, maximum: float) -> tuple[float | None, ...]:
        """Return ``value`` as (x, y) if it is a pair of numbers in [-maximum, maximum], else note why not."""
        parts = () if isinstance(value, str) or not isinstance(value, Iterable) else tuple(value)
        if len(parts) != 2:
            self.problems.append(f"{self.where}{name} = {shown(value)} is not a pair (x, y) of numbers in {unit}")
            return ()
        return tuple(
            self.number(f"{name}.{axis}", part, unit, minimum=-maximum, maximum=maximum)
            for axis, part in zip("xy", parts, strict=True)
        )

    def refuse(self) -> None:
        """Raise one ScenarioError that states all problems, if there are any."""
        if self.problems:
            raise ScenarioError("; ".join(self.problems))


def shortened(text: str, width: int) -> str:
    """Return a text on one line of at most ``width`` characters, cut between two words and ended by " ..." if it is.

    A single word that is longer than that, such as a number of a thousand digits, is cut inside.
    """
    line = " ".join(text.split())
    if len(line) <= width:
        return line
    short = textwrap.shorten(line, width, placeholder=" ...", break_on_hyphens=False)
    return short if short != "..." else line[: width - 3] + "..."


def not_whole(name: str, value: object, minimum: int, maximum: int) -> str:
    """Return what is wrong with ``value`` as a whole number in [minimum, maximum], or an empty string."""
    if isinstance(value, bool) or not isinstance(value, numbers.Integral) or not minimum <= int(value) <= maximum:
        return f"{name} = {shown(value)} is not a whole number in [{minimum}, {maximum}]"
    return ""


def number_in(
    name: str,
    value: object,
    low: float,
    high: float,
    unit: str = "",
    *,
    open_low: bool = False,
    open_high: bool = False,
) -> float:
    """Return ``value`` as float if it is a number from ``low`` to ``high``, which count unless open; inf never does.

    Raises
    ------
    ValueError
        Naming the value and the range; NaN lies in none.
    """
    open_high = open_high or high == math.inf
    admissible = f"{'(' if open_low else '['}{low:g}, {high:g}{')' if open_high else ']'}{unit}"
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise ValueError(f"{name} = {shown(value)} is not a number (admissible: {admissible})")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    # Written as "not inside", because NaN passes every "outside" test.
    inside = (low < number if open_low else low <= number) and (number < high if open_high else number <= high)
    if not inside:
        raise ValueError(f"{name} = {number!r}{unit} is outside {admissible}")
    return number


def shown(value: object) -> str:
    """Return how an error message shows a value: as Python writes it, the middle of a long one left out."""
    text = repr(value)
    half = MAX_SHOWN // 2
    return text if len(text) <= MAX_SHOWN else f"{text[:half]} ... {text[-half:]}"


class UnsuitableFileError(ValueError):
    """What is at a path is no file of reasonable size; the message says what it is."""


def read_text(path: Path, max_bytes: int) -> str:
    """Return the UTF-8 text of a regular file of at most ``max_bytes`` bytes, or of what this program has open already.

    A byte-order mark is left out. A path such as /dev/stdin names an open descriptor, so that a shell may feed a pipe.

    Raises
    ------
    UnsuitableFileError
        For a device, a pipe or a socket, and for a file that is larger.
    OSError
        If it cannot be read.
    UnicodeDecodeError
        If it is not UTF-8.
    """
    refuse_devices(path)
    with path.open("rb") as file:
        content = file.read(max_bytes + 1)
    if len(content) > max_bytes:
        largest = f"{max_bytes / 2**10:g} KiB" if max_bytes < 2**20 else f"{max_bytes / 2**20:g} MiB"
        raise UnsuitableFileError(f"is larger than {largest}, the most that is read of such a file")
    return content.decode("utf-8-sig")


def read_toml(path: str | PathLike[str], max_bytes: int) -> tuple[dict[str, Any], str]:
    """Return the tables of a TOML file of at most ``max_bytes`` bytes, and its text; a ScenarioError names the file."""
    try:
        text = read_text(Path(path), max_bytes)
        return tomllib.loads(text), text
    except UnsuitableFileError as error:
        raise ScenarioError(f"{path}: {error}") from None
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read ({error.strerror or error})") from None
    except RecursionError:
        raise ScenarioError(f"{path}: is nested too deeply") from None
    except ValueError as error:  # bad TOML, bad UTF-8, numbers of thousands of digits
        raise ScenarioError(f"{path}: is not valid TOML ({error})") from None


def refuse_devices(path: Path) -> None:
    """Refuse a device, a pipe or a socket, which may have no end or never begin, unless this program has it open.

    Raises
    ------
    UnsuitableFileError
    """
    if path.exists() and not path.is_file() and not path.is_dir() and not _is_descriptor(path):
        raise UnsuitableFileError("is a device, a pipe or a socket, not a file")


def _is_descriptor(path: Path) -> bool:
    return str(path) == "/dev/stdin" or str(path.parent) in ("/dev/fd", "/proc/self/fd")


@dataclass(frozen=True, slots=True, kw_only=True)
class Bottle:
    """A rigid thin-walled cylinder; the defaults are the paper's bottle (section 5).

    Parameters
    ----------
    length, radius : float
        Cap to base, and radius of the cylinder [m], in [1e-15, 1e15].
    mass : float
        Empty bottle [kg], in [1e-15, 1e15].
    capacity : float
        Water that fills it [kg], in [1e-15, 1e15]. The paper's 1 kg is less than
        ``rho pi R^2 L`` = 1.407 kg of the cylinder it describes.

    Raises
    ------
    ScenarioError
        Naming every field that no bottle can have, its value and the admissible range.
    """

    length: float = 0.28
    radius: float = 0.04
    mass: float = 0.028
    capacity: float = 1.0

    def __post_init__(self) -> None:
        checks = _Checks("bottle.")
        for name, unit in (("length", "m"), ("radius", "m"), ("mass", "kg"), ("capacity", "kg")):
            object.__setattr__(
                self, name, checks.number(name, getattr(self, name), unit, minimum=MIN_VALUE, maximum=MAX_VALUE)
            )
        checks.refuse()


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """One throw. The defaults are the paper's own: half full, 500 slices of 1 g.

    Parameters
    ----------
    bottle : Bottle
    water_mass : float
        Mass of all slices [kg], in [1e-15, bottle.capacity].
    n_slices : int
        Number of slices, at least 1.
    drag : float
        alpha, drag coefficient of one slice [kg/s] (the paper's program says kg/m), in [0, 1e15].
    restitution : float
        e = -beta, in [0, 1].
    omega0 : float
        Angular velocity at release [rad/s], its magnitude in [1e-15, 1e15]: a bottle that does not spin has no flip.
        Negative values spin the other way.
    theta0 : float
        Angle at release [rad], in [-4 pi, 4 pi]; a larger one was meant in degrees.
    duration : float
        Time from release to landing [s], in [1e-15, 1e15].
    gravity : float
        [m/s^2], in [0, 1e15].
    launch_velocity : tuple of two floats
        Velocity of the centre of mass at release [m/s], each in [-1e15, 1e15]. The default has the paper's
        |v_0| of about 2 m/s. It moves the bottle through the lab and nothing else.
    frozen : bool
        The ice case: no slice may move.

    Raises
    ------
    ScenarioError
        Naming every impossible field, its value and the admissible range.
    """

    bottle: Bottle = field(default_factory=Bottle)
    water_mass: float = 0.5
    n_slices: int = 500
    drag: float = 0.01
    restitution: float = 0.5
    omega0: float = 20.0
    theta0: float = math.pi / 2
    duration: float = 0.5
    gravity: float = 9.81
    launch_velocity: tuple[float, float] = (0.5, 1.94)
    frozen: bool = False

    def __post_init__(self) -> None:
        checks = _Checks()
        if not isinstance(self.bottle, Bottle):
            raise ScenarioError(f"bottle = {shown(self.bottle)} is not a Bottle")
        checked: dict[str, object] = {
            "water_mass": self._checked_water_mass(checks),
            "n_slices": checks.whole("n_slices", self.n_slices, minimum=1, maximum=MAX_SLICES),
            "drag": checks.number("drag", self.drag, "kg/s", minimum=0.0, maximum=MAX_VALUE),
            "restitution": checks.number("restitution", self.restitution, "", minimum=0.0, maximum=1.0),
            "omega0": checks.number("omega0", self.omega0, "rad/s", minimum=-MAX_VALUE, maximum=MAX_VALUE),
            "theta0": self._checked_angle(checks),
            "duration": checks.number("duration", self.duration, "s", minimum=MIN_VALUE, maximum=MAX_VALUE),
            "gravity": checks.number("gravity", self.gravity, "m/s^2", minimum=0.0, maximum=MAX_VALUE),
            "launch_velocity": checks.pair("launch_velocity", self.launch_velocity, "m/s", maximum=MAX_VALUE),
        }
        if isinstance(omega0 := checked["omega0"], float) and abs(omega0) < MIN_VALUE:
            checks.problems.append(
                f"omega0 = {omega0!r} rad/s does not spin (its magnitude must be in [{MIN_VALUE:g}, {MAX_VALUE:g}])"
            )
        if not isinstance(self.frozen, bool):
            checks.problems.append(f"frozen = {shown(self.frozen)} is neither true nor false")
        checks.refuse()
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def _checked_water_mass(self, checks: _Checks) -> float | None:
        water_mass = checks.number("water_mass", self.water_mass, "kg", minimum=MIN_VALUE, maximum=MAX_VALUE)
        capacity = self.bottle.capacity
        if water_mass is not None and water_mass > capacity:
            checks.problems.append(
                f"water_mass = {water_mass!r} kg exceeds the bottle's capacity {capacity!r} kg "
                f"(admissible: [{MIN_VALUE:g}, {capacity:g}] kg)"
            )
        return water_mass

    def _checked_angle(self, checks: _Checks) -> float | None:
        angle = checks.number("theta0", self.theta0, "rad", minimum=-MAX_ANGLE, maximum=MAX_ANGLE)
        if angle is None and isinstance(self.theta0, int | float) and MAX_ANGLE < abs(self.theta0) <= 1e6:
            checks.problems[-1] += f"; radians? {self.theta0:g} degrees are {math.radians(self.theta0):.6g} rad"
        return angle

    # ------------------------------------------------------------------ derived geometry

    @property
    def slice_mass(self) -> float:
        """m = M_w / N [kg]."""
        return self.water_mass / self.n_slices

    @property
    def total_mass(self) -> float:
        """M_b + M_w [kg]."""
        return self.bottle.mass + self.water_mass

    @property
    def fill_fraction(self) -> float:
        """M_tilde = M_w / M_max, dimensionless."""
        return self.water_mass / self.bottle.capacity

    @property
    def slice_height(self) -> float:
        """h / N with h = M_tilde L [m]."""
        return self.fill_fraction * self.bottle.length / self.n_slices

    @property
    def r_min(self) -> float:
        """Smallest admissible slice position h / 2N, in contact with the cap [m]."""
        return self.slice_height / 2

    @property
    def r_max(self) -> float:
        """Largest admissible slice position L - h / 2N, in contact with the base [m]."""
        return self.bottle.length - self.slice_height / 2

    @property
    def damping_rate(self) -> float:
        """gamma = alpha / 2m [1/s]."""
        return self.drag / (2 * self.slice_mass)

    def initial_positions(self) -> NDArray[np.float64]:
        """Slices stacked on the base, slice 0 in contact with it (Eq. 3a); shape (N,) [m]."""
        import numpy as np

        return (
            self.bottle.length - self.slice_height / 2 - np.arange(self.n_slices, dtype=np.float64) * self.slice_height
        )

    # ------------------------------------------------------------------ variations

    def with_slices(self, n_slices: int) -> Scenario:
        """Return the same throw cut into ``n_slices`` slices, damping rate alpha/2m unchanged."""
        problem = not_whole("n_slices", n_slices, 1, MAX_SLICES)
        if problem:
            raise ScenarioError(problem)
        try:
            return replace(self, n_slices=int(n_slices), drag=self.drag * self.n_slices / int(n_slices))
        except ScenarioError as error:
            given = f"drag = {self.drag:g} kg/s of {self.n_slices} slices was given and is cut to {n_slices}"
            raise ScenarioError(f"{error}; {given}, alpha/2m unchanged") from None

    # ------------------------------------------------------------------ files

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> Scenario:
        """Read a scenario file with the tables ``[scenario]`` and ``[bottle]``, both optional.

        Raises
        ------
        ScenarioError
            Naming file, table and key: unreadable file, bad TOML, unknown table or key
            (with the nearest known name), impossible value.
        """
        document, _ = read_toml(path, MAX_FILE)
        return cls.from_mapping(document, source=str(path))

    @classmethod
    def from_mapping(cls, document: Mapping[str, Any], *, source: str = "scenario") -> Scenario:
        """Build a scenario from ``{"scenario": {...}, "bottle": {...}}``; errors name ``source``."""
        if not isinstance(document, Mapping):
            raise ScenarioError(f"{source}: {shown(document)} is not a mapping of the tables scenario and bottle")
        if problem := stray_key(document, ("scenario", "bottle")):
            raise ScenarioError(f"{source}: {problem}")
        _refuse_unknown(document, ("scenario", "bottle"), f"{source}: table")
        for table in document:
            if not isinstance(document[table], Mapping):
                raise ScenarioError(f"{source}: {table} = {shown(document[table])} is not a table; write [{table}]")
        bottle_table = document.get("bottle", {})
        scenario_table = dict(document.get("scenario", {}))
        _refuse_unknown(bottle_table, [f.name for f in fields(Bottle)], f"{source}: [bottle] key")
        names = [f.name for f in fields(cls) if f.name != "bottle"]
        _refuse_unknown(scenario_table, names, f"{source}: [scenario] key")
        if isinstance(scenario_table.get("launch_velocity"), list):
            scenario_table["launch_velocity"] = tuple(scenario_table["launch_velocity"])
        try:
            bottle = Bottle(**bottle_table)
        except ScenarioError as error:
            raise ScenarioError(f"{source}: [bottle] {str(error).replace('bottle.', '')}") from None
        try:
            return cls(bottle=bottle, **scenario_table)
        except ScenarioError as error:
            raise ScenarioError(f"{source}: [scenario] {error}") from None

    def to_mapping(self) -> dict[str, dict[str, Any]]:
        """Return the mapping that ``from_mapping`` reads back to an equal scenario."""
        scenario = asdict(self)
        bottle = scenario.pop("bottle")
        scenario["launch_velocity"] = list(self.launch_velocity)
        return {"bottle": bottle, "scenario": scenario}

    def to_toml(self) -> str:
        """Return the scenario as the text of a file that ``from_toml`` reads back exactly."""
        lines: list[str] = []
        for table, entries in self.to_mapping().items():
            lines.append(f"[{table}]")
            lines += [f"{key} = {_toml_value(value)}" for key, value in entries.items()]
            lines.append("")
        return "\n".join(lines)


def _toml_value(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


def unknown_name(label: str, given: object, choices: Iterable[str]) -> str:
    """Return the message for a name that is not known: the nearest one that is, or all of them.

    ``label`` leads to the name, such as "scheme =" or "throw.toml: [bottle] key".
    """
    by_lower_case = {name.lower(): name for name in choices}
    nearest = get_close_matches(str(given)[:MAX_SHOWN].lower(), by_lower_case, n=1)
    advice = (
        f"did you mean {by_lower_case[nearest[0]]!r}?" if nearest else f"known: {', '.join(by_lower_case.values())}"
    )
    return f"{label} {shown(given)} is unknown; {advice}"


def known_name(argument: str, name: object, choices: Collection[str]) -> str:
    """Return ``name`` if it is a key of ``choices``, else raise ValueError with the nearest key."""
    if isinstance(name, str) and name in choices:
        return name
    raise ValueError(unknown_name(f"{argument} =", name, choices))


def true_or_false(argument: str, value: object) -> bool:
    """Return ``value`` as bool if it is one, of Python's or NumPy's, else raise ValueError."""
    import numpy as np

    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f"{argument} = {value!r} is not True or False")
    return bool(value)


def refuse_other(argument: str, value: object, noun: type) -> None:
    """Raise ValueError if ``value`` is not a ``noun`` of this package."""
    if not isinstance(value, noun):
        raise ValueError(f"{argument} = {shown(value)} is not a slicemodel.{noun.__name__}")


def stray_key(document: Mapping[str, Any], tables: Collection[str]) -> str:
    """Return what is wrong with a key of a file that stands outside of its tables, or an empty string."""
    for name, value in document.items():
        first = value[0] if isinstance(value, list) and value else value
        if name not in tables and not isinstance(first, Mapping):
            return f"key {shown(name)} stands outside of a table; write the line of a table such as [scenario] above it"
    return ""


def _refuse_unknown(given: Iterable[str], allowed: Iterable[str], label: str) -> None:
    allowed = list(allowed)
    for name in given:
        if name not in allowed:
            raise ScenarioError(unknown_name(label, name, allowed))
