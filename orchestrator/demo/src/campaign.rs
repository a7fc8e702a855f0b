//! Templates of measurement campaigns: rows without measured values, which `simulate` fills in.

use diagnose::simulate::{Simulated, simulate};
use measure::config::Compared;
use measure::table::DataTable;
use std::fmt::Write as _;
use std::path::Path;

/// A campaign that measures links between stationary motes: they take turns in sending, each time to another mote.
#[derive(Clone, Copy, Debug)]
pub(super) struct LinkCampaign {
    /// Where the motes are (m).
    pub motes_m: &'static [[f64; 2]],
    /// Number of frames.
    pub rows: u32,
    /// Time from one frame to the next (s).
    pub period_s: f64,
    /// Mean and amplitude of a temperature that rises and falls twice during the campaign (°C), if it is measured.
    pub temperature_c: Option<[f64; 2]>,
}

/// A campaign that measures tracks of robots. Each drives along a hexagon with a corner every 4 s.
#[derive(Clone, Copy, Debug)]
pub(super) struct TrackCampaign {
    /// Velocity along each side (m/s).
    pub sides_mps: [[f64; 2]; 6],
    /// Where the first robot starts (m). The others start 8 m farther east each.
    pub start_m: [f64; 2],
    /// Number of robots.
    pub robots: u32,
    /// Number of samples of each, one every 0.2 s.
    pub samples: u32,
}

/// Height of the motes (m).
const HEIGHT_M: f64 = 1.0;
/// Channels 11 to 26 of IEEE Std 802.15.4 in the 2.4 GHz band.
const FIRST_CHANNEL: u32 = 11;
const CHANNELS: u32 = 16;
/// Time from one sample of a track to the next (s).
const SAMPLE_S: f64 = 0.2;
/// Samples along one side of a hexagon.
const SIDE_SAMPLES: u32 = 20;

impl LinkCampaign {
    /// The rows as CSV. The readings are placeholders.
    #[must_use]
    pub(super) fn template(&self) -> String {
        let mut csv = "time_s,tx,rx,channel,".to_owned();
        if self.temperature_c.is_some() {
            csv += "temperature_c,";
        }
        csv += "tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,rssi_dbm,received\n";
        let n_motes = self.motes_m.len() as u32;
        for row in 0..self.rows {
            let (round, tx) = (row / n_motes, row % n_motes);
            let rx = (tx + 1 + round % (n_motes - 1)) % n_motes;
            let channel = FIRST_CHANNEL + (row * 7 + round) % CHANNELS;
            let [[tx_x_m, tx_y_m], [rx_x_m, rx_y_m]] =
                [tx, rx].map(|mote| self.motes_m.get(mote as usize).copied().unwrap_or_default());
            let (time_s, rssi_dbm) = (f64::from(row) * self.period_s, -60 - (row % 20) as i32);
            let _ = write!(csv, "{time_s:.1},{tx},{rx},{channel},");
            if let Some([mean_c, amplitude_c]) = self.temperature_c {
                let turns = 2.0 * f64::from(row) / f64::from(self.rows);
                let c = mean_c + amplitude_c * libm::sin(std::f64::consts::TAU * turns);
                let _ = write!(csv, "{c:.1},");
            }
            let _ = writeln!(
                csv,
                "{tx_x_m},{tx_y_m},{HEIGHT_M},{rx_x_m},{rx_y_m},{HEIGHT_M},{rssi_dbm},1"
            );
        }
        csv
    }
}

impl TrackCampaign {
    /// The rows as CSV. The positions are placeholders.
    #[must_use]
    pub(super) fn template(&self) -> String {
        let mut csv = "time_s,agent,x_m,y_m,z_m,cmd_vx_mps,cmd_vy_mps\n".to_owned();
        for agent in 0..self.robots {
            let [mut x_m, mut y_m] = [self.start_m[0] + f64::from(agent) * 8.0, self.start_m[1]];
            for sample in 0..self.samples {
                let side = (sample / SIDE_SAMPLES + agent) as usize % self.sides_mps.len();
                let [vx_mps, vy_mps] = self.sides_mps.get(side).copied().unwrap_or_default();
                let time_s = f64::from(sample) * SAMPLE_S;
                let _ = writeln!(csv, "{time_s:.1},{agent},{x_m:.3},{y_m:.3},0,{vx_mps},{vy_mps}");
                x_m += vx_mps * SAMPLE_S;
                y_m += vy_mps * SAMPLE_S;
            }
        }
        csv
    }
}

/// What a campaign measures. `truth`: name and text of the model that makes the measurements; `template`: name and rows of the
/// table.
///
/// # Errors
///
/// The measurements cannot be simulated.
pub(super) fn simulated(
    truth: (&str, &str),
    template: (&str, &str),
    seed: u64,
) -> Result<Simulated, String> {
    let config = Compared::of_text(Path::new(truth.0), truth.1.to_owned(), &[]);
    let config = config.map_err(|refusal| refusal.to_string())?;
    let table = DataTable::of_csv(Path::new(template.0), template.1.as_bytes());
    let table = table.map_err(|refusal| refusal.to_string())?;
    simulate(&config, &table, seed, None).map_err(|refusal| refusal.to_string())
}
