"""The page on phones and tablets, where it opens, what its find box finds, and where its counts lead."""

import json
import math
import re
import tomllib

import page_session
import pyarrow.parquet as pq
import pytest
from page_session import opened, serving
from playwright.sync_api import expect

PHONE, SMALL_PHONE, TABLET = (390, 844), (360, 640), (820, 1180)
# What the page is made of. What is hidden has no box.
PARTS = ["header", ".map", ".legend", ".panel-body", ".charts", ".time-bar", ".toolbar", "aside"]
BOXES = """(selectors) => selectors.flatMap((selector) => [...document.querySelectorAll(selector)]
    .filter((part) => part.checkVisibility())
    .map((part) => { const { left, top, right, bottom } = part.getBoundingClientRect(); return { selector, left, top, right, bottom }; }))"""
# Buttons and fields that can be pressed where they are, and those in rows that scroll; and what lies over each of them.
CONTROLS = """() => [...document.querySelectorAll("button, select, input")].filter((control) => control.checkVisibility()).map((control) => {
    control.scrollIntoView({ block: "nearest", inline: "nearest" });
    const { left, top, width, height } = control.getBoundingClientRect();
    const hit = document.elementFromPoint(left + width / 2, top + height / 2);
    const label = control.getAttribute("aria-label") || control.textContent || control.placeholder;
    return { label, height, hit: hit !== null && (control.contains(hit) || hit.contains(control)), over: hit?.outerHTML.slice(0, 80) ?? "nothing" };
})"""


@pytest.fixture(scope="module")
def browser():
    with page_session.browser() as started:
        yield started


@pytest.fixture(scope="module")
def replayed(flocking):
    with serving("replay", flocking) as (url, _):
        yield url


@pytest.fixture(scope="module")
def network(result_of):
    """A network of sensors in which motes fail and come back."""
    return result_of("faults", "output.every_steps=1")


@pytest.fixture(scope="module")
def sensors(network):
    with serving("replay", network) as (url, _):
        yield url


def rows(run, table):
    return pq.read_table(run / f"{table}.parquet").to_pylist()


def assert_laid_out(session, size, first):
    """Parts lie beside and below each other, the one that is drawn on first, and everything can be pressed."""
    boxes = session.page.evaluate(BOXES, PARTS)
    width, height = size
    for box in boxes:
        assert box["left"] >= -0.5 and box["top"] >= -0.5 and box["right"] <= width + 0.5 and box["bottom"] <= height + 0.5, box
    for number, a in enumerate(boxes):
        for b in boxes[number + 1 :]:
            apart = a["right"] <= b["left"] + 0.5 or b["right"] <= a["left"] + 0.5 or a["bottom"] <= b["top"] + 0.5 or b["bottom"] <= a["top"] + 0.5
            inside = a["selector"] == ".panel-body" and b["selector"] == ".toolbar" and b["top"] >= a["top"]
            assert apart or inside, (a, b)
    place = {box["selector"]: box for box in boxes}
    drawn = place[first]
    assert drawn["bottom"] <= place[".time-bar"]["top"] + 0.5 and place[".time-bar"]["bottom"] <= place["aside"]["top"] + 0.5
    assert drawn["right"] - drawn["left"] == width
    assert drawn["bottom"] - drawn["top"] >= 0.22 * height, "the picture is too small to see anything"
    controls = session.page.evaluate(CONTROLS)
    assert len(controls) > 12
    for control in controls:
        assert control["hit"], control
        assert control["height"] >= 24, control
    scrolled = session.page.evaluate("[document.scrollingElement.scrollWidth, document.scrollingElement.scrollHeight]")
    assert scrolled == [width, height]


