"""The laws of the package as CasADi functions with named inputs and outputs, for a user's optimisers, observers and
generated code.

Every input is one named number whose default is the value in the given soil, wheel or model. A caller therefore names
only the inputs that it varies, and may differentiate with respect to each of these inputs:

    f = traction_function()
    f(S=0.3)["F"]                      # a number
    S, phi = ca.SX.sym("S"), ca.SX.sym("phi")
    ca.jacobian(f(S=S, phi=phi)["F"], phi)  # an expression
"""

from collections.abc import Mapping, Sequence
from typing import TypeVar

import casadi as ca

from rover_pin.base.errors import ParameterError
from rover_pin.base.public import public
from rover_pin.base.quantity import Record, quantities
from rover_pin.contact import Contact, Scalar, Soil, Wheel
from rover_pin.control.bound_law import INPUTS, bound_law
from rover_pin.control.torque_bounds import BY_LOAD, SLIP_LIMIT
from rover_pin.effects.effect import Effect
from rover_pin.simulation.compiled.laws import GEOMETRY, amend_subject, load_and_rates
from rover_pin.simulation.model.model import Model
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.wheel_forces import GrossTraction, NetTraction, TorqueTraction, load_traction_factor


@public
def traction_function(
    soil: Soil = Soil(),
    wheel: Wheel = Wheel(),
    form: NetTraction | TorqueTraction | GrossTraction | str = "torque",
    angles: FixedAngles | SinkageAngles | str = "fixed",
) -> ca.Function:
    """Return the load-traction factor F(S), the ratio of a wheel's pull to its normal force, as a CasADi function: (S,
    r, b, c, phi, k, ...) -> F.

    Parameters
    ----------
    soil, wheel : Soil, Wheel
        The soil and wheel whose numbers are the defaults of the function's inputs.
    form : NetTraction, TorqueTraction, GrossTraction, or "net", "torque", "gross"
        The definition of F: the drawbar pull f_t (net), torque / r, or the thrust (gross), divided by the normal force.
    angles : FixedAngles, SinkageAngles, or "fixed", "sinkage"
        Whether the exit angle theta_2 is a constant of the soil (fixed), or follows from the entry angle theta_1 and
        the soil's exit_ratio (sinkage).

    Returns
    -------
    casadi.Function
        Inputs: the slip ratio S [-], then every number of the wheel and of the soil under its own name and in its SI
        unit. Output: F [-].

    Raises
    ------
    ParameterError
        The name of the form or of the rule for the angles is not known.

    Source: section 3.2 of the paper, F(S) = f_t / f_n, by the expression of `load_traction_factor`.

    Examples
    --------
    >>> f = traction_function(form="torque")
    >>> round(float(f(S=0.2)["F"]), 3)
    0.057
    >>> slope = ca.Function("slope", [S := ca.SX.sym("S")], [ca.jacobian(f(S=S)["F"], S)])
    >>> round(float(slope(0.2)), 3)
    0.187
    """
    # The law is evaluated once with symbols in the place of all numbers; the numbers become the inputs' defaults.
    S = ca.SX.sym("S")
    (symbolic_wheel, of_wheel), (symbolic_soil, of_soil) = _with_symbols(wheel), _with_symbols(soil)
    factor = load_traction_factor(S, symbolic_soil, symbolic_wheel, form, angles)
    return _named("traction", {"S": (S, 0.0), **of_wheel, **of_soil}, {"F": factor})


@public
def bounds_function(
    soil: Soil = Soil(), wheel: Wheel = Wheel(), angles: FixedAngles | SinkageAngles = BY_LOAD
) -> ca.Function:
    """Return the torque bounds of a wheel as a CasADi function: (load, slip_limit, r, b, c, ...) -> T_sat, T_lim.

    Parameters
    ----------
    soil, wheel : Soil, Wheel
        The soil and wheel whose numbers are the defaults of the function's inputs.
    angles : FixedAngles or SinkageAngles
        By default the entry angle theta_1 depends on the load; with `FixedAngles()`, the contact angles are constants
        of the soil.

    Returns
    -------
    casadi.Function
        Inputs: the load W [N], the slip limit [-] (default 0.2), then every number of the wheel and of the soil.
        Outputs: T_sat, the torque at which the soil fails [N m]; T_lim, the torque at the slip limit [N m]; dT_sat_dW
        and dT_lim_dW, the derivatives of T_sat and T_lim with respect to the load [m]; refused, which is 1 if no entry
        angle below 90 deg carries the load (the other outputs are then meaningless), and 0 otherwise.

    Source: Eqs (2)-(6) of the paper, by the expression of the function `torque_bounds`, which states the equations.

    Examples
    --------
    >>> bounds = bounds_function()(load=9.5)
    >>> 0.0 < float(bounds["T_lim"]) < float(bounds["T_sat"])
    True
    """
    inputs = {"load": (ca.SX.sym("load"), 0.0), "slip_limit": (ca.SX.sym("slip_limit"), SLIP_LIMIT)}
    inputs |= _with_symbols(wheel)[1] | _with_symbols(soil)[1]
    # `bound_law` takes its inputs as one column in the order of INPUTS.
    outputs = ca.vertsplit(bound_law(angles)(ca.vertcat(*(inputs[name][0] for name in INPUTS))))
    names_out = ("T_sat", "T_lim", "dT_sat_dW", "dT_lim_dW", "refused")
    return _named("bounds", inputs, dict(zip(names_out, outputs, strict=True)))


