"""CAN through python-can and cantools: nothing else in mgdd imports them, and this only inside its functions."""

from __future__ import annotations
