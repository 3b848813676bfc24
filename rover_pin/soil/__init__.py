"""Eqs (1)-(7) as CasADi scalars: slip, stresses, the forces on a wheel, the entry angle of a load.

Every function takes floats and gives floats, or takes CasADi expressions and gives expressions. Import from the
modules: `slip`, `stress`, `wheel_forces` (with the load-traction factor),
`peak_stress` (Wong and Reece), `angles`, `sinkage`.
"""
