"""Figures that the package draws: whether all of them can be read, and saved for a publisher."""

import re
import zlib

import pytest

import murmuration

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("agg")
from matplotlib import pyplot as plt  # noqa: E402

CONFIG = {
    "experiment": {"name": "small", "seed": 1, "duration_s": 2.0, "agents": 5, "control_period": {"rate_hz": 10.0}},
    "robotsim": {"scenario": {"kind": "line"}, "controller": {"kind": "flocking", "flock_radius_m": 10.0}},
    "netsim": {"phy": {"propagation": "unit-disk", "radius_m": 20.0}},
    "output": {"report": False},
}
VARIED = {"netsim.phy.radius_m": [2.0, 5.0, 20.0], "experiment.agents": [5, 10, 20]}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return murmuration.run(CONFIG, out=tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    return murmuration.sweep({**CONFIG, "sweep": {"seeds": 5, "vary": VARIED}}, out=tmp_path_factory.mktemp("sweep"))


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.mark.parametrize("width", ["column", "page", None])
@pytest.mark.parametrize("metrics", [["broadcast_pdr"], ["broadcast_pdr", "task.collisions"]])
@pytest.mark.filterwarnings("error")
def test_a_sweep_has_one_legend_that_is_whole_and_covers_nothing(sweep, metrics, width):
    axes = sweep.plot("radius_m", metrics, by="agents", width=width)
    figure = axes[0].figure
    figure.draw_without_rendering()
    (legend,) = figure.legends
    assert {text.get_text() for text in legend.get_texts()} == {f"number of robots {n}" for n in VARIED["experiment.agents"]}
    box, page = legend.get_window_extent(), figure.bbox
    assert page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1 + 1
    for own in axes:
        assert own.get_legend() is None and own.get_tightbbox().y1 <= box.y0 + 1
        assert own.get_window_extent().width > 0.6 * page.width / (1 if width == "column" else len(metrics))


@pytest.mark.parametrize("kind", ["trajectories", "links", "speed", "neighbours", "delivery"])
@pytest.mark.filterwarnings("error")
def test_all_of_a_run_is_within_the_figure(run, kind):
    for width in ("column", "page", None):
        figure = run.plot(kind, width=width).figure
        figure.draw_without_rendering()
        box, page = figure.get_tightbbox(), figure.get_size_inches()
        assert box.x0 >= -0.01 and box.y0 >= -0.01 and box.x1 <= page[0] + 0.01 and box.y1 <= page[1] + 0.01
        if width is not None:
            assert page[0] == pytest.approx({"column": 88, "page": 180}[width] / 25.4)


def test_names_beside_robots_do_not_cover_each_other(run):
    from murmuration._paper import Names

    axes = run.plot(width="column")
    both = [child for child in axes.get_children() if isinstance(child, Names)]
    # Of the others and of the leader.
    assert [len(names.points) for names in both] == [4, 1]
    drawn = []
    for names in both:
        names.text.draw = lambda renderer, text=names.text: drawn.append(text.get_window_extent(renderer))
    axes.figure.draw_without_rendering()
    axes.figure.canvas.draw()
    once = drawn[-len(drawn) // 2 :]
    assert once and not any(one.overlaps(other) for place, one in enumerate(once) for other in once[:place])


def fonts(path):
    """Subtypes of the fonts of a PDF."""
    data = path.read_bytes()
    streams = [data]
    for stream in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", data, flags=re.DOTALL):
        try:
            streams.append(zlib.decompress(stream))
        except zlib.error:
            continue
    return {found.decode() for stream in streams for found in re.findall(rb"/Subtype /(Type3|Type0|TrueType|CIDFontType2)", stream)}


def test_fonts_are_embedded_as_true_type_and_the_settings_of_the_user_stay(run, sweep, tmp_path):
    before = matplotlib.rcParams["pdf.fonttype"]
    assert before == 3
    murmuration.save_figure(sweep.plot("radius_m", ["broadcast_pdr"], width="column"), tmp_path / "one.pdf")
    run.plot("delivery").figure.savefig(tmp_path / "two.pdf")
    figure, own = plt.subplots()
    murmuration.save_figure(run.plot("delivery", axes=own), tmp_path / "three.pdf")
    for name in ("one", "two", "three"):
        assert "Type3" not in fonts(tmp_path / f"{name}.pdf") and fonts(tmp_path / f"{name}.pdf")
    figure.savefig(tmp_path / "four.pdf")
    assert "Type3" in fonts(tmp_path / "four.pdf") and matplotlib.rcParams["pdf.fonttype"] == before


def test_the_colours_of_links_are_those_of_the_program():
    from murmuration._marks import _shades

    assert matplotlib.colors.to_hex(_shades()(0.0)) == "#440154"
    red, green, blue, _ = _shades()(1.0)
    # Of the light end of viridis, a tenth is left out.
    assert (red, green, blue) == matplotlib.colormaps["viridis"](0.9)[:3]


def test_captions_are_those_of_the_program(run, sweep):
    assert murmuration.caption(run.plot()) == "Where the 5 robots went, seen from above."
    said = murmuration.caption(sweep.plot("radius_m", ["broadcast_pdr", "task.collisions"]))
    assert "n = 5 trials each" in said and "Collisions" in said
    with pytest.raises(murmuration.InvalidInput, match="axes must be what a plot of murmuration returned"):
        murmuration.caption(plt.subplots()[1])


def test_all_problems_of_a_figure_are_named(run, sweep):
    cases = [
        (
            lambda: run.plot("trajectory", from_s=-1, width=3),
            ["kind: 'trajectory' is no kind of figure; the nearest is 'trajectories'", "from_s must be", "width must be"],
        ),
        (lambda: run.plot(3), ["kind: 3 is no kind of figure"]),
        (lambda: run.plot_links(from_s=1.5, until_s=0.5), ["until_s must be later than from_s, got from_s=1.5 and until_s=0.5"]),
        (lambda: run.plot("speed", from_s=9), ["from_s must be at most 2, the end of the run, got 9"]),
        (lambda: run.plot_network(), ["kind: 'network' needs a network with routes"]),
        (
            lambda: sweep.plot("radus", "pdr"),
            ["x: 'radus' is neither a key that varies nor a column of the trials; the nearest is netsim.phy.radius_m",
             "y: 'pdr' is a metric that these trials do not have; the nearest is broadcast_pdr"],
        ),
        (
            lambda: sweep.plot("radius_m", "broadcast_pdrr", by="seed"),
            ["y: 'broadcast_pdrr' is no metric of the trials; the nearest is broadcast_pdr", "by: 'seed' does not vary"],
        ),
    ]  # fmt: skip
    for call, expected in cases:
        with pytest.raises(murmuration.InvalidInput) as error:
            call()
        for text in expected:
            assert text in str(error.value), str(error.value)
        assert "KIND" not in str(error.value) and "--" not in str(error.value)
    assert "network" not in str(pytest.raises(murmuration.InvalidInput, run.plot, "trajectory").value)
