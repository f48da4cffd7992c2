"""A controller of one's own: from the sensors of the drive (position in m) to the opening of its valve, -1 to 1."""


def controller(sensors):
    """Proportional to the distance from 0.3 m."""
    return max(-1.0, min(1.0, 8.0 * (0.3 - sensors.position)))
