"""Protection of a payload by alive counter and CRC."""

from __future__ import annotations

from mgdd._core import rig as core

__all__ = ["protect"]


def protect(settings: core.E2eSettings, counter: int, payload: bytes | bytearray | memoryview) -> bytes:
    """Write alive counter and CRC into a payload.

    Parameters
    ----------
    settings : E2eSettings
        Places, CRC and data identifier.
    counter : int
        Alive counter of this frame, 0 to ``counter_modulus - 1``; ``settings.next_counter`` gives the one that follows.
    payload : bytes
        ``settings.size`` bytes; what stands in the places of CRC and counter is replaced.

    Returns
    -------
    bytes
        The protected payload.

    Raises
    ------
    mgdd.errors.ParameterError
        A counter outside of the modulus.
    mgdd.errors.ShapeError
        A payload of another length.

    Examples
    --------
    >>> from mgdd.rig import E2eSettings, protect
    >>> protect(E2eSettings(data_id=0x120), 5, bytes.fromhex("0000112233445566")).hex()
    '3a05112233445566'
    """
    return core.protect(settings, counter, payload)
