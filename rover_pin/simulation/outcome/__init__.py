"""The outcome of a drive in one sentence, and checks whether the simulation of the drive can be believed.

Start at `outcome` and `audit`; `soil_energy` detects traction laws that create energy.
"""
