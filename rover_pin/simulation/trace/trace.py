"""The trace of a drive: named channels over time with their units, with checks and a summary."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rover_pin.base.errors import DataError, MissingExtraError, ParameterError, UnknownAttributeError, closest
from rover_pin.base.extras import install_command
from rover_pin.base.public import html_table
from rover_pin.simulation.state import DriveEnd
from rover_pin.simulation.trace.channels import RATES, unit_of, wheels_in

NOT_LOSSES = ("energy_motor", "energy_electric", "energy_kinetic", "energy_potential", "energy_elastic")
"""Names of the energy channels that are no losses. All other energy channels are losses (in soil, end stops, servos and
body effects). `energy_elastic` is no loss of its own, because it is the part of `energy_body` that springs store."""
SUMMARY_ATTRS = (
    "stop outcome turned stops warnings notes assumed set_down engine traction_form motion_resistance_R".split()
)
"""Names of the attributes of a trace that are part of its summary."""


@dataclass(frozen=True, eq=False)
class Trace(Mapping[str, np.ndarray]):
    """The recorded channels of one drive, simulated or measured: a mapping from names to arrays over time. Two
    different traces never compare as equal.

    Parameters
    ----------
    channels : dict of name -> array (T,)
        The times `t_s` [s], which increase, and other channels of equal length, named as the columns of a drive log.
        NaN marks a gap.
    units : dict of name -> str, optional
        Units of channels. Channels with a known name need no unit here.
    attrs : dict, optional
        Plain values that describe the drive: rover, control, traction form, dt_s, gravity_mps2, stop, versions, ...
    end : DriveEnd, optional
        End of a simulated drive; `simulate` can continue the drive from it. It is not written to files.

    Raises
    ------
    DataError
        The channels are no dict of numbers, there is no `t_s`, a time is not finite or does not increase, or channels
        have different lengths.

    Examples
    --------
    >>> trace = Trace({"t_s": [0.0, 1.0], "body_x": [0.0, 0.5], "body_y": [0.0, 0.0]})
    >>> trace.summary()["distance_m"], trace.unit("body_x")
    (0.5, 'm')
    """

    channels: dict[str, np.ndarray]
    units: dict[str, str] = field(default_factory=dict)
    attrs: dict[str, Any] = field(default_factory=dict)
    end: DriveEnd | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        # Channels are read-only arrays of floats. An array that is already read-only is kept without a copy.
        channels: dict[str, np.ndarray] = {}
        try:
            for name, values in dict(self.channels).items():
                is_array = type(values) is np.ndarray and values.dtype == float
                if is_array and values.base is None and not values.flags.writeable:
                    channels[name] = values
                else:
                    channels[name] = np.array(values, dtype=float)
                    channels[name].flags.writeable = False
        except (TypeError, ValueError) as error:
            raise DataError(f"Trace: channels are no dict of numbers by name: {error}.") from error
        # The class is frozen, so that fields are set by `object.__setattr__`.
        object.__setattr__(self, "channels", channels)
        object.__setattr__(self, "units", {name: self.units.get(name, unit_of(name)) for name in channels})
        (t,) = self.need("t_s")
        for name, values in channels.items():
            if values.shape != t.shape or t.ndim != 1:
                raise DataError(
                    f"Channel '{name}' has shape {values.shape}, t_s {t.shape}: every channel must have one number for "
                    "each time in t_s."
                )
        wrong = np.flatnonzero(~(np.diff(t, prepend=-np.inf) > 0.0) | ~np.isfinite(t))
        if wrong.size:
            raise DataError(
                f"The times t_s must be finite and increase from row to row, but t_s is {t[wrong[0]]:g} s at row "
                f"{wrong[0]}: remove or correct this row."
            )

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.channels:
            raise ParameterError(f"The trace has no channel '{name}': {closest(name, self.channels)}")
        return self.channels[name]

    if not TYPE_CHECKING:  # for a type checker, the method would mean that every attribute exists

        def __getattr__(self, name: str) -> Any:
            """Refuse an unknown attribute; for the name of a channel, the error advises brackets."""
            if name.startswith("_"):
                raise AttributeError(name)
            channels = self.__dict__.get("channels", {})
            hint = f"write trace['{name}'] for the channel." if name in channels else ""
            per_wheel = [channel for channel in channels if channel.startswith(f"{name}_")]
            if per_wheel and not hint:
                hint = f"write trace['{per_wheel[0]}'] for a channel, or trace.stack('{name}') for all wheels."
            raise UnknownAttributeError(
                self, name, [*channels, *(key for key in dir(type(self)) if key[0] != "_")], hint
            )

    def __contains__(self, name: object) -> bool:
        return name in self.channels

    def __iter__(self) -> Iterator[str]:
        return iter(self.channels)

    def __len__(self) -> int:
        return len(self.channels)

    def get(self, name: str, default: Any = None) -> Any:
        """Return the values of a channel (T,), or `default` if the channel was not recorded."""
        return self.channels.get(name, default)

    # A comparison of arrays gives no single truth value: a trace is compared by identity, and hashed accordingly.
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    @property
    def t(self) -> np.ndarray:
        """Times of the rows [s] (T,)."""
        return self.channels["t_s"]

    @property
    def wheels(self) -> tuple[str, ...]:
        """Names of the wheels: the names that `attrs` declares, otherwise the wheel names in the channels' names."""
        return tuple(self.attrs.get("wheels") or wheels_in(self.channels))

    @property
    def rate_driven(self) -> bool:
        """Whether a replay of this trace turns the wheels at their measured rates instead of driving the motors by
        duties, because no duty was recorded or `attrs` asks for it.
        """
        return self.attrs.get("input") == RATES or not any(name.startswith("duty_") for name in self.channels)

    def unit(self, name: str) -> str:
        """Return the unit of a channel; an empty string if no unit is known."""
        self[name]
        return self.units[name]

    def stack(self, name: str) -> np.ndarray:
        """Return the channel of this name of all wheels as one array (T, wheels), for example `stack("slip")`. The
        columns have the order of `wheels`.

        The column of a wheel without this recorded channel is NaN, if the channel was recorded for at least one other
        wheel.
        """
        suffix = "_A" if name == "current" else ""
        columns = [f"{name}_{wheel}{suffix}" for wheel in self.wheels]
        recorded = any(column in self.channels for column in columns)
        unknown = np.full(len(self.t), np.nan)
        return np.column_stack([self.channels.get(column, unknown) if recorded else self[column] for column in columns])

    def need(self, *names: str) -> tuple[np.ndarray, ...]:
        """Return the channels of these names, in this order.

        Raises DataError: at least one of the channels was not recorded; the error names all that are missing.
        """
        missing = [name for name in names if name not in self.channels]
        if missing:
            where = f"{self.attrs['file']}: " if "file" in self.attrs else ""
            raise DataError(
                f"{where}{'these channels are' if len(missing) > 1 else 'this channel is'} needed, but "
                f"{'were' if len(missing) > 1 else 'was'} not recorded: {', '.join(missing)}; "
                f"{closest(missing[0], self.channels)}"
            )
        return tuple(self.channels[name] for name in names)

    def energy_error(self) -> float:
        """Return the largest error of the drive's energy balance, divided by the largest energy in the balance [-]. It
        shows whether the steps of a simulation were short enough.

        |E_motor - (E_kinetic + E_potential + sum of losses)| / max |term|. Each term is counted from the first row, and
        both maxima are taken over time. The losses are all other `energy_` channels except the electric one: soil,
        stops, servos, ... The result is 0 if nothing moves, and NaN for fewer than two rows.
        """
        motor, *stored = (
            values - values[:1] for values in self.need("energy_motor", "energy_kinetic", "energy_potential")
        )
        losses = [
            values - values[:1]
            for name, values in self.channels.items()
            if name.startswith("energy_") and name not in NOT_LOSSES
        ]
        if len(self.t) < 2:
            return math.nan
        # Work of the motors = mechanical energy + losses.
        residual = np.max(np.abs(motor - sum(stored) - sum(losses)))
        scale = max(float(np.max(np.abs(term))) for term in (motor, *stored, *losses))
        return float(residual / scale) if scale > 0.0 else 0.0

    def summary(self) -> dict[str, Any]:
        """Return a few numbers and texts that describe the drive, as name -> value. A number is omitted if its channels
        were not recorded, and gaps in channels are ignored.
        """
        # Each group of values is left out if its channels are missing.
        short = {"end_time_s": float(self.t[-1])} if len(self.t) else {}
        # Length of the path and position at the end of the drive [m]; rows without a known position are ignored.
        if {"body_x", "body_y"} <= self.channels.keys():
            x, y = self.need("body_x", "body_y")
            valid = np.isfinite(x) & np.isfinite(y)
            if np.any(valid):
                x, y = x[valid], y[valid]
                path = float(np.sum(np.hypot(np.diff(x), np.diff(y))))
                short |= {"distance_m": path, "end_x_m": float(x[-1]), "end_y_m": float(y[-1])}
        if "body_pitch" in self:
            short["max_pitch_deg"] = math.degrees(_over(np.max, np.abs(self["body_pitch"])))
        if self.wheels and all(f"slip_{wheel}" in self for wheel in self.wheels):
            slip = self.stack("slip")
            short["mean_slip"], short["max_slip"] = _over(np.mean, slip), _over(np.max, slip)
        if {"energy_motor", "energy_kinetic", "energy_potential"} <= self.channels.keys():
            short["energy_motor_J"], short["energy_error"] = float(self["energy_motor"][-1]), self.energy_error()
        if "step_error_m" in self.attrs:
            short["step_error_mm"] = 1e3 * float(self.attrs["step_error_m"])
        # Empty lists of warnings and notes are left out too.
        attrs = {name: self.attrs[name] for name in SUMMARY_ATTRS if self.attrs.get(name, []) != []}
        return {**attrs, **{name: value for name, value in short.items() if math.isfinite(value)}}

    def plot(self, *names: str, ax: Any = None) -> Any:
        """Draw channels against time, and return matplotlib's axes.

        Parameters
        ----------
        *names : str
            Names of channels, or names that all wheels share (`slip`, `duty`, `current`). Without a name, the slip of
            all wheels is drawn.
        ax : matplotlib axes, optional
            Axes to draw into. If missing, a new figure of pyplot is made, which a notebook or `pyplot.show()` shows.
        """
        from rover_pin.simulation.trace.draw import draw

        if ax is None:
            from matplotlib import pyplot

            ax = pyplot.subplots(figsize=(8.0, 3.0), layout="constrained")[1]
        return draw(self, names or ("slip",), ax)

    def __repr__(self) -> str:
        span = f", {self.t[0]:g} to {self.t[-1]:g} s" if len(self.t) else ""
        stop = f", stop: {self.attrs['stop']}" if "stop" in self.attrs else ""
        return f"<Trace: {len(self.t)} rows of {len(self.channels)} channels{span}{stop}>"

    def _repr_html_(self) -> str:
        """Return the summary as an HTML table, which notebooks show."""
        rows = {
            name: f"{value:.4g}" if isinstance(value, float) else str(value) for name, value in self.summary().items()
        }
        return html_table(f"{len(self.t)} rows of {len(self.channels)} channels", rows)

    def to_xarray(self) -> Any:
        """Return the channels as an xarray Dataset over time, each with its unit.

        Raises MissingExtraError: xarray is not installed.
        """
        try:
            import xarray
        except ImportError as error:
            raise MissingExtraError(f"Trace.to_xarray needs xarray. Run `{install_command('xarray')}`.") from error
        data = {name: ("t_s", values, {"units": self.units[name]}) for name, values in self.channels.items()}
        t = data.pop("t_s")
        return xarray.Dataset(data, coords={"t_s": t}, attrs=dict(self.attrs))

    def to_frame(self) -> Any:
        """Return the channels as a pandas DataFrame. Its `attrs` contain the attributes and the units of the trace."""
        import pandas

        frame = pandas.DataFrame(self.channels)
        frame.attrs = {**self.attrs, "units": dict(self.units)}
        return frame


def _over(reduce: Callable[[np.ndarray], Any], values: np.ndarray) -> float:
    """Return the value of the function `reduce` (a mean or a maximum) for the finite values of an array, or NaN if no
    value is finite.
    """
    valid = values[np.isfinite(values)]
    return float(reduce(valid)) if valid.size else math.nan