@pytest.mark.parametrize("size", [PHONE, SMALL_PHONE, TABLET])
def test_on_a_phone_the_map_is_first_and_nothing_covers_anything(browser, replayed, size):
    with opened(browser, replayed, size=size, touch=True) as session:
        session.seek(12_500_000_000)
        session.until("document.querySelector('.counts button') !== null")
        assert_laid_out(session, size, ".map")
        session.picture(f"touch-{size[0]}")
        # All robots are in the picture.
        state = session.state()
        map_box = session.page.locator(".map").bounding_box()
        for x, y in state["positions"]:
            dx, dy = (x - state["camera"]["x"]) * state["camera"]["scale"], (y - state["camera"]["y"]) * state["camera"]["scale"]
            assert abs(dx) < map_box["width"] / 2 and abs(dy) < map_box["height"] / 2
        # The legend opens below the map.
        session.page.locator(".legend summary").tap()
        session.until("document.querySelector('.legend').open")
        session.page.wait_for_timeout(300)
        boxes = {box["selector"]: box for box in session.page.evaluate(BOXES, PARTS)}
        assert boxes[".legend"]["top"] >= boxes[".map"]["bottom"] - 0.5 and boxes[".legend"]["bottom"] <= boxes[".time-bar"]["top"] + 0.5


def test_on_a_phone_the_other_views_are_laid_out_the_same_way(browser, sensors):
    with opened(browser, sensors, size=PHONE, touch=True) as session:
        session.until("document.querySelector('.counts button') !== null")
        session.page.get_by_role("button", name="Network", exact=True).tap()
        for pane in ("Routing tree", "Schedule", "Packets", "Joining", "Energy and queues"):
            session.page.get_by_role("button", name=pane, exact=True).tap()
            session.page.wait_for_timeout(300)
            assert_laid_out(session, PHONE, ".panel-body")
        session.page.get_by_role("button", name="Series", exact=True).tap()
        session.page.wait_for_timeout(300)
        assert_laid_out(session, PHONE, ".charts")


def test_fingers_play_select_a_robot_and_zoom(browser, replayed):
    with opened(browser, replayed, size=PHONE, touch=True) as session:
        state = session.seek(12_500_000_000)
        box = session.page.locator(".map").bounding_box()
        camera, (x, y) = state["camera"], state["positions"][0]
        at = lambda x, y: (
            box["x"] + box["width"] / 2 + (x - camera["x"]) * camera["scale"],
            box["y"] + box["height"] / 2 - (y - camera["y"]) * camera["scale"],
        )
        session.page.touchscreen.tap(*at(x, y))
        session.wait("s.selected === 0")

        # Two fingers that move apart to twice their distance, about the middle of the map.
        devtools = session.context.new_cdp_session(session.page)
        middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)

        def touch(kind, apart):
            points = [{"x": middle[0] + side * apart / 2, "y": middle[1], "id": number} for number, side in enumerate((-1, 1))]
            devtools.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points if kind != "touchEnd" else []})

        touch("touchStart", 80)
        for apart in (100, 120, 140, 160):
            touch("touchMove", apart)
        touch("touchEnd", 0)
        session.page.wait_for_timeout(200)
        zoomed = session.state()
        assert zoomed["camera"]["scale"] == pytest.approx(2 * camera["scale"], rel=0.02)
        assert zoomed["camera"]["x"] == pytest.approx(camera["x"], abs=2 / camera["scale"])
        assert zoomed["selected"] == 0, "lifting the fingers selected something else"

        session.page.get_by_role("button", name=re.compile("Play or pause")).tap()
        session.wait(f"s.playing && s.step > {state['step'] + 3}")
        session.page.get_by_role("button", name=re.compile("Play or pause")).tap()
        session.wait("!s.playing")


def test_a_run_opens_playing_and_stands_still_for_who_wants_no_motion(browser, replayed):
    with opened(browser, replayed, moving=True) as session:
        state = session.wait("s.playing && s.step > 3")
        assert state["cursor_ns"] < 15e9
    with opened(browser, replayed) as session:
        state = session.state()
        assert not state["playing"] and state["cursor_ns"] == 10e9 and len(state["links"]) > 20
        session.page.wait_for_timeout(500)
        assert session.state()["cursor_ns"] == 10e9
    # An address with a time opens there.
    with opened(browser, f"{replayed}#t=3.5", moving=True) as session:
        session.page.wait_for_timeout(500)
        state = session.state()
        assert not state["playing"] and state["cursor_ns"] == 3.5e9


