//! In place of a network: who heard whom, as it was measured.

use super::receptions::Receptions;
use bytes::Bytes;
use drive::peer::{Described, NetworkSide, Peer, Side, SideError, Standing};
use proto::exchange::{ConfigureRequest, NetworkStart, NetworkStep};
use proto::types::{DeliveryColumn, MoteCommandKind, Payloads};

/// Delivers what was measured, with what senders had to say when they sent. Orders change nothing of it.
pub(super) struct ReceptionNetwork<'a> {
    heard: &'a Receptions,
    step_ns: u64,
    described: Described,
    /// What everyone said, period by period.
    said: Vec<Payloads>,
}

impl<'a> ReceptionNetwork<'a> {
    /// * `step_ns`: the period of the experiment.
    pub(super) fn new(heard: &'a Receptions, step_ns: u64) -> Self {
        let described = Described {
            name: "what was heard".to_owned(),
            mote_commands: vec![MoteCommandKind::Send],
            columns: vec![DeliveryColumn::RssiDbm],
            ..Described::default()
        };
        Self { heard, step_ns, described, said: Vec::new() }
    }
}

impl Peer<NetworkSide> for ReceptionNetwork<'_> {
    const SHARES_VALUES: bool = true;

    fn described(&self) -> &Described {
        &self.described
    }

    async fn configure(&mut self, request: &ConfigureRequest) -> Result<NetworkStart, SideError> {
        if request.columns.contains(&DeliveryColumn::RssiDbm) && !self.heard.has_strengths() {
            let what = "the robots' controller uses the RSSI, so all receptions need rssi_dbm";
            return Err(SideError::Cannot { side: NetworkSide::SIDE, what: what.to_owned() });
        }
        Ok(NetworkStart::default())
    }

    async fn step(
        &mut self,
        input: &<NetworkSide as Side>::Input<'_>,
    ) -> Result<NetworkStep, SideError> {
        self.said.push(input.payloads.clone());
        let period = [input.from_ns, input.until_ns];
        let n_agents = input.states.len();
        Ok(NetworkStep {
            step: input.step,
            time_ns: input.until_ns,
            deliveries: self.heard.within(period, &self.said, self.step_ns, n_agents),
            ..NetworkStep::default()
        })
    }

    async fn barrier(&mut self, step: u64, time_ns: u64) -> Result<Standing, SideError> {
        Ok(Standing { step, time_ns, digest: Bytes::new() })
    }

    async fn stop(self) {}
}
