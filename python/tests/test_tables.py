"""Tables of runs and sweeps: polars, pandas, lazy; and their pictures."""

import sys

import numpy as np
import pytest

import murmuration

CONFIG = {
    "experiment": {"name": "small", "seed": 1, "duration_s": 2.0, "agents": 5, "control_period": {"rate_hz": 10.0}},
    "robotsim": {"scenario": {"kind": "line"}, "controller": {"kind": "flocking", "flock_radius_m": 10.0}},
    "netsim": {"phy": {"propagation": "unit-disk", "radius_m": 20.0}},
    "output": {"report": False},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("tables")


@pytest.fixture(scope="module")
def run(folder):
    return murmuration.run(CONFIG, out=folder)


@pytest.fixture(scope="module")
def sweep(folder):
    return murmuration.sweep({**CONFIG, "sweep": {"seeds": 2, "vary": {"netsim.phy.radius_m": [1.0, 5.0, 20.0]}}}, out=folder / "sweeps")


@pytest.fixture(autouse=True)
def without_a_screen(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")


def test_tables_are_of_pandas_where_there_is_no_polars(run, monkeypatch):
    import pandas

    tables = {name: getattr(run, name) for name in ("steps", "links", "motes")}
    monkeypatch.setitem(sys.modules, "polars", None)
    again = murmuration.Run(run.folder)
    for name, wanted in tables.items():
        table = getattr(again, name)
        assert isinstance(table, pandas.DataFrame) and list(table.columns) == wanted.columns
    assert np.array_equal(again.steps["x_m"].to_numpy(), run.steps["x_m"].to_numpy())
    with pytest.raises(ImportError, match="lazy tables need polars"):
        again.scan("steps")
    assert len(again.plot().lines) == 5
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="tables need polars or pandas: pip install polars"):
        murmuration.Run(run.folder).steps


def test_lazy_tables_give_what_whole_ones_give(run, sweep):
    import polars

    lazy = run.scan("steps")
    assert isinstance(lazy, polars.LazyFrame)
    one = lazy.filter(polars.col("agent") == 3).select("time_ns", "x_m").collect()
    assert one.equals(run.steps.filter(polars.col("agent") == 3).select("time_ns", "x_m")) and len(one) > 10
    assert sweep.scan().select(polars.len()).collect().item() == 6
    with pytest.raises(FileNotFoundError, match=r"step\.parquet is not there.*This one left: links, motes, steps"):
        run.scan("step")


def test_the_ways_of_robots_are_drawn(run):
    axes = run.plot()
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("east (m)", "north (m)")
    way, start, end, way_of_leader, end_of_leader = axes.lines
    own = [run.steps.filter(run.steps["agent"] == agent).select("x_m", "y_m").to_numpy() for agent in range(5)]
    # A gap stands behind each way. Robot 0 leads.
    for line, ways in [(way, own[1:]), (way_of_leader, own[:1])]:
        drawn = line.get_xydata()
        assert np.array_equal(drawn[~np.isnan(drawn[:, 1])], np.concatenate(ways))
    assert np.array_equal(start.get_xydata(), [way[0] for way in own])
    assert np.array_equal(np.concatenate([end_of_leader.get_xydata(), end.get_xydata()]), [way[-1] for way in own])
    from matplotlib import pyplot

    own_axes = pyplot.figure().add_subplot()
    assert run.plot(axes=own_axes) is own_axes


def test_who_heard_whom_is_drawn_from_the_links(run):
    axes = run.plot_links(from_s=1.0, until_s=2.0, width="column")
    heard = run.links.filter(run.links["received"] & (run.links["time_ns"] >= 1_000_000_000))
    pairs = set(heard.select("sender", "receiver").iter_rows())
    (arrows,) = [child.arrows for child in axes.get_children() if type(child).__name__ == "Arrows"]
    assert len(arrows) == len(pairs) > 0
    assert abs(axes.figure.get_size_inches()[0] - 88 / 25.4) < 1e-9
    with pytest.raises(murmuration.InvalidInput, match="needs a network with routes, and this run has none"):
        run.plot_network()
    with pytest.raises(murmuration.InvalidInput, match=r"is no kind of figure(?s:.*)trajectories"):
        run.plot("pie")
    with pytest.raises(ValueError, match='"column", "page", or a number of millimetres from 40 to 400, got 3'):
        run.plot(width=3)


def test_a_figure_of_a_sweep_is_drawn_over_a_setting(sweep, monkeypatch):
    figure = "network.delivery_ratio"
    axes = sweep.plot("netsim.phy.radius_m", figure)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("phy radius (m)", "delivery ratio")
    dots, medians = axes.lines[:2]
    assert len(dots.get_xdata()) == 6 and medians.get_xdata().tolist() == [1.0, 5.0, 20.0]
    for setting, (radius_m, median) in zip(sweep.summary["settings"], medians.get_xydata(), strict=True):
        assert setting["values"]["netsim.phy.radius_m"] == radius_m
        # The number of the report and of the terminal.
        assert setting["metrics"][figure]["median"] == median
    # Two trials have their range as interval.
    (ranges,) = axes.collections
    ends = [(low, high) for (_, low), (_, high) in ranges.get_segments()]
    spreads = [setting["metrics"][figure] for setting in sweep.summary["settings"]]
    assert np.allclose(ends, [(spread["min"], spread["max"]) for spread in spreads])
    grouped = sweep.plot("experiment.seed", figure, by="netsim.phy.radius_m")
    assert [text.get_text() for text in grouped.figure.legends[0].get_texts()] == ["1.0", "5.0", "20.0"] and len(grouped.lines) == 3
    assert sweep.plot("radius_m", figure).get_xlabel() == "phy radius (m)"
    with pytest.raises(ValueError, match="nor a column of the trials; the nearest is netsim.phy.radius_m"):
        sweep.plot("netsim.phy.radius", figure)
    # The short name of the same metric; of several metrics each has a panel.
    short, _ = sweep.plot("netsim.phy.radius_m", ["broadcast_pdr", "flock_speed"], width="page")
    assert short.get_ylabel() == "delivery ratio"
    assert np.array_equal(short.lines[1].get_xydata(), medians.get_xydata())
    monkeypatch.setitem(sys.modules, "polars", None)
    again = murmuration.Sweep(sweep.folder)
    assert np.array_equal(again.plot("netsim.phy.radius_m", figure).lines[1].get_xydata(), medians.get_xydata())


def test_a_file_that_was_changed_after_the_run_is_not_read(run, sweep, tmp_path):
    import shutil

    for folder, name, read in (
        (run.folder, "steps.parquet", lambda found: (found.steps, found.scan("steps"))),
        (run.folder, "summary.json", lambda found: found.summary),
        (sweep.folder, "trials.parquet", lambda found: found.trials),
    ):
        copy = tmp_path / name
        shutil.copytree(folder, copy)
        kind = murmuration.Sweep if name == "trials.parquet" else murmuration.Run
        content = bytearray((copy / name).read_bytes())
        content[len(content) // 3] ^= 1
        (copy / name).write_bytes(content)
        with pytest.raises(murmuration.MurmurationError, match=f"{name}: its content is not what was written"):
            read(kind(copy))
        if name == "summary.json":
            continue
        (copy / name).write_bytes((folder / name).read_bytes())
        (copy / "provenance.json").unlink()
        with pytest.raises(murmuration.MurmurationError, match="lists no files"):
            read(kind(copy))
        assert len(read(kind(copy, unverified=True))) > 0


def test_a_metric_has_a_short_name_and_a_path(run):
    assert run.metric("flock_speed") == run.metric("task.flock_speed_mps") == run.summary["task"]["flock_speed_mps"] > 0
    assert run.metric("completed") is False
    # This network has no protocols.
    assert run.summary["kpis"] is None and run.metric("pdr") is None
    with pytest.raises(murmuration.InvalidInput, match="did you mean flock_speed"):
        run.metric("flok_speed")
    (pdr,) = murmuration.metrics("pdr")["metrics"]
    assert (pdr["path"], pdr["unit"], pdr["better"]) == ("kpis.since_start.delivered_of_expected.ratio", "0 to 1", "higher")
    every = {metric["path"]: metric["name"] for metric in murmuration.metrics()["metrics"]}
    assert every[pdr["path"]] == "pdr" and every["steps"] is None and "kpis.packets.*.delivered" in every


def test_a_sweep_has_the_columns_that_its_metrics_name(tmp_path):
    config = {**CONFIG, "sweep": {"seeds": 2, "metrics": ["flock_speed", "task.mean_speed_mps"]}}
    sweep = murmuration.sweep(config, out=tmp_path)
    assert {"flock_speed", "task.mean_speed_mps"} < set(sweep.trials.columns)
    assert not {"task.flock_speed_mps", "speed"} & set(sweep.trials.columns)
    by_path = sweep.plot("experiment.seed", "task.flock_speed_mps").lines[0].get_xydata()
    assert by_path[:, 1].tolist() == sweep.trials["flock_speed"].to_list()
    with pytest.raises(murmuration.InvalidInput, match=r'sweep\.metrics\[0\].*nearest valid: "flock_speed"'):
        murmuration.sweep({**config, "sweep": {"seeds": 2, "metrics": ["flok_speed"]}}, out=tmp_path)
