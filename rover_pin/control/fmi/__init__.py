"""Functional mock-up units (FMI 3.0) of a rover on its ground and of its slip control. Start at `unit`."""
