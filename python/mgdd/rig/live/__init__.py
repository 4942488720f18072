"""The live page of a rig: a server in a process of its own, which reads a record or a bus and never the loop."""
