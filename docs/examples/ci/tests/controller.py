"""The device under test: a proportional controller."""

PLACE_M, GAIN_PER_M = 0.3, 20.0


def controller(sensors):
    """From the position of the drive, m, to the opening of its valve, -1 to 1."""
    return max(-1.0, min(1.0, GAIN_PER_M * (PLACE_M - sensors.position)))
