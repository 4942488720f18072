"""Findings of a seeker: reasons to doubt its run, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.results.finding import Finding

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

_FROZEN = 12  # as many failures say that a plant fails; rounded readings near an optimum are seldom alike for longer
_FOLLOWED = 0.5


if TYPE_CHECKING:

    class _CoreSeeker:
        """What every seeker, and what stands around one, has of its class of the core."""

        estimate: NDArray[np.float64]
        settable: NDArray[np.float64]
        cycle: int
        component_count: int
        input_names: list[str]
        limit_names: list[str]
        limit_states: dict[str, str]
        _watched: dict[str, Any]

        @property
        def settings(self) -> dict[str, Any]: ...
        @property
        def state(self) -> dict[str, list[float]]: ...
        @state.setter
        def state(self, saved: Any) -> None: ...
        def ask(self) -> Any: ...
        def tell(
            self,
            J: Any = None,  # noqa: N803
            limits: Any = None,
            *,
            misfire: bool = False,
            applied: Any = None,
        ) -> None: ...
        def restart(self) -> None: ...
        def _history_columns(self) -> dict[str, Any]: ...
        def _clear_history(self) -> None: ...
else:
    _CoreSeeker = object


class SeekerFindings(_CoreSeeker):
    """Mixed into every seeker: its findings."""

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Reasons to doubt the run so far.

        Codes: ``failing_inputs``, ``failing_everywhere``, ``failing_cycles`` (a tenth of all, and no input is known
        to fail), ``limit_delay``, ``frozen`` (a channel read the same to the last bit, twelve cycles in a row, at
        different inputs) and ``not_followed`` (less than half of the moves of an input are applied).

        Examples
        --------
        >>> from mgdd.optimize import GradientDescent
        >>> seeker = GradientDescent(start=0.0, difference=0.5)
        >>> def fails_above_3(x):
        ...     return None if x[0] > 3.0 else -0.02 * (x[0] - 5.0) ** 2
        >>> history = seeker.run(fails_above_3, 300)
        >>> [finding.code for finding in seeker.findings], float(history["applied"][-1, 0]) <= 3.0
        (['failing_inputs'], True)
        """
        return findings_of(self.settings, self._watched)


def findings_of(settings: Mapping[str, Any], watched: Mapping[str, Any]) -> tuple[Finding, ...]:
    """Put into words what a seeker of the core has seen."""
    out = list[Finding]()
    if watched["failing_everywhere"]:
        text = "the last twelve cycles and more have failed, of every input that was tried"
        out.append(Finding("failing_everywhere", (), text, "look at the plant, or start where it is known to run"))
    for side in ("above", "below"):
        edges = watched[f"failing_{side}"]
        for index in np.flatnonzero(np.isfinite(edges)):
            name, edge = _name(settings, int(index)), float(edges[index])
            text = f"the plant fails at {name} = {edge:.4g} and {side}: less is asked, and it is tried now and then"
            remedy = f"set {'upper' if side == 'above' else 'lower'} inside of it, or correct what makes it fail"
            out.append(Finding("failing_inputs", (name,), text, remedy))
    cycle, misfires, alike = watched["cycle"], watched["misfires"], watched["alike"]
    if not out and misfires >= max(4, 0.1 * cycle):
        text = f"{misfires} of {cycle} cycles gave no reading: J is learnt from the others"
        out.append(
            Finding("failing_cycles", (), text, "correct what makes them fail, or set bounds inside of where they do")
        )
    for limit in settings["limits"]:
        taken = watched["limit_delays"][limit.name]
        if taken != limit.delay_cycles:
            text = f"readings of {limit.name} fit a delay of {taken:g} cycles, not {limit.delay_cycles:g} as configured"
            at_end = abs(taken - limit.delay_cycles) >= limit.delay_uncertainty
            more = ", and raise delay_uncertainty: it is the end of the search" if at_end else ""
            out.append(Finding("limit_delay", (limit.name,), text, f"correct delay_cycles of the limit{more}"))
    limits = [limit.name for limit in settings["limits"]]
    components = len(alike) - len(limits)
    channels = ["J" if components == 1 else f"J[{index}]" for index in range(components)] + limits
    for name, count in zip(channels, alike, strict=True):
        if count >= _FROZEN:
            text = f"{name} read the same to the last bit in {count:.0f} cycles in a row, at different inputs"
            out.append(Finding("frozen", (name,), text, "look at what measures it, or whether it is read at all"))
    share = watched["applied_share"]
    for index in np.flatnonzero(share < _FOLLOWED):
        name = _name(settings, int(index))
        text = f"{share[index]:.0%} of the moves of {name} that were asked for are applied"
        remedy = "look at the actuator: a stop, a lag or coarse steps; set bounds inside of a stop"
        out.append(Finding("not_followed", (name,), text, remedy))
    return tuple(out)


def _name(settings: Mapping[str, Any], index: int) -> str:
    inputs = settings["inputs"]
    return str(inputs[index].name) if inputs else f"input[{index}]"
