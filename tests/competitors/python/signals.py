"""Smoothing and differentiation with one zero-phase kernel for data and model alike (Savitzky-Golay)."""

import numpy as np
from scipy.signal import lfilter, savgol_coeffs, savgol_filter

PERIOD_S = 1e-3
# 21 ms for the first derivative, 31 ms for the second: an acceleration of 20 um of noise is then known to 0.1 m/s2.
FIRST, SECOND, ORDER = 21, 31, 3


def smooth(y):
    return savgol_filter(y, FIRST, ORDER)


def slope(y):
    return savgol_filter(y, FIRST, ORDER, deriv=1, delta=PERIOD_S)


def curvature(y):
    return savgol_filter(y, SECOND, ORDER, deriv=2, delta=PERIOD_S)


# A Savitzky-Golay derivative is the plain difference of neighbours, smoothed by a kernel that follows from it: RATE smooths what
# acts over a period just as `slope` smooths its effect, FORCE what accelerates as `curvature` does. Data and model pass the same.
RATE = np.cumsum(savgol_coeffs(FIRST, ORDER, deriv=1))[:-1]
FORCE = np.cumsum(np.cumsum(savgol_coeffs(SECOND, ORDER, deriv=2)))[:-2]


def filtered(y, kernel):
    return np.convolve(y, kernel, "same")


def slow_slope(y):
    """Slope over 41 ms, for telling rest from motion: 20 um of noise leave 0.3 mm/s."""
    return savgol_filter(y, 41, 1, deriv=1, delta=PERIOD_S)


def noise_of_slope(noise):
    return noise * np.linalg.norm(savgol_coeffs(FIRST, ORDER, deriv=1, delta=PERIOD_S))


def noise_of_curvature(noise):
    return noise * np.linalg.norm(savgol_coeffs(SECOND, ORDER, deriv=2, delta=PERIOD_S))


def noise_of_force(noise):
    return noise * np.linalg.norm(FORCE)


def noise_of_velocity(noise):
    """Of a velocity that passes the kernel of forces."""
    return noise * np.linalg.norm(np.diff(FORCE)) / PERIOD_S


def lag(y, time_constant_s, period_s=PERIOD_S):
    """First-order lag of a signal that is held over each period, exact at the periods' ends."""
    if time_constant_s <= 0.0:
        return y
    keep = np.exp(-period_s / time_constant_s)
    return lfilter([1.0 - keep], [1.0, -keep], y, zi=[keep * y[0]])[0]


def lag_mean(y, time_constant_s, period_s=PERIOD_S):
    """Mean of the lagged signal over each period."""
    if time_constant_s <= 0.0:
        return y
    ends = lag(y, time_constant_s, period_s)
    begins = np.concatenate([ends[:1], ends[:-1]])
    return y + (begins - y) * (time_constant_s / period_s) * (1.0 - np.exp(-period_s / time_constant_s))


def delayed(y, delay_s):
    """The signal of a fixed time before, linear between samples."""
    at = np.arange(len(y))
    return np.interp(at - delay_s / PERIOD_S, at, y)
