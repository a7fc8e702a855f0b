"""The page that shows runs, in Chromium: what it draws, against the tables of the run, and what its controls do."""

import bisect
import json
import math
import re
import signal
import time
import urllib.error
import urllib.request

import page_session
import pyarrow.parquet as pq
import pytest
from conftest import ROOT, program, succeed
from page_session import opened, serving

# Positions are drawn to a part of a metre.
TOLERANCE_M = 1 / 512
SIZES = [(1280, 720), (1920, 1080)]


@pytest.fixture(scope="module")
def browser():
    with page_session.browser() as started:
        yield started


@pytest.fixture(scope="module")
def replayed(flocking):
    """The address of a page that replays the run of the README."""
    with serving("replay", flocking) as (url, _):
        yield url


@pytest.fixture(scope="module")
def network(result_of):
    """A network of sensors in which motes fail and come back."""
    return result_of("faults", "output.every_steps=1")


def rows(run, table):
    return pq.read_table(run / f"{table}.parquet").to_pylist()


class Expected:
    """What should be drawn, from the tables alone."""

    def __init__(self, run):
        self.steps = {}
        self.times = {}
        for row in rows(run, "steps"):
            self.steps.setdefault(row["step"], []).append(row)
            self.times[row["step"]] = row["time_ns"]
        self.links, self.senders = {}, {}
        for row in rows(run, "links"):
            self.links.setdefault(row["step"], set()).add((row["sender"], row["receiver"]))
        for row in rows(run, "transmissions"):
            if row["destination"] is None:
                self.senders.setdefault(row["step"], set()).add(row["sender"])

    def step_at(self, time_ns):
        """The last step that does not end after a time."""
        known = sorted(self.times)
        return known[bisect.bisect_right([self.times[step] for step in known], time_ns) - 1]

    def positions(self, step):
        return {row["agent"]: (row["x_m"], row["y_m"]) for row in self.steps[step] if row["alive"]}

    def missed(self, step):
        """Links that delivered within the five seconds before, whose sender sent in this step and whose receiver did not receive."""
        since = self.times[step] - 5e9
        heard = set()
        for other, links in self.links.items():
            if other < step and since <= self.times[other]:
                heard |= links
        now = self.links.get(step, set())
        return {(sender, receiver) for sender, receiver in heard - now if sender in self.senders.get(step, ())}

    def ghosts(self, step, receiver):
        """Where a robot last heard each other one to be, within ten seconds: its position at the end of that step."""
        found = {}
        for other in range(step, 0, -1):
            if self.times[step] - self.times[other] > 10e9:
                break
            for sender, heard_by in self.links.get(other, ()):
                if heard_by == receiver and sender not in found:
                    found[sender] = self.positions(other)[sender]
        return found


@pytest.fixture(scope="module")
def expected(flocking):
    return Expected(flocking)


def assert_drawn(state, expected, step):
    assert state["step"] == step
    positions = {agent: place for agent, place in enumerate(state["positions"]) if place is not None}
    want = expected.positions(step)
    assert positions.keys() == want.keys()
    for agent, place in want.items():
        assert math.dist(place, positions[agent]) < 2 * TOLERANCE_M, agent
    assert {tuple(link) for link in state["links"]} == expected.links.get(step, set())
    assert {tuple(link) for link in state["missed"]} == expected.missed(step)


@pytest.mark.parametrize("size", SIZES)
def test_what_is_drawn_is_what_the_tables_say(browser, replayed, expected, size):
    with opened(browser, replayed, size=size) as session:
        for time_s in [0.0, 0.1, 3.14, 12.5, 24.99, 25.0]:
            assert_drawn(session.seek(int(time_s * 1e9)), expected, expected.step_at(time_s * 1e9))
        session.seek(12_500_000_000)
        session.picture(f"swarm-{size[0]}")


def test_dark_and_light_look_different(browser, replayed):
    pictures = []
    for dark in (False, True):
        with opened(browser, replayed, dark=dark) as session:
            session.seek(12_500_000_000)
            session.picture(f"swarm-{'dark' if dark else 'light'}")
            pictures.append(session.page.screenshot())
    assert pictures[0] != pictures[1]


