"""Rigs over a CAN bus: DBC and signal map, transport, rig, and the node and hub of the other side."""
