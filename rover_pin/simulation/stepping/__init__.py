"""The step size of a drive, and the error that it causes.

`timing` holds the times that a caller asks for. `resolution` divides the step as finely as the stiffness of the ground
needs, and `pace` divides it further while forces change fast. `tolerance` repeats a drive with halved steps until the
error, which `step_error` estimates, is within the tolerance.
"""
