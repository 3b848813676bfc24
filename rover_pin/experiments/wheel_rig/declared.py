"""Which numbers of a rig set's model are uncertain, by how much, as the set declares it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rover_pin.estimation.parameter import Parameter, declared_in, parameter_of
from rover_pin.experiments.soil_priors import MAX_EXIT_RATIO, SD, known_constant, unknown_constant
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.measurements.channel import DrawbarPull, SideForce, Sinkage, Torque, VerticalMoment
from rover_pin.measurements.rig_set import RigSet

TARE, SCALE = 0.1, 0.05
"""SD of an offset that nobody states, as a share of the channel's largest value, and of a scale: cells are sure to 1 %,
a torque by a motor's current to 10 % (assumed)."""
OFFSET_AND_SCALE = {
    DrawbarPull: ("pull_tare", "force_scale"),
    Torque: ("torque_tare", "torque_scale"),
    Sinkage: ("sinkage_zero", "sinkage_scale"),
    SideForce: ("side_tare", "side_scale"),
    VerticalMoment: ("moment_tare", "moment_scale"),
}
"""The offset and the scale of each channel that a rig may have."""
PRESSING = "rig.pressing_scale"
PRESSING_SD = 0.3
"""SD of ln of how much stiffer sand is under a wheel that is pressed in than under one that rolls (assumed)."""


def own_name(name: str) -> str:
    """Return a parameter's name as a rig model's vector has it: soil and wheel are not said."""
    return name.removeprefix("soil.").removeprefix("wheel.")


@dataclass(frozen=True, eq=False)
class SetNumbers:
    """The uncertain numbers of a set's model: of the sand, of wheel and rig, and the errors that nobody declares."""

    data: RigSet
    model: RigModel

    def of_sand(self) -> list[Parameter]:
        """Return which soil constants are uncertain, and what is assumed of those that these channels tell in part.

        k and phi where a force was measured, k_1 where the sinkage was, with no prior; the exit ratio; n where loads
        differ, or the wheel was pressed in; c where loads differ, with 300 Pa or its own size. What [soil] states with
        an SD has that prior around the stated value, and is uncertain whatever was measured.
        """
        rig, soil = self.data, self.data.soil()
        constants = (known_constant("soil", soil, name, rig.declared, rig.doubts) for name in rig.doubts)
        declared = {parameter.name: parameter for parameter in constants}
        assumed = [declared.pop(parameter.name, parameter) for parameter in self._assumed_constants()]
        return [*assumed, *declared.values()]

    def of_rig(self) -> Iterator[Parameter]:
        """Yield what rig.toml states with an SD, of rig and wheel, and how much stiffer sand is where pressed in."""
        rig = self.data
        if self.data.trials and PRESSING not in rig.error_sd:
            yield self._parameter(PRESSING, PRESSING_SD, log=True)
        for name, sd in rig.error_sd.items():
            parameter = self._parameter(name, sd, declared="declared in rig.toml")
            low, high = rig.wheel_range.get(own_name(name), (parameter.low, parameter.high))
            yield replace(parameter, low=low, high=high)

    def reading_errors(self) -> list[Parameter]:
        """Return what rig.toml does not state: a tare or zero and a scale of each channel, and one of the load."""
        sds = {"rig.load_scale": SCALE}
        for channel in self.data.channels:
            offset, scale = OFFSET_AND_SCALE[type(channel)]
            sds |= {f"rig.{offset}": TARE * float(np.nanmax(np.abs(channel.measured))), f"rig.{scale}": SCALE}
        return [self._parameter(name, sd) for name, sd in sds.items() if name not in self.data.error_sd]

    def _assumed_constants(self) -> Iterator[Parameter]:
        """Yield the uncertain soil constants, as if nothing were stated of them."""
        rig, soil = self.data, self.model.soil
        kinds = {type(channel) for channel in rig.channels}
        if kinds & {DrawbarPull, Torque}:
            yield unknown_constant("soil", soil, "k")
            yield unknown_constant("soil", soil, "phi")
        if Sinkage in kinds:
            yield unknown_constant("soil", soil, "k_1")
        yield replace(self._of_soil("exit_ratio"), low=0.0, high=MAX_EXIT_RATIO)
        if rig.loads_vary or self.data.trials:
            yield self._of_soil("n")
        if rig.loads_vary:
            yield self._of_soil("c", float(soil.c))

    def _of_soil(self, name: str, least_sd: float = 0.0) -> Parameter:
        """Return a soil constant with the SD of one that nobody declares, and where it is declared."""
        rig = self.data
        declared = declared_in("soil", name, rig.declared, rig.doubts)
        return self._parameter(f"soil.{name}", max(SD[name].undeclared, least_sd), declared=declared)

    def _parameter(self, name: str, sd: float, log: bool = False, declared: str = "") -> Parameter:
        return parameter_of(name, self.model.records[name.rpartition(".")[0]], sd, log, declared)
