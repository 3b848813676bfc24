"""Runs of wheels on a test rig as one experiment, from one data set or from several data sets with one sand.

`experiment` holds the runs and the uncertain numbers, `model` the model of a wheel, `candidates` the effects that the
model may lack, and `describe` the description of the residual. `loop_data` has the data in the form that the loop (the
search for missing effects) needs. Data sets are read as `measurements.rig_set.RigSet`.
"""
