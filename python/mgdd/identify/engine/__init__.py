"""Calibration of the cylinder model to measured pressure; public names stand in `mgdd.identify`."""
