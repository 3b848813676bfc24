"""The load-traction factor against slip."""

from pathlib import Path

from rover_pin.plot.sheet import save, sheet, write_csv
from rover_pin.simulation.trace.draw import COLOURS
from rover_pin.soil.curves import TractionCurves


def traction_figure(table: TractionCurves, name: str, out: Path) -> list[Path]:
    """Write traction.csv and traction.png into `out`; return their paths."""
    import pandas as pd

    figure, axes = sheet(1, size=(7.5, 5.0))
    styles = dict(zip(("net", "torque", "gross"), ("-", "--", ":"), strict=True))
    values = sorted({k for _, k in table.curves})
    for (form, k), curve in table.curves.items():
        colour = COLOURS[values.index(k) % len(COLOURS)]
        axes.plot(table.S, curve, styles[form], color=colour, label=f"{form}, k = {1e3 * k:g} mm")
    axes.axhline(0.0, color="black", lw=0.6)
    axes.set(xlabel="slip S [-]", ylabel="load-traction factor F [-]", title=f"soil: {name}", xlim=(0.0, 1.0))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    columns = {f"{form}_k{1e3 * k:g}mm": curve for (form, k), curve in table.curves.items()}
    csv = write_csv(pd.DataFrame({"S": table.S, **columns}), out / "traction.csv")
    return [csv, save(figure, out / "traction.png")]
