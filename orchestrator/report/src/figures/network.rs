//! Pictures of a network with protocols: who hears whom, the routing graph, the schedule, delivery and latency. Each is
//! there only if the network said what it shows.

use super::plan::{Places, between, plan, plan_width};
use super::{
    Figure, HALF, HALF_HEIGHT, TaskTime, WIDE, connectivity, dots_by_group, spread_in_words,
};
use crate::svg::{Axis, Chart};
use metrics::{Kpis, Measures};
use numbers::format::{count, count_of, number, percent, shortest};
use proto::types::{Schedule, seconds};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// All pictures for which there is something to show.
pub(super) fn network_figures(measures: &Measures) -> Vec<Figure> {
    let kpis = &measures.kpis;
    let places = &measures.trajectories.ends[1];
    let mut figures = Vec::new();
    figures.extend(connectivity::figure(measures));
    figures.extend(routing_graph(measures, places));
    figures.extend(schedules(kpis));
    figures.extend(delivery_over_time(measures));
    figures.extend(latency(kpis));
    figures
}

fn routing_graph(measures: &Measures, places: &Places) -> Option<Figure> {
    let kpis = &measures.kpis;
    let parents = &kpis.motes.parent;
    let n_with_parent = parents.iter().filter(|&&parent| parent != u32::MAX).count();
    if n_with_parent == 0 {
        return None;
    }
    // Motes that have failed are no part of it.
    let living: Vec<Option<[f64; 2]>> = places
        .iter()
        .enumerate()
        .map(|(mote, place)| place.filter(|_| kpis.motes.alive.get(mote)))
        .collect();
    let width = plan_width(&living);
    let mut chart = plan(&living, width);
    let links = (0..).zip(parents).filter_map(|(mote, &parent)| {
        Some((format!("{mote} to {parent}"), between(&living, mote, parent)?))
    });
    let (names, links): (Vec<String>, Vec<_>) = links.unzip();
    chart.names(names);
    chart.segments("link", links);
    let has_parent = |mote: usize| parents.get(mote).is_some_and(|&parent| parent != u32::MAX);
    let motes = |wanted: bool| {
        living.iter().enumerate().filter(move |&(mote, _)| has_parent(mote) == wanted)
    };
    let mut key =
        dots_by_group(&mut chart, &measures.task, ["mote", "mote with a parent"], motes(true));
    let named = motes(false).filter(|(_, place)| place.is_some());
    chart.names(named.map(|(mote, _)| format!("mote {mote}")));
    chart.dots("start", motes(false).filter_map(|(_, place)| *place));
    for (mote, place) in living.iter().enumerate().filter(|&(mote, _)| kpis.is_root(mote)) {
        if let Some(place) = *place {
            chart.ring("start-leader", place, 6.0);
            chart.label("leader", place, &format!("root {mote}"));
        }
    }
    let others = living.iter().enumerate().filter(|&(mote, _)| !kpis.is_root(mote));
    chart.numbers(others.filter_map(|(mote, place)| Some((mote, (*place)?))));
    let depths = depths(parents);
    let depth = depths.iter().flatten().max().copied().unwrap_or(0);
    let sentence = format!(
        "Whom each mote has chosen as parent at the end: {} of {} motes have one, and the deepest is {} from its root.",
        count(n_with_parent as u64),
        count(parents.len() as u64),
        count_of(depth as u64, "hop"),
    );
    key.extend([("start", "mote without".into()), ("link", "to the parent".into())]);
    let svg = chart.finish("routing", "Routing graph", &sentence);
    Some(Figure { title: "Routing graph", sentence, key, svg, is_wide: HALF < width })
}

/// How many parents there are on the way up from each mote; `None` on a way that never ends.
pub(crate) fn depths(parents: &[u32]) -> Vec<Option<usize>> {
    let climb = |start: usize| {
        let mut mote = start;
        for depth in 0..=parents.len() {
            match parents.get(mote) {
                Some(&parent) if parent != u32::MAX => mote = parent as usize,
                _ => return Some(depth),
            }
        }
        None
    };
    (0..parents.len()).map(climb).collect()
}

/// A slotframe: who uses which of its places.
#[derive(Default)]
struct Used {
    n_slots: u32,
    /// Cells in which a mote may transmit.
    n_cells: u64,
    /// By slot and channel offset, how many motes may transmit there; 0: some listen, nobody may.
    places: BTreeMap<(u32, u32), u64>,
}

