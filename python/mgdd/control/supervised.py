"""A throttle controller and its supervisor as one object: measured values in, inputs of the plant out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Protocol

from mgdd._core.control import ThrottleSupervisor
from mgdd.errors import ParameterError


class Controller(Protocol):
    """What a supervisor can stand beside."""

    def step(self, reference_deg: float, measurement_deg: float, /) -> float:
        """Return the duty [-] of this sample."""
        ...


def note_sent(controller: Any, duty: float) -> None:
    """Give a controller that predicts from its own duties the one that really left; others have no use for it."""
    set_sent = getattr(controller, "set_sent", None)
    if callable(set_sent):
        set_sent(duty)


class SupervisedController:
    """A controller that a supervisor watches, from measured values to the inputs of the plant.

    Parameters
    ----------
    controller : object
        Anything with ``step(reference_deg, measured_deg) -> duty``: `Pid`, `SlidingMode`, one of your own. It is not
        stepped while the bridge is open; ``reset()`` is called when it starts again, and ``set_sent(duty)`` with what
        left, where there are such.
    supervisor : ThrottleSupervisor, optional
        With the settings of the throttle; the defaults fit ``P1``.

    See Also
    --------
    ThrottleSupervisor : what is checked, and what follows.
    mgdd.loop.VirtualThrottle : a plant with faults, whose inputs ``duty`` and ``bridge_open`` this gives.

    Examples
    --------
    >>> from mgdd.control import Pid, SupervisedController
    >>> from mgdd.loop import ThrottleFault, VirtualThrottle
    >>> lost = ThrottleFault(kind="missing_sample", from_s=0.3, until_s=0.5)
    >>> plant = VirtualThrottle(inputs=("duty", "bridge_open"), faults=[lost], seed=1)
    >>> loop = SupervisedController(Pid())
    >>> plant.apply({"duty": 0.0, "bridge_open": 1.0})
    >>> values = plant.measure().values
    >>> for _ in range(900):
    ...     plant.apply(loop.step(40.0, values))
    ...     values = plant.measure().values
    >>> loop.supervisor.mode, loop.supervisor.reason, abs(values["angle_deg"] - 8.0) < 1.0
    ('limp_home', 'missing_sample', True)
    >>> loop.acknowledge()
    'none'
    >>> for _ in range(300):
    ...     plant.apply(loop.step(40.0, values))
    ...     values = plant.measure().values
    >>> loop.supervisor.mode, abs(values["angle_deg"] - 40.0) < 0.3
    ('normal', True)
    """

    def __init__(self, controller: Controller, supervisor: ThrottleSupervisor | None = None) -> None:
        if not callable(getattr(controller, "step", None)):
            raise ParameterError.of("controller", controller, "an object with step(reference_deg, measured_deg)")
        self.controller = controller
        self.supervisor = ThrottleSupervisor() if supervisor is None else supervisor

    def step(self, reference_deg: float, values: Mapping[str, float]) -> dict[str, float]:
        """Run one sample.

        Parameters
        ----------
        reference_deg : float
            What is asked for [deg].
        values : mapping of str to float
            As `mgdd.loop.VirtualThrottle.measure` gives them: ``first_angle_deg`` and ``second_angle_deg`` [deg], and
            where known ``age_s`` [s], ``supply_v`` [V] and ``fault``. Empty where no measurement arrived.

        Returns
        -------
        dict of str to float
            ``duty`` [-], and ``bridge_open`` as 0 or 1.
        """
        angles = (values.get("first_angle_deg", math.nan), values.get("second_angle_deg", math.nan))
        was_open = self.supervisor.bridge_open
        reference, measured = self.supervisor.observe(
            reference_deg,
            angles,
            age_s=values.get("age_s", 0.0),
            supply_v=values.get("supply_v"),
            sensor_fault=bool(values.get("fault", False)),
        )
        duty, bridge_open = self.supervisor.decide(0.0 if was_open else self.controller.step(reference, measured))
        if not bridge_open:
            note_sent(self.controller, duty)
        return {"duty": duty, "bridge_open": float(bridge_open)}

    def acknowledge(self) -> str:
        """Go back to normal where the cause is gone; the controller starts anew.

        Returns
        -------
        str
            The reason that stands, ``"none"`` where it was accepted.
        """
        was_open = self.supervisor.bridge_open
        stands = self.supervisor.acknowledge()
        reset = getattr(self.controller, "reset", None)
        if was_open and stands == "none" and callable(reset):
            reset()
        return stands
