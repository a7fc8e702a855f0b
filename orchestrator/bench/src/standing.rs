//! Standing sensor networks: simulated hours, with per-mote energy and every packet recorded.

use super::{
    BenchOptions, Printer, begin_record, end_record, number_or_dash, record_failed, step,
    temporary_folder,
};
use drive::Wanted;
use experiment::{Overrides, Plan};
use numbers::format::wrapped;
use numbers::layout::WIDTH;
use proto::types::{NS_PER_S, seconds};
use record::Recorder;
use run::{Processes, RunError, start};
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt::{self, Write as _};
use std::path::Path;
use std::time::Instant;

/// A row, and the peers' figures (wall seconds per simulated hour; measured elsewhere).
#[derive(Clone, Copy, Debug)]
pub(super) struct StandingRow {
    pub(super) motes: u32,
    roots: u32,
    sf: &'static str,
    /// Between two packets of a mote (s).
    app_period_s: u32,
    /// The 6TiSCH simulator, with MSF.
    simulator_s: Option<f64>,
    /// TSCH-Sim, with Orchestra.
    tsch_sim_s: Option<f64>,
    to_reach_s: Option<f64>,
}

const fn row(
    motes: u32,
    sf: &'static str,
    app_period_s: u32,
    to_reach_s: Option<f64>,
) -> StandingRow {
    let roots = if motes < 10_000 { 1 } else { 20 };
    let (simulator_s, tsch_sim_s) = match motes {
        10 => (Some(5.0), Some(1.0)),
        50 => (Some(30.0), Some(4.4)),
        100 => (Some(80.0), Some(9.7)),
        1000 => (None, Some(47.0)),
        _ => (None, None),
    };
    StandingRow { motes, roots, sf, app_period_s, simulator_s, tsch_sim_s, to_reach_s }
}

pub(super) const ROWS: [StandingRow; 9] = [
    row(10, "msf", 60, Some(0.05)),
    row(10, "orchestra", 60, Some(0.05)),
    row(50, "msf", 60, Some(0.3)),
    row(50, "orchestra", 60, Some(0.3)),
    row(100, "msf", 60, Some(0.7)),
    row(100, "orchestra", 60, Some(0.7)),
    row(1000, "msf", 60, Some(5.0)),
    row(2500, "msf", 600, None),
    row(10_000, "msf", 600, Some(100.0)),
];

/// Rows of at most so many motes are measured where no table is asked for.
pub(super) const SMALL: u32 = 100;

/// Simulated time after which a network that has not formed is measured as it is (ns).
const LIMIT_NS: u64 = 7200 * NS_PER_S;
/// Simulated time that is measured (ns).
const HOUR_NS: u64 = 3600 * NS_PER_S;
/// Between two readings of every mote's energy (ns).
const STATISTICS_NS: u64 = 600 * NS_PER_S;
/// Slots of a step: a minute.
const STEP_SLOTS: u32 = 6000;
/// With headers this is a 6LoWPAN datagram of 90 bytes; the peers have 90 bytes of payload without headers. A datagram to a root
/// one hop away omits the root's address, and has 82 bytes.
const PAYLOAD_BYTES: u32 = 72;
/// Between neighbours of the grid (m).
const SPACING_M: f64 = 10.0;

impl StandingRow {
    fn side(&self) -> u32 {
        (1..).find(|side| self.motes <= side * side).unwrap_or(self.motes)
    }

    /// A square grid, row by row.
    fn places(&self) -> String {
        let mut text = "agent,x_m,y_m\n".to_owned();
        for mote in 0..self.motes {
            let [x_m, y_m] =
                [mote % self.side(), mote / self.side()].map(|k| f64::from(k) * SPACING_M);
            let _ = writeln!(text, "{mote},{x_m},{y_m}");
        }
        text
    }

    /// The mote in the middle, or those in the middles of four by five parts of the grid.
    fn root_numbers(&self) -> Vec<u32> {
        let (columns, rows) = if self.roots == 1 { (1, 1) } else { (4, self.roots / 4) };
        let lines = self.motes.div_ceil(self.side());
        let middle = |part: u32, parts: u32, length: u32| (2 * part + 1) * length / (2 * parts);
        let position_m = |row, column| {
            middle(row, rows, lines) * self.side() + middle(column, columns, self.side())
        };
        (0..rows)
            .flat_map(|row| (0..columns).map(move |column| (row, column)))
            .map(|(row, column)| position_m(row, column).min(self.motes - 1))
            .collect()
    }

