"""Tables of measured links for tests, made without the product: free space, a curve of reception, and noise."""

import math

HEADER = "time_s,tx,rx,channel,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,rssi_dbm,received"


def free_space_dbm(power_dbm, a, b):
    """Received signal strength at 2.4 GHz."""
    return power_dbm - 40.2 - 20 * math.log10(max(1.0, math.dist(a, b)))


def is_received(draw, rssi):
    """Whether a frame of this strength is received: half of them are at -91 dBm."""
    return draw.random() < 1 / (1 + math.exp(-(rssi + 91)))


def line(row, time_s, motes, places, rssi, received, covariate):
    """A row of the table, which a covariate ends."""
    (tx, rx), (a, b) = motes, places
    return (
        f"{time_s},{tx},{rx},{11 + row % 16},{a[0]:.2f},{a[1]:.2f},1.2,{b[0]:.2f},{b[1]:.2f},1.2,"
        f"{round(rssi) if received else ''},{int(received)},{covariate}"
    )
