"""Habits of a throttle: its loop of angle over duty at several frequencies, and its answer to air flow."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.plot.style import GREY, LINE_STYLES, finished, minus, new_axes, require

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

    from mgdd.results.result import Result

__all__ = ["air_flow", "rate_dependence"]

_MADE_BY = "the study throttle-characteristics"


def rate_dependence(dataset: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw the angle over the duty for every frequency.

    Parameters
    ----------
    dataset : xarray.Dataset or Result
        ``loop_duty`` [-] and ``loop_angle_deg`` [deg] over ``frequency_hz`` [Hz] and ``phase``: one preset of the
        study ``throttle-characteristics``.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.

    Raises
    ------
    DataError
        A variable is missing or has no unit.

    Examples
    --------
    >>> from mgdd_studies.throttle_habits import rate_dependence
    >>> from mgdd_studies import run_study
    >>> study = run_study("throttle-characteristics", quick=True, figures=False)
    >>> rate_dependence(study.dataset.isel(preset=0)).get_xlabel()
    'duty [-]'
    """
    dataset = require("dataset", dataset, ("frequency_hz", "phase", "loop_duty", "loop_angle_deg"), _MADE_BY)
    ax = new_axes(ax)
    lines: list[Line2D] = []
    for place, frequency in enumerate(dataset["frequency_hz"].to_numpy()):
        one = dataset.isel(frequency_hz=place)
        dash, color = LINE_STYLES[place % len(LINE_STYLES)]
        width = 1.3 if place < len(LINE_STYLES) else 2.2
        label = f"{frequency:g} Hz"
        lines += ax.plot(
            one["loop_duty"], one["loop_angle_deg"], linestyle=dash, color=color, linewidth=width, label=label
        )
    return finished(ax, dataset, "loop_duty", "loop_angle_deg", lines, columns=4)


def air_flow(dataset: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw the angle over time at constant duty for every torque of the air flow.

    Parameters
    ----------
    dataset : xarray.Dataset or Result
        ``air_angle_deg`` [deg] over ``airflow_torque_nm`` [N m] and ``time_s`` [s]: one preset and one arrival of the
        study ``throttle-characteristics``; attribute ``air_from_s`` marks the onset.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.

    Raises
    ------
    DataError
        A variable is missing or has no unit.

    Examples
    --------
    >>> from mgdd_studies.throttle_habits import air_flow
    >>> from mgdd_studies import run_study
    >>> study = run_study("throttle-characteristics", quick=True, figures=False)
    >>> air_flow(study.dataset.isel(preset=0, arrival=0)).get_ylabel()
    'plate angle [deg]'
    """
    dataset = require("dataset", dataset, ("time_s", "airflow_torque_nm", "air_angle_deg"), _MADE_BY)
    ax = new_axes(ax)
    lines: list[Line2D] = []
    for place, torque in enumerate(dataset["airflow_torque_nm"].to_numpy()):
        dash, color = LINE_STYLES[place % len(LINE_STYLES)]
        angle = dataset["air_angle_deg"].isel(airflow_torque_nm=place)
        label = minus(f"{torque:g} N m")
        lines += ax.plot(dataset["time_s"], angle, linestyle=dash, color=color, linewidth=1.4, label=label)
    if "air_from_s" in dataset.attrs:
        lines.append(
            ax.axvline(
                float(dataset.attrs["air_from_s"]),
                color=GREY,
                linewidth=0.9,
                linestyle=(0, (1, 1)),
                label="air flow from here",
            )
        )
    return finished(ax, dataset, "time_s", "air_angle_deg", lines, columns=3)
