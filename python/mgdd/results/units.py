"""Units by name: a physical name ends in its unit, as ``tau_s``, ``bore_mm`` or ``spring_above_nm_per_rad`` do."""

from __future__ import annotations

__all__ = ["unit_of"]

_UNITS = {
    "_deg_per_s2_per_duty": "deg/s² per duty",
    "_duty_per_deg": "duty/deg",
    "_per_deg2": "1/deg²",
    "_per_deg": "1/deg",
    "_deg_per_duty": "deg/duty",
    "_nms_per_rad": "N m s/rad",
    "_nm_per_rad": "N m/rad",
    "_nm_per_a": "N m/A",
    "_vs_per_rad": "V s/rad",
    "_deg_per_s": "deg/s",
    "_rad_per_s": "rad/s",
    "_ns_per_m": "N s/m",
    "_n_per_m": "N/m",
    "_n_per_v": "N/V",
    "_n_per_s": "N/s",
    "_m_per_s": "m/s",
    "_bar_per_cad": "bar/°CA",
    "_percent_per_cad2": "%/°CA²",
    "_percent_per_cad": "%/°CA",
    "_percent_per_ppm": "%/ppm",
    "_mj_per_kg": "MJ/kg",
    "_per_ppm": "1/ppm",
    "_per_cad2": "1/°CA²",
    "_per_cad": "1/°CA",
    "_per_s": "1/s",
    "_per_k": "1/K",
    "_kgm2": "kg m²",
    "_samples": "samples",
    "_cycles": "cycles",
    "_percent": "%",
    "_duration_cad": "°CA",
    "_scatter_cad": "°CA",
    "_rms_cad": "°CA",
    "_cad": "°CA aTDC",
    "_mean_j": "unit of J",
    "_deg2": "deg²",
    "_deg": "deg",
    "_rad": "rad",
    "_duty": "-",
    "_ohm": "ohm",
    "_rpm": "rpm",
    "_bar": "bar",
    "_kpa": "kPa",
    "_pa": "Pa",
    "_ppm": "ppm",
    "_hz": "Hz",
    "_mm": "mm",
    "_nm": "N m",
    "_mh": "mH",
    "_ms": "ms",
    "_mg": "mg",
    "_us": "µs",
    "_kg": "kg",
    "_m": "m",
    "_g": "g",
    "_l": "L",
    "_h": "H",
    "_n": "N",
    "_v": "V",
    "_a": "A",
    "_j": "J",
    "_k": "K",
    "_s": "s",
}
_LONGEST_FIRST = sorted(_UNITS, key=len, reverse=True)


def unit_of(name: str) -> str:
    """Read the unit off the end of a name.

    Parameters
    ----------
    name : str
        Name of a parameter or result.

    Returns
    -------
    str
        Its unit, ``"-"`` if the name ends in none.

    Examples
    --------
    >>> from mgdd.results.units import unit_of
    >>> unit_of("spring_above_nm_per_rad"), unit_of("compression_ratio")
    ('N m/rad', '-')
    """
    whole = f"_{name}"
    return next((_UNITS[ending] for ending in _LONGEST_FIRST if whole.endswith(ending)), "-")
