"""Describe the unexplained residual of a fitted drive model, as an effect that no effect file contains.

Such an unlisted effect is described as an action (such as a torque on one wheel) times a function of a signal.
`residual` describes the residual of a fitted drive model, `terms` fits and ranks the descriptions, and `draft` makes an
effect file of the best one. Start at `residual`.
"""
