"""`rover-pin curve`: the load-traction factor against slip."""

from pathlib import Path
from typing import Annotated

import typer

from rover_pin.base.files.results_folder import alone_in
from rover_pin.cli.options import AsJson, Out, SoilName
from rover_pin.cli.terminal import report, stoppable


def curve(
    soil: SoilName = "table-1",
    k: Annotated[
        list[str], typer.Option(help="Shear displacement, as 10mm, repeatable; default: the soil's own.")
    ] = [],  # noqa: B006
    n: Annotated[str, typer.Option(help="Sinkage exponent, in place of the soil's.")] = "",
    out: Out = Path("out/curve"),
    as_json: AsJson = False,
) -> None:
    """Draw the load-traction factor F(S) against slip. In every form, at the soil's fixed angles."""
    from rover_pin import plot
    from rover_pin.base.quantity import parse_quantity
    from rover_pin.parameters import soil_named
    from rover_pin.soil.curves import traction_curves

    lengths = [parse_quantity(length, "m", "--k") for length in k]
    table = traction_curves(soil_named(soil), lengths, parse_quantity(n, "", "--n") if n else None)
    with stoppable(out, ("traction.csv", "traction.png")), alone_in(out):
        files = plot.traction_figure(table, soil, out)
    at = {f"F({form}, k = {1e3 * value:g} mm)": curve for (form, value), curve in table.curves.items()}
    rows = {
        name: {"S=0": float(curve[0]), "S=0.2": float(curve[20]), "S=1": float(curve[-1])} for name, curve in at.items()
    }
    report({"soil": soil, **rows, "files": [str(file) for file in files]}, as_json)
