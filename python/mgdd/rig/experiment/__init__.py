"""Experiments from a file: the same one in process, over a bus, on a record and on a bench."""

from __future__ import annotations

from mgdd.rig.experiment.checked import CheckedExperiment, check_experiment
from mgdd.rig.experiment.experiment import Experiment
from mgdd.rig.experiment.run import ExperimentResult, run_experiment
from mgdd.rig.experiment.self_test import SelfTest, run_self_test

__all__ = [
    "CheckedExperiment",
    "Experiment",
    "ExperimentResult",
    "SelfTest",
    "check_experiment",
    "run_experiment",
    "run_self_test",
]
