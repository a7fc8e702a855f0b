//! EMSF: as many cells as a Poisson process of the traffic will need.
//!
//! Hamza, Kaddoum: "Enhanced Minimal Scheduling Function for IEEE 802.15.4e TSCH Networks", WCNC 2019, arXiv:1901.10591. See
//! `Forecast` for what of it is the paper's.

use super::msf::policy::Policy;
use super::msf::{self, Msf, MsfConfig};
use super::{Config, Configured, Entry, PayloadCells};
use proto::config::{Field, Problem, Section, Variant, join, joined};
use proto::ids::MoteId;
use serde::{Deserialize, Serialize};

/// The key that EMSF has beside those of MSF.
#[derive(Section)]
struct Own {
    /// Probability that the cells suffice for the frames of a slotframe.
    #[key(range = 0.5..=0.9999, default = 0.9)]
    quantile: f64,
}

/// The key of MSF that decides when a cell is added, which EMSF replaces, and its place among them.
const LIMIT: (&str, usize) = ("lim_numcellsused_high", 2);

/// The keys of MSF without that limit, and EMSF's own.
const FIELDS: &[Field] = {
    let (before, from_limit) = MsfConfig::SPEC.fields.split_at(LIMIT.1);
    let after = from_limit.split_at(1).1;
    &joined::<{ MsfConfig::SPEC.fields.len() }>(&[before, after, Own::SPEC.fields])
};

/// `kind = "emsf"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "emsf",
        doc: "EMSF: cells are negotiated as with msf, but as many at once as a Poisson process with the rate of the recent \
              traffic needs (after Hamza and Kaddoum, WCNC 2019).",
        fields: FIELDS,
    },
    payload_cells: PayloadCells::Shared,
    build: |table, context| {
        let number = |key: &str| table.get(key).and_then(toml::Value::as_integer);
        let (low, most) = (number("lim_numcellsused_low")?, number("max_num_cells")?);
        if most < low {
            let path = join(context.path, "lim_numcellsused_low");
            let message = format!("must be at most max_num_cells, {most}");
            context.problems.push(Problem::new(path, message).value(low).nearest(most));
            return None;
        }
        let mut keys = table.clone();
        keys.insert(LIMIT.0.to_owned(), toml::Value::Integer(most));
        let msf = msf::read(&keys, context)?;
        let Own { quantile } = Own::read(table);
        Some(Config::new(EmsfConfig { msf, quantile }))
    },
};

/// Keys of `[netsim.sf]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct EmsfConfig {
    /// Those of MSF. Its upper limit of use has no influence.
    pub msf: MsfConfig,
    /// Probability that the cells suffice for the frames of a slotframe: 0.5 to 0.9999.
    pub quantile: f64,
}

impl Configured for EmsfConfig {
    type OfMote = Msf<Forecast>;

    fn create(&self, _mote: MoteId) -> Msf<Forecast> {
        Msf::with_policy(&self.msf, Forecast { quantile: self.quantile })
    }

    fn has_dedicated_cells(&self) -> bool {
        true
    }
}

/// EMSF's choice of the number of cells.
///
/// # Model
///
/// The frames of a slotframe are a Poisson variable. Its rate λ is the number of frames per slotframe since the cells were last
/// judged. The mote wants the least number n of cells with P(X ≤ n) of at least the key `quantile`. It asks for all that
/// are missing in one request. Where fewer cells were used than LIM_NUMCELLSUSED_LOW (RFC 9033, § 5.1) it gives back, in one
/// request, all that are too many: chance alone brings no cell back and forth.
///
/// # Validity
///
/// The abstract of the paper states the Poisson process, the prediction of the cells that will be needed, and its purpose: fewer
/// negotiations, less delay, shorter queues. The full text was not available to check against. The estimator of the rate
/// (frames that used cells since the last judgement, at the interval of RFC 9033), the quantile with its default, and the condition
/// of deletion are this simulator's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Forecast {
    /// Probability that the cells suffice for the frames of a slotframe.
    pub quantile: f64,
}

/// The least n with P(X ≤ n) ≥ `quantile` for a Poisson variable of mean `mean`, which is at most `most`.
fn poisson_quantile(mean: f64, quantile: f64, most: u16) -> u16 {
    let mut term = libm::exp(-mean);
    let mut sum = term;
    let mut n = 0;
    while sum < quantile && n < most {
        n += 1;
        term *= mean / f64::from(n);
        sum += term;
    }
    n
}

impl Policy for Forecast {
    fn judge(&self, config: &MsfConfig, used: u64, own: u16, least: u16) -> (u16, u16) {
        // MAX_NUM_CELLS cells have elapsed: that many divided by their number in a slotframe, slotframes. Where no cell is
        // negotiated the autonomous one elapses.
        let rate = used as f64 * f64::from(own.max(1)) / f64::from(config.max_num_cells);
        let needed = poisson_quantile(rate, self.quantile, config.slotframe_slots);
        // The autonomous cell is enough for one.
        let wanted = if least == 0 && needed <= 1 { 0 } else { needed.max(least) };
        let is_idle = used < u64::from(config.lim_numcellsused_low);
        (wanted.saturating_sub(own), if is_idle { own.saturating_sub(wanted) } else { 0 })
    }
}

#[cfg(test)]
mod tests;
