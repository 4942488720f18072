"""Measured benchmarks of identification: a drive, two tanks and a circuit, fitted beside published figures.

Models and fits stand in `drive_axis`, `two_tanks` and `wiener_hammerstein`; they serve the study and the tests.
"""
