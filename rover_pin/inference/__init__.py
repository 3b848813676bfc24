"""What the data make of hypotheses: evidence with a smooth discrepancy, form error, scatter and drift beside the noise.

Start at `explore.py`; `error_model.py` has the equation of the errors, `evidence.py` that of the evidence.
"""
