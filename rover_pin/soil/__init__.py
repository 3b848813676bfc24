"""The paper's soil laws, Eqs (1)-(7), as CasADi scalars: slip, stresses, forces on a wheel, and the entry angle at
which the soil carries a given load.

The functions return floats if their arguments are floats, and CasADi expressions if at least one argument is an
expression. Import from the modules: `slip`, `stress`, `wheel_forces` (with the load-traction factor), `peak_stress`
(Wong and Reece), `angles`, `sinkage`.
"""