@public
def wheel_function(model: Model, ground: int = 0) -> ca.Function:
    """Return the forces on a wheel of a model, with all its contact effects, as a CasADi function.

    Parameters
    ----------
    model : Model
        The model whose contact effects, wheel and soil are used, for example `scenario("ditch").model`.
    ground : int
        Index of the soil in `model.soils`; 0 is the usual ground.

    Returns
    -------
    casadi.Function
        Inputs, in this order: h, the sinkage [m]; v_x, v_y and v_n, the speeds of the wheel centre along the patch
        forwards, to the left, and into the ground [m/s]; rim, the speed of the rim r omega [m/s]; x, the world x of
        the wheel [m]; axle, the number of wheels that have passed this place before; the states of the effects, named
        EFFECT_STATE; the numbers of the wheel and of the soil; the numbers of the effects, named EFFECT_NUMBER.
        Outputs: f_t, the force in the direction of travel [N]; f_y, the force to the left [N]; f_n, the normal force
        [N]; torque, which resists the motor [N m]; S and S_y, the slip ratios [-]; and the time derivative of each
        state, named d_EFFECT_STATE.

    Raises
    ------
    ParameterError
        The model has no soil of this index.

    Examples
    --------
    >>> from rover_pin import scenario
    >>> f = wheel_function(scenario("flat").model)
    >>> load = f(h=0.008, v_x=0.05, rim=0.06, RelaxedSlip_S=0.17)
    >>> float(load["f_n"]) > float(load["f_t"]) > 0.0
    True
    """
    inputs, outputs = _wheel_law(model, ground)
    return _named("wheel", inputs, outputs)


@public
def rig_step_function(model: Model, period: float, mass: float, ground: int = 0) -> ca.Function:
    """Return one time step of a wheel that a test rig drags at a given speed under a given load, as a CasADi function.

    The rig's carriage moves the wheel at the speed v_x and turns it at the rim speed `rim`. The wheel moves freely in
    the vertical: mass dv_n/dt = W - f_n and dh/dt = v_n, with the sinkage h, the speed v_n into the ground, the load W
    and the normal force f_n. The step is linearly implicit in the vertical motion and in the states of the effects
    (Rosenbrock-Euler, first order), so that it is stable for periods that are long compared with the settling of the
    wheel.

    Parameters
    ----------
    model : Model
        The model whose contact effects, wheel and soil are used.
    period : float
        Length of the step [s], above 0.
    mass : float
        Mass that moves vertically with the wheel [kg], above 0.
    ground : int
        Index of the soil in `model.soils`.

    Returns
    -------
    casadi.Function
        Inputs: the inputs of `wheel_function` (with h, v_n and the states at the beginning of the step), and W, the
        vertical load on the wheel [N]. Outputs: next_h, next_v_n and next_EFFECT_STATE at the end of the step; f_t,
        f_y, f_n and torque at its beginning.

    Raises
    ------
    ParameterError
        The period or the mass is not positive, or the model has no soil of this index.

    Examples
    --------
    >>> from rover_pin import scenario
    >>> step = rig_step_function(scenario("flat").model, period=0.01, mass=1.0)
    >>> state = {"h": 0.0, "v_n": 0.0}
    >>> for _ in range(200):
    ...     end = step(**state, v_x=0.05, rim=0.06, W=9.5)
    ...     state = {name: end[f"next_{name}"] for name in state}
    >>> 0.003 < float(state["h"]) < 0.03
    True
    """
    for name, value in (("period", period), ("mass", mass)):
        if not value > 0.0:
            raise ParameterError(f"rig_step_function: {name} = {value:g} is not allowed. Give a number above 0.")
    # The state of the wheel is the sinkage h, the speed v_n into the ground, and the states of all effects.
    inputs, outputs = _wheel_law(model, ground)
    load = ca.SX.sym("W")
    states = {name.removeprefix("d_"): rate for name, rate in outputs.items() if name.startswith("d_")}
    moving = {"h": inputs["v_n"][0], "v_n": (load - outputs["f_n"]) / mass, **states}
    before, rates = ca.vertcat(*(inputs[name][0] for name in moving)), ca.vertcat(*moving.values())
    # Rosenbrock-Euler: (1 - period J) (after - before) = period rates, with J = d rates / d states.
    jacobian = ca.jacobian(rates, before)
    after = before + ca.solve(ca.SX.eye(before.numel()) - period * jacobian, period * rates)
    # The function returns the state after the step, so that a caller can feed its outputs back as inputs.
    following = {f"next_{name}": value for name, value in zip(moving, ca.vertsplit(after), strict=True)}
    forces = {name: outputs[name] for name in ("f_t", "f_y", "f_n", "torque")}
    return _named("rig_step", {**inputs, "W": (load, 0.0)}, {**following, **forces})