def test_a_network_opens_where_it_has_formed(browser, sensors, network):
    formed_ns = json.loads((network / "summary.json").read_text())["kpis"]["formation"]["formed_s"] * 1e9
    step_ends = sorted({row["time_ns"] for row in rows(network, "steps")})
    begin_ns = next(time_ns for time_ns in step_ends if time_ns >= formed_ns)
    with opened(browser, sensors) as session:
        assert session.state()["cursor_ns"] == begin_ns + 10e9
    with opened(browser, sensors, moving=True) as session:
        state = session.wait("s.playing")
        assert begin_ns <= state["cursor_ns"] < begin_ns + 600e9
        # An hour of simulated time is over within two minutes.
        expect(session.page.get_by_label("Speed")).not_to_have_value("1")
        speed = float(session.page.get_by_label("Speed").input_value())
        assert (step_ends[-1] - begin_ns) / 1e9 / speed <= 120


def test_the_find_box_selects_the_robot_whose_number_is_typed(browser, replayed):
    for size, touch in (((1280, 720), False), (PHONE, True)):
        with opened(browser, replayed, size=size, touch=touch) as session:
            find = session.page.get_by_label(re.compile("Find a robot"))
            find.press_sequentially("3")
            session.wait("s.selected === 3")
            session.page.locator("aside h2").filter(has_text=re.compile("^Robot 3$")).wait_for()
            find.fill("robot 5")
            session.wait("s.selected === 5")
            find.fill("99")
            session.page.get_by_text("There is no robot 99: this run has robots 0 to 9.").wait_for()
            find.fill("collides with robot 7")
            session.wait("s.eventsShown > 0")
            assert session.page.locator(".event .words").first.inner_text().endswith("collides with robot 7")


def collisions(run):
    """When pairs of robots came closer to each other than their diameter (ns), after a larger distance at the end of the step before."""
    diameter_m = tomllib.loads((run / "config.toml").read_text())["robotsim"]["diameter_m"]
    steps = {}
    for row in rows(run, "steps"):
        if row["step"] > 0 and row["alive"]:
            steps.setdefault(row["time_ns"], {})[row["agent"]] = (row["x_m"], row["y_m"], row["z_m"])
    found, before = [], set()
    for time_ns, places in sorted(steps.items()):
        close = {(a, b) for a in places for b in places if a < b and math.dist(places[a], places[b]) < diameter_m}
        found += [time_ns] * len(close - before)
        before = close
    return found


def test_a_count_of_collisions_leads_from_one_to_the_next(browser, replayed, flocking):
    times_ns = collisions(flocking)
    n = json.loads((flocking / "summary.json").read_text())["task"]["collisions"]
    assert len(times_ns) == n > 10
    with opened(browser, replayed) as session:
        button = session.page.locator(".counts button").filter(has_text="collisions")
        session.until("document.querySelector('.counts button') !== null")
        assert button.inner_text() == f"{n} collisions"
        for number, time_ns in enumerate(times_ns[:6], 1):
            button.click()
            session.wait(f"s.cursor_ns === {time_ns} && s.time_ns === {time_ns} && s.selected !== null")
            assert button.inner_text() == f"{number} of {n} collisions"
        button.click(modifiers=["Shift"])
        session.wait(f"s.cursor_ns === {times_ns[4]}")
        for _ in range(5):
            button.click(modifiers=["Shift"])
        session.wait(f"s.cursor_ns === {times_ns[-1]}")
        session.picture("collisions")