fn schedules(kpis: &Kpis) -> Vec<Figure> {
    let Some(cells) = kpis.schedule.as_ref() else { return Vec::new() };
    let mut slotframes: BTreeMap<u32, Used> = BTreeMap::new();
    for i in 0..cells.len() {
        let used = slotframes.entry(cells.slotframe[i]).or_default();
        used.n_slots = used.n_slots.max(cells.slotframe_slots[i]);
        let n = used.places.entry((cells.slot[i], cells.channel_offset[i])).or_default();
        if transmits(cells, i) {
            used.n_cells += 1;
            *n += 1;
        }
    }
    // Those with most to see; a cell that all have needs no picture where there is anything else.
    let mut by_places: Vec<u32> = slotframes.keys().copied().collect();
    by_places.sort_by_key(|handle| std::cmp::Reverse(slotframes[handle].places.len()));
    let mut drawn: Vec<u32> = by_places
        .iter()
        .enumerate()
        .filter(|&(rank, handle)| {
            rank == 0 || (rank < MAX_SLOTFRAMES && 1 < slotframes[handle].places.len())
        })
        .map(|(_, &handle)| handle)
        .collect();
    drawn.sort_unstable();
    let not_drawn: Vec<String> = slotframes
        .iter()
        .filter(|(handle, _)| !drawn.contains(handle))
        .map(|(handle, used)| {
            let n = used.places.len() as u64;
            format!("slotframe {handle} of {} slots ({})", used.n_slots, count_of(n, "place"))
        })
        .collect();
    let mut figures: Vec<Figure> =
        drawn.iter().map(|handle| slotframe(*handle, &slotframes[handle])).collect();
    if let (Some(last), false) = (figures.last_mut(), not_drawn.is_empty()) {
        let _ = write!(last.sentence, " Not drawn: {}.", not_drawn.join(", "));
    }
    figures
}

fn slotframe(handle: u32, used: &Used) -> Figure {
    let n_channels = used.places.keys().map(|&(_, channel)| channel + 1).max().unwrap_or(1);
    let x = Axis::new("slot offset (slots)", 0.0, f64::from(used.n_slots)).integer_ticks();
    let y = Axis::new("channel offset (channels)", 0.0, f64::from(n_channels)).integer_ticks();
    let plane_height = (15.0 * f64::from(n_channels)).clamp(60.0, 240.0);
    let mut chart = Chart::new(x, y, WIDE, Chart::with_plane_height(plane_height));
    let places = |wanted: std::ops::RangeInclusive<u64>| {
        let chosen = used.places.iter().filter(move |&(_, n)| wanted.contains(n));
        chosen.map(|(&(slot, channel), _)| {
            let (x, y) = (f64::from(slot), f64::from(channel));
            [[x, y], [x + 1.0, y + 1.0]]
        })
    };
    let (idle, one, several) = (places(0..=0), places(1..=1), places(2..=u64::MAX));
    let [n_idle, n_one, n_several] =
        [idle.clone(), one.clone(), several.clone()].map(|places| places.count() as u64);
    chart.rectangles("cell idle", idle);
    chart.rectangles("cell", one);
    chart.rectangles("cell several", several);
    let n_places = n_one + n_several;
    let slots = format!("slotframe {handle} of {} slots", count(u64::from(used.n_slots)));
    let listened = match n_idle {
        0 => String::new(),
        n => format!("at {} motes listen, where nobody may transmit now", count_of(n, "place")),
    };
    let sentence = if n_places == 0 {
        format!("In {slots}, {listened}.")
    } else {
        format!(
            "Where motes may transmit in {slots}: {} at {}, {} of which several motes share{}{listened}.",
            count_of(used.n_cells, "cell"),
            count_of(n_places, "place"),
            count(n_several),
            if n_idle == 0 { "" } else { "; " },
        )
    };
    let key = [
        (n_one, ("cell", "one mote may transmit".into())),
        (n_several, ("cell several", "several may".into())),
        (n_idle, ("cell idle", "motes listen, nobody may transmit now".into())),
    ];
    let key = key.into_iter().filter(|&(n, _)| n != 0).map(|(_, key)| key).collect();
    let svg = chart.finish(&format!("schedule-{handle}"), "Schedule", &sentence);
    Figure { title: "Schedule", sentence, key, svg, is_wide: true }
}