    fn config(&self) -> String {
        format!(
            "[experiment]\nname = \"bench\"\nseed = 1\nduration_s = 1e6\nagents = {}\ncontrol_period.slots = {STEP_SLOTS}\n\
             [robotsim.scenario]\nkind = \"csv\"\nfile = \"places.csv\"\n[robotsim.controller]\nkind = \"hold\"\n\
             [netsim]\nmode = \"6tisch\"\nroots = {:?}\n[netsim.phy]\npropagation = \"unit-disk\"\nradius_m = 25.0\n\
             [netsim.sf]\nkind = \"{}\"\n[netsim.swarm]\ntransport = \"none\"\n\
             [netsim.rpl]\nroute_lifetime_s = 1800\n\
             [[netsim.app]]\nkind = \"periodic\"\nperiod_s = {}\npayload_bytes = {PAYLOAD_BYTES}\n\
             [output]\nlinks = \"none\"\nmcap = false\ntransmissions = false\nschedule = false\nneighbours = false\n\
             motes_every_s = {}\nreport = false\n",
            self.motes,
            self.root_numbers(),
            self.sf,
            self.app_period_s,
            seconds(STATISTICS_NS),
        )
    }
}

/// Measures rows.
pub(super) async fn bench(
    rows: &[StandingRow],
    options: &BenchOptions,
    printer: &mut Printer<'_>,
) -> Result<Vec<RowAnswer>, RunError> {
    printer.heading(&heading());
    let mut cells = Vec::new();
    for row in rows {
        let cell = measure(*row, options).await?;
        printer.row(&cell);
        cells.push(cell);
    }
    Ok(cells)
}

async fn measure(row: StandingRow, options: &BenchOptions) -> Result<RowAnswer, RunError> {
    let folder = temporary_folder()?;
    let places = folder.path().join("places.csv");
    system::write(&places, row.places())
        .map_err(|source| record_failed(record::RecordError::Create { path: places, source }))?;
    let path = folder.path().join("bench.toml");
    let plan = experiment::read(Path::new(&path), row.config(), &Overrides::default())?;
    let started = start(&plan, &options.start, Wanted::Record, None).await?;
    let mut coupled = started.coupled;
    let path = folder.path().join("record");
    let mut recorder = Some(begin_record(&path, started.header, started.exchange)?);
    let mut run =
        StandingRun { plan: &plan, coupled: &mut coupled, recorder: &mut recorder, ends: [0; 2] };
    let measured = run.measure().await;
    let [delivered, lost] = run.ends;
    coupled.stop().await;
    let (formed_ns, forming_wall_s, hour_wall_s) = measured?;
    recorder.map_or(Ok(()), end_record)?;
    Ok(RowAnswer {
        motes: row.motes,
        roots: row.roots,
        scheduling_function: row.sf,
        app_period_s: row.app_period_s,
        formed_s: formed_ns.map(seconds),
        forming_wall_s,
        hour_wall_s,
        delivered,
        lost,
        simulator_6tisch_s: row.simulator_s,
        tsch_sim_s: row.tsch_sim_s,
        to_reach_s: row.to_reach_s,
    })
}

struct StandingRun<'a> {
    plan: &'a Plan,
    coupled: &'a mut Processes,
    recorder: &'a mut Option<Recorder>,
    /// Packets delivered and lost since the last phase began.
    ends: [u64; 2],
}

impl StandingRun<'_> {
    /// When the network had formed, and wall times (s) until then and of the hour after.
    async fn measure(&mut self) -> Result<(Option<u64>, f64, f64), RunError> {
        let begun = Instant::now();
        let formed = |run: &Self| run.coupled.formation().and_then(|formed| formed.formed_ns);
        while formed(self).is_none() && self.coupled.time_ns() < LIMIT_NS {
            self.step().await?;
        }
        let (formed_ns, forming_s) = (formed(self), begun.elapsed().as_secs_f64());
        let (begun, end_ns) = (Instant::now(), self.coupled.time_ns() + HOUR_NS);
        self.ends = [0; 2];
        while self.coupled.time_ns() < end_ns {
            self.step().await?;
        }
        Ok((formed_ns, forming_s, begun.elapsed().as_secs_f64()))
    }

    async fn step(&mut self) -> Result<(), RunError> {
        let outcome = step(self.plan, self.coupled, self.recorder, true).await?;
        for outcome in outcome.network.packets.iter().flat_map(|packets| &packets.outcome) {
            self.ends[usize::from(*outcome != 0)] += 1;
        }
        Ok(())
    }
}

