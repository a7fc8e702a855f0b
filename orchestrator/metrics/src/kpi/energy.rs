//! Charge, current, duty cycle and lifetime.

use super::kpi_summary::{EnergySummary, MoteSpread};
use super::samples::Samples;
use super::{BATTERY_MAH, Kpis, in_seconds};
use proto::types::MoteStatistics;

/// Energy of all motes over a time.
#[derive(Clone, Debug)]
pub(super) struct Energy {
    is_root: Vec<bool>,
    charge_uc: Vec<Option<f64>>,
    /// Charge over the time during which it was drawn (µA).
    pub(super) current_ua: Vec<Option<f64>>,
    /// Time the radio sent or listened over the time the mote was on.
    pub(super) duty_cycle: Vec<Option<f64>>,
    /// Charge of a new battery (mAh).
    battery_mah: f64,
}

/// From the beginning, or since `since`; `None` where the network does not count charge.
pub(super) fn summarise(kpis: &Kpis, since: Option<&MoteStatistics>, n: usize) -> Option<Energy> {
    let latest = kpis.statistics()?;
    latest.column("charge_uc")?;
    let counted = |name: &str, mote: usize| {
        let value = latest.column(name)?.get(mote)?;
        let before = since.map_or(Some(0.0), |since| since.column(name)?.get(mote))?;
        Some(value - before)
    };
    let charge_uc: Vec<Option<f64>> = (0..n).map(|mote| counted("charge_uc", mote)).collect();
    let on_ns = |mote: usize| counted("up_ns", mote).filter(|&on_ns| 0.0 < on_ns);
    Some(Energy {
        is_root: (0..n).map(|mote| kpis.is_root(mote)).collect(),
        current_ua: (0..n).map(|mote| Some(charge_uc[mote]? / in_seconds(on_ns(mote)?))).collect(),
        duty_cycle: (0..n).map(|mote| Some(counted("radio_on_ns", mote)? / on_ns(mote)?)).collect(),
        charge_uc,
        // The same for all.
        battery_mah: latest
            .column("battery_mah")
            .and_then(|column| column.get(0))
            .unwrap_or(BATTERY_MAH),
    })
}

impl Energy {
    /// How long a battery lasts at a mean current (µA), in years of 365 days.
    pub(super) fn lifetime_years(&self, current_ua: f64) -> Option<f64> {
        let battery_uah = self.battery_mah * 1000.0;
        (0.0 < current_ua).then(|| battery_uah / current_ua / (24.0 * 365.0))
    }

    /// For `summary.json`. Roots count for the total charge alone.
    pub(super) fn summary(&self) -> EnergySummary {
        let others = |column: &[Option<f64>]| {
            Samples::from_values(
                column
                    .iter()
                    .zip(&self.is_root)
                    .filter(|&(_, is_root)| !is_root)
                    .filter_map(|(value, _)| *value),
            )
        };
        let (current_ua, duty_cycle) = (others(&self.current_ua), others(&self.duty_cycle));
        let spread = |samples: &Samples| {
            let [median, p99, max] = samples.quantiles([0.5, 0.99, 1.0]);
            MoteSpread { mean: samples.mean(), median, p99, max }
        };
        let lifetime_years =
            |part| current_ua.quantile(part).and_then(|current| self.lifetime_years(current));
        EnergySummary {
            charge_uc: self.charge_uc.iter().flatten().sum(),
            mean_current_ua: spread(&current_ua),
            duty_cycle: spread(&duty_cycle),
            battery_mah: self.battery_mah,
            network_lifetime_years: lifetime_years(1.0),
            median_lifetime_years: lifetime_years(0.5),
        }
    }
}
