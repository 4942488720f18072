"""The fixtures of all tests."""

from fixtures import _figures_are_closed, _signals_are_left_as_found, no_thread_is_left, quick_study, root

__all__ = ["_figures_are_closed", "_signals_are_left_as_found", "no_thread_is_left", "quick_study", "root"]
