"""What a seeker has found out that speaks against its run, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.results.finding import Finding

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

__all__ = ["SeekerFindings", "findings_of"]


if TYPE_CHECKING:

    class _Watching:
        """What every seeker has of its class of the core, and what stands around one."""

        @property
        def cycle(self) -> int: ...
        @property
        def misfires(self) -> int: ...
        @property
        def failing_above(self) -> NDArray[np.float64]: ...
        @property
        def failing_below(self) -> NDArray[np.float64]: ...
        @property
        def failing_everywhere(self) -> bool: ...
        @property
        def limit_delays(self) -> dict[str, float]: ...
        @property
        def settings(self) -> dict[str, Any]: ...
else:
    _Watching = object


class SeekerFindings(_Watching):
    """Mixed into every seeker: its findings."""

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What speaks against the run so far.

        Codes: ``failing_inputs``, ``failing_everywhere``, ``failing_cycles`` (a tenth of all, and no input is known
        to fail) and ``limit_delay``.

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
        return findings_of(
            self.settings,
            cycle=self.cycle,
            misfires=self.misfires,
            failing_above=self.failing_above,
            failing_below=self.failing_below,
            failing_everywhere=self.failing_everywhere,
            limit_delays=self.limit_delays,
        )


def findings_of(
    settings: Mapping[str, Any],
    *,
    cycle: int,
    misfires: int,
    failing_above: NDArray[np.float64],
    failing_below: NDArray[np.float64],
    failing_everywhere: bool,
    limit_delays: Mapping[str, float],
) -> tuple[Finding, ...]:
    """Put into words what a seeker has seen."""
    out = list[Finding]()
    if failing_everywhere:
        text = "the last twelve cycles and more have failed, of every input that was tried"
        out.append(Finding("failing_everywhere", (), text, "look at the plant, or start where it is known to run"))
    for side, edges in (("above", failing_above), ("below", failing_below)):
        for index in np.flatnonzero(np.isfinite(edges)):
            inputs = settings["inputs"]
            name, edge = inputs[index].name if inputs else f"input[{index}]", float(edges[index])
            text = f"the plant fails at {name} = {edge:.4g} and {side}: less is asked, and it is tried now and then"
            remedy = f"set {'upper' if side == 'above' else 'lower'} inside of it, or mend what makes it fail"
            out.append(Finding("failing_inputs", (name,), text, remedy))
    if not out and misfires >= max(4, 0.1 * cycle):
        text = f"{misfires} of {cycle} cycles gave no reading: J is learnt from the others"
        out.append(
            Finding("failing_cycles", (), text, "mend what makes them fail, or set bounds inside of where they do")
        )
    for limit in settings["limits"]:
        taken = limit_delays[limit.name]
        if taken != limit.delay_cycles:
            text = f"readings of {limit.name} fit a delay of {taken:g} cycles, not {limit.delay_cycles:g} as stated"
            at_end = abs(taken - limit.delay_cycles) >= limit.delay_uncertainty
            more = ", and raise delay_uncertainty: it is the end of the search" if at_end else ""
            out.append(Finding("limit_delay", (limit.name,), text, f"mend delay_cycles of the limit{more}"))
    return tuple(out)