def test_it_plays_pauses_and_steps(browser, replayed, expected):
    with opened(browser, replayed) as session:
        session.seek(0)
        session.page.keyboard.press("Space")
        session.wait("s.playing && s.step > 3")
        session.page.keyboard.press("Space")
        paused = session.wait("!s.playing")
        time.sleep(0.4)
        assert session.state()["cursor_ns"] == paused["cursor_ns"]
        for key, change in (("ArrowRight", 1), ("ArrowRight", 2), ("ArrowLeft", 1)):
            session.page.keyboard.press(key)
            state = session.wait(f"s.step === {paused['step'] + change}")
            assert_drawn(state, expected, paused["step"] + change)


def test_a_selected_robot_shows_where_it_believes_its_neighbours_to_be(browser, replayed, expected):
    with opened(browser, replayed) as session:
        session.seek(12_500_000_000)
        session.page.get_by_label(re.compile("Find a robot")).fill("7")
        session.page.keyboard.press("Enter")
        state = session.wait("s.selected === 7 && s.ghosts.length > 0")
        want = expected.ghosts(state["step"], 7)
        drawn = {ghost["neighbour"]: (ghost["x"], ghost["y"]) for ghost in state["ghosts"]}
        assert drawn.keys() == want.keys()
        now = expected.positions(state["step"])
        for ghost in state["ghosts"]:
            place = want[ghost["neighbour"]]
            assert math.dist(place, drawn[ghost["neighbour"]]) < 2 * TOLERANCE_M
            assert abs(ghost["errorM"] - math.dist(place, now[ghost["neighbour"]])) < 4 * TOLERANCE_M
        session.picture("selected")
        # The address captures it, and opens it again.
        session.until("location.hash.includes('7')")
        url = session.page.url
    with opened(browser, url) as again:
        state = again.wait("s.selected === 7")
        assert state["step"] == expected.step_at(12_500_000_000)


def test_a_page_by_itself_shows_the_same_and_asks_for_nothing(browser, flocking, expected, tmp_path):
    page = tmp_path / "page.html"
    said = succeed([program("murmuration"), "replay", flocking, "--output", page])
    assert "251 frames, every step" in said
    with opened(browser, page.as_uri()) as session:
        assert session.state()["source"] == "embedded"
        for time_s in [0.1, 12.5, 25.0]:
            assert_drawn(session.seek(int(time_s * 1e9)), expected, expected.step_at(time_s * 1e9))
        assert session.requests == [page.as_uri()]


def test_a_long_recording_is_thinned_to_the_size_that_was_asked_for(browser, result_of, tmp_path):
    run = result_of("flocking", "experiment.duration_s=400.0", "experiment.agents=30")
    page = tmp_path / "page.html"
    said = succeed([program("murmuration"), "replay", run, "--output", page, "--max-size", "1"])
    assert page.stat().st_size <= 1_000_000
    every = int(re.search(r"one of (\d+) steps", said).group(1))
    with opened(browser, page.as_uri()) as session:
        state = session.seek(200_000_000_000)
        tables = Expected(run)
        assert state["step"] % every == 0
        assert 0 <= tables.step_at(200_000_000_000) - state["step"] < every
        positions = tables.positions(state["step"])
        for agent, place in positions.items():
            assert math.dist(place, state["positions"][agent]) < 2 * TOLERANCE_M


def test_render_draws_the_same_numbers(browser, replayed, flocking, tmp_path):
    numbers = tmp_path / "scene.json"
    succeed([program("murmuration"), "render", flocking, "--at", "12.5", "--output", tmp_path / "a.svg", "--json", numbers])
    scene = json.loads(numbers.read_text())
    with opened(browser, replayed) as session:
        state = session.seek(12_500_000_000)
    assert scene["step"] == state["step"]
    assert {robot["robot"]: [robot["x_m"], robot["y_m"]] for robot in scene["robots"]} == dict(enumerate(state["positions"]))
    assert {(link["sender"], link["receiver"]) for link in scene["links"]} == {tuple(link) for link in state["links"]}


