"""Identification of a throttle from its log; public names are in `mgdd.identify`."""
