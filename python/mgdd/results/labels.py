"""Labelled results: xarray Datasets in which every variable has its unit and its long name, ready for netCDF.

The units of the names that several modules share stand once, in `VARIABLES`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import Enum
from numbers import Real
from pathlib import PurePath
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd.errors import DataError, ShapeError
from mgdd.results.units import attribute_units, printed_units, unit_attributes, unit_of, without_unit

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

    from mgdd.results.dataset import Dataset

ANGLE = "crank_angle_cad"


class Label(NamedTuple):
    """Unit and long name of a variable; an axis label reads ``long_name [units]``.

    Parameters
    ----------
    units : str
        Unit as figures print it, ``"-"`` if dimensionless; attributes hold it as `labelled_dataset` describes.
    long_name : str
        Name for axis labels.
    """

    units: str
    long_name: str


_CAD = "°CA aTDC"
# Quantities whose unit is a letter.
_OF_LETTER = {
    letter: frozenset(words.split())
    for letter, words in {
        "a": "current", "v": "voltage supply battery signal", "k": "temperature temp", "l": "volume displacement",
        "m": "length distance position bore stroke rod", "n": "force", "g": "mass", "h": "time duration inductance",
        "j": "heat energy work",
    }.items()
}  # fmt: skip

_FOLLOWED = {
    "settling_ms": Label("ms", "settling time"),
    "mse_deg2": Label("deg²", "mean square error"),
    "static_error_deg": Label("deg", "static error"),
    "overshoot_deg": Label("deg", "overshoot"),
    "limit_cycle_deg": Label("deg", "peak to peak at rest"),
    "largest_error_deg": Label("deg", "largest error"),
}  # of the true angle; measured ones bear its noise and have names of their own

VARIABLES: Mapping[str, Label] = MappingProxyType(
    {
        ANGLE: Label(_CAD, "crank angle"),
        "pressure_bar": Label("bar", "cylinder pressure"),
        "motored_pressure_bar": Label("bar", "motored pressure"),
        "volume_l": Label("L", "cylinder volume"),
        "temperature_k": Label("K", "mean gas temperature"),
        "burned_fraction": Label("-", "burned fraction"),
        "heat_release_j_per_cad": Label("J/°CA", "heat release rate"),
        "heat_release_net_j_per_cad": Label("J/°CA", "net heat release rate"),
        "heat_release_gross_j_per_cad": Label("J/°CA", "gross heat release rate"),
        "heat_net_cumulative_j": Label("J", "cumulative net heat release"),
        "heat_gross_cumulative_j": Label("J", "cumulative gross heat release"),
        "heat_loss_j_per_cad": Label("J/°CA", "wall heat loss rate"),
        "imep_closed_bar": Label("bar", "closed-cycle IMEP (IVC to EVO)"),
        "imep_gross_bar": Label("bar", "gross IMEP (-180 to 180 °CA)"),
        "imep_net_bar": Label("bar", "net IMEP (720 °CA)"),
        "pmep_bar": Label("bar", "pumping mean pressure, net less gross IMEP"),
        "mapo_bar": Label("bar", "largest pressure oscillation in the knock band"),
        "impo_bar_cad": Label("bar °CA", "integral of the absolute pressure oscillation"),
        "sepo_bar2_cad": Label("bar² °CA", "integral of the squared pressure oscillation"),
        "oscillation_bar": Label("bar", "pressure in the knock band"),
        "frequency_khz": Label("kHz", "frequency"),
        "pressure_psd_bar2_per_khz": Label("bar²/kHz", "power spectral density of the pressure"),
        "ringing_frequency_khz": Label("kHz", "frequency of ringing"),
        "tangential_mode_khz": Label("kHz", "first tangential mode of the bore"),
        "knock_share_percent": Label("%", "cycles that knock, of all"),
        "frequency_hz": Label("Hz", "mid-band frequency"),
        "pressure_level_db": Label("dB", "third-octave level of the pressure, re 20 µPa"),
        "mean_pressure_level_db": Label("dB", "third-octave level of the pressure, re 20 µPa, mean of the cycles"),
        "noise_level_dba": Label("dB", "A-weighted combustion noise, re 20 µPa"),
        "mean_noise_level_dba": Label("dB", "A-weighted combustion noise, re 20 µPa, mean of the cycles"),
        "misfire": Label("-", "nothing burned"),
        "partial_burn": Label("-", "less burned than in the other cycles"),
        "efficiency_gross": Label("-", "gross indicated efficiency"),
        "p_max_bar": Label("bar", "maximum pressure"),
        "p_max_cad": Label(_CAD, "angle of maximum pressure"),
        "t_max_k": Label("K", "maximum mean gas temperature"),
        "t_max_cad": Label(_CAD, "angle of maximum mean gas temperature"),
        "dp_max_bar_per_cad": Label("bar/°CA", "maximum pressure rise rate"),
        "dp_max_cad": Label(_CAD, "angle of maximum pressure rise rate"),
        "ca10_cad": Label(_CAD, "CA10, angle of 10 % heat released"),
        "ca50_cad": Label(_CAD, "CA50, angle of 50 % heat released"),
        "ca90_cad": Label(_CAD, "CA90, angle of 90 % heat released"),
        "heat_loss_j": Label("J", "wall heat loss of the closed cycle"),
        "heat_loss_fraction": Label("-", "wall heat loss over fuel heat"),
        "work_closed_j": Label("J", "closed-cycle work (IVC to EVO)"),
        "work_gross_j": Label("J", "gross work (-180 to 180 °CA)"),
        "ringing_intensity_mw_per_m2": Label("MW/m²", "ringing intensity"),
        "soc_cad": Label(_CAD, "start of combustion"),
        "intake_pressure_kpa": Label("kPa", "intake pressure"),
        "second_fraction": Label("-", "share of the heat in the second Wiebe law"),
        "intake_o2_fraction": Label("-", "oxygen of the charge by volume"),
        "t_evo_k": Label("K", "gas temperature at EVO"),
        "soi_cad": Label(_CAD, "start of injection"),
        "burn_duration_cad": Label("°CA", "burn duration"),
        "fuel_heat_j": Label("J", "fuel heat"),
        "pegging_bar": Label("bar", "pegging offset"),
        "n_compression": Label("-", "polytropic exponent of compression"),
        "n_expansion": Label("-", "polytropic exponent of expansion"),
        "heat_net_j": Label("J", "net heat release"),
        "heat_gross_j": Label("J", "gross heat release"),
        "heat_from_cad": Label(_CAD, "start of the heat window"),
        "heat_to_cad": Label(_CAD, "end of the heat window"),
        "trapped_mass_g": Label("g", "trapped mass"),
        "tdc_offset_cad": Label("°CA", "error of top dead centre, angle minus truth"),
        "compression_offset_bar": Label("bar", "offset that a free polytrope of compression adds"),
        "nox_affine_log_ppm": Label("ppm", "NOx proxy, affine-log map"),
        "nox_arrhenius_ppm": Label("ppm", "NOx proxy, Arrhenius map"),
        "no_ppm": Label("ppm", "thermal NO of all gas, wet"),
        "flame_k": Label("K", "flame temperature of what burns"),
        "unburned_k": Label("K", "temperature of the unburned charge"),
        "nox_ppm": Label("ppm", "NOx"),
        "nox_g_per_kwh": Label("g/kWh", "NOx as NO2 over the closed-cycle work"),
        "lambda_global": Label("-", "air over the need of the fuel, all charge"),
        "flame_max_k": Label("K", "highest flame temperature"),
        "cycle": Label("-", "engine cycle"),
        "soc_requested_cad": Label(_CAD, "requested start of combustion"),
        "soc_applied_cad": Label(_CAD, "start of combustion that was set, clamped to the timing window"),
        "nox_true_ppm": Label("ppm", "NOx, true value"),
        "nox_analyser_ppm": Label("ppm", "NOx, analyser"),
        "nox_fast_ppm": Label("ppm", "NOx, fast sensor"),
        "nox_soft_ppm": Label("ppm", "NOx, soft sensor"),
        "nox_soft_corrected_ppm": Label("ppm", "NOx, soft sensor held to the analyser"),
        "j": Label("unit of J", "J"),
        "cov_imep_percent": Label("%", "COV of IMEP, last 50 cycles"),
        "measured_bar": Label("bar", "measured pressure"),
        "model_bar": Label("bar", "model pressure"),
        "residual_bar": Label("bar", "model minus measured pressure"),
        "rmse_bar": Label("bar", "pressure RMSE, closed cycle"),
        "rmse_percent": Label("% of p_max", "pressure RMSE, closed cycle"),
        "imep_closed_error_percent": Label("%", "error of the closed-cycle IMEP"),
        "wall_heat_scale": Label("-", "wall-heat scale"),
        "time_s": Label("s", "time"),
        "duty": Label("-", "duty"),
        "angle_deg": Label("deg", "plate angle"),
        "model_deg": Label("deg", "plate angle, model"),
        "current_a": Label("A", "motor current"),
        "supply_v": Label("V", "supply voltage"),
        "airflow_torque_nm": Label("N m", "torque of the air flow on the plate"),
        "start_angle_deg": Label("deg", "plate angle at the start"),
        "final_angle_deg": Label("deg", "plate angle at the end"),
        "max_angle_deg": Label("deg", "highest plate angle"),
        "min_angle_deg": Label("deg", "lowest plate angle"),
        "max_current_a": Label("A", "highest motor current"),
        "duration_s": Label("s", "length of the run"),
        "step_s": Label("s", "integration step"),
        "t10_s": Label("s", "time to 10 % of the way"),
        "t90_s": Label("s", "time to 90 % of the way"),
        "speed_deg_per_s": Label("deg/s", "plate speed"),
        "sensed_angle_deg": Label("deg", "measured plate angle"),
        "reference_deg": Label("deg", "wanted plate angle"),
        "total_variation": Label("-", "total variation of the duty"),
        **_FOLLOWED,
        **{f"sensed_{name}": Label(unit, f"{what}, measured") for name, (unit, what) in _FOLLOWED.items()},
    }
)


def labelled_dataset(
    variables: Mapping[str, Sequence[Any]], *, attrs: Mapping[str, Any] | None = None, copy: bool = True
) -> Dataset:
    """Build a Dataset in which nothing lacks a unit, of ``name: (dims, values, units, long_name)``; values are copied.

    The last two are left out for a name in `VARIABLES`. A name that is its own only dimension becomes its coordinate.
    Units are as figures print them or as pint parses them, and are kept for pint; a convention that they cannot hold
    ends the long name: ``crank angle, °CA aTDC``.
    """
    from mgdd.results.dataset import Dataset

    _check_attributes("the Dataset", attrs or {})
    arrays: dict[str, tuple[tuple[str, ...], np.ndarray[Any, Any], dict[str, str]]] = {}
    sizes: dict[str, tuple[int, str]] = {}
    for name, entry in variables.items():
        dims, values, label = _entry(name, entry)
        array = np.array(values) if copy else np.asarray(values)
        if array.ndim != len(dims):
            raise ShapeError(f"{name} has shape {array.shape}: {len(dims)} dimension(s) {dims} were declared")
        for dim, size in zip(dims, array.shape, strict=True):
            earlier, first = sizes.setdefault(dim, (size, name))
            if earlier != size:
                raise ShapeError(f"{name} has {size} samples along {dim}: {first} has {earlier}")
        arrays[name] = (dims, array, unit_attributes(label.units, label.long_name))
    coords = {name: item for name, item in arrays.items() if item[0] == (name,)}
    for dim, (_, name) in sizes.items():
        if dim not in coords:
            raise DataError(f"dimension {dim} of {name} has no coordinate: add a variable {dim!r}")
    data = {name: item for name, item in arrays.items() if name not in coords}
    return Dataset(data_vars=data, coords=coords, attrs=dict(attrs or {}))


def label_of(variable: xr.DataArray | xr.Variable) -> Label:
    """Return unit and name of a variable as figures print them."""
    return Label(*printed_units(str(variable.attrs["units"]), str(variable.attrs["long_name"])))


def name_unit(name: str) -> str:
    """Return the unit that a name gives for certain, whoever chose it; ``"-"`` for none.

    A letter at the end of a name, but for seconds, is a unit behind a word of its quantity alone.
    """
    if name in VARIABLES:
        return VARIABLES[name].units
    *words, last = name.lower().split("_")
    unsure = last in _OF_LETTER and "per" not in words
    return "-" if unsure and not set(words) & _OF_LETTER[last] else unit_of(name)


def named_label(name: str) -> Label:
    """Return unit and name of a quantity of which nothing but its name is known."""
    return VARIABLES[name] if name in VARIABLES else Label(unit_of(name), without_unit(name))


def check_labels(dataset: xr.Dataset) -> None:
    """Refuse a Dataset in which a variable lacks its unit or long name, or that netCDF cannot store."""
    _check_attributes("the Dataset", dataset.attrs)
    for name, variable in dataset.variables.items():
        _check_attributes(f"variable {name}", variable.attrs)
        _check(str(name), variable.attrs.get("units"), variable.attrs.get("long_name"))
    for dim in dataset.dims:
        if dim not in dataset.coords:
            raise DataError(f"dimension {dim} has no coordinate: its unit is unknown")


def to_jsonable(obj: Any) -> Any:
    """Turn results into what `json.dumps(..., allow_nan=False)` takes: NaN and infinities become None."""
    if isinstance(obj, Enum):
        return to_jsonable(obj.value)
    if obj is None or isinstance(obj, bool | str | int):
        return obj
    if isinstance(obj, float):
        return float(obj) if math.isfinite(obj) else None
    if isinstance(obj, np.generic | np.ndarray):
        return to_jsonable(obj.tolist())
    if isinstance(obj, PurePath):
        return obj.as_posix()
    if isinstance(obj, Mapping):
        variables = getattr(obj, "variables", obj)
        return {str(name): to_jsonable(value) for name, value in variables.items()}
    if isinstance(obj, Sequence) and not isinstance(obj, bytes | bytearray):
        return [to_jsonable(item) for item in obj]
    if isinstance(obj, set | frozenset):
        return [to_jsonable(item) for item in sorted(obj)]
    if hasattr(obj, "to_numpy"):
        return to_jsonable(obj.to_numpy())
    raise TypeError(f"{type(obj).__name__} has no JSON form")


def _entry(name: str, entry: Sequence[Any]) -> tuple[tuple[str, ...], ArrayLike, Label]:
    if isinstance(entry, str) or len(entry) not in (2, 4):
        raise DataError(f"variable {name}: give (dims, values) or (dims, values, units, long_name)")
    dims = (entry[0],) if isinstance(entry[0], str) else tuple(entry[0])
    label = Label(entry[2], entry[3]) if len(entry) == 4 else VARIABLES.get(name, Label("", ""))
    _check(name, label.units, label.long_name)
    return dims, entry[1], label


def _check(name: str, units: object, long_name: object) -> None:
    if not isinstance(units, str) or not units.strip():
        raise DataError(f"variable {name} has no units: give them ('-' if dimensionless)")
    if not isinstance(long_name, str) or not long_name.strip():
        raise DataError(f"variable {name} has no long_name: name it for axis labels")
    usual = VARIABLES.get(name)
    try:
        written = attribute_units(units)
    except ValueError as error:
        raise DataError(f"variable {name} has units {error}") from None
    if usual is not None and not usual.units.startswith("unit of ") and attribute_units(usual.units) != written:
        raise DataError(f"variable {name} has units {units!r}: this name is reserved for {usual.units!r}")


def _check_attributes(owner: str, attrs: Mapping[Any, Any]) -> None:
    """Refuse an attribute that no netCDF file can hold; found when the file is written, the run would be lost."""
    for name, value in attrs.items():
        if not isinstance(name, str) or not name:
            raise DataError(f"attribute {name!r} of {owner}: its name must be text")
        if isinstance(value, str) or _is_number(value):
            continue
        if isinstance(value, Sequence | np.ndarray) and not isinstance(value, bytes):
            items = list(value) if np.ndim(np.asarray(value, dtype=object)) == 1 else []
            if items and all(_is_number(item) for item in items):
                continue
        remedy = "join the lines to one text" if isinstance(value, Sequence) else "give text, or 0 or 1 for a bool"
        raise DataError(
            f"attribute {name} of {owner} = {value!r}: netCDF stores text, numbers and flat, non-empty sequences of "
            f"numbers; {remedy}"
        )


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)