def test_the_player_of_a_report_plays_the_run(browser, flocking, expected):
    context = browser.new_context()
    page = context.new_page()
    complaints = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto((flocking / "report.html").as_uri())
    page.get_by_text("Play the run").click()
    player = page.frame_locator("iframe")
    player.get_by_role("button", name="Swarm", exact=True).wait_for(timeout=60000)
    frame = next(frame for frame in page.frames if frame.parent_frame is not None)
    frame.evaluate("window.murmuration.ready")
    frame.evaluate("window.murmuration.seek(12500000000)")
    assert_drawn(frame.evaluate("window.murmuration.state()"), expected, 125)
    assert complaints == []
    page_session.PICTURES.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=page_session.PICTURES / "report.png")
    context.close()


def test_pictures_are_exported(browser, replayed, expected):
    with opened(browser, replayed) as session:
        session.seek(12_500_000_000)
        svg = session.download("SVG").read_text()
        png = session.download("PNG").read_bytes()
    assert svg.lstrip().startswith("<svg") or svg.lstrip().startswith("<?xml")
    assert png[:8] == b"\x89PNG\r\n\x1a\n"


def test_a_packet_and_the_schedule_of_a_network(browser, network):
    packets = rows(network, "packets")
    with serving("replay", network) as (url, _), opened(browser, url) as session:
        end_ns = max(row["time_ns"] for row in rows(network, "steps"))
        session.seek(end_ns)
        session.press("Network")
        for pane in ("Routing tree", "Schedule", "Joining", "Energy and queues", "Packets"):
            session.press(pane)
            session.page.wait_for_timeout(400)
            session.picture(f"network-{pane.split()[0].lower()}")
        state = session.wait("s.packetsShown > 0")
        assert state["packetsShown"] == len(packets)
        source = packets[0]["source"]
        session.page.get_by_label("From").fill(str(source))
        session.wait(f"s.packetsShown === {sum(row['source'] == source for row in packets)}")


def test_a_packet_is_followed_from_hop_to_hop(browser, network):
    words = {"not-acknowledged": "not acknowledged", "broadcast": "sent"}
    frames = {}
    for row in rows(network, "frames"):
        if row["packet"] is not None:
            frames.setdefault(row["packet"], []).append(row)
    packets = rows(network, "packets")
    lost = next(row for row in packets if row["drop_reason"] and len(frames.get(row["packet"], ())) > 3)
    far = next(row for row in packets if row["delivered"] and row["hops"] > 2)
    with serving("replay", network) as (url, _):
        for packet in (lost, far):
            address = f"{url}#view=network&pane=packets&packet={packet['packet']}&t={packet['ended_ns'] / 1e9}"
            with opened(browser, address) as session:
                want = [
                    [row["sender"], row["destination"], row["sent_ns"], words.get(row["outcome"], row["outcome"])]
                    for row in frames[packet["packet"]]
                    if row["sent_ns"] <= packet["ended_ns"]
                ]
                state = session.wait(f"s.packet === {packet['packet']} && s.way.length === {len(want)}")
                assert state["way"] == want
                session.picture(f"packet-{'lost' if packet is lost else 'delivered'}")
                session.press("Swarm")
                session.page.wait_for_timeout(500)
                session.picture(f"way-{'lost' if packet is lost else 'delivered'}")


def test_why_a_robot_was_lost_is_found(browser, network):
    killed = [row for row in rows(network, "motes") if row["mote"] == 9 and not row["alive"]]
    with serving("replay", network) as (url, _), opened(browser, url) as session:
        session.page.get_by_label(re.compile("Find a robot")).fill("9")
        session.page.keyboard.press("Enter")
        session.press("Events")
        session.page.get_by_label(re.compile("Find a robot")).fill("9")
        row = session.page.get_by_role("button").filter(has_text="switch off mote 9").first
        row.click()
        session.wait(f"s.selected === 9 && s.step === {killed[0]['step']}")
        session.picture("robot-lost")


def test_two_runs_are_compared_in_the_same_time(browser, flocking, result_of):
    other = result_of("flocking", "netsim.phy.propagation=unit-disk", "netsim.phy.radius_m=10.0")
    with serving("replay", flocking, "--with", other) as (url, _), opened(browser, url) as session:
        assert session.state()["runs"] == 2
        session.press("Compare")
        session.seek(12_500_000_000)
        session.page.wait_for_timeout(1000)
        session.picture("compare")