def test_counts_of_failures_and_dropped_packets_lead_to_them(browser, sensors, network):
    alive, failed = {}, []
    for row in rows(network, "motes"):
        if alive.get(row["mote"], True) and not row["alive"]:
            failed.append((row["time_ns"], row["mote"]))
        alive[row["mote"]] = row["alive"]
    dropped = sorted((row["ended_ns"], row["packet"]) for row in rows(network, "packets") if row["drop_reason"])
    with opened(browser, sensors) as session:
        counts = session.page.locator(".counts button")
        session.until("[...document.querySelectorAll('.counts button')].some((b) => b.textContent.includes('dropped'))")
        failures = counts.filter(has_text="failure")
        assert failures.inner_text() == f"{len(failed)} failures"
        failures.click()
        session.wait(f"s.cursor_ns === {failed[0][0]} && s.selected === {failed[0][1]}")
        packets = counts.filter(has_text="dropped packet")
        assert packets.inner_text() == f"{len(dropped)} dropped packets"
        for time_ns, packet in dropped[:3]:
            packets.click()
            session.wait(f"s.cursor_ns === {time_ns} && s.packet === {packet} && s.way.length > 0")
        # The count of a list leads through it, too.
        session.press("Network")
        session.press("Packets")
        session.page.get_by_label("Outcome").select_option("dropped")
        listed = session.page.locator(".packets .toolbar button")
        session.wait(f"s.packetsShown === {len(dropped)}")
        listed.click()
        session.wait(f"s.packet === {dropped[0][1]}")
        session.press("Events")
        session.page.get_by_label(re.compile("Find a robot")).fill("radio of robot")
        session.wait("s.eventsShown > 0")
        session.page.locator(".events button.link").click()
        session.wait(f"s.cursor_ns === {failed[0][0]}")


def test_numbers_of_a_report_lead_to_their_moments_in_its_player(browser, flocking):
    times_ns = collisions(flocking)
    context = browser.new_context(reduced_motion="reduce")
    page = context.new_page()
    complaints = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto((flocking / "report.html").as_uri())
    words = f"{len(times_ns)} collisions"
    page.locator(".notice").get_by_role("button", name=words).click()
    page.frame_locator("iframe").get_by_role("button", name="Swarm", exact=True).wait_for(timeout=60000)
    player = next(frame for frame in page.frames if frame.parent_frame is not None)

    def reached(time_ns):
        for _ in range(300):
            state = player.evaluate("window.murmuration?.state === undefined ? null : window.murmuration.ready.then(() => window.murmuration.state())")
            if state is not None and state["cursor_ns"] == time_ns:
                return state
            page.wait_for_timeout(50)
        raise AssertionError(f"the player is not at {time_ns} ns: {state}")

    assert not reached(times_ns[0])["playing"]
    page.locator(".tile").filter(has_text="Collisions between robots").get_by_role("button").click()
    reached(times_ns[1])
    assert complaints == []
    context.close()


# Numbers in cards and tables of facts whose letters are on more than one line.
BROKEN = """(selector) => [...document.querySelectorAll(selector)].flatMap((card) => {
    const found = [];
    const walker = document.createTreeWalker(card, NodeFilter.SHOW_TEXT);
    while (walker.nextNode()) {
        const { data } = walker.currentNode;
        for (const { 0: number, index } of data.matchAll(/[−+-]?\\d[\\d.,eE−+-]*/g)) {
            const range = document.createRange();
            range.setStart(walker.currentNode, index);
            range.setEnd(walker.currentNode, index + number.length);
            if (new Set([...range.getClientRects()].map(({ top }) => Math.round(top))).size > 1) found.push(data);
        }
    }
    if (card.scrollWidth > card.clientWidth + 1) found.push(`too wide: ${card.textContent}`);
    return found;
})"""


@pytest.mark.parametrize("width_px", [320, 390, 820, 1280])
def test_cards_break_no_number(browser, flocking, network, replayed, width_px):
    context = browser.new_context(viewport={"width": width_px, "height": 900})
    page = context.new_page()
    for run in (flocking, network):
        page.goto((run / "report.html").as_uri())
        assert page.locator(".tile").count() >= 4
        assert page.evaluate(BROKEN, ".tile, .tile dd") == []
        assert page.evaluate("document.scrollingElement.scrollWidth") <= width_px
    context.close()
    with opened(browser, f"{replayed}#robot=3&t=12.5", size=(width_px, 900)) as session:
        session.page.locator("aside h2").filter(has_text="Robot 3").wait_for()
        assert session.page.evaluate(BROKEN, ".facts, .facts dd") == []
