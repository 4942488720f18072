"""Identification of a throttle from its log; public names stand in `mgdd.identify`."""
