"""The figure and the table of the load-traction factor F against slip S."""

from pathlib import Path

from rover_pin.base.encode import figure_text
from rover_pin.plot.sheet import save, sheet, write_csv
from rover_pin.simulation.trace.draw import COLOURS
from rover_pin.soil.curves import TractionCurves


def traction_figure(table: TractionCurves, name: str, out: Path) -> list[Path]:
    """Write the curves of the load-traction factor against slip as traction.csv and traction.png, and return both
    paths.

    Parameters
    ----------
    table : TractionCurves
        Curves by form of the factor (net, torque, gross) and shear displacement k [m].
    name : str
        Name of the soil, for the title.
    out : Path
        Folder of the files.
    """
    import pandas as pd

    figure, axes = sheet(1, size=(7.5, 5.0))
    # The line style shows the form of the factor, the colour shows the shear displacement.
    styles = dict(zip(("net", "torque", "gross"), ("-", "--", ":"), strict=True))
    values = sorted({k for _, k in table.curves})
    for (form, k), curve in table.curves.items():
        colour = COLOURS[values.index(k) % len(COLOURS)]
        axes.plot(table.S, curve, styles[form], color=colour, label=f"{form}, k = {1e3 * k:g} mm")
    axes.axhline(0.0, color="black", lw=0.6)
    axes.set(
        xlabel="slip S [-]", ylabel="load-traction factor F [-]", title=f"soil: {figure_text(name)}", xlim=(0.0, 1.0)
    )
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    columns = {f"{form}_k{1e3 * k:g}mm": curve for (form, k), curve in table.curves.items()}
    csv = write_csv(pd.DataFrame({"S": table.S, **columns}), out / "traction.csv")
    return [csv, save(figure, out / "traction.png")]
