"""Numbers that `mgdd.loop.tune_controller` found for each kind of controller and each preset.

Protocol: 20 throttles within 20% of the preset (P1 with stiction of 0.3 N m), a budget of
400 runs of the whole set for every kind, seed 7, noise of 0.03 deg, a delay of one sample; the
controller knows the preset only.
Written by ``tools/tune_controllers.py``.
"""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["TUNED_SETS"]

TUNED_SETS: Mapping[str, Mapping[str, Mapping[str, float]]] = {
    "guided": {
        "P1": {
            "first_move": 2.182,
            "second_move": 7.709,
            "duty_change_weight": 0.361,
            "speed_weight": 8.415e-06,
            "observer_angle_per_s": 424.6,
            "observer_speed_per_s2": 49370.0,
            "learning_rate_per_s": 148.4,
            "gain_weight": 13.54,
            "damping_weight": 55.97,
        },
        "P2": {
            "first_move": 2.421,
            "second_move": 7.841,
            "duty_change_weight": 0.5695,
            "speed_weight": 3.901e-06,
            "observer_angle_per_s": 470.9,
            "observer_speed_per_s2": 44460.0,
            "learning_rate_per_s": 138.3,
            "gain_weight": 38.79,
            "damping_weight": 139.5,
        },
        "P3": {
            "first_move": 2.371,
            "second_move": 6.477,
            "duty_change_weight": 0.4477,
            "speed_weight": 7.698e-06,
            "observer_angle_per_s": 367.9,
            "observer_speed_per_s2": 34090.0,
            "learning_rate_per_s": 126.6,
            "gain_weight": 6.816,
            "damping_weight": 59.22,
        },
    },
    "mgdd1": {
        "P1": {
            "horizon_samples": 7.983,
            "adaptation_gain": 0.737,
            "duty_change_weight": 1.748,
            "trim_rate_per_deg_s": 0.5564,
        },
        "P2": {
            "horizon_samples": 8.135,
            "adaptation_gain": 0.8831,
            "duty_change_weight": 1.068,
            "trim_rate_per_deg_s": 0.6097,
        },
        "P3": {
            "horizon_samples": 11.22,
            "adaptation_gain": 0.9743,
            "duty_change_weight": 5.449,
            "trim_rate_per_deg_s": 0.423,
        },
    },
    "pid": {
        "P1": {
            "proportional": 16.49,
            "integral_per_s": 54.55,
            "derivative_s": 0.1413,
            "kick": 1.117,
            "kick_width_deg": 0.161,
            "integral_window_deg": 3.607,
            "dead_band_deg": 0.1082,
            "rate": 0.8685,
            "friction": 1.102,
        },
        "P2": {
            "proportional": 9.788,
            "integral_per_s": 62.97,
            "derivative_s": 0.1053,
            "kick": 1.402,
            "kick_width_deg": 0.08017,
            "integral_window_deg": 7.016,
            "dead_band_deg": 0.02431,
            "rate": 0.972,
            "friction": 1.415,
        },
        "P3": {
            "proportional": 25.94,
            "integral_per_s": 298.1,
            "derivative_s": 0.2134,
            "kick": 1.247,
            "kick_width_deg": 0.2279,
            "integral_window_deg": 0.4733,
            "dead_band_deg": 0.05345,
            "rate": 1.236,
            "friction": 1.5,
        },
    },
    "sliding_mode": {
        "P1": {
            "switching": 0.1932,
            "layer_deg": 0.5564,
            "integral_per_s": 39.11,
            "bandwidth_per_s": 153.7,
            "reference_pole_per_s": 268.0,
            "friction": 0.7661,
            "integral_layers": 0.9212,
        },
        "P2": {
            "switching": 0.1331,
            "layer_deg": 0.8033,
            "integral_per_s": 40.0,
            "bandwidth_per_s": 153.6,
            "reference_pole_per_s": 290.7,
            "friction": 1.195,
            "integral_layers": 0.6945,
        },
        "P3": {
            "switching": 0.147,
            "layer_deg": 1.115,
            "integral_per_s": 40.0,
            "bandwidth_per_s": 132.0,
            "reference_pole_per_s": 295.5,
            "friction": 1.219,
            "integral_layers": 0.5049,
        },
    },
    "linear_mpc": {
        "P1": {
            "first_move": 2.418,
            "second_move": 3.649,
            "duty_change_weight": 1.067,
            "speed_weight": 2.309e-05,
            "observer_angle_per_s": 230.7,
            "observer_speed_per_s2": 65800.0,
            "bias_rate_per_deg_s": 38.91,
            "trim_rate_per_deg_s": 0.4909,
        },
        "P2": {
            "first_move": 1.271,
            "second_move": 8.61,
            "duty_change_weight": 1.083,
            "speed_weight": 4.173e-07,
            "observer_angle_per_s": 577.8,
            "observer_speed_per_s2": 60880.0,
            "bias_rate_per_deg_s": 16.87,
            "trim_rate_per_deg_s": 0.06144,
        },
        "P3": {
            "first_move": 1.378,
            "second_move": 3.097,
            "duty_change_weight": 0.4324,
            "speed_weight": 1.368e-05,
            "observer_angle_per_s": 219.6,
            "observer_speed_per_s2": 65470.0,
            "bias_rate_per_deg_s": 1.014,
            "trim_rate_per_deg_s": 0.1232,
        },
    },
    "nmpc": {
        "P1": {
            "first_move": 1.808,
            "second_move": 3.384,
            "duty_change_weight": 0.3038,
            "speed_weight": 1.148e-06,
            "observer_angle_per_s": 421.7,
            "observer_speed_per_s2": 64800.0,
            "bias_rate_per_deg_s": 4.803,
            "trim_rate_per_deg_s": 0.484,
        },
        "P2": {
            "first_move": 1.034,
            "second_move": 7.202,
            "duty_change_weight": 0.3971,
            "speed_weight": 4.681e-06,
            "observer_angle_per_s": 481.3,
            "observer_speed_per_s2": 32950.0,
            "bias_rate_per_deg_s": 4.651,
            "trim_rate_per_deg_s": 0.09889,
        },
        "P3": {
            "first_move": 1.189,
            "second_move": 3.497,
            "duty_change_weight": 0.3472,
            "speed_weight": 1.54e-05,
            "observer_angle_per_s": 245.3,
            "observer_speed_per_s2": 63270.0,
            "bias_rate_per_deg_s": 4.15,
            "trim_rate_per_deg_s": 0.1914,
        },
    },
}