def test_a_run_is_watched_while_it_lasts_paused_and_stepped(browser, tmp_path):
    arguments = [
        "run", ROOT / "configs/flocking.toml", "--out", tmp_path, "--live", "--live-control", "--live-speed", "10",
        "--set", "experiment.duration_s=150.0",
    ]
    with serving(*arguments) as (url, _), opened(browser, url) as session:
        state = session.wait("s.source === 'live' && s.step > 10")
        session.page.keyboard.press("Space")
        session.page.wait_for_timeout(1500)
        paused = session.state()
        session.page.wait_for_timeout(1000)
        assert session.state()["step"] == paused["step"] < 1500
        session.page.keyboard.press("ArrowRight")
        session.wait(f"s.step === {paused['step'] + 1}")
        session.picture("live")
        session.page.keyboard.press("Space")
        session.wait(f"s.step > {paused['step'] + 20}")
        # When it has ended, the page replays it.
        session.wait("s.source !== 'live' && s.step >= 0 && !s.loading", seconds=60)
        run = tmp_path / "flocking"
        assert_drawn(session.seek(100_000_000_000), Expected(run), 1000)


def test_a_viewer_that_is_gone_or_slow_does_not_hold_up_a_run(tmp_path):
    with serving("run", ROOT / "configs/flocking.toml", "--out", tmp_path, "--live", "--set", "experiment.duration_s=2000.0") as (url, process):
        token = url.split("token=")[1]
        request = urllib.request.Request(url.split("?")[0] + "api/live", headers={"Authorization": f"Bearer {token}"})
        # It reads a little and then nothing more.
        slow = urllib.request.urlopen(request, timeout=60)
        slow.read(100)
        said = ""
        begun = time.monotonic()
        while "replay the run" not in said:
            assert time.monotonic() - begun < 120, said
            said += process.stdout.readline()
        assert "20000 steps" in said


def test_a_page_that_is_served_after_a_run_ends_with_the_program(tmp_path):
    arguments = ["run", ROOT / "configs" / "flocking.toml", "--out", tmp_path, "--live"]
    for end in (signal.SIGINT, signal.SIGTERM):
        with serving(*arguments) as (_, process):
            while "replay the run" not in process.stdout.readline():
                pass
            process.send_signal(end)
            assert process.wait(timeout=60) == 0


def test_other_pages_can_neither_read_nor_drive_a_run(replayed):
    base = replayed.split("?")[0]
    token = replayed.split("token=")[1]
    for headers in (
        {}, {"Authorization": "Bearer 0"}, {"Authorization": f"Bearer {token}", "Origin": "https://example.org"},
        {"Authorization": f"Bearer {token}", "Host": "example.org"},
    ):
        request = urllib.request.Request(base + "api/runs", headers=headers)
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(request, timeout=60)
        assert refused.value.code in (401, 403)


def test_a_wrong_token_says_what_to_do(browser, replayed):
    session = page_session.Session.__new__(page_session.Session)
    context = browser.new_context()
    session.page = context.new_page()
    session.page.goto(replayed[:-4] + "0000")
    session.page.get_by_text("token").first.wait_for(timeout=60000)
    context.close()


def test_the_built_page_is_that_of_its_sources(tmp_path):
    """What is committed is what `npm run build` makes."""
    source = ROOT / "orchestrator" / "page"
    copy = tmp_path / "orchestrator" / "page"
    succeed(["mkdir", "-p", copy.parent])
    succeed(["cp", "-r", source, copy])
    succeed(["rm", "-rf", copy / "dist", copy / "node_modules"])
    succeed(["cp", "-r", ROOT / "orchestrator" / "view", copy.parent])
    succeed(["cp", "-r", ROOT / "proto", tmp_path / "proto"])
    for command in (["npm", "ci", "--no-audit", "--no-fund"], ["npm", "run", "build"], ["npm", "test"]):
        succeed(command, cwd=copy, deadline_s=300)
    for name in ("index.html", "page.js", "page.css"):
        assert (copy / "dist" / name).read_bytes() == (source / "dist" / name).read_bytes(), f"{name}: run npm run build in orchestrator/page"
