//! How many packets applications should have sent: from the network's configuration, whatever the motes then did.

use serde::Deserialize;

/// The applications of a network, as its effective configuration states them. A simulator of a stranger may have other keys:
/// then nothing is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Applications(Vec<Application>);

/// One entry of `[[netsim.app]]`, as far as it decides who sends how often.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Application {
    senders: Option<Senders>,
    destination: Option<Destination>,
    #[serde(flatten)]
    pattern: Pattern,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
enum Senders {
    /// All that have a destination.
    Word(String),
    Listed(Vec<u32>),
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
enum Destination {
    Mote(u32),
    Word(String),
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
enum Pattern {
    Periodic {
        period_s: f64,
    },
    Burst {
        at_s: f64,
        n_packets: u32,
    },
    Poisson {
        mean_interval_s: f64,
    },
    /// Kinds of which the number of packets does not follow from the configuration: as many as were created.
    #[serde(other)]
    Other,
}

impl Applications {
    /// Reads the network's effective configuration.
    pub fn from_config(netsim_toml: &str) -> Self {
        #[derive(Deserialize)]
        struct Network {
            #[serde(default)]
            app: Vec<Application>,
        }
        Self(toml::from_str::<Network>(netsim_toml).map_or_else(|_| Vec::new(), |all| all.app))
    }

    /// Whether any is known.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// How many packets a mote of `n_motes` should have sent that was on for `on_s` seconds: those of its periods, and the
    /// bursts whose time has come.
    pub(super) fn expected(&self, mote: u32, is_root: bool, n_motes: usize, on_s: f64) -> f64 {
        let sends = |application: &&Application| {
            let is_sender = match &application.senders {
                None | Some(Senders::Word(_)) => true,
                Some(Senders::Listed(motes)) => motes.contains(&mote),
            };
            is_sender
                && match &application.destination {
                    Some(Destination::Mote(other)) => *other != mote,
                    Some(Destination::Word(word)) if word != "root" => 2 <= n_motes,
                    None | Some(Destination::Word(_)) => !is_root,
                }
        };
        let packets = |application: &Application| match application.pattern {
            Pattern::Periodic { period_s } => on_s / period_s,
            Pattern::Poisson { mean_interval_s } => on_s / mean_interval_s,
            Pattern::Other => 0.0,
            Pattern::Burst { at_s, n_packets } if at_s < on_s => f64::from(n_packets),
            Pattern::Burst { .. } => 0.0,
        };
        self.0.iter().filter(sends).map(packets).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_application_counts_for_its_senders_and_for_the_time_they_were_on() {
        let text = "[[app]]\nkind = \"periodic\"\nperiod_s = 10.0\nsenders = \"all\"\ndestination = \"root\"\n\
                    [[app]]\nkind = \"periodic\"\nperiod_s = 20\nsenders = [0, 2]\ndestination = \"peers\"\n\
                    [[app]]\nkind = \"burst\"\nat_s = 50.0\nn_packets = 5\nsenders = \"all\"\ndestination = 1\n";
        let applications = Applications::from_config(text);
        let expected = |mote, on_s| applications.expected(mote, mote == 0, 3, on_s);
        assert_eq!(
            [expected(0, 100.0), expected(1, 100.0), expected(2, 100.0)],
            [10.0, 10.0, 20.0]
        );
        assert_eq!(expected(2, 40.0), 6.0);
        let text = "[[app]]\nkind = \"poisson\"\nmean_interval_s = 4.0\nsenders = \"all\"\ndestination = \"root\"\n\
                    [[app]]\nkind = \"coap\"\nservers = \"in-turn\"\nperiod_s = 2.0\n";
        let applications = Applications::from_config(text);
        assert_eq!(applications.expected(1, false, 3, 100.0), 25.0);
        assert!(Applications::from_config("speaks = \"otherwise\"").is_empty());
    }
}
