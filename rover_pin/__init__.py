"""A planetary rover on loose soil: slip-based traction (CasADi), rigid bodies (Pinocchio's model), and control.

The names below are imported on first use, so that `import rover_pin` takes hardly any time. All other names are
imported from their own modules, for example batch studies from `rover_pin.sweep`.
"""

import sys

from rover_pin.version import __version__

# This module imports nothing but `sys`: it runs before `__main__` can leave the working directory.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from rover_pin.base.errors import RoverPinError
    from rover_pin.contact import Soil, Wheel
    from rover_pin.control.design.linear import linear_model, trim_state
    from rover_pin.control.open_loop import ConstantDuty
    from rover_pin.control.slip_control import SlipControl
    from rover_pin.control.torque_bounds import torque_bounds
    from rover_pin.loop.close import close_the_loop
    from rover_pin.loop.identify import identify
    from rover_pin.parameters import SOILS
    from rover_pin.rover.rover import load_rover
    from rover_pin.scenarios.scenario import scenario
    from rover_pin.scenarios.sensitivities import sensitivities
    from rover_pin.simulation.model.model import Model
    from rover_pin.simulation.model.motor import Motor
    from rover_pin.simulation.simulate import simulate
    from rover_pin.simulation.trace.trace import Trace
    from rover_pin.soil.wheel_forces import load_traction_factor, wheel_forces
    from rover_pin.tuning.improve import improve
    from rover_pin.tuning.tune import tune_gains

# A program that uses this package decides where its log goes; without this handler, warnings would go to stderr.
# A program that has not imported `logging` yet gets the handler with `rover_pin.base.errors`.
if "logging" in sys.modules:
    _logging = sys.modules["logging"]
    _logging.getLogger(__name__).addHandler(_logging.NullHandler())

__all__ = [
    "SOILS",
    "ConstantDuty",
    "Model",
    "Motor",
    "RoverPinError",
    "SlipControl",
    "Soil",
    "Trace",
    "Wheel",
    "__version__",
    "close_the_loop",
    "identify",
    "improve",
    "linear_model",
    "load_rover",
    "load_traction_factor",
    "scenario",
    "sensitivities",
    "simulate",
    "torque_bounds",
    "trim_state",
    "tune_gains",
    "wheel_forces",
]

_HOMES = {
    "rover.rover": ("load_rover",),
    "contact": ("Soil", "Wheel"),
    "control.design.linear": ("linear_model", "trim_state"),
    "control.torque_bounds": ("torque_bounds",),
    "control.open_loop": ("ConstantDuty",),
    "control.slip_control": ("SlipControl",),
    "base.errors": ("RoverPinError",),
    "loop.close": ("close_the_loop",),
    "loop.identify": ("identify",),
    "simulation.model.model": ("Model",),
    "simulation.model.motor": ("Motor",),
    "simulation.simulate": ("simulate",),
    "simulation.trace.trace": ("Trace",),
    "parameters": ("SOILS",),
    "scenarios.scenario": ("scenario",),
    "scenarios.sensitivities": ("sensitivities",),
    "tuning.improve": ("improve",),
    "tuning.tune": ("tune_gains",),
    "soil.wheel_forces": ("load_traction_factor", "wheel_forces"),
}


def __getattr__(name: str) -> "Any":
    """Import a public name from its module when it is used for the first time."""
    from importlib import import_module

    for home, names in _HOMES.items():
        if name in names:
            value = globals()[name] = getattr(import_module(f"{__name__}.{home}"), name)
            return value
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
