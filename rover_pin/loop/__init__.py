"""The loop: compare measured data with a model, find a missing effect, add it, and test the new model on held-out data.

Start at `close.close_the_loop`. `identify.identify` only fits the numbers of the base model.
"""
