"""Numbers that `mgdd.loop.tune_controller` found for each kind of controller and each preset.

Protocol: 20 throttles within 20% of the preset (P1 with stiction of 0.3 N m), 2 rounds of
400 runs of the whole set for every kind, each from the best of the one before, seed 7, noise of
0.03 deg, samples of 1 ms and a delay of one; the controller knows the preset only.
Written by ``tools/tune_controllers.py``.
"""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["TUNED_SETS"]

TUNED_SETS: Mapping[str, Mapping[str, Mapping[str, float]]] = {
    "guided": {
        "P1": {
            "first_move": 2.344,
            "second_move": 9.102,
            "duty_change_weight": 0.3629,
            "speed_weight": 2.481e-06,
            "observer_angle_per_s": 460.6,
            "observer_speed_per_s2": 62394.0,
            "learning_rate_per_s": 146.1,
            "gain_weight": 11.55,
            "damping_weight": 37.89,
        },
        "P2": {
            "first_move": 2.398,
            "second_move": 7.774,
            "duty_change_weight": 1.689,
            "speed_weight": 5.495e-06,
            "observer_angle_per_s": 458.6,
            "observer_speed_per_s2": 68360.8,
            "learning_rate_per_s": 146.8,
            "gain_weight": 32.17,
            "damping_weight": 57.94,
        },
        "P3": {
            "first_move": 2.105,
            "second_move": 7.48,
            "duty_change_weight": 0.5969,
            "speed_weight": 2.844e-06,
            "observer_angle_per_s": 349.2,
            "observer_speed_per_s2": 45416.5,
            "learning_rate_per_s": 132.4,
            "gain_weight": 10.41,
            "damping_weight": 33.81,
        },
    },
    "mgdd1": {
        "P1": {
            "horizon_s": 0.007932,
            "adaptation_gain": 0.7661,
            "duty_change_weight": 1.787,
            "trim_rate_per_deg_s": 0.6509,
        },
        "P2": {
            "horizon_s": 0.007558,
            "adaptation_gain": 0.8944,
            "duty_change_weight": 1.166,
            "trim_rate_per_deg_s": 0.3647,
        },
        "P3": {
            "horizon_s": 0.01122,
            "adaptation_gain": 0.9829,
            "duty_change_weight": 5.661,
            "trim_rate_per_deg_s": 0.4259,
        },
    },
    "pid": {
        "P1": {
            "proportional": 16.35,
            "integral_per_s": 83.3,
            "derivative_s": 0.142,
            "kick": 1.094,
            "kick_width_deg": 0.2315,
            "integral_window_deg": 3.625,
            "dead_band_deg": 0.1052,
            "rate": 0.9228,
            "friction": 1.09,
        },
        "P2": {
            "proportional": 10.45,
            "integral_per_s": 62.12,
            "derivative_s": 0.1099,
            "kick": 1.232,
            "kick_width_deg": 0.08185,
            "integral_window_deg": 6.473,
            "dead_band_deg": 0.01983,
            "rate": 1.112,
            "friction": 1.451,
        },
        "P3": {
            "proportional": 25.36,
            "integral_per_s": 299.2,
            "derivative_s": 0.2128,
            "kick": 1.241,
            "kick_width_deg": 0.1543,
            "integral_window_deg": 0.4812,
            "dead_band_deg": 0.06039,
            "rate": 1.221,
            "friction": 1.481,
        },
    },
    "sliding_mode": {
        "P1": {
            "switching": 0.1914,
            "layer_deg": 0.5728,
            "integral_per_s": 39.18,
            "bandwidth_per_s": 154.8,
            "reference_pole_per_s": 269.2,
            "friction": 0.7648,
            "integral_layers": 0.935,
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
            "switching": 0.1523,
            "layer_deg": 1.072,
            "integral_per_s": 40.0,
            "bandwidth_per_s": 131.1,
            "reference_pole_per_s": 295.8,
            "friction": 1.148,
            "integral_layers": 0.4871,
        },
    },
    "linear_mpc": {
        "P1": {
            "first_move": 2.068,
            "second_move": 3.05,
            "duty_change_weight": 0.8499,
            "speed_weight": 3.882e-05,
            "observer_angle_per_s": 210.3,
            "observer_speed_per_s2": 78125.2,
            "bias_rate_per_deg_s": 35.7,
            "trim_rate_per_deg_s": 0.6166,
        },
        "P2": {
            "first_move": 1.271,
            "second_move": 8.61,
            "duty_change_weight": 1.083,
            "speed_weight": 4.173e-07,
            "observer_angle_per_s": 577.8,
            "observer_speed_per_s2": 80690.8,
            "bias_rate_per_deg_s": 16.87,
            "trim_rate_per_deg_s": 0.06144,
        },
        "P3": {
            "first_move": 1.415,
            "second_move": 3.118,
            "duty_change_weight": 0.3655,
            "speed_weight": 1.675e-05,
            "observer_angle_per_s": 200.1,
            "observer_speed_per_s2": 67742.9,
            "bias_rate_per_deg_s": 1.877,
            "trim_rate_per_deg_s": 0.221,
        },
    },
    "nmpc": {
        "P1": {
            "first_move": 1.682,
            "second_move": 3.27,
            "duty_change_weight": 0.3011,
            "speed_weight": 1.367e-06,
            "observer_angle_per_s": 402.7,
            "observer_speed_per_s2": 79955.3,
            "bias_rate_per_deg_s": 5.549,
            "trim_rate_per_deg_s": 0.3971,
        },
        "P2": {
            "first_move": 1.166,
            "second_move": 5.115,
            "duty_change_weight": 0.4274,
            "speed_weight": 1.653e-05,
            "observer_angle_per_s": 396.4,
            "observer_speed_per_s2": 52250.1,
            "bias_rate_per_deg_s": 8.215,
            "trim_rate_per_deg_s": 0.06961,
        },
        "P3": {
            "first_move": 1.173,
            "second_move": 3.253,
            "duty_change_weight": 0.4165,
            "speed_weight": 2.255e-05,
            "observer_angle_per_s": 225.3,
            "observer_speed_per_s2": 70937.6,
            "bias_rate_per_deg_s": 22.44,
            "trim_rate_per_deg_s": 0.2852,
        },
    },
}
