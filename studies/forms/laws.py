"""The wheel-soil laws that `wheel_laws.py` compares on each measured data set: the base model, laws from the
literature, and laws (effects) of this package.
"""

from __future__ import annotations

from forms.sinkage import DingMetres, Exponential, Lyasko, Squared
from rover_pin.effects.effect import Effect
from rover_pin.effects.flank_pressure import FlankPressure
from rover_pin.effects.interface_friction import InterfaceFriction
from rover_pin.effects.lug_excavation import LugExcavation
from rover_pin.effects.lug_grip import LugGrip
from rover_pin.effects.ploughing import Ploughing
from rover_pin.effects.rate_dependence import RateDependence
from rover_pin.effects.skid_sinkage import SkidSinkage
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.effects.slip_softening import SlipSoftening

Laws = dict[str, tuple[Effect, ...]]
LUG_HEIGHT, DENSITY = 0.005, 1330.0 * 9.81
"""Lug height [m] and specific weight [N/m^3] in studies/data/cmu-grousered-wheel/rig.toml."""
SOFT, RATE, LUGS = SlipSoftening(), RateDependence(v_0=0.05), LugExcavation(h_l=LUG_HEIGHT)
GRIP = LugGrip(h_l=LUG_HEIGHT)
PLOUGH, FLANK, RIM = Ploughing(gamma=DENSITY), FlankPressure(gamma=DENSITY), InterfaceFriction()
BRAKING: Laws = {
    "base": (),
    "exponent (h/b)^n": (SkidSinkage(),),
    "Ding 2010, h in m": (DingMetres(),),
    "exponential": (Exponential(),),
    "squared": (Squared(),),
    "ploughing": (PLOUGH,),
}
LAWS: dict[str, Laws] = {
    "smooth": {
        "base": (),
        "Ding 2010, (h/b)^n": (SlipSinkage(),),
        "Ding 2010, h in m": (DingMetres(),),
        "Lyasko 2010, power free": (Lyasko(),),
        "exponential": (Exponential(),),
        "softening": (SOFT,),
        "softening + rate": (SOFT, RATE),
    },
    "lugged": {
        "base": (),
        "Ding 2010, h in m": (DingMetres(),),
        "exponential": (Exponential(),),
        "softening": (SOFT,),
        "softening + trench": (SOFT, LUGS),
        "softening + trench + rate": (SOFT, LUGS, RATE),
    },
    "braked": BRAKING,
    "both signs": {
        "base": (),
        "exponents (h/b)^n": (SlipSinkage(), SkidSinkage()),
        "softening + squared": (SOFT, Squared()),
        "softening + ploughing": (SOFT, PLOUGH),
    },
    "slip angles": {
        "combined shear": (),
        "+ softening": (SOFT,),
        "+ flank": (FLANK,),
        "+ softening + flank": (SOFT, FLANK),
        "+ softening + flank + rate": (SOFT, FLANK, RATE),
    },
    "braked askew": {
        "combined shear": (),
        "+ softening + flank": (SOFT, FLANK),
        "+ softening + flank + ploughing": (SOFT, FLANK, PLOUGH),
    },
    "lugs askew": {
        "combined shear": (),
        "+ softening + flank + trench": (SOFT, FLANK, LUGS),
        "+ softening + flank + trench + grip": (SOFT, FLANK, LUGS, GRIP),
    },
    "braked lugs": BRAKING,
}
"""Name of a data set -> name of a law -> effects that form this law."""
ONE_SAND: Laws = {
    "base": (),
    "softening, ploughing, flank, trench": (SOFT, PLOUGH, FLANK, LUGS),
    "+ smooth rims": (SOFT, PLOUGH, FLANK, LUGS, RIM),
    "+ grip of lugs": (SOFT, PLOUGH, FLANK, LUGS, GRIP),
    "+ grip of lugs + rate": (SOFT, PLOUGH, FLANK, LUGS, GRIP, RATE),
}
LAW = "+ grip of lugs"
"""The law of `ONE_SAND` that predicts each set from the others."""
