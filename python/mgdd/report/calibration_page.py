"""What a page of measured pressure shows of a calibration: its sections, tables and figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from mgdd import plot
from mgdd.engine import timing_sweep
from mgdd.identify.engine.family import Member, ModelFamily
from mgdd.identify.engine.profile import WallHeatProfile
from mgdd.identify.engine.records import Load
from mgdd.identify.engine.timing_records import undetermined
from mgdd.plot.calibration import family_strips
from mgdd.plot.calibration import wall_heat_profile as draw_profile
from mgdd.plot.style import drawn, new_figure
from mgdd.report.report import Section, Table, as_number

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from mgdd.identify.engine.family import Member
    from mgdd.identify.engine.timing_records import BestTiming

_ANALYSIS_COLUMNS = {
    "p_max_bar": ("p_max [bar]", ".1f"),
    "p_max_cad": ("at [°CA aTDC]", ".1f"),
    "imep_closed_bar": ("closed IMEP [bar]", ".2f"),
    "ca10_cad": ("CA10 [°CA aTDC]", ".1f"),
    "ca50_cad": ("CA50 [°CA aTDC]", ".1f"),
    "ca90_cad": ("CA90 [°CA aTDC]", ".1f"),
    "heat_net_j": ("net heat [J]", ".0f"),
    "n_compression": ("n_c [-]", ".3f"),
    "n_expansion": ("n_e [-]", ".3f"),
}
_BURN = {
    "soc_cad": ("SOC [°CA aTDC]", ".2f"),
    "burn_duration_cad": ("duration [°CA]", ".1f"),
    "fuel_heat_j": ("fuel heat [J]", ".0f"),
    "ca50_cad": ("CA50 [°CA aTDC]", ".1f"),
    "rmse_bar": ("RMSE [bar]", ".2f"),
    "heat_loss_fraction": ("wall heat over fuel heat [-]", ".3f"),
}
_WALL = {
    "value": ("scale [-]", ".2f"),
    "stderr": ("standard error [-]", ".3f"),
    "correlation": ("strongest correlation [-]", ".2f"),
}
_TIMING = {
    "soc_cad": ("best SOC, own p_max kept [°CA aTDC]", 1),
    "ca50_cad": ("best CA50, own p_max kept [°CA aTDC]", 1),
    "shift_cad": ("move by, own p_max kept [°CA]", 1),
    "gain_percent": ("gain [%]", 2),
    "free_soc_cad": ("best SOC, no limit [°CA aTDC]", 1),
    "free_ca50_cad": ("best CA50, no limit [°CA aTDC]", 1),
    "free_shift_cad": ("move by, no limit [°CA]", 1),
    "free_gain_percent": ("gain, no limit [%]", 2),
}
_MEMBERS = {
    "rmse_percent": ("RMSE [% of p_max]", ".2f"),
    "imep_closed_error_percent": ("closed IMEP error [%]", "+.1f"),
    "soc_minus_soi_cad": ("SOC minus SOI [°CA]", "+.1f"),
    "efficiency_gross": ("gross efficiency [-]", ".3f"),
    "ca50_cad": ("best CA50, own p_max kept [°CA aTDC]", ".1f"),
    "free_ca50_cad": ("best CA50, no limit [°CA aTDC]", ".1f"),
}
_TIMING_TEXT = (
    "{kept} of {n} models are plausible for at least one load. Each cell: the answer of the headline model, then the "
    "range over all plausible ones, angles with {misfit:g} °CA on both sides for crevices, blow-by and gas properties "
    "that no model has. Where the range is wide, these traces do not determine the best timing: wall heat and gamma "
    "cannot be separated. What to set is 'move by': later than measured if positive; 'open' where the range spans "
    "zero, so that no direction is determined. CA50 is that of the modelled burn, some tenths later than that of the "
    "net heat below. Own p_max is the highest measured sample, or the model's where that is higher at the measured "
    "timing. Gains are those of the models, in closed-cycle work over the measured timing."
)
_HEADLINE_TEXT = (
    "Headline: {law}. It has the least distance from the best fit and from the textbook wall heat (1 ± 0.25) of the "
    "models that are plausible."
)
_MEMBERS_TEXT = (
    "Every model is fitted to all loads together, the burn bounded by the injection. Plausible: wall heat 0.3 to 1.5 "
    "of the textbook law, closed efficiency at most 0.55, heat 0.86 to 1.04 of a stated fuel, closed IMEP within 2 %, "
    "RMSE at most twice the least (of which less than 0.2 % counts as 0.2), no burn before the injection, a fit that "
    "converged, and wall heat and gamma of the other loads serve the one left out."
)
_LAWS_TEXT = (
    "Pressure error over the closed cycle, error of the closed IMEP, fitted burn start against injection, and the "
    "largest local error. A small pressure error alone proves nothing."
)


def sections_of(s: Mapping[str, Any], figures: Mapping[str, Figure]) -> tuple[Section, ...]:
    """Make the sections from the summary."""
    profiles = s["common"]["wall_heat_scale"]
    return (
        Section(title="Best timing", text=_headline(s), table=_timing_table(s["best_timing"])),
        Section(title="Limitations found", items=tuple(_limitations(s))),
        Section(title="Every member of the family", text=(_MEMBERS_TEXT,), table=_members(s["best_timing"])),
        Section(title="Every burn law, free to start before the injection", text=(_LAWS_TEXT,), table=_laws(s["laws"])),
        Section(
            title="Wall heat",
            text=() if profiles else ("Not profiled in this quick run.",),
            table=_wall_heat(profiles) if profiles else None,
        ),
        Section(title=f"Calibrated burn ({s['law']})", table=_per_trace(s["traces"], "calibrated", _BURN)),
        Section(
            title="Analysis of the measured traces",
            text=("Net heat release with gamma 1.33 in the window found from each trace, which is taken as absolute.",),
            table=_per_trace(s["traces"], "analysis", _ANALYSIS_COLUMNS),
        ),
        *((Section(title="Figures", figures=figures),) if figures else ()),
    )


def _limitations(s: Mapping[str, Any]) -> list[str]:
    out = []
    for law, profile in s["common"]["wall_heat_scale"].items():
        if not profile["identifiable"]:
            out.append(
                f"The wall-heat scale is not identifiable from these traces ({law}): {'; '.join(profile['reasons'])}."
            )
    not_identifiable = "wall_heat_scale is not identifiable from these traces"
    out += [f"{text}." for text in s["warnings"] if not (out and text.endswith(not_identifiable))]
    for row in s["traces"]:
        out += [f"{row['file']}: {text}." for text in row["warnings"]]
    out.append(
        "Standard errors of the wall heat take the residual as white noise; it is model error, so the true ones are "
        "larger."
    )
    errors = [abs(row["best"]["p_max_model_error_bar"]) for row in s["best_timing"] if row["best"]] or [0.0]
    out.append(
        f"At the measured timing the headline's p_max is wrong by up to {max(errors):.1f} bar: gains of a tenth of a "
        "percent under the trace's own p_max lie within that error."
    )
    out.append("NOx is a proxy from the maximum bulk gas temperature with unfitted constants: read its trend only.")
    out.append("The gas exchange is not in these traces: gains leave out pumping work, emissions and exhaust enthalpy.")
    return out


def _headline(s: Mapping[str, Any]) -> tuple[str, ...]:
    rows = s["best_timing"]
    n = len(rows[0]["members"])
    good = sum(any(row["members"][at]["plausible"] for row in rows) for at in range(n))
    if not good:
        return (
            (
                f"None of {n} models is plausible for these traces: no best timing is given. The member that comes "
                f"nearest is {s['law']}; what it fails stands below. Suspect geometry, TDC, pegging, speed or mass."
            ),
        )
    return _HEADLINE_TEXT.format(law=s["law"]), _TIMING_TEXT.format(kept=good, n=n, misfit=ModelFamily().misfit_cad)


def move_of(row: Mapping[str, Any]) -> str:
    """State how far to move the timing of a trace, what that gains, and how sure that is."""
    best = row["best"]
    if best is None:
        return f"{row['file']}: no plausible model, so no best timing."
    limited, free = (_part(row, prefix) for prefix in ("", "free_"))
    same = abs(best["shift_cad"] - best["free_shift_cad"]) < 0.05
    if same and undetermined(row["shift_cad"]) == undetermined(row["free_shift_cad"]):
        return f"{row['file']}: {free}; its own p_max kept, range {_ends(row['shift_cad'])} °CA."
    return f"{row['file']}: {limited}, its own p_max kept; without that limit {free}."


def _part(row: Mapping[str, Any], prefix: str) -> str:
    """Describe the move of one question; a range that spans zero gives none."""
    best, ends = row["best"], row[f"{prefix}shift_cad"]
    if undetermined(ends):
        return f"no direction is determined, range {_ends(ends)} °CA"
    to = f" to a p_max of {best['free_p_max_bar']:.0f} bar" if prefix else ""
    return (
        f"{_move(best[f'{prefix}shift_cad'])}{to}, gain {best[f'{prefix}gain_percent']:.2f} %, range {_ends(ends)} °CA"
    )


def _move(cad: float) -> str:
    return f"{'retard' if cad > 0 else 'advance'} by {abs(cad):.1f} °CA" if abs(cad) >= 0.05 else "leave the timing"


def _ends(pair: Sequence[float]) -> str:
    return " to ".join(dict.fromkeys(f"{value:+z.1f}".replace("-", "−") for value in pair))


def _table(first: Sequence[str], columns: Mapping[str, tuple[str, Any]], rest: Sequence[str], body: Any) -> Table:
    heads = (*first, *(head for head, _ in columns.values()), *rest)
    return Table(columns=heads, rows=tuple(map(tuple, body)))


def _cells(values: Mapping[str, Any], columns: Mapping[str, tuple[str, str]]) -> list[str]:
    return [as_number(values[name], form) for name, (_, form) in columns.items()]


def _timing_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    def cell(row: Mapping[str, Any], name: str, digits: int) -> str:
        if row["best"] is None:
            return "not known"
        prefix = "free_" if name.startswith("free_") else ""
        is_open = undetermined(row[f"{prefix}shift_cad"])
        first = (
            "open"
            if is_open and name.endswith(("shift_cad", "gain_percent"))
            else as_number(row["best"][name], f"z.{digits}f")
        )
        return f"{first} ({_span(row[name], digits)})"

    body = ((row["file"], *(cell(row, name, digits) for name, (_, digits) in _TIMING.items())) for row in rows)
    return _table(["trace"], _TIMING, [], body)


def _members(rows: Sequence[Mapping[str, Any]]) -> Table:
    body = (
        (first["name"] if row is rows[0] else "", row["file"], *_cells(row["members"][at], _MEMBERS),
         row["members"][at]["why_not"] or "yes")
        for at, first in enumerate(rows[0]["members"]) for row in rows
    )  # fmt: skip
    return _table(["model", "trace"], _MEMBERS, ["plausible"], body)


def _laws(laws: Sequence[Mapping[str, Any]]) -> Table:
    head = ["law", "wall-heat scale [-]", "trace", "RMSE [% of p_max]", "closed IMEP error [%]", "SOC [°CA aTDC]"]
    onset = all("onset_against_soi_cad" in law for law in laws)
    head += ["SOC minus SOI [°CA]"] if onset else []
    head += ["largest error [bar]", "at [°CA aTDC]"]
    body = []
    for law in laws:
        for i, file in enumerate(law["file"]):
            row = [law["law"], f"{law['wall_heat_scale']:.2f}"] if i == 0 else ["", ""]
            row += [file, f"{law['rmse_percent'][i]:.2f}", f"{law['imep_closed_error_percent'][i]:+.1f}"]
            row += [f"{law['soc_cad'][i]:.1f}"]
            row += [as_number(law["onset_against_soi_cad"][i], "+.1f")] if onset else []
            body.append((*row, f"{law['largest_error_bar'][i]:+.1f}", f"{law['largest_error_cad'][i]:.0f}"))
    return Table(columns=tuple(head), rows=tuple(body))


def _wall_heat(profiles: Mapping[str, Mapping[str, Any]]) -> Table:
    body = (
        (
            law, *_cells(profile, _WALL), str(profile["correlated_with"]),
            _span((profile["range_low"], profile["range_high"]), 2),
            _span((profile["possible_low"], profile["possible_high"]), 2),
            "yes" if profile["identifiable"] else "no",
        )
        for law, profile in profiles.items()
    )  # fmt: skip
    return _table(["law"], _WALL, ["with", "as good within 10 % [-]", "possible in all [-]", "identifiable"], body)


def _per_trace(rows: Sequence[Mapping[str, Any]], part: str, columns: Mapping[str, tuple[str, str]]) -> Table:
    return _table(["trace"], columns, [], ((row["file"], *_cells(row[part], columns)) for row in rows))


def _span(pair: Sequence[float], digits: int) -> str:
    low, high = (as_number(value, f"z.{digits}f") for value in pair)
    return low if low == high else f"{low} to {high}"


def draw(
    analyses: Sequence[xr.Dataset], main: Member, profiles: Mapping[str, WallHeatProfile], timing: Sequence[BestTiming]
) -> dict[str, Figure]:
    """Draw the figures by caption; nothing is registered with pyplot."""
    figures = {
        "Best timing by every member of the family, without a pressure limit": family_strips(timing),
        "Measured pressure and apparent heat release": _grid(analyses, plot.pressure),
        "log p over log V with the polytropic slopes of compression and expansion": _grid(
            analyses, partial(plot.pressure, log_pv=True)
        ),
        f"Calibration, {main.name}": _grid(main.fit.loads, Load.plot),
    }
    for law, profile in profiles.items():
        figures[f"What the traces show of wall heat: refitted RMSE over the wall-heat scale, {law}"] = drawn(
            draw_profile, profile.dataset, size=(13.0, 4.8)
        )
    sweeps = [timing_sweep(load.cylinder, load.point).assign_attrs(file=load.file) for load in main.fit.loads]
    figures[f"Efficiency and NOx proxies over timing, {main.name}"] = _grid(sweeps, plot.timing, label=True)
    return figures


def _grid(datasets: Sequence[Any], function: Any, *, label: bool = False) -> Figure:
    columns = min(2, len(datasets))
    rows = -(-len(datasets) // columns)
    figure = new_figure(13.0, 4.8 * rows)
    for i, dataset in enumerate(datasets):
        part = figure.add_subplot(rows, columns, i + 1)
        function(dataset, ax=part)
        if label:  # plots of a trace name their file themselves
            part.annotate(dataset.attrs["file"], (0.5, 0.04), xycoords="axes fraction", ha="center")
    return figure
