//! Keys of `[robotsim]` that are written and have no influence, because of what other keys say: one list.

use crate::catalogue::Catalogue;
use crate::config::{self, Keys};
use crate::dynamics::effect;
use crate::knowledge::Source;
use proto::config::{IdleKey, Reason, Relation, Section as _, idle_keys, join};
use proto::effect::Need;
use proto::side::Setup;
use proto::site::Terrain;

/// Which keys have no influence, and when.
const fn relations<'a>() -> &'a [Relation<Facts<'a>>] {
    &[
        Relation {
            keys: &[
                "controller.leader_velocity_mps",
                "controller.leader_path_m",
                "controller.leader_path_closed",
                "controller.leader_weight",
                "controller.leader_weight_on",
            ],
            except: &[],
            reason: nobody_leads,
        },
        Relation {
            keys: &["controller.leader_path_closed"],
            except: &[],
            reason: leader_has_no_path,
        },
        Relation { keys: &["memory"], except: &[], reason: truth_is_known },
        Relation { keys: &["dynamics.effect[*]"], except: &[], reason: effect_meets_nothing },
    ]
}

/// The keys of a valid section that are written and have no influence.
#[must_use]
pub fn idle(setup: &Setup, catalogue: &Catalogue) -> Vec<IdleKey> {
    let effective = |node: &_| {
        let setup = Setup { config: Clone::clone(node), path: String::new(), ..setup.clone() };
        let mut problems = Vec::new();
        let table = match config::read(&setup, catalogue) {
            Ok((_, table)) => table,
            Err(found) => {
                problems.extend(found.into_iter().map(|problem| problem.path));
                config::keys(node, "", catalogue, &mut Vec::new())
            }
        };
        (table, problems)
    };
    let table = config::keys(&setup.config, "", catalogue, &mut Vec::new());
    let facts = Facts { setup, catalogue, keys: Keys::read(&table) };
    idle_keys(relations(), &facts, (&setup.config, &setup.path), effective)
}

/// What the relations ask.
struct Facts<'a> {
    setup: &'a Setup,
    catalogue: &'a Catalogue,
    keys: Keys,
}

impl Facts<'_> {
    fn path(&self, key: &str) -> String {
        join(&self.setup.path, key)
    }

    /// A key of the controller that all robots share.
    fn of_controller(&self, key: &str) -> Option<&toml::Value> {
        self.keys.controller.as_ref().and_then(|controller| controller.get(key))
    }
}

fn nobody_leads(facts: &Facts<'_>, _: &str) -> Option<Reason> {
    let is_leaderless = facts.of_controller("leaderless").and_then(toml::Value::as_bool);
    let key = facts.path("controller.leaderless");
    (is_leaderless == Some(true)).then(|| {
        Reason::new(
            format!("with {key} = true no robot leads"),
            format!("set {key} = false, or leave the key out"),
        )
    })
}

fn leader_has_no_path(facts: &Facts<'_>, _: &str) -> Option<Reason> {
    let key = facts.path("controller.leader_path_m");
    facts
        .of_controller("leader_path_m")
        .is_none()
        .then(|| Reason::new(format!("{key} is not set"), "set it, or leave this key out"))
}

fn truth_is_known(facts: &Facts<'_>, _: &str) -> Option<Reason> {
    let key = facts.path("knowledge");
    (facts.keys.knowledge == Source::Truth).then(|| {
        Reason::new(
            format!("with {key} = \"truth\" robots know the present states of all others"),
            format!("set {key} = \"heard\", or leave the key out"),
        )
    })
}

/// Effects for which the experiment lacks what they act on.
fn effect_meets_nothing(facts: &Facts<'_>, key: &str) -> Option<Reason> {
    let index: usize = key.strip_suffix(']')?.rsplit_once('[')?.1.parse().ok()?;
    let effects = facts.keys.dynamics.get("effect")?.as_array()?;
    let table = effects.get(index)?.as_table()?;
    let entry = facts.catalogue.effects.selected(table, &effect::TAG)?;
    let Setup { site, experiment, .. } = facts.setup;
    entry.about.needs.iter().find_map(|need| {
        let (is_lacking, why, instead) = match need {
            Need::Terrain => (
                site.terrain == Terrain::default(),
                "[site] has no terrain",
                "add [[site.terrain]]",
            ),
            Need::OtherAgents => (
                experiment.agent_count < 2,
                "there is one robot only",
                "set experiment.agents to at least 2",
            ),
            _ => return None,
        };
        is_lacking.then(|| Reason::new(why, instead))
    })
}
