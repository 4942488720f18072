"""Models that guide a seeker: feed-forward with a learnt trim, trust in it, and maps that learn.

A guide is any function of the operating point that says where the optimum should be: `ModelOptimum` asks the cycle
model, `TimingMap` a table, and a function of your own will do. `FeedForward` puts it in front of a seeker of
`mgdd.optimize`, which learns only what is left. The measured performance alone decides; ``guide=None`` is the plain
seeker.
"""

from __future__ import annotations

from mgdd.guide.feed_forward import FeedForward
from mgdd.guide.model_optimum import ModelOptimum
from mgdd.guide.timing_map import TimingMap

__all__ = ["FeedForward", "ModelOptimum", "TimingMap"]
