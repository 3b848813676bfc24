"""Functional mock-up units (FMI 3.0) for co-simulation: one unit for a rover on its ground, and one for its control.
Start at `unit`.
"""
