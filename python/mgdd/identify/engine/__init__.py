"""Calibration of the cylinder model to measured pressure; public names are in `mgdd.identify`."""
