"""The commands that are not in `app`: one file for each command, or for several commands with one subject.

Every command imports the modules that it needs when it runs, so that the program starts fast. The files do not use
`from __future__ import annotations`, because typer would then evaluate each annotation several times at every start.
"""

import typer

from rover_pin.cli.commands import (
    close_loop,
    compare,
    curve,
    data_sets,
    export,
    improve,
    listing,
    map_ground,
    new_effect,
    view,
    watch,
)


def add_to(app: typer.Typer) -> None:
    """Add the commands of this package to the typer application `app`."""
    app.command("map")(map_ground.map_ground)
    app.command()(curve.curve)
    app.command("list")(listing.list_)
    app.command()(view.view)
    app.command()(watch.watch)
    app.command()(export.export)
    app.command("export-c")(export.export_c)
    app.command("export-fmu")(export.export_fmu)
    app.command("export-mjcf")(export.export_mjcf)
    app.command("close-loop")(close_loop.close_loop)
    app.command()(improve.improve)
    app.command()(compare.compare)
    app.command("check-data")(data_sets.check_data)
    app.command()(data_sets.init)
    app.command()(data_sets.demo)
    app.command("import-log")(data_sets.import_log)
    app.command("new-effect")(new_effect.new_effect)
    app.command("new-rover")(new_effect.new_rover)
