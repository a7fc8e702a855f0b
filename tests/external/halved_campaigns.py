"""Campaigns of links and of robots with something hidden, for tests that divide them. Nothing of the program's catalogue computes them."""

import csv
import math
import random

LINKS = ["time_s", "tx", "rx", "channel", "tx_x_m", "tx_y_m", "tx_z_m", "rx_x_m", "rx_y_m", "rx_z_m", "rssi_dbm", "received", "temperature_c"]
ROBOTS = ["time_s", "run", "agent", "x_m", "y_m", "heading_rad", "cmd_speed_mps", "cmd_yaw_rate_radps"]
LINK_MODEL = '[netsim.phy]\npropagation = "friis"\ntx_power_dbm = 0.0\n'
ROBOT_MODEL = '[robotsim.dynamics]\nkind = "unicycle"\n'

# Delivery at -97 to -79 dBm: the table that the 6TiSCH simulator measured, which is the model's default.
DELIVERY = [0, 0.1494, 0.2340, 0.4071, 0.6359, 0.6866, 0.7476, 0.8603, 0.8702, 0.9324, 0.9427, 0.9562, 0.9611, 0.9739, 0.9745, 0.9844, 0.9854,
            0.9903, 1]
N_NODES = 16
N_RUNS = 8


def delivery(dbm):
    """The probability that a frame at this level is received."""
    place = min(max(dbm + 97.0, 0.0), 18.0)
    below = min(int(place), 17)
    return DELIVERY[below] + (DELIVERY[below + 1] - DELIVERY[below]) * (place - below)


def links(seed, exponent=2.0, gain_db=0.0, offset_db=0.0, db_per_c=0.0, n_rows=2400):
    """Frames between nodes at random places, over three hours in which the temperature rises and falls. `offset_db`: standard deviation of the
    levels that senders and receivers have."""
    draws = random.Random(seed)
    places = [(draws.uniform(0, 60), draws.uniform(0, 40), draws.uniform(1, 2)) for _ in range(N_NODES)]
    sends, hears = ([draws.gauss(0, offset_db) for _ in range(N_NODES)] for _ in range(2))
    rows = []
    for k in range(n_rows):
        time_s = 10800 * k / n_rows
        celsius = 22 + 8 * math.sin(time_s / 900) + draws.gauss(0, 0.3)
        tx, rx = draws.sample(range(N_NODES), 2)
        channel = draws.randint(11, 26)
        distance_m = math.dist(places[tx], places[rx])
        free_db = 20 * math.log10(4 * math.pi * (2405 + 5 * (channel - 11)) * 1e6 / 299792458)
        dbm = -free_db - 10 * exponent * math.log10(distance_m) + gain_db + sends[tx] + hears[rx]
        dbm += db_per_c * (celsius - 22) + draws.gauss(0, 2)
        received = draws.random() < delivery(dbm)
        ends = [f"{value:.3f}" for node in (tx, rx) for value in places[node]]
        rows.append([f"{time_s:.2f}", tx, rx, channel, *ends, round(dbm) if received else "", int(received), f"{celsius:.2f}"])
    return LINK_MODEL, [LINKS, *rows]


def robots(seed, speed=1.0, lag_s=0.0, turn=1.0, n_steps=100):
    """Robots that drive alone, a run each, from rest at a random place, in steps of 0.2 s. `speed`, `turn`: what is executed of a command; `lag_s`: with which delay of
    first order speed follows it."""
    draws = random.Random(seed)
    step_s, parts = 0.2, 10
    rows = []
    for run in range(N_RUNS):
        x, y, heading, v = draws.uniform(0, 20), draws.uniform(0, 20), draws.uniform(-3, 3), 0.0
        for k in range(n_steps):
            if k % 8 == 0:
                ahead, around = draws.uniform(0.2, 1.2), draws.uniform(-0.8, 0.8)
            measured = [x + draws.gauss(0, 0.01), y + draws.gauss(0, 0.01), math.remainder(heading + draws.gauss(0, 0.005), math.tau)]
            rows.append([f"{k * step_s:.2f}", run, 0, *(f"{value:.4f}" for value in measured), f"{ahead:.3f}", f"{around:.3f}"])
            for _ in range(parts):
                part_s = step_s / parts
                before, v = v, v + (speed * ahead - v) * (1 - math.exp(-part_s / lag_s) if lag_s else 1)
                way_m = part_s * ((before + v) / 2 if lag_s else v)
                # The heading half way: that at the start would be a yaw coupling of half a part.
                middle = heading + part_s * turn * around / 2
                x, y = x + way_m * math.cos(middle), y + way_m * math.sin(middle)
                heading += part_s * turn * around
    return ROBOT_MODEL, [ROBOTS, *rows]


CAMPAIGNS = {
    "links: nothing": lambda: links(1),
    "links: exponent and levels of nodes": lambda: links(2, exponent=2.5, offset_db=1.5),
    "links: gain and temperature": lambda: links(3, gain_db=-4.0, db_per_c=-0.3),
    "robots: speed and turns": lambda: robots(4, speed=0.9, turn=0.95),
    "robots: lag": lambda: robots(5, lag_s=0.3),
}


def half(table, seed):
    """The rows between half of the nodes, or those of half of the runs."""
    head, *rows = table
    is_of_links = "tx" in head
    kept = set(random.Random(seed).sample(range(N_NODES if is_of_links else N_RUNS), (N_NODES if is_of_links else N_RUNS) // 2))
    groups = [head.index(name) for name in (["tx", "rx"] if is_of_links else ["run"])]
    return [head, *(row for row in rows if all(row[group] in kept for group in groups))]


def write(path, table):
    """Writes a table as CSV."""
    with open(path, "w", newline="") as file:
        csv.writer(file).writerows(table)