/// A row of the answer for programs.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct RowAnswer {
    /// Number of motes, roots included.
    motes: u32,
    /// Number of roots.
    roots: u32,
    /// The scheduling function.
    scheduling_function: &'static str,
    /// Period of the application of each mote (s).
    app_period_s: u32,
    /// Simulated time until the network had formed (s); null if it did not.
    formed_s: Option<f64>,
    /// Wall time of forming (s).
    forming_wall_s: f64,
    /// Wall time of a simulated hour after that (s).
    hour_wall_s: f64,
    /// Packets delivered in that hour.
    delivered: u64,
    /// Packets lost in that hour.
    lost: u64,
    /// Wall time that the 6TiSCH simulator takes (s); null where it is unknown.
    simulator_6tisch_s: Option<f64>,
    /// Wall time that TSCH-Sim takes (s); null where it is unknown.
    tsch_sim_s: Option<f64>,
    /// The goal for the wall time (s); null where there is none.
    to_reach_s: Option<f64>,
}

/// What stands above the rows.
fn heading() -> String {
    let about = format!(
        "Standing networks: wall time (s) until they have formed, and of the simulated hour after that; both processes and gRPC \
         included, every packet and every ten minutes every mote's energy recorded. Square grid of 10 m, unit disk of 25 m (20 \
         neighbours), root in the middle, 20 roots in the middles of as many parts. From every mote a 6LoWPAN datagram of 90 \
         bytes every so many seconds to its root ({PAYLOAD_BYTES} of payload; 8 less over a single hop); routes live for 30 \
         min. Peers: one process, measured elsewhere on a 2-core machine: 6TiSCH simulator with MSF (90 bytes, no headers), \
         TSCH-Sim with Orchestra (1000: fixed two hops)."
    );
    let line =
        |[motes, sf, app, formed, forming, hour, pdr, reach, tisch, tsch, faster]: [&str; 11]| {
            format!(
                "{motes:>8} {sf:<9} {app:>4} {formed:>6} {forming:>7} {hour:>7} {pdr:>6} {reach:>6} {tisch:>6} {tsch:>5}  {faster}"
            )
        };
    format!(
        "{}\n\n{}\n{}",
        wrapped(&about, "", WIDTH),
        line(["motes/", "", "app", "formed", "", "", "PDR", "to", "6TiSCH", "TSCH-", "times"]),
        line([
            "roots", "cells by", "s", "s", "forming", "hour", "%", "reach", "sim", "Sim", "faster"
        ])
    )
}

impl fmt::Display for RowAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { motes, roots, scheduling_function: sf, app_period_s, formed_s, .. } = self;
        let Self { simulator_6tisch_s, tsch_sim_s, delivered, .. } = self;
        let formed = formed_s.map_or_else(|| "no".to_owned(), |s| format!("{s:.0}"));
        let peer_s = if *sf == "msf" { simulator_6tisch_s.or(*tsch_sim_s) } else { *tsch_sim_s };
        write!(
            f,
            "{:>8} {sf:<9} {app_period_s:>4} {formed:>6} {:>7.3} {:>7.3} {:>6.2} {:>6} {:>6} {:>5}  {}",
            format!("{motes}/{roots}"),
            self.forming_wall_s,
            self.hour_wall_s,
            100.0 * *delivered as f64 / (delivered + self.lost).max(1) as f64,
            number_or_dash(self.to_reach_s),
            number_or_dash(*simulator_6tisch_s),
            number_or_dash(*tsch_sim_s),
            peer_s.map_or_else(|| "-".to_owned(), |peer| format!("{:.0}", peer / self.hour_wall_s)),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_motes_and_none_comes_twice() {
        for row in ROWS {
            let mut roots = row.root_numbers();
            assert!(roots.iter().all(|&root| root < row.motes));
            roots.sort_unstable();
            roots.dedup();
            assert_eq!(roots.len(), row.roots as usize, "{row:?}");
            assert_eq!(row.places().lines().count(), row.motes as usize + 1);
        }
    }

    #[test]
    fn every_row_is_a_configuration_that_is_accepted() {
        for row in ROWS {
            let folder = tempfile::tempdir().unwrap();
            std::fs::write(folder.path().join("places.csv"), row.places()).unwrap();
            let path = folder.path().join("bench.toml");
            experiment::read(&path, row.config(), &Overrides::default()).unwrap();
        }
    }
}
