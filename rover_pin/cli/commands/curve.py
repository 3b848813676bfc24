"""`rover-pin curve`: draws the load-traction factor F against slip S."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from rover_pin.base.files.results_folder import alone_in
from rover_pin.cli.assumed import report_assuming
from rover_pin.cli.options import AsJson, Out, Set, SoilName
from rover_pin.cli.terminal import soil_and_wheel, stoppable


def curve(
    soil: SoilName = "",
    k: Annotated[
        list[str],
        typer.Option(help="Shear displacement, such as 10mm; by default the value of the soil; can be repeated."),
    ] = [],  # noqa: B006 - typer wants a list
    n: Annotated[str, typer.Option(help="Sinkage exponent; by default the value of the soil.")] = "",
    set_: Set = [],  # noqa: B006
    out: Out = Path("out/curve"),
    as_json: AsJson = False,
) -> None:
    """Draw the load-traction factor F(S) against the slip S, in its three forms: net, torque and gross.

    The entry and exit angles are the fixed angles of the soil. The soil is table-1 by default. --set changes the
    numbers of the soil (soil.phi=33deg, or phi=33deg) and of the wheel (wheel.r=10cm).
    """
    from rover_pin import plot
    from rover_pin.base.errors import ParameterError
    from rover_pin.base.quantity import parse_quantity
    from rover_pin.base.settings import numbers_of
    from rover_pin.contact import Wheel
    from rover_pin.parameters import soil_named
    from rover_pin.scenarios.assumptions import assumptions_of, with_influence
    from rover_pin.soil.curves import traction_curves
    from rover_pin.soil.wheel_forces import load_traction_factor

    # The same number may be given by its own option and by --set; two different values would hide one of them.
    base = soil_named(soil or "table-1")
    changes, sizes = soil_and_wheel(set_, base, Wheel())
    for option, given in (("k", k), ("n", n)):
        if given and option in changes:
            raise ParameterError(f"--{option} and --set soil.{option} both state {option}: give only one of them.")
    # The options are read before any curve is computed, so that a wrong unit is reported at once.
    lengths = [parse_quantity(length, "m", "--k") for length in k]
    exponent = parse_quantity(n, "", "--n") if n else None
    table = traction_curves(base.replace(**changes), lengths, exponent, Wheel().replace(**sizes))
    with stoppable(out, ("traction.csv", "traction.png")), alone_in(out):
        files = plot.traction_figure(table, soil or "table-1", out)
    # The printed table has F at three slips: S = 0, 0.2 and 1, the rows 0, 20 and -1 of the curve.
    at = {f"F({form}, k = {1e3 * value:g} mm)": curve for (form, value), curve in table.curves.items()}
    rows = {
        name: {"S=0": float(curve[0]), "S=0.2": float(curve[20]), "S=1": float(curve[-1])} for name, curve in at.items()
    }
    # Numbers of soil and wheel that no option states are assumed. F of the torque form at S = 0.2 decides their order.
    stated = {f"soil.{name}" for name in changes} | {f"wheel.{name}" for name in sizes}
    stated |= {f"soil.{name}" for name, option in (("k", k), ("n", n)) if option}
    chosen, wheel = base.replace(**changes), Wheel().replace(**sizes)
    # The first curve is the reference: its k, and the exponent that --n states.
    chosen = chosen.replace(k=lengths[0] if lengths else chosen.k, n=chosen.n if exponent is None else exponent)

    def torque_factor(changed: Mapping[str, float]) -> dict[str, float]:
        parts: dict[str, dict[str, float]] = {"soil": {}, "wheel": {}}
        for name, value in changed.items():
            owner, _, number = name.partition(".")
            parts[owner][number] = value
        varied = chosen.replace(**parts["soil"]), wheel.replace(**parts["wheel"])
        return {"F_torque_at_S_0.2": float(load_traction_factor(0.2, *varied, "torque"))}

    numbers = (*numbers_of(chosen, "soil"), *numbers_of(wheel, "wheel"))
    assumptions = with_influence(assumptions_of(numbers, stated), torque_factor)
    result = {"soil": soil or "table-1", **rows, "files": [str(file) for file in files]}
    report_assuming(result, assumptions, as_json, out, {"F_torque_at_S_0.2": ""})
