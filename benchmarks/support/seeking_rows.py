"""Rows of the tables of seeking: a seeker of ours on a map as a contender, and one run of it."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass

from peers.peer_seekers import Contender, Plant, Point, like, run_to_end
from support.seeking_maps import CountedPlant

from mgdd import optimize
from mgdd_studies.several_maps import SeekingMap, tuned_seeker

OnMap = Callable[[SeekingMap], Contender]
Make = Callable[[SeekingMap, Point, int], optimize.Seeker]  # map, start, seed


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    name: str
    contender: OnMap
    is_tested: bool = False  # set beside the best of the others
    is_bayes: bool = False
    must_arrive: bool = False


def driven(make: Make, *, asks_again: bool = False) -> OnMap:
    """Where nothing is read it is told of a misfire, or its input is applied again until something is."""

    def on(field: SeekingMap) -> Contender:
        def run(plant: Plant, start: Point, seed: int) -> None:
            seeker = make(field, start, seed)
            while True:
                x = seeker.ask()
                plant.estimate = like(start, seeker.estimate)
                if isinstance(seeker, optimize.GaussianProcessSeeking):
                    plant.stated = (seeker.expected, seeker.expected_sd)
                j = plant(like(start, x))
                while asks_again and math.isnan(j):
                    j = plant(like(start, x))
                seeker.tell(j, misfire=math.isnan(j))

        return run

    return on


def untouched(kind: Callable[..., optimize.Seeker], **settings: object) -> OnMap:
    def make(field: SeekingMap, start: Point, seed: int) -> optimize.Seeker:
        chance = {"seed": seed} if kind is optimize.Spsa else {}
        return kind(start=start, bounds=(field.lower, field.upper), **settings, **chance)

    return driven(make)


def tuned(method: str) -> OnMap:
    """Given noise and curvature; the perturbation is kept inside the bounds at the start."""
    return driven(lambda field, start, seed: tuned_seeker(field, start, seed, method, field.curvature))


def run_once(row: Row, field: SeekingMap, seed: int, *, noisy: bool = True) -> CountedPlant:
    setting = field.setting(seed, noisy)
    plant = CountedPlant(setting)
    run_to_end(row.contender(field), plant, setting.start, seed)
    return plant


def check_agreement(rows: list[Row], field: SeekingMap) -> None:
    """SystemExit where one that must arrive ends elsewhere without noise."""
    for row in rows:
        if row.must_arrive and not all(run_once(row, field, seed, noisy=False).near() for seed in (0, 1)):
            sys.exit(f"{row.name} does not find the optimum of {field.name} without noise: nothing counted")