/// Whether a mote may transmit in the cell.
fn transmits(cells: &Schedule, cell: usize) -> bool {
    cells.options[cell] & 1 != 0
}

fn delivery_over_time(measures: &Measures) -> Option<Figure> {
    let timeline = &measures.kpis.account.over_time;
    let [delivered, dropped] =
        timeline.bins.iter().fold([0, 0], |sum, bin| [sum[0] + bin[0], sum[1] + bin[1]]);
    if delivered + dropped == 0 {
        return None;
    }
    let bin_s = seconds(timeline.bin_ns);
    let middle_s = |bin: usize| (bin as f64 + 0.5) * bin_s;
    let start_s = seconds(measures.start_ns);
    let before = timeline.bins.iter().enumerate().take_while(|&(bin, _)| middle_s(bin) < start_s);
    let shows_before = before.into_iter().any(|(_, ended)| *ended != [0, 0]);
    let time = TaskTime::new(measures, shows_before);
    let mut chart = Chart::new(
        time.axis(),
        Axis::new("share delivered (%)", 0.0, 1.03).percent(),
        HALF,
        HALF_HEIGHT,
    );
    chart.line(
        "line",
        timeline.bins.iter().enumerate().map(|(bin, &[delivered, dropped])| {
            let ended = delivered + dropped;
            (ended != 0).then(|| [time.at(middle_s(bin)), delivered as f64 / ended as f64])
        }),
    );
    let ended = timeline.bins.iter().filter(|ended| **ended != [0, 0]);
    let shares = ended.map(|&[delivered, dropped]| delivered as f64 / (delivered + dropped) as f64);
    let spread = spread_in_words(shares, &percent, "interval");
    let sentence = format!(
        "Which share of the application packets that ended within {} s reached its destination: {} of {} over all{spread}.",
        shortest(bin_s),
        percent(delivered as f64 / (delivered + dropped) as f64),
        count(delivered + dropped)
    );
    let mut key = vec![("line", "delivered, of those delivered or dropped".into())];
    key.extend(time.mark(&mut chart, measures.events()));
    let svg = chart.finish("packets", "Packets delivered over time", &sentence);
    Some(Figure { title: "Packets delivered over time", sentence, key, svg, is_wide: false })
}

fn latency(kpis: &Kpis) -> Option<Figure> {
    let latencies_s = kpis.account.latencies_s();
    let [Some(median), Some(p99), Some(longest)] = latencies_s.quantiles([0.5, 0.99, 1.0]) else {
        return None;
    };
    let ascending = latencies_s.ascending();
    let x = Axis::new("from creation to delivery (s)", 0.0, p99.max(1e-3) * 1.1);
    let mut chart =
        Chart::new(x, Axis::new("share of packets (%)", 0.0, 1.03).percent(), HALF, HALF_HEIGHT);
    let n = ascending.len();
    let every = n.div_ceil(MAX_POINTS);
    let points = (0..n).step_by(every).map(|i| [ascending[i], (i + 1) as f64 / n as f64]);
    chart.line("line", points.filter(|point| point[0] <= p99 * 1.1).map(Some));
    chart.level(0.5, "median");
    if 1 < every {
        chart.note(format!("In the order of latency, one packet of {every} is drawn"));
    }
    let sentence = format!(
        "How many of the {} packets delivered had arrived after how long: half of them after {} s (median), 99 % after {} s, all \
         after {} s.",
        count(n as u64),
        number(median),
        number(p99),
        number(longest)
    );
    let key = vec![("line", "share delivered by then".into())];
    let svg = chart.finish("latency", "Latency", &sentence);
    Some(Figure { title: "Latency", sentence, key, svg, is_wide: false })
}

/// Most slotframes drawn.
const MAX_SLOTFRAMES: usize = 4;
/// Most points of a line.
const MAX_POINTS: usize = 500;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_up_is_counted_and_a_loop_has_no_depth() {
        let none = u32::MAX;
        assert_eq!(depths(&[none, 0, 1, 0]), [Some(0), Some(1), Some(2), Some(1)]);
        assert_eq!(depths(&[1, 0, none, 1]), [None, None, Some(0), None]);
    }
}
