"""The figure of a rover's response to its motor duties near a trim point: step response and frequency response."""

import numpy as np
from matplotlib.figure import Figure

from rover_pin.control.design.linear import LinearModel
from rover_pin.plot.sheet import new_figure

RISE = 0.1
"""Size of the step in all motor duties for the step response [-]."""


def response_figure(linear: LinearModel, seconds: float = 1.0, outputs: tuple[str, ...] = ("speed",)) -> Figure:
    """Return the figure of a rover's response: the outputs after a step of all motor duties, and gain and phase against
    frequency.

    The step has the size RISE.

    Parameters
    ----------
    linear : LinearModel
        The model, linearised at a trim point.
    seconds : float
        Duration of the step response [s].
    outputs : tuple of str
        Outputs of the model that are drawn.

    Examples
    --------
    >>> from rover_pin import linear_model, scenario, trim_state
    >>> flat = scenario("flat").model
    >>> figure = response_figure(linear_model(flat, trim_state(flat, 0.5), 0.5))
    >>> [panel.get_title() for panel in figure.axes]
    ['all duties rise by 0.1', '', '']
    """
    figure, panels = new_figure(1, 3, (10.0, 3.4))
    # Frequencies from 0.01 to 100 Hz, evenly spaced on a logarithmic scale.
    t, hertz = np.linspace(0.0, seconds, 401), np.logspace(-2, 2, 200)
    after = RISE * linear.step_response(t)
    # All duties change together, so that the columns of the response, one for each duty, add up.
    over = np.array([linear.response(2.0 * np.pi * f).sum(axis=1) for f in hertz])
    for name in outputs:
        at = linear.outputs.index(name)
        panels[0].plot(t, after[:, at], label=name)
        panels[1].loglog(hertz, np.abs(over[:, at]))
        panels[2].semilogx(hertz, np.degrees(np.unwrap(np.angle(over[:, at]))))
    panels[0].set(xlabel="t [s]", ylabel="change [SI]", title=f"all duties rise by {RISE:g}")
    panels[1].set(xlabel="frequency [Hz]", ylabel="gain [SI for a duty of 1]")
    panels[2].set(xlabel="frequency [Hz]", ylabel="phase [deg]")
    figure.legend(loc="outside lower center", ncols=len(outputs))
    return figure