Inputs = dict[str, tuple[ca.SX, float]]
"""The inputs of a CasADi function: name of the input -> its symbol and its default value."""
Quantified = TypeVar("Quantified", bound=Record)
"""Type of a record of numbers with units: a wheel, a soil or an effect."""


def _wheel_law(model: Model, ground: int) -> tuple[Inputs, dict[str, Scalar]]:
    """Return the inputs of `wheel_function`, and a mapping from the name of each output to its expression.

    Raises ParameterError: the model has no soil of the index `ground`.
    """
    if not 0 <= ground < len(model.soils):
        raise ParameterError(
            f"ground = {ground} is no soil of the model, which has {len(model.soils)} soils. Give an index from 0 to "
            f"{len(model.soils) - 1}."
        )
    # Every number becomes an input: geometry of the contact, wheel, soil, and numbers and states of each effect.
    patch = {name: (ca.SX.sym(name), 0.0) for name in GEOMETRY}
    (wheel, of_wheel), (soil, of_soil) = _with_symbols(model.rover.wheel), _with_symbols(model.soils[ground])
    states: Inputs = {}
    numbers: Inputs = {}
    effects: list[Effect] = []
    effect_states: list[tuple[ca.SX, ...]] = []
    for effect, label in zip(model.contact_effects, _labels(model.contact_effects), strict=True):
        symbolic_effect, of_effect = _with_symbols(effect, f"{label}_")
        of_states = {f"{label}_{state.name}": (ca.SX.sym(f"{label}_{state.name}"), 0.0) for state in effect.states}
        effects.append(symbolic_effect)
        effect_states.append(tuple(symbol for symbol, _ in of_states.values()))
        numbers |= of_effect
        states |= of_states
    # The effects amend the contact first (for instance its slip), and then give forces and rates of their states.
    moving = {name: symbol for name, (symbol, _) in patch.items()}
    contact = Contact(S=0.0, S_y=0.0, wheel=wheel, soil=soil, **moving)
    contact = amend_subject(effects, contact, effect_states)
    load, rates = load_and_rates(effects, contact, effect_states)
    outputs = {"f_t": load.f_t, "f_y": load.f_y, "f_n": load.f_n, "torque": load.torque}
    outputs |= {"S": contact.S, "S_y": contact.S_y}
    rates_of_states = (rate for of_effect in rates for rate in of_effect)
    outputs |= {f"d_{name}": rate for name, rate in zip(states, rates_of_states, strict=True)}
    # The inputs are merged in the order that `wheel_function` documents.
    return patch | states | of_wheel | of_soil | numbers, outputs


def _labels(effects: Sequence[Effect]) -> list[str]:
    """Return a name for each effect: the name of its class. A further effect of a class gets a number, for example
    HardPatch_2.
    """
    labels: list[str] = []
    for effect in effects:
        name = type(effect).__name__
        count = sum(label.split("_")[0] == name for label in labels)
        labels.append(f"{name}_{count + 1}" if count else name)
    return labels


def _with_symbols(record: Quantified, prefix: str = "") -> tuple[Quantified, Inputs]:
    """Return a copy of a record (a wheel, a soil or an effect) whose numbers are CasADi symbols, and these symbols as
    inputs of a function.

    The default of each input is the record's number, and its name is `prefix` followed by the name of the number.
    """
    inputs: Inputs = {
        f"{prefix}{name}": (ca.SX.sym(f"{prefix}{name}"), float(getattr(record, name))) for name in quantities(record)
    }
    symbols = {name.removeprefix(prefix): symbol for name, (symbol, _) in inputs.items()}
    return record.replace(**symbols), inputs


def _named(name: str, inputs: Inputs, outputs: Mapping[str, Scalar]) -> ca.Function:
    """Return a CasADi function called `name` with named inputs that have defaults, and with named outputs."""
    symbols, defaults = zip(*inputs.values(), strict=True)
    options = {"default_in": list(defaults), "cse": True}
    return ca.Function(name, list(symbols), list(outputs.values()), list(inputs), list(outputs), options)
