//! A simulator of this process: a plain object, called directly.

use super::{Described, NetworkSide, Peer, RobotSide, Side, SideError, Standing};
use bytes::Bytes;
use proto::config::Problem;
use proto::exchange::{ConfigureRequest, NetworkStart, NetworkStep, RobotsStart, RobotsStep};
use proto::side::{NetSimulator, RobotSimulator};
use std::future::Future;
use std::task::{Context, Poll, Waker};

/// A simulator that is called directly. Nothing is converted, nothing is copied, and no call waits: [`ready`] takes what its
/// futures bring.
#[derive(Debug)]
pub struct InProcess<T> {
    simulator: T,
    described: Described,
    step: u64,
    time_ns: u64,
}

impl<T: RobotSimulator> InProcess<T> {
    /// Around a robot simulator that has not been configured.
    pub fn robots(simulator: T) -> Self {
        let described = Described { commands: true, hold: true, ..described(T::NAME) };
        Self { simulator, described, step: 0, time_ns: 0 }
    }
}

impl<T: NetSimulator> InProcess<T> {
    /// Around a network simulator that has not been configured.
    pub fn network(simulator: T) -> Self {
        let described = Described {
            stop_at_first_delivery: true,
            mote_commands: T::commands().to_vec(),
            columns: T::columns().to_vec(),
            records: T::records().to_vec(),
            ..described(T::NAME)
        };
        Self { simulator, described, step: 0, time_ns: 0 }
    }
}

fn described(name: &str) -> Described {
    Described {
        name: name.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        contract_version: proto_messages::CONTRACT_VERSION,
        parallel: true,
        ..Described::default()
    }
}

impl<T> InProcess<T> {
    /// Notes that an experiment begins.
    fn begin(&mut self) {
        (self.step, self.time_ns) = (0, 0);
    }

    /// Notes where a step ended.
    fn reach(&mut self, step: u64, time_ns: u64) {
        (self.step, self.time_ns) = (step, time_ns);
    }

    fn standing(&self) -> Standing {
        Standing { step: self.step, time_ns: self.time_ns, digest: Bytes::new() }
    }
}

fn unacceptable(side: &'static str) -> impl FnOnce(Vec<Problem>) -> SideError {
    move |problems| SideError::Unacceptable { side, problems }
}

impl<T: RobotSimulator> Peer<RobotSide> for InProcess<T> {
    const SHARES_VALUES: bool = true;

    fn described(&self) -> &Described {
        &self.described
    }

    async fn configure(&mut self, request: &ConfigureRequest) -> Result<RobotsStart, SideError> {
        let setup = request.setup().map_err(unacceptable(RobotSide::SIDE))?;
        let start = self.simulator.configure(&setup).map_err(unacceptable(RobotSide::SIDE))?;
        self.begin();
        Ok(start.into())
    }

    async fn step(
        &mut self,
        input: &<RobotSide as Side>::Input<'_>,
    ) -> Result<RobotsStep, SideError> {
        let output = self.simulator.step(input);
        self.reach(input.step, input.until_ns);
        Ok(RobotsStep::of_output(input.step, input.until_ns, input.hold, output))
    }

    async fn barrier(&mut self, _step: u64, _time_ns: u64) -> Result<Standing, SideError> {
        Ok(self.standing())
    }

    async fn stop(self) {}
}

impl<T: NetSimulator> Peer<NetworkSide> for InProcess<T> {
    const SHARES_VALUES: bool = true;

    fn described(&self) -> &Described {
        &self.described
    }

    async fn configure(&mut self, request: &ConfigureRequest) -> Result<NetworkStart, SideError> {
        let setup = request.setup().map_err(unacceptable(NetworkSide::SIDE))?;
        let start = self.simulator.configure(&setup).map_err(unacceptable(NetworkSide::SIDE))?;
        self.begin();
        Ok(start.into())
    }

    async fn step(
        &mut self,
        input: &<NetworkSide as Side>::Input<'_>,
    ) -> Result<NetworkStep, SideError> {
        let mut kinds = input.commands.iter().map(|command| command.order.kind());
        if let Some(kind) = kinds.find(|&kind| !self.simulator.obeys(kind)) {
            let what = format!("as it is configured, does not obey {kind:?}");
            return Err(SideError::Cannot { side: NetworkSide::SIDE, what });
        }
        let output = self.simulator.step(input);
        self.reach(input.step, output.time_ns);
        Ok(NetworkStep::of_output(input.step, output))
    }

    async fn barrier(&mut self, _step: u64, _time_ns: u64) -> Result<Standing, SideError> {
        Ok(self.standing())
    }

    async fn stop(self) {}
}

/// What a future brings that waits for nobody: the driver over peers of this process. It needs no runtime.
pub fn ready<T>(future: impl Future<Output = T>) -> T {
    let mut future = std::pin::pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut context) {
            return value;
        }
        // Only if something was waited for after all: then its thread needs this one's turn.
        std::thread::yield_now();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_waits_for_nobody_is_ready_without_a_runtime() {
        assert_eq!(ready(async { 1 + std::future::ready(2).await }), 3);
    }
}
