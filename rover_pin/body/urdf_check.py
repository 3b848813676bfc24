"""What is wrong with a rover's URDF, each fault one sentence that says what to mend."""

from __future__ import annotations

from rover_pin.body.layout import Layout


def refuse_faults(layout: Layout) -> None:
    """Raise the first fault of a layout's URDF."""
