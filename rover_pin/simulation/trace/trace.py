"""What a drive leaves: named channels over time, with units, that can judge themselves."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError, MissingExtraError, ParameterError, closest
from rover_pin.base.public import html_table
from rover_pin.simulation.checkpoint import DriveEnd
from rover_pin.simulation.trace.channels import RATES, unit_of, wheels_in

NOT_LOSSES = ("energy_motor", "energy_electric", "energy_kinetic", "energy_potential", "energy_elastic")
"""Energy channels beside what soil, stops, servos and further effects take; springs' share is within `energy_body`."""
SUMMARY_ATTRS = "stop outcome turned warnings notes assumed set_down traction_form motion_resistance_R".split()
"""Attributes that a summary repeats."""


@dataclass(frozen=True, eq=False)
class Trace(Mapping[str, np.ndarray]):
    """Channels of one drive, simulated or measured: a mapping from names to arrays, equal only to itself.

    Parameters
    ----------
    channels : dict of name -> array (T,)
        `t_s` [s], increasing, and any others of the same length, named as the columns of a drive log; NaN is a gap.
    units : dict of name -> str, optional
        Units; those of the known names need not be given.
    attrs : dict, optional
        Plain values about the drive: rover, control, traction form, dt_s, gravity_mps2, stop, versions, ...
    end : Ended, optional
        Where a simulated drive ended, for `simulate` to go on from; no file keeps it.

    Raises
    ------
    DataError
        Channels that are no numbers by name, no `t_s`, a time that is not finite or not increasing, or channels of
        different lengths.

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
        try:
            channels = {name: _unchanging(values) for name, values in dict(self.channels).items()}
        except (TypeError, ValueError) as error:
            raise DataError(f"Trace: channels are no dict of numbers by name: {error}.") from error
        object.__setattr__(self, "channels", channels)
        object.__setattr__(self, "units", {name: self.units.get(name, unit_of(name)) for name in channels})
        (t,) = self.need("t_s")
        for name, values in channels.items():
            if values.shape != t.shape or t.ndim != 1:
                raise DataError(
                    f"Channel '{name}' has shape {values.shape}, t_s {t.shape}: give one number a row to each."
                )
        wrong = np.flatnonzero(~(np.diff(t, prepend=-np.inf) > 0.0) | ~np.isfinite(t))
        if wrong.size:
            raise DataError(f"t_s must be finite and increase, but it is {t[wrong[0]]:g} s at row {wrong[0]}.")

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.channels:
            raise ParameterError(f"The trace has no channel '{name}': {closest(name, self.channels)}")
        return self.channels[name]

    def __contains__(self, name: object) -> bool:
        return name in self.channels

    def __iter__(self) -> Iterator[str]:
        return iter(self.channels)

    def __len__(self) -> int:
        return len(self.channels)

    def get(self, name: str, default: Any = None) -> Any:
        """Return a channel, or `default` where it was not recorded."""
        return self.channels.get(name, default)

    # arrays have no one truth value: a trace is compared by identity, as it is hashed
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    @property
    def t(self) -> np.ndarray:
        """Time [s] (T,)."""
        return self.channels["t_s"]

    @property
    def wheels(self) -> tuple[str, ...]:
        """Names of the wheels: as declared in `attrs`, else those that channels are of."""
        return tuple(self.attrs.get("wheels") or wheels_in(self.channels))

    @property
    def rate_driven(self) -> bool:
        """Whether a replay turns the wheels at their measured rates: no duty was recorded, or the log says so."""
        return self.attrs.get("input") == RATES or not any(name.startswith("duty_") for name in self.channels)

    def unit(self, name: str) -> str:
        """Return a channel's unit."""
        self[name]
        return self.units[name]

    def stack(self, name: str) -> np.ndarray:
        """Return a channel of all wheels (T, wheels), as in `stack("slip")`, in the order of `wheels`."""
        suffix = "_A" if name == "current" else ""
        return np.column_stack([self[f"{name}_{wheel}{suffix}"] for wheel in self.wheels])

    def need(self, *names: str) -> tuple[np.ndarray, ...]:
        """Return these channels; one error names all that are missing.

        Raises DataError: a channel that was not recorded.
        """
        missing = [name for name in names if name not in self.channels]
        if missing:
            where = f"{self.attrs['file']}: " if "file" in self.attrs else ""
            raise DataError(
                f"{where}channel{'s' * (len(missing) > 1)} {', '.join(missing)} needed and not recorded: "
                f"{closest(missing[0], self.channels)}"
            )
        return tuple(self.channels[name] for name in names)

    def energy_error(self) -> float:
        """Return the greatest energy that the balance leaves unexplained, over the greatest energy in it [-].

        |E_motor - (E_kinetic + E_potential + sum of losses)| / max |term|, each term counted from the first row, both
        maxima over time; the losses are all other `energy_` channels but the electric one: soil, stops, servos, ...
        0 where nothing moves, NaN where there are fewer than two rows.
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
        residual = np.max(np.abs(motor - sum(stored) - sum(losses)))
        scale = max(float(np.max(np.abs(term))) for term in (motor, *stored, *losses))
        return float(residual / scale) if scale > 0.0 else 0.0

    def summary(self) -> dict[str, Any]:
        """Return a few plain values of the drive; what was not recorded is left out, and gaps are passed over."""
        short = {"end_time_s": float(self.t[-1]), **self._travel()} if len(self.t) else {}
        if "body_pitch" in self:
            short["max_pitch_deg"] = math.degrees(_over(np.max, np.abs(self["body_pitch"])))
        if self.wheels and all(f"slip_{wheel}" in self for wheel in self.wheels):
            slip = self.stack("slip")
            short["mean_slip"], short["max_slip"] = _over(np.mean, slip), _over(np.max, slip)
        if {"energy_motor", "energy_kinetic", "energy_potential"} <= self.channels.keys():
            short["energy_motor_J"], short["energy_error"] = float(self["energy_motor"][-1]), self.energy_error()
        if "step_error_m" in self.attrs:
            short["step_error_mm"] = 1e3 * float(self.attrs["step_error_m"])
        attrs = {name: self.attrs[name] for name in SUMMARY_ATTRS if self.attrs.get(name, []) != []}
        return {**attrs, **{name: value for name, value in short.items() if math.isfinite(value)}}

    def _travel(self) -> dict[str, float]:
        if not {"body_x", "body_y"} <= self.channels.keys():
            return {}
        x, y = self.need("body_x", "body_y")
        valid = np.isfinite(x) & np.isfinite(y)
        if not np.any(valid):
            return {}
        x, y = x[valid], y[valid]
        path = float(np.sum(np.hypot(np.diff(x), np.diff(y))))
        return {"distance_m": path, "end_x_m": float(x[-1]), "end_y_m": float(y[-1])}

    def plot(self, *names: str, ax: Any = None) -> Any:
        """Draw channels against time; return matplotlib's axes.

        Parameters
        ----------
        *names : str
            Channels, or what all wheels share of one (`slip`, `duty`, `current`); the slip of all wheels if none.
        ax : matplotlib axes, optional
            Where to draw; those of a new figure of pyplot's, if none, which a notebook or `pyplot.show()` shows.
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
        """Return the summary as a table, for notebooks."""
        rows = {name: _value_text(value) for name, value in self.summary().items()}
        return html_table(f"{len(self.t)} rows of {len(self.channels)} channels", rows)

    def to_xarray(self) -> Any:
        """Return the channels as an xarray Dataset over time, each with its unit.

        Raises MissingExtraError: xarray is not installed.
        """
        try:
            import xarray
        except ImportError as error:
            raise MissingExtraError("Trace.to_xarray needs xarray: pip install 'rover-pin[xarray]'.") from error
        data = {name: ("t_s", values, {"units": self.units[name]}) for name, values in self.channels.items()}
        t = data.pop("t_s")
        return xarray.Dataset(data, coords={"t_s": t}, attrs=dict(self.attrs))

    def to_frame(self) -> Any:
        """Return the channels as a pandas DataFrame; its `attrs` hold the trace's attributes and units."""
        import pandas

        frame = pandas.DataFrame(self.channels)
        frame.attrs = {**self.attrs, "units": dict(self.units)}
        return frame


def _unchanging(values: Any) -> np.ndarray:
    """Return numbers that nobody can change: as they are where that is so already."""
    if type(values) is np.ndarray and values.dtype == float and values.base is None and not values.flags.writeable:
        return values
    numbers = np.array(values, dtype=float)
    numbers.flags.writeable = False
    return numbers


def _value_text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _over(reduce: Callable[[np.ndarray], Any], values: np.ndarray) -> float:
    valid = values[np.isfinite(values)]
    return float(reduce(valid)) if valid.size else math.nan
